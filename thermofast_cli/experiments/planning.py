"""How long a test must run for an accuracy: half-widths of records that the prior holds for likely, against the time measured."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from thermofast.models.imperfection import NONE, SCATTER, Imperfection, Known, Part, Past, PastRun, Rates, learn_past, settle
from thermofast.models.imperfection.draw import draw_record
from thermofast.models.search.discover import Spread

from ..analysis.watching import TOGETHER
from ..analysis.watching import TURNS as WATCHED
from ..errors import rounded
from ..estimation.rules import RULES
from ..records import PlanRecord

Array = NDArray[np.float64]

#: Times looked at, in time constants; draws of a record; readings that stand for all of a draw.
TURNS = np.geomspace(0.15, 7.0, 15)
DRAWS, READINGS = 6, 120
#: Sensors of a draw: more say no more of each other.
MOST_SENSORS = 12
#: Machines known to be quiet, as calibrate finds them from complete runs.
QUIET_SHARE, QUIET_SPREAD = 0.005, 0.4
#: The alternative that no machine is.
LAW = "a machine that is the law"
#: Times the half-width of all others from which one sensor alone sets how long a test must be.
ALONE = 3.0
#: Numbers of past runs that are tried, and time constants of a complete one.
PAST_RUNS, COMPLETE = (1, 4, 10), 5.0


@dataclass(frozen=True)
class Design:
    """A test: sensors, seconds between readings, noise [K], rise [K] and time constant [min] that are expected.

    rises_c: those of the machine's sensors, where they are known, in the proportions of which rise_c is the median, in the order of
    what past runs tell of them. tau_min is the median of their time constants.
    """

    sensors: int = 10
    interval_s: float = 1.0
    noise_c: float = 0.02
    rise_c: float = 9.0
    tau_min: float = 65.0
    rises_c: tuple[float, ...] = ()


@dataclass(frozen=True)
class Curve:
    """Half-width of the steady state's interval (n,) [K] against the time measured (n,) [min]; nan where a side is open.

    draws (d, n) are those of single records, half_width their median. widest: in words, of known sensors the one that comes last.
    """

    name: str
    time: Array
    half_width: Array
    draws: Array
    widest: str = ""


@dataclass(frozen=True)
class Option:
    """A way to test: its design, what machines do beside the law, what sensors share, and what past runs have told.

    beside: each sensor that was asked for stands beside so many alike, itself among them, which are not waited for.
    """

    name: str
    design: Design
    prior: Imperfection
    rates: Rates = "auto"
    past: Past | None = None
    beside: int = 1


def alternatives(design: Design, prior: Imperfection, past: Past | None = None) -> list[Option]:
    """The design itself and what could be changed of it; past: of the machine at hand."""
    found = [
        Option("as asked", design, prior, past=past),
        Option("readings ten times as often", replace(design, interval_s=design.interval_s / 10.0), prior, past=past),
        Option("half the noise", replace(design, noise_c=design.noise_c / 2.0), prior, past=past),
        Option("twice the sensors", replace(design, sensors=2 * design.sensors), prior, past=past, beside=2),
    ]
    if not prior.none:
        if past is not None:
            found.append(Option("without its past runs", design, prior))
        else:
            found += [
                Option(f"after {n} past run{'s' if n > 1 else ''}", design, prior, past=_hoped(design, prior, n)) for n in PAST_RUNS
            ]
        if prior.strong_share > QUIET_SHARE and past is None:
            quiet = replace(prior, strong_share=QUIET_SHARE, scale_spread=QUIET_SPREAD)
            found.append(Option("after calibrate on quiet machines", design, quiet))
        found.append(Option(LAW, design, NONE, "shared"))
    return found


def _hoped(design: Design, prior: Imperfection, runs: int) -> Past:
    """What so many complete runs of a machine of this kind would tell."""
    sensors = min(design.sensors, MOST_SENSORS)
    names, rises = tuple(map(str, range(sensors))), _rises(design, sensors)
    time = np.linspace(0.0, COMPLETE * design.tau_min, READINGS)
    noise = np.full(sensors, design.noise_c)
    nothing = Past({}, runs=runs).prior(prior)
    done = []
    for k in range(runs):
        rng = np.random.default_rng([11, k])
        reading, _ = draw_record(nothing, time, design.tau_min * math.exp(SCATTER * rng.standard_normal()), rises, noise, rng)
        parts = tuple(Part(time, line[None], noise[:1], np.zeros(1)) for line in reading)
        done.append(PastRun(names, parts, np.full(sensors, -math.log(design.tau_min))))
    told = learn_past(done, prior)
    # Some runs say more of the disturbances and the scatter of rates, by chance, and some less: a plan is for neither.
    shapes = {name: replace(shape, deviation=SCATTER / math.sqrt(runs)) for name, shape in told.shapes.items()}
    return replace(told, scale=1.0, scatter=SCATTER, shapes=shapes)


def plan(
    design: Design,
    tolerances_c: tuple[float, ...],
    prior: Imperfection,
    advance: Callable[[int], None] = lambda _: None,
    past: Past | None = None,
    replayed: Array | None = None,
    spread: Spread = map,
) -> tuple[list[PlanRecord], list[Curve]]:
    """A row for each alternative and tolerance [K], and the curves behind them; past: what runs of the machine have told.

    replayed (n,) [K]: half-widths at TURNS of a record of such a test, which know the machine better than any prior; alternatives
    are then worth what they are worth to machines in general.
    """
    options = alternatives(design, prior, past)
    others = [] if prior.none or replayed is not None else list(dict.fromkeys(o.design for o in options if o.design != design))
    # Other readings alone would do after another time.
    alone = [Option(LAW, one, NONE, "shared") for one in others]
    every = []
    for curve in spread(partial(_curve, TURNS, DRAWS), [*options, *alone]):
        every.append(curve)
        advance(1)
    curves = every[: len(options)]
    if replayed is not None:
        curves = _as_replayed(curves, [option.past is not None for option in options] if past else [], replayed)
    asked = next((c for c in curves if c.name == LAW), curves[0])
    laws: dict[Design, Curve] = {design: asked, **dict(zip(others, every[len(options) :], strict=True))}
    rows = []
    for option, curve in zip(options, curves, strict=True):
        one = option.design
        law = laws.get(one, asked)
        for tolerance in tolerances_c:
            each = [needed(curve.time, line, tolerance) for line in curve.draws]
            # Of half of the machines drawn it is no longer. A half-width that rises again is known only from when it stays.
            time = sorted(each, key=lambda t: math.inf if t is None else t)[len(each) // 2]
            told = [t for t in each if t is not None]
            best = float(np.nanmin(curve.half_width)) if np.isfinite(curve.half_width).any() else math.nan
            rows.append(
                PlanRecord(
                    run="plan",
                    channel=option.name,
                    sensors=one.sensors,
                    interval_s=one.interval_s,
                    noise_c=one.noise_c,
                    rise_c=one.rise_c,
                    tau_min=one.tau_min,
                    tolerance_c=tolerance,
                    time_min=time,
                    time_lo_min=min(told) if time is not None and told else None,
                    time_hi_min=max(told) if time is not None and len(told) == len(each) else None,
                    time_constants=time / one.tau_min if time is not None else None,
                    least_half_width_c=best if math.isfinite(best) else None,
                    status="ok" if time is not None else "hopeless",
                    message=_watched(option, time) if time is not None else _why(curve, law, tolerance, best),
                )
            )
    return rows, curves


def of_all(half_widths: Array, exact: bool = False) -> float:
    """The half-width [K] within which all sensors (S,) are together, as ``watch`` asks for it; of exact machines their median."""
    return float(np.median(half_widths)) if exact else float(half_widths.max()) * (TOGETHER if len(half_widths) > 1 else 1.0)


def needed(time: Array, half_width: Array, tolerance_c: float) -> float | None:
    """The time [min] from which the half-width stays below the tolerance, straight between logarithms; None if it never does."""
    below = half_width < tolerance_c
    above = np.flatnonzero(~below)
    first = int(above[-1]) + 1 if len(above) else 0
    if first >= len(below):
        return None
    if first == 0 or not np.isfinite(half_width[first - 1]):
        return float(time[first])
    sides = np.log(half_width[first - 1 : first + 1])
    share = (sides[0] - math.log(tolerance_c)) / (sides[0] - sides[1])
    times = np.log(time[first - 1 : first + 1])
    return float(np.exp(times[0] + share * (times[1] - times[0])))


def _watched(option: Option, time: float) -> str:
    """What ``watch`` waits for although the tolerance is reached, where nothing tells that there is no second mass."""
    tau = option.design.tau_min
    least = max(WATCHED * tau, min(RULES.heard_min, RULES.heard_turns * tau))
    if option.past is not None or option.prior.rarely_strong or time >= least:
        return ""
    turns = rounded(least / tau, 2)
    return f"watch does not stop before {turns} time constants ({rounded(least, 3)} min), before which no slower part shows"


def _last(names: Sequence[str], widths: Array) -> str:
    """Which sensor comes last within a tolerance, by the half-widths (S,) at the end, and what to do where it is alone in that."""
    name = names[int(np.argmax(widths))]
    others = widths[[other != name for other in names]]
    alone = len(others) > 0 and float(widths.max()) > ALONE * float(others.max())
    return f"{name!r} last" + (
        " and by far (--exclude it, in the runs learnt from and in the test, if it does not matter)" if alone else ""
    )


def _why(curve: Curve, law: Curve, tolerance: float, best: float) -> str:
    within = f"within {TURNS[-1]:g} time constants ({rounded(float(curve.time[-1]), 3)} min)"
    if best < tolerance:
        return f"{within} it comes to +-{rounded(best)} K at best, but not on half of the machines drawn so that it stays so"
    reached = f"{within} it comes to +-{rounded(best)} K at best" if math.isfinite(best) else f"{within} no side is ever closed"
    reached += f", {curve.widest}" if curve.widest else ""
    alone = needed(law.time, law.half_width, tolerance)
    if curve.name != law.name and alone is not None:
        return f"{reached}: the machine is the limit, not the readings, which alone would do after {alone:.3g} min"
    return f"{reached}: the readings are the limit; read more often, or with less noise"


def _as_replayed(curves: Sequence[Curve], known_past: Sequence[bool], replayed: Array) -> list[Curve]:
    """Curves times what a record's half-widths are over those of the first like it; after its end as at its end.

    known_past: which curves count past runs of the machine, where any does: a record was read without, and says nothing of them.
    """
    counted = list(known_past) or [False] * len(curves)
    like = next((curve for curve, past in zip(curves, counted, strict=True) if not past), None)
    if like is None:
        return list(curves)
    with np.errstate(all="ignore"):
        ratio = replayed / like.half_width
    known = np.flatnonzero(np.isfinite(ratio))
    if not len(known):
        return list(curves)
    factor = np.where(np.isfinite(ratio), ratio, ratio[known[-1]])
    factor[: known[0]] = np.nan  # before a side of the record's interval is closed
    return [
        curve if curve.name == LAW or past else replace(curve, half_width=curve.half_width * factor, draws=curve.draws * factor)
        for curve, past in zip(curves, counted, strict=True)
    ]


def _rises(design: Design, sensors: int) -> Array:
    """Rises (sensors,) [K] about that of the design, or in the proportions of those that are known."""
    if design.rises_c:
        known = np.quantile(design.rises_c, np.linspace(0.0, 1.0, sensors) if sensors > 1 else [0.5])
        return np.asarray(design.rise_c * known / np.median(design.rises_c))
    return design.rise_c * np.exp(0.25 * np.linspace(-1.0, 1.0, sensors)) if sensors > 1 else np.array([design.rise_c])


@dataclass(frozen=True)
class _Machine:
    """Sensors of a draw: names, rises (S,) [K], time constants (S,) [min], what past runs say of each, and the shape (S, n) beside
    the law that these know, over time constants x (n,).
    """

    names: tuple[str, ...]
    rises: Array
    tau: Array
    known: Known | None = None
    shape: Array | None = None

    @classmethod
    def of(cls, option: Option) -> "_Machine":
        """Those that are asked for, each with what stands beside it."""
        design, past = option.design, option.past
        asked = min(design.sensors // option.beside, MOST_SENSORS)
        if past is None:
            rises = np.repeat(_rises(design, asked), option.beside)
            return cls(("",) * len(rises), rises, np.full(len(rises), design.tau_min))
        every = list(past.shapes)
        # More than a draw has: some of them, from the first to the last.
        some = np.linspace(0, len(every) - 1, asked).round().astype(int) if asked < len(every) else np.arange(asked) % len(every)
        names = [every[k] for k in np.repeat(some, option.beside)]
        own = len(design.rises_c) == len(every)
        of_each = design.rise_c * np.asarray(design.rises_c) / np.median(design.rises_c) if own else _rises(design, len(every))
        rises = np.repeat(of_each[some], option.beside)
        rates = np.array([past.shapes[name].log_rate for name in names])
        tau = design.tau_min * np.exp(np.median([s.log_rate for s in past.shapes.values()]) - rates)
        shapes = {str(i): replace(past.shapes[n], log_rate=-math.log(tau[i])) for i, n in enumerate(names)}
        known = replace(past, shapes=shapes, rises={}).known(tuple(shapes))
        return cls(tuple(names), rises, tau, known, known.curve[:, 0] + np.expm1(-known.x))

    def drawn(self, prior: Imperfection, time: Array, noise: Array, rng: np.random.Generator) -> Array:
        """Readings (S, n) of a record of such a machine."""
        reading, _ = draw_record(prior, time, self.tau, self.rises, noise, rng)
        if self.known is not None and self.shape is not None:
            beside = [np.interp(time / tau, self.known.x, line) for tau, line in zip(self.tau, self.shape, strict=True)]
            reading = reading + self.rises[:, None] * np.array(beside)
        return reading


def _curve(turns: Array, draws: int, option: Option) -> Curve:
    design, past = option.design, option.past
    machine, prior = _Machine.of(option), option.prior if past is None else past.prior(option.prior)
    sensors = len(machine.names)
    half, widths = np.full((draws, len(turns)), np.nan), np.zeros(sensors)
    for k, turn in enumerate(turns):
        span = turn * design.tau_min
        count = span * 60.0 / design.interval_s + 1.0
        if count < 6.0:
            continue
        for d in range(draws):
            # So many readings of other noise say the same as all of them, and every alternative meets the same machines.
            rng = np.random.default_rng([7, d, k])
            noise = np.full(sensors, design.noise_c * math.sqrt(READINGS / count))
            time = np.linspace(0.0, span, READINGS)
            part = Part(time, machine.drawn(prior, time, noise, rng), noise, np.zeros(sensors), known=machine.known)
            found = settle([part], min(design.tau_min, 2.0 * span), prior, rates=option.rates)
            widths = 0.5 * (found.steady[:, 2] - found.steady[:, 0])
            widths = np.where(found.open_limit, np.inf, widths)
            half[d, k] = of_all(widths[:: option.beside], prior.none)
    middle = np.median(half, axis=0)
    half = np.where(np.isfinite(half), half, np.nan)
    return Curve(
        option.name,
        turns * design.tau_min,
        np.where(np.isfinite(middle), middle, np.nan),
        half,
        _last(machine.names, widths) if past else "",
    )
