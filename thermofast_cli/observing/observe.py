"""A run made ready for a joint fit: all sensors on one grid, thinned where that loses nothing, noise and rounding told apart."""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Observations, averaging_window, fit_decay, spike_weights, third_difference_noise
from thermofast.models.joint import fit_model
from thermofast.models.noise.chain import came_off, originals
from thermofast.models.noise.spikes import logger_step
from thermofast.models.observations import up_to
from thermofast.models.search.judge import least_p, sensor_p_values
from thermofast.models.search.rules import RULES

from ..errors import rounded
from ..estimation.sensor import frozen, saturated
from ..reading import Run
from ..reading.signs import sign_of
from ..reading.units import parse_unit
from ..reading.vocabulary import COOLING, HEATING, MEDIA, words

Array = NDArray[np.float64]

#: A joint fit looks at no more readings of a sensor than about this many.
ENOUGH = 700
#: Readings are averaged over no more than this share of a time constant, and the grid is no coarser than that.
FINE = 0.05
#: What the base law leaves of a sensor's range, at most, where its rate is one to follow though others are slower.
DESCRIBED = 0.05
#: Words that may stand beside what flows past a machine, and say no quantity of it.
BESIDE_MEDIA = frozenset(("c", "f", "k", "in", "out", "line", "tank", "side", "main", "circuit", "kreis", "zulauf", "ablauf"))
#: No grid has more points than this.
MOST_POINTS = 1500
FEWEST_READINGS = 24
#: Share of a drive's range that is a jump; readings on either side of it that tell when in its interval it came: few, so that what
#: the base law lacks has no time to show; and of how many jumps, the largest, this is asked.
JUMP, ABOUT, ASKED_OF = 0.3, 5, 6
#: Twice the log-likelihood ratio from which one reading of a logged jump is surely better than another.
SURELY = 8.0
#: The same ratio by which a jump at an end of its interval must beat one in its middle, which errs least.
RATHER = 4.0
#: Jumps in no more than this share of the intervals are few.
FEW = 0.03


@dataclass(frozen=True)
class Note:
    """Something to say of a sensor, or of the whole run (None)."""

    channel: str | None
    text: str


@dataclass(frozen=True)
class Observed:
    """What a joint fit sees of a run; refused are (channel, status, why) of sensors it leaves out."""

    seen: Observations | None
    refused: tuple[tuple[str, str, str], ...]
    notes: tuple[Note, ...]
    readings: int = 0


