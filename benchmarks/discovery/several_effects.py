"""Three and four clear effects at once on clean machines: is the whole set named, and nothing else?

python -m benchmarks.discovery.several_effects [--each 40] [--seed 50000] [--rule NAME=NUMBER] draws as many sets of three and of
four of the twelve effects, each clear by itself, from the tests' own simulator (scipy's solver, no part of the search) and
searches each as `diagnose` does. A name is wrong where the effect was not hidden, unless a model that is said to be as good has
hidden ones only. Without sets: --rule most_left_quick=0.
"""

import argparse
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from benchmarks.discovery.dominant import with_rule
from benchmarks.discovery.proof import as_run
from tests.machines import EFFECTS, draw
from thermofast.models.effects import BUILT_IN
from thermofast.models.search.discover import discover
from thermofast.observing.observe import observe


def judge(job: tuple[int, int]) -> tuple[int, frozenset[str], frozenset[str], list[frozenset[str]], float]:
    """(how many, hidden effects, effects named, models that do as well, seconds) of one record."""
    count, seed = job
    rng = np.random.default_rng([seed, count])
    seen = None
    while seen is None:
        kind = frozenset(str(k) for k in rng.choice(EFFECTS, count, replace=False))
        try:
            seen = observe(as_run(draw(tuple(sorted(kind)), rng, "clear"))).seen
        except RuntimeError:  # these do not go together: another set
            continue
    began = time.perf_counter()
    found = discover(seen, [effect() for effect in BUILT_IN])
    named = frozenset(found.named.ids) if found.named is not None else frozenset()
    return count, kind, named, [frozenset(c.ids) for c in found.also], time.perf_counter() - began


def main() -> None:
    """Print the table, and below it what was said where it was not the set."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=40)
    parser.add_argument("--seed", type=int, default=50_000)
    parser.add_argument("--rule", default="", metavar="NAME=NUMBER", help="with another value of a rule, to see what it is for")
    asked = parser.parse_args()
    jobs = [(count, asked.seed + i) for count in (3, 4) for i in range(asked.each)]
    with ProcessPoolExecutor(initializer=with_rule, initargs=(asked.rule,)) as pool:
        found = list(pool.map(judge, jobs))
    print("| hidden | records | the set | or among those as good | only hidden ones named | of the hidden ones named | s, median |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    for count in (3, 4):
        some = [f for f in found if f[0] == count]
        shares = (
            np.mean([named == kind for _, kind, named, *_ in some]),
            np.mean([kind in (named, *also) for _, kind, named, also, _ in some]),
            np.mean([any(f <= kind for f in (named, *also)) for _, kind, named, also, _ in some]),
            np.mean([len(named & kind) / count for _, kind, named, *_ in some]),
        )
        told = " | ".join(f"{100.0 * s:.0f} %" for s in shares)
        print(f"| {count} effects | {len(some)} | {told} | {np.median([f[-1] for f in some]):.1f} |")
    print("\n| hidden | not named | named beside |\n| --- | --- | --- |")
    for _, kind, named, *_ in found:
        if named != kind:
            print(f"| {', '.join(sorted(kind))} | {', '.join(sorted(kind - named))} | {', '.join(sorted(named - kind))} |")


if __name__ == "__main__":
    main()
