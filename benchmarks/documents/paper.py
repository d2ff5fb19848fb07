"""The spindle paper redrawn: ``python -m benchmarks.documents.paper`` writes docs/paper.md and its pictures.

Figures 6 to 12 and the numbers of the text, of the filter as printed and of the one in use, on records of the law that the paper
takes for true (its measured record is not printed), and which records the fading acts on at all, on simulators that do not know
the law.
"""

import argparse
import importlib
import math
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import thermofast as tf
from thermofast.estimation.request import Method
from thermofast.estimation.sensor import Signals
from thermofast.estimation.sweep import sweep_sensors
from thermofast.filters.fading import Context, PrintedFading
from thermofast.filters.moments import SymmetricPoints
from thermofast.models import Lump, PrintedLump
from thermofast.pipeline.methods import known_filters

Array = NDArray[np.float64]
ROOT = Path(__file__).resolve().parents[2]
START, STEADY, T95, END, IDENTIFIED = 17.9, 26.7, 195.0, 400, 28
MINUTES = np.arange(END + 1.0)
LAW = STEADY - (STEADY - START) * np.exp(-MINUTES * math.log(20.0) / T95)


def measured(noise: float, seed: int) -> Array:
    """The paper's sensor 5 as its numbers tell it: 17.9 to 26.7 degC, 95 % of it after 195 min, a reading a minute."""
    return LAW + noise * np.random.default_rng(seed).standard_normal(len(LAW))


@dataclass(frozen=True)
class Variant:
    """The printed filter, or one with a part of it changed."""

    name: str
    rule: PrintedFading = PrintedFading()
    from_record: bool = False
    pseudo: bool = True


#: A weakening factor so large that alpha stays 1.
NO_FADING = 1e12
VARIANTS = (
    Variant("as printed"),
    Variant("the conventional fading UKF, Q and R held", PrintedFading(adapts=False)),
    Variant("as printed, started at the record's first reading", from_record=True),
    Variant("as printed, alpha = 1", PrintedFading(weakening=NO_FADING)),
    Variant("alpha = 1, started at the first reading", PrintedFading(weakening=NO_FADING), from_record=True),
    Variant("alpha = 1, no pseudo-readings (14)", PrintedFading(weakening=NO_FADING), pseudo=False),
    Variant("alpha = 1, Q and R held", PrintedFading(weakening=NO_FADING, adapts=False)),
)


@dataclass(frozen=True)
class Ran:
    """A run of the printed filter: states (n, 3), alpha, Q and R (n,), n the readings until it broke."""

    states: Array
    alpha: Array
    process: Array
    noise: Array


def printed(variant: Variant, reading: Array, until: int, seed: int = 0) -> Ran:
    """The filter over `until` readings after the first, then fed with its own (14) to the end of the record."""
    model, moments, rng = PrintedLump(), SymmetricPoints(), np.random.default_rng(seed)
    state, p = np.array(model.start_state), np.diag(model.start_variance)
    if variant.from_record:
        state[0] = reading[0]
    rule, m, context = variant.rule, variant.rule.memory(1.0, 1.0), Context(p, 0.0)
    rows = [(state, 1.0, m.process, m.noise)]
    with np.errstate(all="ignore"):
        for k in range(1, len(reading)):
            if k <= until:
                y = float(reading[k])
            else:
                rule = replace(rule, threshold=math.inf)  # no readings, no adaptation
                drawn = model.step(state, 1.0)
                y = float(drawn[0] + math.sqrt(m.process) * rng.standard_normal() + math.sqrt(m.noise) * rng.standard_normal())
            try:
                state, p = moments.predict(model, state, p, 1.0, 1.0)
            except np.linalg.LinAlgError:
                break
            if k <= until or variant.pseudo:
                update = rule.update(m, state, p, y - float(state[0]), context)
                state, p, alpha = update.state, update.covariance, update.fading
            else:
                p, alpha = p + m.process * np.eye(3), 1.0
            if not np.isfinite(state).all() or np.abs(state).max() > 1e6:
                break
            rows.append((state, alpha, m.process, m.noise))
    return Ran(np.array([r[0] for r in rows]), *(np.array([r[i] for r in rows]) for i in (1, 2, 3)))