def observe(run: Run, start_min: float = 0.0, drive: str | None = None, until_min: float | None = None) -> Observed:
    """All usable sensors of a run from `start_min` on, time counted from there; noise is told from the readings up to until_min."""
    keep = run.time_s / 60.0 >= start_min - 1e-9
    time = run.time_s[keep] / 60.0 - start_min
    channels, rows, weights, steps, refused, notes = [], [], [], [], [], []
    every = [values[keep] for values in run.channels.values()]
    for name, reading, first in zip(run.channels, every, originals(every).tolist(), strict=True):
        good = np.isfinite(reading)
        status = _refusal(reading[good])
        if not status and reading is not every[first]:
            status = "no_data", f"every reading is that of {list(run.channels)[first]}, and so no evidence of its own"
        if status:
            refused.append((name, *status))
            continue
        step = logger_step(reading[good])
        weight = good.astype(float)
        at = np.flatnonzero(good)
        ways = ("stuck at the end of the range", saturated), ("of a frozen probe or logger", frozen)
        for said, found in ways:
            stuck = found(reading[good], step)
            if stuck.any():
                weight[at[stuck]] = 0.0
                notes.append(Note(name, f"{int(stuck.sum())} readings {said} left out"))
        weight[at] *= spike_weights(np.ascontiguousarray(reading[good]), step)
        channels.append(name)
        rows.append(reading)
        weights.append(weight)
        steps.append(step)
    if not channels:
        return Observed(None, tuple(refused), tuple(notes))
    notes += _without_fallen(time, channels, rows, weights, run, keep, start_min)
    window = averaging_window(time, np.array([_filled(time, row) for row in rows]))
    if window > 1:
        notes.append(Note(None, _one_of(window, weights)))
    notes += _of_columns({**run.ambient, **run.inputs}, keep, drive)
    used = {n: _filled(time, c[keep]) for n, c in run.ambient.items() if np.isfinite(c[keep]).any()}
    inputs = {n: _filled(time, c[keep]) for n, c in run.inputs.items() if np.isfinite(c[keep]).any()}
    reading, weight = np.array(rows), np.array(weights)
    rates = [_rate(time, r, w) for r, w in zip(reading, weight, strict=True)]
    seen, note = _gridded(run.name, tuple(channels), time, reading, weight, np.array(steps), used, inputs, rates, until_min)
    if note:
        notes.append(Note(None, note))
    warm = _warm(run, inputs)
    heats, cools = _sides(run, [n for n in inputs if n not in warm])
    seen = replace(seen, temperatures=warm, heats=heats, cools=cools, start_min=start_min)
    notes += _without_rise(seen)
    unsaid = "has no unit and counts as no temperature: --units"
    notes += [Note(None, f"{n} {unsaid} {n}=C if it is one") for n in _unsaid(run, inputs, warm)]
    if drive is not None:
        seen = _driven(seen, drive, until_min)
    return Observed(seen, tuple(refused), tuple(notes), len(time))


def _one_of(window: int, weights: list[Array]) -> str:
    """What to say of readings that are averages over the last `window`; of their weights, changed in place, one in a window stays.

    Those have noise of their own each, and hold nearly all that the record says.
    """
    told = f"each reading is an average over the last {window}"
    if len(weights[0]) < FEWEST_READINGS * window:
        return f"{told}, and the record has too few of its own: noise is told too small"
    for weight in weights:
        weight[np.arange(len(weight))[::-1] % window != 0] = 0.0
    return f"{told}: one of each {window} is looked at"


def _without_fallen(
    time: Array, channels: list[str], rows: list[Array], weights: list[Array], run: Run, keep: NDArray[np.bool_], start_min: float
) -> list[Note]:
    """What to say of probes that came off; their weights, changed in place, are none from there on."""
    used = np.array(weights) > 0.0
    noise = np.array([_noise(time, r, w, None) for r, w in zip(rows, weights, strict=True)])
    notes = []
    for i, fell in came_off(time, np.array(rows), used, noise).items():
        begins, ends = time[fell.first], time[fell.first] + 2.0 * fell.minutes
        if any(_jumps_within(time, column[keep], begins - fell.minutes, ends) for column in run.inputs.values()):
            continue  # what was switched at that time may have cooled it
        weights[i][time >= begins] = 0.0
        how = f"it falls {rounded(fell.fall)} K in {rounded(fell.minutes)} min at {start_min + begins:.4g} min"
        text = (
            f"{how}, and stays at {fell.level:.4g} degC, where it began, while the other sensors go on: did the probe come off? "
            "Readings from there on are left out"
        )
        notes.append(Note(channels[i], text))
    return notes


def _jumps_within(time: Array, column: Array, begins: float, ends: float) -> bool:
    """Whether a logged column moves by the share of its range that is a jump between two moments [min]."""
    within = column[(time >= begins) & (time <= ends)]
    within, whole = within[np.isfinite(within)], column[np.isfinite(column)]
    return len(within) > 1 and float(np.ptp(within)) > JUMP * float(np.ptp(whole))


