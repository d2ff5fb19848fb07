"""Do the intervals hold on machines that are not the law? Two simulators that know nothing of the estimator, limits known.

python -m benchmarks.intervals.imperfect [--machines 100] [--seed 50000] [--simulator bar|network|plate|both] [--scale] prints, by
identification time: coverage of all rows and of ``ok`` rows, median width, interval score (Winkler, 95 %) over that of an oracle
that knows the best constant width, and the RMS error over that of the bare law (``--imperfection none --rates own``); with
dominant effects, what the law leaves of the range of the readings at most where a row is ``ok`` (the rule `lawless`).
"""

import argparse
import importlib
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import thermofast as tf
from benchmarks.machines.record import EFFECTS
from thermofast.models.imperfection import TYPICAL, Imperfection

TIMES = (45.0, 60.0, 90.0, 120.0, 180.0)
END = 410.0


@dataclass(frozen=True)
class Row:
    """One sensor at one identification time: what was said, and what was true."""

    machine: int
    effect: str | None
    until: float
    status: str
    status_cut: str
    limit: float
    steady: tuple[float, float, float]
    end: float
    at: tuple[float, float, float]
    bare_error: float
    bare_held: bool
    left: float


def rows_of(
    seed: int,
    simulator: str,
    effect: str | None,
    background: float,
    exact: bool,
    times: Sequence[float],
    prior: Imperfection,
) -> list[Row]:
    """All sensors of one machine at all times."""
    machine = importlib.import_module(f"benchmarks.machines.{simulator}").simulate(seed, background, effect, exact=exact)
    run = machine.runs[0]
    good = np.isfinite(run.reading).all(axis=0)
    time, reading = run.time[good], run.reading[:, good]
    record = {"time_min": time} | {f"T{i}": line for i, line in enumerate(reading)}
    found = []
    for until in times:
        began = float(tf.identify(record, until=until, rates="own", imperfection="none", channels="T0").records[0].start_min or 0.0)
        at = min(END, float(time[-1])) - began
        said = tf.identify(record, until=until, at=at, imperfection=prior).records
        bare = tf.identify(record, until=until, at=at, imperfection="none", rates="own").records
        short = {name: column[time - time[0] <= until + 1e-9] for name, column in record.items()}
        cut = tf.identify(short, imperfection=prior).records
        ranges = [float(np.ptp(np.percentile(short[name], (1, 99)))) for name in short if name != "time_min"]
        last = int(np.searchsorted(time - time[0], until + 1e-9, "right")) - 1
        end = int(np.abs(time - time[0] - at - began).argmin())
        for i, (r, b, c) in enumerate(zip(said, bare, cut, strict=True)):
            truth = float(run.clean[:, good][i, end])
            found.append(
                Row(
                    seed,
                    effect,
                    until,
                    r.status,
                    c.status,
                    float(run.limit[:, good][i, last]),
                    _three(r.steady_state_lo_c, r.steady_state_c, r.steady_state_hi_c),
                    truth,
                    _three(r.at_lo_c, r.at_c, r.at_hi_c),
                    (b.at_c if b.at_c is not None else np.nan) - truth,
                    _holds(_three(b.steady_state_lo_c, b.steady_state_c, b.steady_state_hi_c), float(run.limit[:, good][i, last])),
                    (c.rmse_fit_c or 0.0) / ranges[i],
                )
            )
    return found


def _three(low: float | None, middle: float | None, high: float | None) -> tuple[float, float, float]:
    return (-np.inf if low is None else low, np.nan if middle is None else middle, np.inf if high is None else high)


def _holds(three: tuple[float, float, float], truth: float) -> bool:
    return three[0] <= truth <= three[2]


def score(low: Any, high: Any, truth: Any) -> Any:
    """Winkler's score of 95 % intervals: the width, and 40 times what is missed."""
    return high - low + 40.0 * np.maximum(low - truth, 0.0) + 40.0 * np.maximum(truth - high, 0.0)


def oracle(error: Any) -> float:
    """The least mean score of intervals of one width about the same estimates."""
    widths = np.linspace(0.0, np.abs(error).max(), 400)
    return float(min(np.mean(score(-w, w, error)) for w in widths))


def covered(three: Any, truth: Any) -> Any:
    """Whether intervals (n, 3) hold truths (n,)."""
    return (three[:, 0] <= truth) & (truth <= three[:, 2])


def table(rows: Iterable[Row], times: Sequence[float], title: str) -> None:
    """Background machines: temperatures at the end, and limits."""
    rows = list(rows)
    print(f"\n{title}: {len({r.machine for r in rows})} machines\n")
    heads = "min | at 410: held | `ok` held | width K | score / oracle | RMS K | RMS / law | limit held | `ok` held | share `ok`"
    print(f"| {heads} | law's held |")
    print("|" + " ---: |" * 11)
    for until in times:
        some = [r for r in rows if r.until == until]
        at, end = np.array([r.at for r in some]), np.array([r.end for r in some])
        steady, limit = np.array([r.steady for r in some]), np.array([r.limit for r in some])
        ok = np.array([r.status == "ok" for r in some])
        error, bare = at[:, 1] - end, np.array([r.bare_error for r in some])
        both = np.isfinite(error) & np.isfinite(bare)
        held, held_limit = covered(at, end), covered(steady, limit)
        rms, of_bare = (float(np.sqrt(np.mean(e[both] ** 2))) for e in (error, bare))
        best = np.mean(score(at[both, 0], at[both, 2], end[both])) / oracle(error[both])
        parts = [f"{until:g}", f"{held.mean():.3f}", f"{_mean(held[ok])}", f"{np.median(at[:, 2] - at[:, 0]):.2f}", f"{best:.2f}"]
        parts += [f"{rms:.3f}", f"{rms / of_bare:.2f}", f"{held_limit.mean():.3f}", _mean(held_limit[ok]), f"{ok.mean():.2f}"]
        parts.append(f"{np.mean([r.bare_held for r in some]):.3f}")
        print("| " + " | ".join(parts) + " |")