def variants(draws: int) -> Iterator[str]:
    """A table: where each variant breaks, and what it finds at 28 min."""
    found = "T_inf at 28 min, median (5 to 95 %) | b | RMSE over 400 min | R, Q at 28 min"
    yield f"| filter | noise | broke | at reading (median) | {found} |"
    yield "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    for variant in VARIANTS:
        for noise in (0.0, 0.005, 0.02):
            ran = [(r := measured(noise, s), printed(variant, r, IDENTIFIED, s)) for s in range(draws)]
            broke = [len(one.states) for _, one in ran if len(one.states) <= END]
            kept = [(r, one) for r, one in ran if len(one.states) > IDENTIFIED]
            cells = [variant.name, f"{1000 * noise:g} mK", f"{len(broke)} of {draws}", f"{np.median(broke):g}" if broke else "-"]
            if kept:
                at = np.array([one.states[IDENTIFIED] for _, one in kept])
                low, middle, high = np.percentile(at[:, 2], [5, 50, 95])
                whole = [_rmse(one.states[:, 0], r) for r, one in kept if len(one.states) > END]
                q, r = (np.median([getattr(one, name)[IDENTIFIED] for _, one in kept]) for name in ("process", "noise"))
                cells += [f"{middle:.2f} ({low:.2f} to {high:.2f})", f"{np.median(at[:, 1]):.4f}"]
                cells += [f"{np.median(whole):.2f}" if whole else "-", f"{r:.1e}, {q:.1e}"]
            else:
                cells += ["-"] * 4
            yield "| " + " | ".join(cells) + " |"


def _rmse(predicted: Array, reading: Array) -> float:
    """Equation (38)."""
    return math.sqrt(float(((predicted - reading) ** 2).sum()) / (len(reading) - 1))


def _method(name: str) -> Method:
    return Method(Lump(), known_filters()[name]())


def _swept(reading: Array, windows: tuple[float, ...], times: Array, name: str = "afukf") -> Array:
    return sweep_sensors(Signals("r", ("T5",), MINUTES, reading[None]), _method(name), windows, tuple(times.tolist()), 0.1)[0].rmse


def numbers(draws: int, noise: float) -> Iterator[str]:
    """Every printed number beside ours."""
    sample = tf.identify(
        str(ROOT / "sample_runs" / "spindle.csv"), until=IDENTIFIED, channels="T5", imperfection="none", rates="own"
    )[0]
    found = [_identified(measured(noise, s), IDENTIFIED) for s in range(draws)]
    steady, late, rate, ahead = (
        np.array([getattr(r, n) for r in found], float) for n in ("steady_state_c", "t95_min", "rate_per_min", "rmse_ahead_c")
    )
    times, few = np.arange(10.0, 40.0), [measured(noise, seed) for seed in range(min(draws, 40))]
    best = np.array([_least(_swept(reading, (float(END),), times), times)[0] for reading in few])
    four = np.array([_least(_swept(reading, (40.0, 45.0, 50.0, 55.0), times), times) for reading in few])
    yield f"| number | printed | `sample_runs/spindle.csv`, T5 (20 mK) | {draws} records, {1000 * noise:g} mK: median (5 to 95 %) |"
    yield "| --- | ---: | ---: | ---: |"
    yield f"| T_inf after 28 min, measured 26.7 [degC] | 26.797 | {sample.steady_state_c:.3f} | {_spread(steady, 3)} |"
    error = f"RMS {np.sqrt(np.nanmean((steady - STEADY) ** 2)):.3f}; the Cramer-Rao limit is {_limit(noise):.3f}"
    yield f"| its error [K] | 0.097 | {abs(sample.steady_state_c - STEADY):.3f} | {error} |"
    yield f"| time to 95 %, measured 195 [min] | 197 | {sample.t95_min:.0f} | {_spread(late, 0)} |"
    yield f"| b [1/min] | 0.016 | {sample.rate_per_min:.4f} | {_spread(rate, 4)} |"
    yield f"| RMSE over 400 min [K] | 0.1291 | {sample.rmse_ahead_c:.3f} | {_spread(ahead, 3)} |"
    yield f"| identification time with the least RMSE over 400 min, 10 to 39 tried | 28 | - | {_spread(best, 0)} |"
    later, wide = np.arange(10.0, 50.0), (50.0, 55.0, 60.0, 65.0)
    slow = np.array([_least(_swept(reading, wide, later, "fading_ukf"), later) for reading in few])
    alike = f"in {np.mean(np.ptp(four, axis=1) == 0):.0%} of records; median {np.median(four):.0f}"
    yield f"| the same over windows of 40, 45, 50, 55 min: all four alike | 28, yes | - | {alike} |"
    alike = f"in {np.mean(np.ptp(slow, axis=1) == 0):.0%} of records; median {np.median(slow):.0f}"
    yield f"| the same with the fading UKF, windows of 50, 55, 60, 65 min | 32, yes | - | {alike} |"
    ran = [printed(VARIANTS[3], reading, IDENTIFIED) for reading in few]
    last = np.array([[one.noise[IDENTIFIED], one.process[IDENTIFIED]] for one in ran if len(one.noise) > IDENTIFIED])
    moved = ", ".join(f"{v:.1e}" for v in np.median(last, axis=0))
    yield f"| R and Q after 28 min, by the rule of figure 1 | 1.932e-9, 1e-7 | - | {moved}, with alpha held at 1 |"


