"""Does the run that `diagnose --next` proposes settle what a record left open? On machines of the tests' own simulator.

python -m benchmarks.discovery.next_experiment [--cases 40] [--seed 30000] draws faint single effects until so many records are
left with the true cause and another; simulates the run proposed, and the same run once more, by scipy's ODE solver, which knows
nothing of the search; searches them with the whole catalogue; and prints how often the true cause alone is named. A run once more
is searched by itself and together with the first. Where no run settles half of what is simulated, none is proposed, and the
program says so.
"""

import argparse
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np

import thermofast as tf
from tests.machines import EFFECTS, Case, _record, draw
from thermofast.experiments.next_experiment import LEAST, SEEN_RISE, Experiment, causes, next_experiments, planned, possible, rises
from thermofast.models import Observations
from thermofast.models.effects import BUILT_IN
from thermofast.models.search.discover import discover, discover_together
from thermofast.observing.observe import observe

SAID = {True: "settled", False: "not settled", None: "none proposed"}
CATALOGUE = [effect() for effect in BUILT_IN]


def observed(case: Case, heat: np.ndarray | None = None) -> Observations:
    """A case as the loop sees it, with the heat (N,) as logged drive where it is switched."""
    columns = dict(case.columns)
    if heat is None:
        run = tf.read(columns, ambient="ambient")
        seen = observe(run).seen
    else:
        run = tf.read({**columns, "heat_on": heat}, ambient="ambient", inputs="heat_on")
        seen = observe(run, 0.0, "heat_on").seen
    assert seen is not None
    return seen


def again(case: Case, experiment: Experiment, rng: np.random.Generator) -> Observations:
    """An experiment on the machine of a case."""
    seen = observed(case)
    time, heat = planned(experiment, seen.time)
    truth = {**case.truth, "effects": dict(case.truth["effects"])}
    if heat is not None:
        at = np.flatnonzero(np.diff(heat) != 0.0)
        edges = [0.5 * float(time[i] + time[i + 1]) for i in at]
        truth["effects"]["planned"] = {"at_min": edges, "levels": [float(heat[0]), *(float(heat[i + 1]) for i in at)]}
    if experiment.heated is not None:
        truth |= {"R": np.where(np.arange(len(truth["R"])) == experiment.heated, truth["R"], 0.0), "T0": truth["room"]}
    if experiment.faster > 1 and heat is not None:  # the program averages what is read more often than it needs
        fine = np.linspace(time[0], time[-1], experiment.faster * (len(time) - 1) + 1)
        time, heat = fine, heat[np.searchsorted(time, fine - 1e-9)]
        at = np.flatnonzero(np.diff(heat) != 0.0)
        truth["effects"]["planned"]["at_min"] = [0.5 * float(time[i] + time[i + 1]) for i in at]
    told = replace(_record(case.kind, truth, np.asarray(time), False, case.noise, case.step, rng), truth=truth)
    return observed(told, heat)


def trial(seed: int) -> tuple[str, bool | None, bool, str] | None:
    """(true cause, settled by the run proposed, by the same run once more, the run); None where the truth is not left open."""
    rng = np.random.default_rng(seed)
    kind = str(rng.choice(EFFECTS))
    case = draw(kind, rng, "faint")
    if case.truth["dt_min"] > 1.0:  # when a heat is switched between two readings of a coarse logger is not known
        return None
    first = observed(case)
    found = discover(first, CATALOGUE)
    open_ = causes(found)
    if len(open_) < 2 or all(c.ids != (kind,) for c in open_):
        return None
    proposed = next_experiments(found, CATALOGUE)[0]

    def settled(run: Observations, experiment: Experiment) -> bool:
        if experiment.heated is not None:
            linked = [any(p.effect.reads_sensors for p in c.parts) for c in open_]
            mine = linked[[c.ids for c in open_].index((kind,))]
            return bool(rises(run, experiment.heated).max() > SEEN_RISE) == mine and linked.count(mine) == 1
        repeat = experiment.effort == 1
        searches = [discover(run, CATALOGUE)] + (discover_together([first, run], CATALOGUE)[1:] if repeat else [])
        return any(f.named is not None and all(set(c.ids) == {kind} for c in (f.named, *f.also)) for f in searches)

    with_it = settled(again(case, proposed, rng), proposed) if proposed.share >= LEAST else None
    repeat = possible(first)[0]
    once_more = settled(again(case, repeat, rng), repeat)
    return kind, with_it, once_more, f"{proposed.name} ({proposed.settled} of {proposed.runs})"


def _row(name: str, number: int, mine: Sequence[tuple[str, bool | None, bool, str]]) -> str:
    proposed = [m[1] for m in mine if m[1] is not None]
    return f"| {name} | {number} | {len(proposed)} | {sum(proposed)} | {sum(m[2] for m in mine)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--seed", type=int, default=30_000)
    asked = parser.parse_args()
    found: list[tuple[str, bool | None, bool, str]] = []
    looked, seed = 0, asked.seed
    with ProcessPoolExecutor() as pool:
        while len(found) < asked.cases:
            seeds = range(seed, seed + 16)
            for one in pool.map(trial, seeds):
                looked += 1
                if one is not None and len(found) < asked.cases:
                    found.append(one)
                    print(f"{one[0]}: {one[3]}: {SAID[one[1]]}; once more: {one[2]}", flush=True)
            seed += 16
    print("\n| true cause | left open | a run proposed | settled by it | by the same run once more |")
    print("| --- | ---: | ---: | ---: | ---: |")
    for kind, number in Counter(k for k, *_ in found).items():
        print(_row(kind, number, [f for f in found if f[0] == kind]))
    print(_row("all", len(found), found))
    print(f"\n{looked} faint records looked at.")


if __name__ == "__main__":
    main()
