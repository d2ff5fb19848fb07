"""Records of simulated machines, and the rule that sets the size of a dominant effect (independent of the estimators)."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import curve_fit
from scipy.signal import lfilter

Array = NDArray[np.float64]

DURATION = 420.0  # min, every record
STEP = 0.5  # min, grid of both simulators
GRID = np.arange(0.0, DURATION + STEP / 2, STEP)  # min
LEAST, MOST = 4.0, 12.0  # misfit of one exponential with the effect, as a multiple of the background's


@dataclass(frozen=True)
class Effect:
    """How one dominant effect is sized: the usual range of its size, the largest one tried, and whether it touches one
    sensor only. Units: see `EFFECTS`.
    """

    usual: tuple[float, float]
    cap: float
    local: bool = False


EFFECTS: dict[str, Effect] = {
    "second_mode": Effect((0.10, 0.30), 0.35),  # share of the rise that a hidden slower mass holds back
    "neighbour_heat": Effect((0.3, 0.8), 0.8, local=True),  # link to a hotter neighbour, as a share of one place's own loss
    "ambient": Effect((1.0, 4.0), 5.0),  # K of drift over the run, or of a step
    "friction_decay": Effect((0.2, 0.6), 0.8),  # surplus of heat at the start, as share of the final heat
    "sensor_lag": Effect((2.0, 8.0), 10.0),  # min, lag of every probe
    "nonlinear_loss": Effect((0.2, 0.5), 0.6),  # exponent of the loss less one
    "sensor_drift": Effect((0.1, 0.4), 0.5, local=True),  # K/h
    "reading_jump": Effect((0.3, 1.5), 2.0, local=True),  # K
    "cooling_switch": Effect((0.3, 0.8), 0.8),  # increase of the loss, as a share
    "load_step": Effect((0.1, 0.4), 0.5),  # change of the load, as a share
    "cyclic_load": Effect((0.2, 0.5), 0.6),  # amplitude, as a share of the mean load
    "transport_delay": Effect((3.0, 15.0), 18.0),  # min
}


@dataclass(frozen=True)
class Record:
    """One run: `time` (n,) min; `reading` (S, n) degC as logged; `clean` (S, n) degC, the measured points without noise,
    drift or jump (after the probe's lag); `room` (n,) degC, true air; `limit` (S, n) degC, where each point would settle
    with the room and the load of that time; `load`, the level of the load (1: the machine's nominal one); `beside` (n,) degC, the
    warm neighbour as logged by one more sensor, where the effect is `neighbour_heat`.
    """

    time: Array
    reading: Array
    clean: Array
    room: Array
    limit: Array
    load: float = 1.0
    beside: Array | None = None


@dataclass(frozen=True)
class Machine:
    """The runs of one machine. Also how its effect came out: `size` (units in `EFFECTS`), `ratio` of the first run's misfit
    to the background's, the `background` in force (below the one asked for where no size reached `LEAST`), `noise` (K).
    """

    seed: int
    effect: str | None
    runs: tuple[Record, ...]
    size: float = 0.0
    ratio: float = 1.0
    background: float = 1.0
    noise: float = 0.0


def _basis() -> tuple[Array, Array]:
    """Centred unit exponentials (R, n) on whole minutes and their log rates (R,), rates in 1/min."""
    rates = np.geomspace(4e-4, 0.4, 350)
    waves = np.exp(-np.outer(rates, GRID[::2]))
    waves -= waves.mean(axis=1, keepdims=True)
    return waves / np.sqrt((waves**2).sum(axis=1, keepdims=True)), np.log(rates)


_WAVES, _LOG_RATES = _basis()


def misfit(curves: Array) -> Array:
    """RMS (...), K, that one exponential fitted by least squares leaves of noise-free `curves` (..., G) on `GRID`, K."""
    whole = curves[..., ::2] - curves[..., ::2].mean(axis=-1, keepdims=True)
    left = (whole**2).sum(axis=-1)[..., None] - (whole @ _WAVES.T) ** 2
    best = np.clip(left.argmin(axis=-1), 1, left.shape[-1] - 2)[..., None]
    low, mid, high = (np.take_along_axis(left, best + shift, -1)[..., 0] for shift in (-1, 0, 1))
    bend = np.maximum(low - 2 * mid + high, 1e-12)
    least = np.where(np.abs(low - high) < 2 * bend, mid - (low - high) ** 2 / (8 * bend), np.minimum(low, high))
    return np.asarray(np.sqrt(np.maximum(least, 0.0) / whole.shape[-1]))


@dataclass(frozen=True)
class Sized:
    """Outcome of `scale_effect`: `size`, `ratio` and `background` as in `Machine`, and which `draw` of the times it took."""

    size: float = 0.0
    ratio: float = 1.0
    background: float = 1.0
    draw: int = 0


def scale_effect(
    seed: int, effect: str, curves: Callable[[float, int, Array], Array], background: float, sensor: int, noise: float
) -> Sized:
    """Smallest size of an effect whose misfit is a multiple, drawn from LEAST..MOST, of the background's.
    `curves(background, draw, sizes (K,))` gives noise-free readings (K, S, G), K. A local effect is judged at `sensor`, any
    other at the middle one. Where no size up to the cap goes so far, the one of most misfit; if that is below `LEAST`, the
    effect's times are drawn again, up to thrice; then the background is reduced. A background below a quarter of the
    `noise` (K) counts as that much.
    """
    kind = EFFECTS[effect]
    target = between(np.random.default_rng([seed, 15]), 1.1 * LEAST, MOST)
    sizes = np.concatenate([[0.0], np.geomspace(kind.usual[0] / 8, kind.cap, 16)])
    best = Sized(ratio=0.0)
    for attempt in range(12):
        draw = attempt if attempt < 4 else best.draw
        if attempt >= 4:
            background *= 0.9 * best.ratio / LEAST
        left = misfit(curves(background, draw, sizes))
        each = left[1:] / np.maximum(left[0], noise / 4)
        ratios = each[:, sensor] if kind.local else np.median(each, axis=1)
        top = int(ratios.argmax())
        if attempt >= 4 or ratios[top] > best.ratio:
            best = Sized(float(sizes[1 + top]), float(ratios[top]), background, draw)
        if ratios[top] >= LEAST:
            over = int((ratios >= min(target, ratios[top])).argmax())
            if over and ratios[over] > target:
                part = np.log(target / ratios[over - 1]) / np.log(ratios[over] / ratios[over - 1])
                return Sized(float(sizes[over] * (sizes[over + 1] / sizes[over]) ** part), target, background, draw)
            return Sized(float(sizes[1 + over]), float(ratios[over]), background, draw)
    return best


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """Log-uniform draw between two positive bounds."""
    return float(low * (high / low) ** rng.random())


def coloured(rng: np.random.Generator, correlation: float, count: int) -> Array:
    """Ornstein-Uhlenbeck path (count,) on the grid, unit variance, correlation time in min."""
    keep = float(np.exp(-STEP / correlation))
    steps = rng.standard_normal(count)
    steps[1:] *= np.sqrt(1 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], steps))


def lagged(curve: Array, lag: float) -> Array:
    """Curve (G,) on the grid, K, seen through a first-order probe of time constant `lag`, min, at rest with it at first."""
    ratio = STEP / max(lag, 1e-3)
    keep = float(np.exp(-ratio))
    mean = (1 - keep) / ratio
    taps = [1 - mean, mean - keep]  # exact for a curve straight between grid points
    return np.asarray(lfilter(taps, [1.0, -keep], curve - curve[0]) + curve[0])


def allow(effect: str | None, exact: bool) -> None:
    """Raise ValueError at an unknown effect, or at one asked of an exact machine."""
    if effect is not None and (exact or effect not in EFFECTS):
        raise ValueError(f"no effect {effect!r} here; without `exact`, one of {', '.join(EFFECTS)}")


def exact_run(rng: np.random.Generator, time: Array, rate: float, rises: Array, noise: float, level: float) -> Record:
    """One exponential per sensor: rates within 2 % of each other about `rate`, 1/min; `rises` (S,) K; constant room."""
    room = rng.uniform(18, 24)
    rates = rate * np.exp(0.05 * rng.standard_normal()) * (1 + rng.uniform(-0.01, 0.01, rises.size))
    clean = room + rises[:, None] + (rng.uniform(-0.3, 0.3) - rises)[:, None] * np.exp(-rates[:, None] * time)
    reading = clean + noise * rng.standard_normal(clean.shape)
    limit = np.repeat((room + rises)[:, None], time.size, axis=1)
    return Record(time, reading, clean, np.full(time.size, room), limit, level)


def levels(seed: int, runs: int, spread: float) -> list[float]:
    """Load level of each run: 1 in the first, within +-`spread` of it in the others."""
    return [1.0, *(1 + spread * np.random.default_rng([seed, 18]).uniform(-1, 1, runs - 1)).tolist()]


def held(rng: np.random.Generator, spread: float) -> Array:
    """Load (G,) about 1, standing at one level for 2 to 30 min, then at the next; `spread` is the levels' sd."""
    ends = np.cumsum(rng.uniform(2, 30, 250))
    return np.asarray(1 + spread * rng.standard_normal(251)[np.searchsorted(ends, GRID, side="right")])


def rough_times(rng: np.random.Generator, interval: float) -> Array:
    """Times of a record, min: jitter of 1 % of the interval, a gap of 3 to 10 min in a third of them."""
    time = np.arange(0.0, DURATION + interval / 2, interval)
    time[1:-1] += 0.01 * interval * rng.standard_normal(time.size - 2)
    gap, length, begin = rng.random() < 1 / 3, rng.uniform(3, 10), rng.uniform(10, DURATION - 20)
    return time[(time < begin) | (time > begin + length)] if gap else time


def _wave(time: Array, final: float, change: float, rate: float) -> Array:
    return np.asarray(final + change * np.exp(-rate * time))


def _over(machine: Machine) -> list[float]:
    """RMS of the readings about one fitted exponential, over the noise, for each sensor of the first run."""
    record, ratios = machine.runs[0], []
    for time, reading in ((record.time, row) for row in record.reading):
        for _ in range(2):
            guess = (reading[-1], reading[0] - reading[-1], 0.015)
            best = curve_fit(_wave, time, reading, guess, bounds=([-500, -500, 1e-5], [500, 500, 1]))[0]
            left = reading - _wave(time, *best)
            keep = np.abs(left) < 9 * np.median(np.abs(left))  # outliers aside
            time, reading = time[keep], reading[keep]
        ratios.append(float(np.std(left)) / machine.noise)
    return ratios


def check(simulate: Callable[..., Machine], count: int = 200, each: int = 40) -> None:
    """Print, for `count` plain machines and `each` of every effect, the RMS over the noise, sizes, ratios and times."""
    for effect in (None, *EFFECTS):
        begun = clock.perf_counter()
        machines = [simulate(seed, effect=effect) for seed in range(count if effect is None else each)]
        spent = (clock.perf_counter() - begun) / len(machines)
        ratios = np.concatenate([_over(machine) for machine in machines])
        sizes = np.percentile([machine.size for machine in machines], [10, 50, 90])
        known = [machine.ratio for machine in machines]
        lower = [machine.background for machine in machines if machine.background < 1]
        print(
            f"{effect or 'background':16} RMS/noise 10..90 %: {np.percentile(ratios, [10, 25, 50, 75, 90]).round(1)}"
            f"  in 2..5: {np.mean((ratios >= 2) & (ratios <= 5)):.0%}  size {sizes.round(2)}"
            f"  x background {np.median(known):.1f} (least {min(known):.1f})"
            f"  reduced {len(lower)} (to {np.median(lower) if lower else 1:.2f})  {spent * 1000:.0f} ms"
        )