def _least(rmse: Array, times: Array) -> list[float]:
    """The time [min] of the least RMSE of each window (windows, times)."""
    return [float(times[np.nanargmin(row)]) for row in rmse]


def _spread(values: Array, digits: int) -> str:
    low, middle, high = np.nanpercentile(values, [5, 50, 95])
    return f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def _identified(reading: Array, until: float, **more: Any) -> Any:
    how = {"imperfection": "none", "rates": "own"} | more
    return tf.identify({"time_min": MINUTES, "T5": reading}, until=until, **how)[0]


def _limit(noise: float) -> float:
    """Cramer-Rao limit of T_inf [K] of 29 readings."""
    b, t = math.log(20.0) / T95, MINUTES[: IDENTIFIED + 1]
    decay = np.exp(-b * t)
    jacobian = np.stack([np.ones_like(t), -decay, (STEADY - START) * t * decay], axis=1)
    return noise * math.sqrt(np.linalg.inv(jacobian.T @ jacobian)[0, 0])


def pictures(folder: Path, noise: float) -> None:
    """Figures 6 to 12 in one picture, and alpha, Q and R in another."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    reading = measured(noise, 1)
    held = printed(VARIANTS[3], reading, IDENTIFIED)
    raw = printed(VARIANTS[0], reading, IDENTIFIED)
    grey = {"color": "0.6", "linewidth": 1.0}
    figure, axes = plt.subplots(3, 2, figsize=(10.0, 11.0), layout="constrained")
    times = np.arange(10.0, 60.0)
    for axis, name, windows, title in (
        (axes[0, 0], "afukf", (40.0, 45.0, 50.0, 55.0), "figure 6: RMSE, windows of 40 to 55 min"),
        (axes[2, 0], "fading_ukf", (50.0, 55.0, 60.0, 65.0), "figure 11: the same, fading UKF, 50 to 65 min"),
    ):
        for window, line in zip(windows, _swept(reading, windows, times, name), strict=True):
            axis.plot(times, line, label=f"{window:g} min")
        axis.set(title=title, xlabel="identification time [min]", ylabel="K", yscale="log")
        axis.legend(fontsize=8)
    axes[0, 1].plot(np.arange(10.0, 101.0, 2.0), _swept(reading, (400.0,), np.arange(10.0, 101.0, 2.0))[0], label="AFUKF in use")
    axes[0, 1].axhline(0.1291, label="printed at 28 min", linestyle=":", color="black")
    axes[0, 1].set(title="figure 10: RMSE over 400 min", xlabel="identification time [min]", ylabel="K", yscale="log")
    axes[0, 1].legend(fontsize=8)
    tracked = [_identified(reading, float(k)) for k in range(6, 101, 2)]
    at = np.arange(6.0, 101.0, 2.0)
    for axis, index, name, title, limits in (
        (axes[1, 0], 1, "rate_per_min", "figure 8: b [1/min]", (0.0, 0.04)),
        (axes[1, 1], 2, "steady_state_c", "figure 9: T_inf [degC]", (22.0, 31.0)),
    ):
        axis.plot(at, [getattr(r, name) or np.nan for r in tracked], label="AFUKF in use")
        axis.plot(held.states[:101, index], label="as printed, alpha = 1", **grey)
        axis.plot(raw.states[:, index], "x", color="#d95f0e", label="as printed, until it breaks")
        axis.axhline(0.016 if index == 1 else 26.797, linestyle=":", color="black", label="printed")
        axis.set(title=title, xlabel="readings up to [min]", ylim=limits)
        axis.legend(fontsize=8)
    one = _identified(reading, IDENTIFIED)
    axes[2, 1].plot(MINUTES, reading, label="measured", **grey)
    axes[2, 1].plot(
        MINUTES,
        one.steady_state_c + (one.initial_c - one.steady_state_c) * np.exp(-one.rate_per_min * MINUTES),
        label="AFUKF in use, 28 min",
    )
    axes[2, 1].plot(held.states[:, 0], "--", label="as printed, alpha = 1")
    axes[2, 1].set(title="figures 7 and 12: foretold from 28 min", xlabel="min", ylabel="degC", ylim=(15.0, 32.0))
    axes[2, 1].legend(fontsize=8)
    figure.savefig(folder / "paper-figures.png", dpi=90)
    plt.close(figure)
    figure, axes = plt.subplots(1, 3, figsize=(10.0, 3.2), layout="constrained")
    for axis, name, title in zip(
        axes, ("alpha", "process", "noise"), ("fading factor alpha", "Q (one of three)", "R"), strict=True
    ):
        axis.semilogy(getattr(held, name)[: IDENTIFIED + 1], label="alpha = 1", **grey)
        axis.semilogy(getattr(raw, name), "x", color="#d95f0e", label="as printed, until it breaks")
        axis.set(title=title, xlabel="reading")
    axes[2].axhline(1.932e-9, linestyle=":", color="black", label="printed")
    axes[1].axhline(1e-7, linestyle=":", color="black", label="printed")
    for axis in axes:
        axis.legend(fontsize=8)
    figure.savefig(folder / "paper-adaptation.png", dpi=90)
    plt.close(figure)


def _broken_noise(reading: Array, rng: np.random.Generator) -> Array:
    """Ten times the noise for a quarter of an hour."""
    reading = reading.copy()
    reading[30:45] += 0.2 * rng.standard_normal(15)
    return reading


def _outliers(reading: Array, rng: np.random.Generator) -> Array:
    reading = reading.copy()
    reading[rng.choice(np.arange(15, 60), 4, replace=False)] += rng.choice([-3.0, 3.0], 4)
    return reading


def _slip(reading: Array, rng: np.random.Generator) -> Array:
    reading = reading.copy()
    reading[40:] -= rng.uniform(0.3, 1.0)
    return reading


def _load(reading: Array, rng: np.random.Generator) -> Array:
    b, more = math.log(20.0) / T95, rng.uniform(0.1, 0.3)
    return reading + np.where(MINUTES >= 30.0, more * (STEADY - START) * -np.expm1(-b * (MINUTES - 30.0)), 0.0)


SLIPS = "a probe that slips by 0.3 to 1 K at 40 min"
KINDS: dict[str, Callable[[Array, np.random.Generator], Array]] = {
    "the law": lambda reading, _rng: reading,
    "ten times the noise for 15 min": _broken_noise,
    "four outliers of 3 K": _outliers,
    SLIPS: _slip,
    "10 to 30 % more load from 30 min on": _load,
}


def truth_of(kind: str, reading: Array) -> float:
    """Where a record of a kind settles [degC]."""
    return float(reading[-1] + STEADY - LAW[-1]) if "load" in kind or "slips" in kind else STEADY


FILTERS = ("afukf", "ukf", "fading_ukf", "least_squares")


@dataclass(frozen=True)
class Judged:
    """Of one record at an hour: whether fading acted, the errors of the filters [K], whether intervals held."""

    faded: bool
    errors: tuple[float, ...]
    held: tuple[bool, ...]
    counted: bool
    counted_error: float


def judged(kind: str, seed: int) -> list[Judged]:
    """Filters by the readings alone, and the default with the machine counted."""
    if kind in KINDS:
        rng = np.random.default_rng(seed)
        reading = KINDS[kind](measured(0.02, seed), rng)
        return [_judge(MINUTES, reading, truth_of(kind, reading))]
    run = importlib.import_module(f"benchmarks.machines.{kind}").simulate(seed).runs[0]
    last = int(np.searchsorted(run.time - run.time[0], 60.0, "right")) - 1
    return [_judge(run.time, line, float(run.limit[i, last])) for i, line in enumerate(run.reading) if np.isfinite(line).all()]


def _judge(time: Array, reading: Array, truth: float) -> Judged:
    record, errors, held = {"time_min": time, "T": reading}, [], []
    for name in FILTERS:
        r = tf.identify(record, until=60, filter=name, imperfection="none", rates="own")[0]
        errors.append(np.nan if r.steady_state_c is None else r.steady_state_c - truth)
        held.append(_holds(r, truth))
    used = time - time[0] <= 60.0 + 1e-9
    track = known_filters()["afukf"]().track(Lump(), time[used] - time[0], reading[used])
    whole = tf.identify(record, until=60)[0]
    found = np.nan if whole.steady_state_c is None else whole.steady_state_c - truth
    return Judged(bool((track.fading > 1.0).any()), tuple(errors), tuple(held), _holds(whole, truth), found)


def _holds(r: Any, truth: float) -> bool:
    low = -np.inf if r.steady_state_lo_c is None else r.steady_state_lo_c
    high = np.inf if r.steady_state_hi_c is None else r.steady_state_hi_c
    return bool(low <= truth <= high)


def fading(draws: int, jobs: int) -> Iterator[str]:
    """A table: on which records the fading acts, and what it gains."""
    heads = " | ".join(f"`{name}`" for name in FILTERS)
    yield f"| records (60 min used) | fading acts on | {heads} | the default, machine counted | their intervals hold |"
    yield "| --- | ---: |" + " ---: |" * (len(FILTERS) + 2)
    with ProcessPoolExecutor(jobs) as pool:
        for kind in (*KINDS, "bar", "network"):
            rows = [j for some in pool.map(partial(judged, kind), range(60_000, 60_000 + draws), chunksize=4) for j in some]
            errors = np.abs(np.array([r.errors for r in rows]))
            cells = [f"{np.nanmedian(column):.2f} K" for column in errors.T]
            held = " / ".join(f"{100 * v:.0f}" for v in np.mean([r.held for r in rows], axis=0))
            counted = f"{np.nanmedian(np.abs([r.counted_error for r in rows])):.2f} K"
            name = {"bar": "machines (bar)", "network": "machines (network)"}.get(kind, kind)
            said = f"{held}; {100 * np.mean([r.counted for r in rows]):.0f} %"
            yield (
                f"| {name} | {100 * np.mean([r.faded for r in rows]):.0f} % of {len(rows)} | "
                + " | ".join([*cells, counted, said])
                + " |"
            )


def searched(seed: int) -> tuple[bool, bool]:
    """Whether ``identify --auto`` is sure of a record with a slip, and whether its interval holds."""
    reading = KINDS[SLIPS](measured(0.02, seed), np.random.default_rng(seed))
    found = tf.identify({"time_min": MINUTES, "T": reading}, until=60, auto=True)[0]
    return found.status == "ok", _holds(found, truth_of(SLIPS, reading))


def slips(draws: int, jobs: int) -> Iterator[str]:
    """A sentence: what searching for the slip gains."""
    with ProcessPoolExecutor(jobs) as pool:
        sure, held = np.array(list(pool.map(searched, range(60_000, 60_000 + draws)))).T
    yield f"`identify --auto` on the records that slip: `ok` on {sure.sum()} of {draws}, held on {held[sure].sum()} of these."


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=60, help="records of each kind")
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    docs = ROOT / "docs"
    text = (docs / "paper.md").read_text(encoding="utf-8")
    for name, lines in (
        ("numbers", numbers(3 * given.draws, 0.005)),
        ("variants", variants(given.draws)),
        ("fading", fading(given.draws, given.jobs)),
        ("slips", slips(given.draws, given.jobs)),
    ):
        head, tail = f"<!-- {name} -->", f"<!-- /{name} -->"
        before, _, rest = text.partition(head)
        _, _, after = rest.partition(tail)
        text = f"{before}{head}\n" + "\n".join(lines) + f"\n{tail}{after}"
    (docs / "paper.md").write_text(text, encoding="utf-8")
    pictures(docs, 0.005)


if __name__ == "__main__":
    main()
