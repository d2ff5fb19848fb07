"""What several runs of an imperfect machine say together, where the search of each names nothing.

python -m benchmarks.machines.runs_left_out [--each 4] [--background 10] [--seed 500000] [--simulator bar|network|all] [--runs 2]
[--minutes 420] [--blind]
draws machines of the simulators of ``dominant`` with one effect of the machine's own, and with a background only, gives their runs
to `improve --together --auto` and prints, by effect: how often the effect is in the model, named by a search (alone or with others
as good) or taken by the error on runs left out; how often another one is, without the right one as good; the error on runs left out
over that of the base model; and of the backgrounds how often an effect is taken that is not the background's own. --minutes cuts
the records, --blind leaves out the room's column.
"""

import argparse
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor

import numpy as np

import thermofast as tf
from benchmarks.discovery.dominant import BACKGROUND, LASTING, runs_of
from benchmarks.machines import bar, network
from thermofast.errors import ThermofastError

SIMULATORS = {"bar": bar, "network": network}
#: What the reason for stopping begins with where no search named anything.
NO_SEARCH = "the search names no effect"


def judged(job: tuple[str, str | None, int, int, float, bool]) -> tuple[str, str | None, list[str], list[str], bool, float]:
    """(simulator, effect, effects in the model, those as good, whether a search named them, error over the base's)."""
    simulator, effect, seed, runs, minutes, blind = job
    machine = SIMULATORS[simulator].simulate(seed, effect=effect, runs=runs, load_spread=0.2)
    records = [_shortened(run, minutes, blind) for run in runs_of(machine, seed)]
    try:
        found = tf.improve(records, together=True, auto=True).records
    except ThermofastError:
        return simulator, effect, [], [], False, 1.0
    errors = [
        np.sqrt(np.nanmean([(r.rmse_other_runs_c or np.nan) ** 2 for r in found if r.step == step]))
        for step in (0, max(r.step for r in found))
    ]
    last = max(found, key=lambda r: r.step)
    good = last.stopped_because.partition("as good: ")[2].partition(":")[0]
    others = good.replace("+", ", ").split(", ") if good else []
    return simulator, effect, list(last.effects), others, not last.stopped_because.startswith(NO_SEARCH), errors[1] / errors[0]


def _shortened(run: tf.Run, minutes: float, blind: bool) -> tf.Run:
    kept = run.time_s <= 60.0 * minutes
    columns = {"time_s": run.time_s[kept]} | {n: v[kept] for n, v in run.channels.items()}
    return tf.read(columns | ({} if blind else {n: v[kept] for n, v in run.ambient.items()}), name=run.name)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=4)
    parser.add_argument("--background", type=int, default=10)
    parser.add_argument("--seed", type=int, default=500_000)
    parser.add_argument("--simulator", choices=[*SIMULATORS, "all"], default="all")
    parser.add_argument("--runs", type=int, default=2)
    parser.add_argument("--minutes", type=float, default=420.0)
    parser.add_argument("--blind", action="store_true")
    asked = parser.parse_args()
    how = asked.runs, asked.minutes, asked.blind
    jobs: list[tuple[str, str | None, int, int, float, bool]] = []
    for simulator in SIMULATORS if asked.simulator == "all" else (asked.simulator,):
        for k, effect in enumerate(sorted(LASTING)):
            jobs += [(simulator, effect, asked.seed + 1000 * k + i, *how) for i in range(asked.each)]
        jobs += [(simulator, None, asked.seed + 50_000 + i, *how) for i in range(asked.background)]
    rows = defaultdict(list)
    with ProcessPoolExecutor(2) as pool:
        for simulator, effect, *rest in pool.map(judged, jobs):
            rows[simulator, effect].append(rest)
    print("| simulator | effect | machines | named by a search | by runs left out | right one as good | wrong | error over base |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    for (simulator, effect), some in rows.items():
        allowed = BACKGROUND if effect is None else {effect}
        searched = sum(effect in mine and by for mine, _, by, _ in some)
        taken = sum(effect in mine and not by for mine, _, by, _ in some)
        open_ = sum(effect not in mine and effect in good for mine, good, _, _ in some)
        wrong = sum(bool(mine) and not allowed & {*mine, *good} for mine, good, _, _ in some)
        ratio = np.median([e for *_, e in some])
        print(f"| {simulator} | {effect} | {len(some)} | {searched} | {taken} | {open_} | {wrong} | {ratio:.2f} |")


if __name__ == "__main__":
    main()