def _of_columns(columns: Mapping[str, Array], keep: NDArray[np.bool_], drive: str | None) -> list[Note]:
    """What to say of logged columns (N,) that have gaps, and of a drive that never moves."""
    notes = []
    for name, column in columns.items():
        mine = column[keep]
        empty = int(np.count_nonzero(~np.isfinite(mine)))
        if 0 < empty < len(mine):
            notes.append(Note(None, f"{name}: {empty} of {len(mine)} readings are missing, filled by straight lines"))
        if name == drive and empty < len(mine) and float(np.nanmax(mine) - np.nanmin(mine)) == 0.0:
            notes.append(Note(None, f"the drive {name} never moves: a heat that is constant, as without it"))
    return notes


def _without_rise(seen: Observations) -> list[Note]:
    """A word for each sensor whose readings stay within their noise."""
    notes = []
    for i, name in enumerate(seen.channels):
        reading = seen.reading[i][seen.used[i]]
        tenth = max(len(reading) // 10, 3)
        ends = abs(float(np.median(reading[-tenth:]) - np.median(reading[:tenth])))
        if max(ends, 0.5 * float(reading.std())) < seen.least_noise[i]:
            notes.append(Note(name, "it does not move beyond its noise: there is no rise to learn from; was this part heated?"))
    return notes


def _warm(run: Run, inputs: Mapping[str, Array]) -> tuple[str, ...]:
    """Names of the inputs that are temperatures, as of a coolant."""
    told = () if run.seen is None else run.seen.columns
    units = {c.name: parse_unit(c.unit) for c in told if c.name in inputs}
    return tuple(n for n, unit in units.items() if (unit.temperature if unit is not None else _degrees(n)))


def _degrees(name: str) -> bool:
    """Whether a name without unit says that it is in degC: of what flows past the machine a C at its end does, as in coolant_C."""
    return sign_of(name, "").temperature or (re.search(r"[ _]C\d*$", name) is not None and _of_medium(name))


def _of_medium(name: str) -> bool:
    """Whether a name is that of what flows past the machine, with no more than a place or the letter of a unit beside it."""
    said = set(words(name))
    return bool(said & MEDIA) and said - BESIDE_MEDIA <= MEDIA


def _unsaid(run: Run, inputs: Collection[str], warm: Collection[str]) -> list[str]:
    """Names of inputs that are what flows past the machine, of which nothing says whether they are its temperature."""
    units = {c.name: c.unit for c in (() if run.seen is None else run.seen.columns)}
    return [n for n in inputs if n not in warm and not units.get(n) and _of_medium(n)]


def _sides(run: Run, inputs: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the inputs that heat (a power, a load) and of those that cool (a fan, a flow); a speed may do either."""
    told = () if run.seen is None else run.seen.columns
    units = {c.name: parse_unit(c.unit) for c in told}
    cools = tuple(n for n in inputs if COOLING & set(words(n)))
    heats = tuple(n for n in inputs if n not in cools and (HEATING & set(words(n)) or ((u := units.get(n)) and u.kind == "power")))
    return heats, cools


def _driven(whole: Observations, drive: str, until_min: float | None) -> Observations:
    """The run with a logged column as its heat, of which the temperatures until then tell how the logger keeps it.

    Loggers hold a column, or tell what was, or mean a straight line. The one with which the base law leaves no pattern is right.
    Else, where the column jumps, the readings about the largest jumps decide: farther away the effects that a fit lacks would.
    """
    endings, seen = (0.5, 0.0, 1.0), whole.until(until_min)
    if int(seen.used.sum(axis=1).min()) < FEWEST_READINGS:
        return whole.driven_by(drive, endings[0])  # too little is read to tell, or to judge anything
    ways = [seen.driven_by(drive, ending) for ending in endings]
    fits = [fit_model(way) for way in ways]
    column = seen.inputs[drive]
    there = np.arange(len(column)) if seen.logged is None else np.flatnonzero(seen.logged)
    # An interval of the grid jumps as that of the file in which it lies.
    jumps = np.abs(np.diff(column[there]))[np.clip(np.searchsorted(there, np.arange(1, len(column))) - 1, 0, len(there) - 2)]
    last = seen.last
    jumped = jumps > JUMP * (float(np.ptp(column[: last + 1])) or float(np.ptp(column)))
    asked = jumped & (np.arange(len(jumped)) < last)
    best = int(np.argmin([float((fit.rss / way.noise**2).sum()) for fit, way in zip(fits, ways, strict=True)]))
    if asked.any() and least_p(sensor_p_values(fits[best])) < RULES.pattern:
        largest = [int(j) for j in np.argsort(np.where(asked, -jumps, 0.0))[:ASKED_OF] if asked[j]]
        told = [one for j in largest if (one := _misfits_about([*ways, seen], j)) is not None]
        misfits = np.sum(told, axis=0) if told else np.zeros((4, 0))
        # A sensor that does as well without the jumps does not follow them, and tells nothing of when they were.
        misfits = misfits[:3, misfits[:3].min(axis=0) < misfits[3] - SURELY]
        if misfits.size:
            middle, late, early = misfits
            # A probe may be late, and so may most of them, but none is early: one that surely is tells when the switch was.
            refused = np.any(middle > early + SURELY), np.any(late > np.minimum(middle, early) + SURELY), False
            total = [np.inf if no else float(m.sum()) for m, no in zip(misfits, refused, strict=True)]
            total[0] -= RATHER
            best = int(np.argmin(total))
    return _about_jumps(whole.driven_by(drive, endings[best], last), jumped, last)


def _misfits_about(ways: list[Observations], jump: int) -> Array | None:
    """Twice the negative log likelihood (ways, S) of the readings about a jump's interval; None where there are too few."""
    far = np.abs(np.arange(len(ways[0].time)) - jump - 0.5) > ABOUT
    near = [way.without(far) for way in ways]
    readings = near[0].used.sum(axis=1)
    if int(readings.min()) < ABOUT + 2:
        return None
    return np.array([readings * np.log(fit_model(way).rss + 1e-300) for way in near])


def _about_jumps(seen: Observations, jumped: NDArray[np.bool_], last: int) -> Observations:
    """Without the readings before and after each jump (N - 1,) of the heat, where jumps are few up to the last reading used.

    When in the interval it came, and what an average over it means, is not known.
    """
    if last and float(np.mean(jumped[:last])) > FEW:
        return seen
    before = np.append(jumped, False)
    before[last] = False  # what comes then is not known at the last reading used
    return seen.without(before | np.append(False, jumped))


def _refusal(reading: Array) -> tuple[str, str] | None:
    if not len(reading):
        return "no_data", "no reading in this column"
    if len(reading) < FEWEST_READINGS:
        return "too_short", f"{len(reading)} readings; at least {FEWEST_READINGS} are needed to judge a model"
    if float(np.ptp(reading)) == 0.0:
        return "constant", f"every reading is {reading[0]:g} degC: is the probe connected?"
    return None


def _filled(time: Array, column: Array) -> Array:
    good = np.isfinite(column)
    return column if good.all() else np.interp(time, time[good], column[good])


def _rate(time: Array, reading: Array, weight: Array) -> float:
    """Rate of the base law [1/min], no less than what the record can show."""
    used = weight > 0.0
    span = float(time[-1] - time[0])
    return float(max(fit_decay(time[used], reading[used], weight[used]).rate, 2.0 / span))


def _fastest(rates: Sequence[float], time: Array, reading: Array, weight: Array) -> float:
    """The rate [1/min] that the grid must follow: the usual one, or that of a quicker sensor which the base law describes."""
    usual = float(np.median(rates))
    quick = [usual]
    for rate, row, used in zip(rates, reading, weight > 0.0, strict=True):
        if rate > usual:
            fit = fit_decay(time[used], row[used])
            left = row[used] - fit.predict(time[used])
            quick += [rate] if float(np.std(left)) <= DESCRIBED * float(np.ptp(row[used])) else []
    return max(quick)


def _noise(time: Array, reading: Array, weight: Array, until_min: float | None) -> float:
    """Of one reading [K], from those up to until_min where these are enough."""
    used = weight > 0.0
    early = used if until_min is None else used & (time <= up_to(until_min))
    used = early if np.count_nonzero(early) >= FEWEST_READINGS else used
    return third_difference_noise(reading[used], time[used])


def _gridded(
    name: str,
    channels: tuple[str, ...],
    time: Array,
    reading: Array,
    weight: Array,
    steps: Array,
    ambient: dict[str, Array],
    inputs: dict[str, Array],
    rates: list[float],
    until_min: float | None,
) -> tuple[Observations, str]:
    """Long records averaged over neighbours, gaps and coarse sampling filled with points without readings."""
    noise = np.array([_noise(time, r, w, until_min) for r, w in zip(reading, weight, strict=True)])
    step, finest = float(np.median(np.diff(time))), FINE / float(np.median(rates))
    together = max(1, math.floor(min(len(time) / ENOUGH, FINE / _fastest(rates, time, reading, weight) / step)))
    note = ""
    if together > 1:
        note = f"{together} neighbouring readings averaged into one: nothing in this record is faster"
        time, reading, weight, ambient, inputs = _averaged(together, time, reading, weight, ambient, inputs)
        # The rounding of a noisy reading averages out; of a quiet one it stays.
        dithered = noise > 0.4 * steps
        steps = np.where(dithered, 0.0, steps)
        weight = np.where(dithered[:, None], weight, np.minimum(weight, 1.0))
    floor = np.where(steps > 0.0, steps / math.sqrt(12.0), 1e-9)
    noise = np.maximum(noise, floor)
    grid = _grid(time, finest)
    at = np.searchsorted(grid, time - 1e-9)
    wide = np.full((len(channels), len(grid)), np.nan)
    wide[:, at] = reading
    heavy = np.zeros_like(wide)
    heavy[:, at] = np.where(np.isfinite(reading), weight, 0.0)
    ambient_noise = 0.0
    if ambient:
        first = next(iter(ambient.values()))
        ambient_noise = third_difference_noise(first, time)
    seen = Observations(
        name,
        channels,
        grid,
        wide,
        heavy,
        noise,
        steps,
        {n: np.interp(grid, time, c) for n, c in ambient.items()},
        {n: np.interp(grid, time, c) for n, c in inputs.items()},
        ambient_noise,
        logged=None if len(grid) == len(time) else np.isin(np.arange(len(grid)), at),
    )
    return seen, note


def _averaged(
    size: int, time: Array, reading: Array, weight: Array, ambient: dict[str, Array], inputs: dict[str, Array]
) -> tuple[Array, Array, Array, dict[str, Array], dict[str, Array]]:
    edges = np.arange(0, len(time), size)
    count = np.diff(np.append(edges, len(time)))
    heavy = np.add.reduceat(weight, edges, axis=1)
    total = np.add.reduceat(np.nan_to_num(reading) * weight, edges, axis=1)
    with np.errstate(all="ignore"):
        means = np.where(heavy > 0.0, total / heavy, np.nan)

    def mean(column: Array) -> Array:
        return np.asarray(np.add.reduceat(column, edges) / count)

    columns = [{n: mean(c) for n, c in group.items()} for group in (ambient, inputs)]
    return mean(time), means, heavy, columns[0], columns[1]


def _grid(time: Array, finest: float) -> Array:
    finest = max(finest, float(time[-1] - time[0]) / MOST_POINTS)
    pieces = np.maximum(1, np.ceil(np.diff(time) / finest - 1e-9).astype(int))
    points = [time[:1]]
    for a, b, k in zip(time[:-1], time[1:], pieces, strict=True):
        points.append(a + (b - a) * np.arange(1, k + 1) / k)
    grid = np.concatenate(points)
    grid[np.cumsum(np.concatenate([[0], pieces]))] = time
    return grid
