"""What the readings of one sensor, or of several on one grid, say: numbers with their intervals. Arrays and plain numbers only."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Interval, Lump, PrintedLump, growth, growth_slope, interval
from thermofast.models.arrow import covariance_root
from thermofast.models.imperfection import Past
from thermofast.models.uncertainty.first_passage import Pace, TimeToGo, clock_time, time_to_go

from ..errors import rounded
from .measured import contradiction
from .rules import RULES

Array = NDArray[np.float64]

#: Times at which the readings ahead are foretold, and those of a picture.
AHEAD, DRAWN = 9, 30
#: The same of a rise with corners, which a logged column or an event gives it.
CORNERED = 32
Model = Lump | PrintedLump
#: What is said where a drive, effects that a search chose or past runs are not counted, because the readings contradict them.
NOT_FOLLOWED = "the readings do not follow the drive or the effects added, and they are not counted"
NOT_LIKELIER = "what was found makes the readings hardly likelier than a machine's usual disturbances do, and is not counted"
NOT_SURE = "what was found is not sure, and not counted where the law holds without it"
NOT_THIS_RUN = "past runs of this machine do not fit this one and are not counted"
NOT_YET = "; so early the intervals reach to what they say, too"
#: Residuals over the range of the readings from which on a filter's state is none; one that forgets may miss what was long ago.
LOST = 1e6


@dataclass(frozen=True)
class Estimate:
    """What the first k + 1 readings say. Temperatures degC, times min, rates 1/min; None is 'not determined'.

    state (temperature, slope, rate) at ``time`` carries the free run, before and after.
    noise [K] is the standard deviation of a reading; limit [K] the least standard deviation of the steady state that any
    unbiased method could have on this record (Cramer-Rao).
    """

    time: float
    state: Array
    steady_state: float | None
    steady_state_interval: Interval
    rate: float | None
    noise: float
    limit: float | None
    weights: Array
    initial: float
    t95: float | None
    t95_interval: Interval
    covariance: Array
    pattern_p: float = math.nan
    misfit: float = math.nan
    faded: bool = False
    too_large: bool = False

    def band(self, times: Array, draws: int = 400) -> tuple[Array, Array]:
        """95 % band (n,), (n,) of the model's temperature at times (n,) [min]: quantiles over draws of the state.

        nan where the filter knows nothing: a covariance that has grown beyond all bounds.
        """
        if not np.isfinite(self.covariance).all():
            return np.full(len(times), np.nan), np.full(len(times), np.nan)
        rng = np.random.default_rng(1)
        try:
            root = np.linalg.cholesky(self.covariance + 1e-12 * np.diag(np.diag(self.covariance) + 1e-12))
        except np.linalg.LinAlgError:  # a direction of which all is known, of states of very unlike sizes
            size = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
            whole = np.where(size > 0.0, size, 1.0)
            root = size[:, None] * covariance_root(np.clip(self.covariance / whole / whole[:, None], -1.0, 1.0))
        states = self.state + rng.standard_normal((draws, 3)) @ root.T
        dt = times - self.time
        curves = states[:, :1] + states[:, 1:2] * growth(states[:, 2:], dt)
        low, high = np.quantile(curves, [0.025, 0.975], axis=0)
        return low, high

    def contradicted_by(self, times: Array, residual: Array, half_width: Array) -> float | None:
        """Largest of the residuals (n,) [K] at times (n,) [min] where they leave the curved band of draws, or None.

        half_width (n,) [K] is the band's to first order; no side of the band is taken for narrower.
        """
        few = np.linspace(float(times.min()), float(times.max()), 60)
        curve, (low, high) = self.free_run(few), self.band(few)
        above, below = np.interp(times, few, high - curve), np.interp(times, few, curve - low)
        half = np.maximum(np.where(residual > 0.0, above, below), half_width)
        return contradiction(residual, half, self.noise)

    def free_run(self, times: Array) -> Array:
        """Model temperatures (n,) [degC] at times (n,) [min], run from the state forwards and backwards."""
        return Lump().free_run(self.state, times - self.time)

    @property
    def bounded(self) -> bool:
        sides = (self.steady_state_interval, self.t95_interval)
        return self.steady_state is not None and all(i.low is not None and i.high is not None for i in sides)


@dataclass(frozen=True)
class Estimates:
    """:class:`Estimate` for S sensors on one grid: the same names as arrays (S, ...), nan for 'not determined'."""

    time: float
    state: Array
    steady_state: Array
    steady_low: Array
    steady_high: Array
    rate: Array
    noise: Array
    limit: Array
    weights: Array
    initial: Array
    t95: Array
    t95_low: Array
    t95_high: Array
    covariance: Array
    pattern_p: Array
    misfit: Array
    faded: NDArray[np.bool_]
    too_large: NDArray[np.bool_]

    @classmethod
    def empty(cls, sensors: int, readings: int, time: float) -> "Estimates":
        """Room for estimates that are put in one by one or in parts."""
        shapes = {"state": (3,), "covariance": (3, 3), "weights": (readings,)}
        flags = ("faded", "too_large")
        return cls(
            time=time,
            **{
                f.name: np.zeros(sensors, dtype=bool) if f.name in flags else np.full((sensors, *shapes.get(f.name, ())), np.nan)
                for f in fields(cls)
                if f.name != "time"
            },
        )

    def put(self, rows: Any, others: "Estimates") -> None:
        """Others' values into these rows."""
        for f in fields(self):
            if f.name != "time":
                getattr(self, f.name)[rows] = getattr(others, f.name)

    def put_one(self, i: int, estimate: "Estimate") -> None:
        """One sensor's estimate into its row."""
        for f in fields(self):
            if f.name not in ("time", "steady_low", "steady_high", "t95_low", "t95_high"):
                value = getattr(estimate, f.name)
                getattr(self, f.name)[i] = np.nan if value is None else value
        for name, bounds in (("steady", estimate.steady_state_interval), ("t95", estimate.t95_interval)):
            getattr(self, f"{name}_low")[i] = np.nan if bounds.low is None else bounds.low
            getattr(self, f"{name}_high")[i] = np.nan if bounds.high is None else bounds.high

    def one(self, i: int) -> "Estimate":
        """The i-th sensor's."""

        def number(values: Array) -> float | None:
            return None if math.isnan(values[i]) else float(values[i])

        return Estimate(
            time=self.time,
            state=self.state[i],
            steady_state=number(self.steady_state),
            steady_state_interval=interval(self.steady_low[i], self.steady_high[i]),
            rate=number(self.rate),
            noise=float(self.noise[i]),
            limit=number(self.limit),
            weights=self.weights[i],
            initial=float(self.initial[i]),
            t95=number(self.t95),
            t95_interval=interval(self.t95_low[i], self.t95_high[i]),
            covariance=self.covariance[i],
            pattern_p=float(self.pattern_p[i]),
            misfit=float(self.misfit[i]),
            faded=bool(self.faded[i]),
            too_large=bool(self.too_large[i]),
        )

    @property
    def bounded(self) -> NDArray[np.bool_]:
        """Whether steady state and settling time are bounded on both sides (S,)."""
        sides = (self.steady_state, self.steady_low, self.steady_high, self.t95_low, self.t95_high)
        found: NDArray[np.bool_] = np.all([~np.isnan(v) for v in sides], axis=0)
        return found

    def free_run(self, times: Array) -> Array:
        """Model temperatures (S, m) [degC] at times (m,) [min], run from the states forwards and backwards."""
        run: Array = self.state[:, :1] + self.state[:, 1:2] * growth(self.state[:, 2:], times - self.time)
        return run

    def band_from_tangent(self, times: Array) -> Array:
        """Half-width (S, m) [K] of the 95 % band of the curves at times (m,) [min], to first order."""
        dt = times - self.time
        rate = self.state[:, 2:]
        tangent = np.stack([np.ones((len(rate), len(dt))), growth(rate, dt), self.state[:, 1:2] * growth_slope(rate, dt)], axis=1)
        with np.errstate(all="ignore"):  # beyond all bounds where the filter knows nothing
            half: Array = 1.96 * np.sqrt(np.maximum(((self.covariance @ tangent) * tangent).sum(axis=1), 0.0))
        return half