def mixture(background: Sequence[Row], strong: Sequence[Row], times: Sequence[float]) -> None:
    """Half background only, half one dominant effect: limits."""
    cut = "`ok` held where the record ends there | share `ok`, background | effects"
    print(f"\n| min | all rows held | background | effects | `ok` rows held | share `ok`, background | effects | {cut} |")
    print("|" + " ---: |" * 10)
    for until in times:
        held, ok, ok_cut = [], [], []
        for rows in (background, strong):
            some = [r for r in rows if r.until == until]
            held.append(covered(np.array([r.steady for r in some]), np.array([r.limit for r in some])))
            ok.append(np.array([r.status == "ok" for r in some]))
            ok_cut.append(np.array([r.status_cut == "ok" for r in some]))
        cells = [f"{until:g}", f"{np.mean([h.mean() for h in held]):.3f}", *(f"{h.mean():.3f}" for h in held)]
        for those in (ok, ok_cut):
            shares = [o.mean() for o in those]
            among = sum((h & o).mean() for h, o in zip(held, those, strict=True)) / max(sum(shares), 1e-9)
            cells += [f"{among:.3f}", *(f"{s:.2f}" for s in shares)]
        print("| " + " | ".join(cells) + " |")
    most = [max((r.left for r in rows if r.status_cut == "ok"), default=0.0) for rows in (background, strong)]
    left = f"background {most[0]:.3f}, effects {most[1]:.3f}"
    print(f"\nResiduals of the law over the range of the readings, largest of rows `ok` where the record ends there: {left}.")
    print("\n| effect | " + " | ".join(f"{t:g} min" for t in times) + " |\n| --- |" + " ---: |" * len(times))
    for effect in EFFECTS:
        line = []
        for until in times:
            some = [r for r in strong if r.until == until and r.effect == effect]
            line.append(_mean(covered(np.array([r.steady for r in some]), np.array([r.limit for r in some]))) if some else "-")
        print(f"| {effect} | " + " | ".join(line) + " |")


def _mean(values: Any) -> str:
    return f"{values.mean():.3f}" if len(values) else "-"


def learnt(simulator: str, seed: int, exact: bool) -> Imperfection:
    """What calibrate says of ten machines."""
    records = []
    for k in range(seed, seed + 10):
        run = importlib.import_module(f"benchmarks.machines.{simulator}").simulate(k, exact=exact).runs[0]
        good = np.isfinite(run.reading).all(axis=0)
        columns = {"time_min": run.time[good]} | {f"T{i}": line for i, line in enumerate(run.reading[:, good])}
        records.append(tf.read(columns, name=f"past {k}"))
    prior = tf.calibrate(records).prior
    assert prior is not None
    return prior


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--machines", type=int, default=100)
    parser.add_argument("--seed", type=int, default=50000)
    parser.add_argument("--simulator", choices=["bar", "network", "plate", "both"], default="both")
    parser.add_argument("--scale", action="store_true", help="backgrounds twice as large and 0.4 times as large too")
    parser.add_argument("--calibrated", action="store_true", help="after calibrate on ten past runs of other machines too")
    given = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    seeds = range(given.seed, given.seed + given.machines)
    with ProcessPoolExecutor() as pool:

        def run(
            simulator: str,
            effects: Sequence[str | None],
            background: float,
            exact: bool,
            which: Iterable[int],
            prior: Imperfection = TYPICAL,
        ) -> list[Row]:
            found: list[Row] = []
            for effect in effects:
                those = list(which)[EFFECTS_IN_ORDER.index(effect) :: len(EFFECTS)] if effect else list(which)
                work = partial(
                    rows_of, simulator=simulator, effect=effect, background=background, exact=exact, times=TIMES, prior=prior
                )
                found += [r for rows in pool.map(work, those, chunksize=2) for r in rows]
            return found

        for simulator in ("bar", "network") if given.simulator == "both" else (given.simulator,):
            background = run(simulator, [None], 1.0, False, seeds)
            table(background, TIMES, f"{simulator}, background only")
            if given.calibrated:
                for exact in (False,) if simulator == "plate" else (False, True):
                    prior = learnt(simulator, given.seed + 2_000_000, exact)
                    kind = "exact" if exact else "background only"
                    title = f"{simulator}, {kind}, after calibrate on 10 past runs of such machines"
                    table(run(simulator, [None], 1.0, exact, seeds, prior), TIMES, title)
            if simulator == "plate":  # it has a background only
                continue
            if given.scale:
                for factor in (2.0, 0.4):
                    table(run(simulator, [None], factor, False, seeds), TIMES, f"{simulator}, background times {factor:g}")
            table(run(simulator, [None], 1.0, True, seeds), TIMES, f"{simulator}, exact")
            offset = range(given.seed + 1_000_000, given.seed + 1_000_000 + given.machines)
            strong = run(simulator, EFFECTS_IN_ORDER, 1.0, False, offset)
            mixture(background, strong, TIMES)


EFFECTS_IN_ORDER = list(EFFECTS)

if __name__ == "__main__":
    main()
