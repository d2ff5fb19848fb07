"""A load or a cooling that steps in one part of the machine: is it named, and in the right sensors?

python -m benchmarks.analysis.part_steps [--each 20] [--seed 91000] prints, by what steps half way through a run in one to all but
one of three to five linked bodies: how often `diagnose` names it, alone or in an "A or B", and in exactly the sensors that have it;
how often something else is named there, and how often the bodies without it are said to have it. The machines are those of
benchmarks.analysis.room_steps, with conduction between the bodies.
"""

import argparse
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import thermofast as tf

from .room_steps import RIGHT, record

#: Effects that these machines have beside.
THERE = {"second_mode", "neighbour_heat", "ambient", "room_step", "nonlinear_loss", "sensor_lag"}


def trial(seed: int, what: str) -> tuple[str, int, int]:
    """(how it was named, sensors that have it and are told so, those that do not and are told so)."""
    table, _, _, who = record(what, seed, parts=True)
    found = tf.diagnose(table, jobs=1)
    right = RIGHT[what]
    named = [set() if r.verdict in ("none", "unexplained") else {n.partition(".")[0] for n in r.verdict.split("+")} for r in found]
    either = {
        n.partition(".")[0] for r, own in zip(found, named, strict=True) if own for o in r.also_possible for n in o.split("+")
    }
    has = [right in own for own in named]
    told = sum(h and w for h, w in zip(has, who, strict=True))
    too_many = sum(h and not w for h, w in zip(has, who, strict=True))
    everything = set().union(*named)
    if not everything:
        return "nothing named", told, too_many
    if right not in everything:
        other = everything - THERE
        return (
            ("in an A or B" if right in either else f"{'+'.join(sorted(other))} instead" if other else "only what is there too"),
            0,
            0,
        )
    return (
        ("in an A or B, " if either - THERE else "") + ("in its sensors" if has == who.tolist() else "in other sensors"),
        told,
        too_many,
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", type=int, default=20)
    parser.add_argument("--seed", type=int, default=91000)
    asked = parser.parse_args()
    print("| what steps in a part | runs | how it was named | told in sensors without it |\n| --- | ---: | --- | ---: |")
    with ProcessPoolExecutor(2) as pool:
        for what in ("heat", "loss"):
            found = list(pool.map(partial(trial, what=what), range(asked.seed, asked.seed + asked.each)))
            ways = ", ".join(f"{way} {count}" for way, count in Counter(way for way, *_ in found).most_common())
            print(f"| {what} | {asked.each} | {ways} | {sum(many for *_, many in found)} |", flush=True)


if __name__ == "__main__":
    main()