@dataclass(frozen=True)
class Claims:
    """What a block's sensors may claim, rows as in the block; nan where there is none. See :class:`Settled` for the names.

    known (S,): past runs of the machine were counted; let_go (S,): they were asked, and do not fit this run; other_rise (S,): the
    rise that was fitted is not the law's, and what a filter of the law said of these readings says nothing. trips, missing (S, 3):
    when a stopping rule holds [min of the run] and what is missing then [K], as of readings that have not kept to it yet, or
    have `hidden` (S,) whether they do.
    averaged (S,): over how many readings each is the logger's moving average; left_last (S,): how many of the last ones were left
    out and are no outliers: something has just changed. behind (S,): it has moved by this share of what another sensor of the run
    did, too little so early to be foretold; faster (S,): it would be so many times as fast as others that have not settled; moved
    (S,) [K]: so far it has moved since it settled by the law; else nan. alone (S, 3) [degC]: as steady, by the readings without
    the past that is counted; as_fast (S,): how many times as fast as in past runs it is, where that is more than chance. early (S,)
    [min]: from when on a slower part behind what moved so far would show, where that is later than the last reading; else nan.
    """

    steady: Array
    t95: Array
    at: Array
    rate: Array
    open_limit: NDArray[np.bool_]
    open_t95: NDArray[np.bool_]
    check_p: Array
    strong: Array
    unseen: Array
    unseen_from: Array
    hides: Array
    evidence: Array
    shared_with: tuple[str, ...]
    times: Array
    ahead: NDArray[np.bool_]
    known: NDArray[np.bool_]
    let_go: NDArray[np.bool_]
    other_rise: NDArray[np.bool_]
    trips: Array
    missing: Array
    hidden: NDArray[np.bool_]
    averaged: NDArray[np.int_]
    left_last: NDArray[np.int_]
    behind: Array
    faster: Array
    moved: Array
    alone: Array
    as_fast: Array
    early: Array

    @property
    def held(self) -> NDArray[np.bool_]:
        """Which sensors have a posterior (S,)."""
        return np.isfinite(self.steady[:, 1])

    def curves(self, times: Array, drawn: bool = False) -> tuple[Array, Array, Array]:
        """Temperatures foretold (S, n) [degC] at times (n,) [min of the run] between the sides of their 95 % band.

        Straight over 1 - exp(-rate t) between those asked for over the readings ahead, or where `drawn`, between all.
        """
        some = np.ones_like(self.ahead) if drawn else self.ahead
        rate = np.where(self.held, self.rate[:, 1], 1.0)[:, None]
        first = min(times.min(initial=np.inf), self.times[some].min(initial=np.inf))  # the run may have idled for hours
        there, asked = (-np.expm1(-rate * (minutes - first)) for minutes in (times, self.times[some]))
        sides = np.moveaxis(self.at[:, some], 2, 0)
        low, middle, high = (np.array([np.interp(*line) for line in zip(there, asked, side, strict=True)]) for side in sides)
        return low, middle, high


def none_yet(count: int, times: Array, ahead: NDArray[np.bool_]) -> Claims:
    """Claims of `count` sensors of which nothing is said yet."""
    numbers = {
        n: np.full(count, np.nan)
        for n in (
            "check_p",
            "strong",
            "unseen",
            "unseen_from",
            "hides",
            "evidence",
            "behind",
            "faster",
            "moved",
            "as_fast",
            "early",
        )
    }
    threes = {n: np.full((count, 3), np.nan) for n in ("steady", "t95", "rate", "trips", "missing", "alone")}
    return Claims(
        **numbers,
        **threes,
        at=np.full((count, len(times), 3), np.nan),
        shared_with=[""] * count,  # type: ignore[arg-type]
        times=times,
        ahead=ahead,
        known=np.zeros(count, dtype=bool),
        let_go=np.zeros(count, dtype=bool),
        hidden=np.zeros(count, dtype=bool),
        open_limit=np.zeros(count, dtype=bool),
        open_t95=np.zeros(count, dtype=bool),
        left_last=np.zeros(count, dtype=int),
        other_rise=np.zeros(count, dtype=bool),
        averaged=np.ones(count, dtype=int),
    )


def said_of_slow(claimed: Claims, i: int, rise: float) -> str:
    """What a record could not exclude of a slow second mass, in words; empty where that is nothing worth a word."""
    size, width = float(claimed.unseen[i]), float(claimed.steady[i, 2] - claimed.steady[i, 0])
    if not math.isfinite(size) or not abs(rise) > 0.0 or size < 0.25 * width:
        return ""
    share = 100.0 * size / abs(rise)
    return f"a second mass slower than {rounded(claimed.unseen_from[i])} min, up to {rounded(min(share, 999.0))} % of the rise"


def said_of_early(claimed: Claims, i: int) -> str:
    """What is said of a sensor whose record is too short for slow parts behind quick ones."""
    return (
        f"so early a slower part behind what has moved so far does not show: measure for {rounded(claimed.early[i])} min at least, "
        "or say what past runs told: --model, or --imperfection of the lab"
    )


def lost(found: Estimates, reading: Array) -> dict[int, str]:
    """Why a sensor's estimate is none, by sensor: its state is LOST times as far from the readings (S, n) used as a constant is."""
    far = np.flatnonzero(found.misfit > LOST * np.ptp(reading, axis=1)).tolist()
    return {i: f"the filter's state leaves the readings ({rounded(float(found.misfit[i]))} K rms)" for i in far}


class FilterError(Exception):
    """A filter that cannot run on a record, or a stranger's that raises; the message names it and says why."""


def remaining(estimate: Estimate, elapsed: float, paces: Sequence[Pace] = ()) -> TimeToGo:
    """Minutes from the last reading used until 95 % of the rise is done for good, `elapsed` [min] after its start.

    Where one curve holds from the start on, what is left is t95 less what has passed. Where the filter has forgotten its past,
    the start is a reading of its own, and the time is the first passage of the state's curve into the band around its steady state.
    """
    if estimate.t95 is None:
        return TimeToGo(None, None, None)
    if estimate.faded:
        return time_to_go(estimate.state, estimate.covariance, estimate.initial, paces=paces)
    sides = estimate.t95_interval.low, estimate.t95, estimate.t95_interval.high
    low, median, high = (clock_time(max(v - elapsed, 0.0), paces) if v is not None else None for v in sides)
    return TimeToGo(low, median, high)


def times_asked(
    last: float, end: float, at_min: float | None, drawn: tuple[float, float] | None, cornered: bool = False
) -> tuple[Array, NDArray[np.bool_]]:
    """When temperatures are asked for (k,) [min], and which of them (k,) lie over the readings from `last` to `end`.

    The others are for a picture, from when to when it is drawn, and at a named time; more where the rise has corners.
    """
    times: list[float] = []
    if end > last:
        times += (last + (end - last) * np.linspace(0.0, 1.0, CORNERED if cornered else AHEAD) ** 1.5).tolist()
    over = set(np.round(times, 9).tolist())
    if drawn is not None:
        times += np.linspace(drawn[0], max(end, drawn[1]), CORNERED if cornered else DRAWN).tolist()
    if at_min is not None:
        times.append(at_min)
    asked = np.unique(np.round(times, 9)) if times else np.zeros(0)
    return asked, np.array([t in over for t in asked.tolist()], dtype=bool)


def says_more(own: Claims, one: Claims, found: Estimates) -> NDArray[np.bool_]:
    """Sensors of which the law says more than what is not sure does, with no likely effect beside it that may still do much."""
    with np.errstate(invalid="ignore"):
        ahead = np.abs(own.steady[:, ::2] - found.state[:, :1]).max(axis=1)
        done = ahead <= RULES.done * np.abs(own.steady[:, 1] - found.initial)
        narrower = np.ptp(own.steady[:, ::2], axis=1) < np.ptp(one.steady[:, ::2], axis=1)
        return np.asarray(narrower & (done | ~(own.strong > RULES.strong)))


def why_let_go(past: Past | None, read_min: float) -> str:
    """What is said of a sensor whose past was let go after so long [min]."""
    if past is None or not past.guessed:
        early = past is not None and read_min < RULES.past_until * past.time_constant
        return NOT_THIS_RUN + (NOT_YET if early else "")
    if past.unsure:
        return NOT_SURE
    return NOT_LIKELIER if past.searched else NOT_FOLLOWED


def without_past(notes: Sequence[str]) -> list[str]:
    """Notes of a sensor whose past was let go: nothing was identified with it, and what was found was not added."""
    return [n.replace(" added, which", " found, which") for n in notes if not n.startswith(("with ", "by "))]
