"""Is the effect that matters named although the rest is imperfect? Simulators that know nothing of the search, seeds of choice.

python -m benchmarks.discovery.dominant [--each 10] [--background 100] [--seed 700000] [--simulator bar|network|outside|all]
[--rule NAME=NUMBER] [--cases] prints, by simulator and effect: how often the dominant effect is named (alone, or in an
"A or B" of two), how often a wrong one is, what becomes of the error on readings left out and on another run of the
machine; how often machines with a background only, and machines with a cause outside the catalogue, have an effect named.
"""

import argparse
import importlib
import json
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import thermofast as tf
from benchmarks.machines import outside
from benchmarks.machines.record import EFFECTS, Machine
from thermofast.machine.learnt import carry
from thermofast.machine.modelfile import model_file
from thermofast.models.effects import BUILT_IN
from thermofast.models.joint import Fit
from thermofast.models.search.discover import discover
from thermofast.models.search.rules import RULES
from thermofast.observing.observe import observe
from thermofast.observing.task import ahead_errors
from thermofast.reading import Run

#: What every machine holds a little of: naming it is not wrong.
BACKGROUND = frozenset({"second_mode", "second_mode.2", "neighbour_heat", "ambient", "nonlinear_loss", "sensor_lag"})
#: Effects that belong to the machine: known on its next run.
LASTING = frozenset(
    {"second_mode", "neighbour_heat", "sensor_lag", "nonlinear_loss", "transport_delay", "friction_decay", "ambient"}
)
CASES = Path(__file__).parents[3] / "shared" / "cases"
#: Minutes of another run that the learnt model may see.
READ = 60.0


@dataclass
class Outcome:
    """What the search said of one machine; `held` and `other` are errors over those of the base model."""

    simulator: str
    effect: str | None
    seed: int
    named: list[str]
    rivals: list[str]
    partly: bool
    held: float = float("nan")
    other: float = float("nan")
    seconds: float = 0.0
    wrong: list[str] = field(default_factory=list)

    @property
    def right(self) -> bool:
        return self.effect in self.named or self.effect in self.rivals


def runs_of(machine: Machine, seed: int) -> list[Run]:
    """Records as a lab would have them: the room and the warm neighbour logged."""
    found = []
    for number, record in enumerate(machine.runs):
        rng = np.random.default_rng([seed, 99, number])
        columns = {"time_min": record.time} | {f"T{i}": row for i, row in enumerate(record.reading)}
        if record.beside is not None:
            columns["N"] = record.beside
        if np.isfinite(record.room).all():
            columns["ambient"] = np.round((record.room + 0.02 * rng.standard_normal(record.room.size)) / 0.02) * 0.02
        found.append(tf.read(columns, name=f"run {number}"))
    return found


def judge(job: tuple[str, str | None, int]) -> Outcome:
    """One machine drawn and searched."""
    simulator, effect, seed = job
    module = importlib.import_module(f"benchmarks.machines.{simulator}")
    machine = outside.simulate(seed, str(effect)) if simulator == "outside" else module.simulate(seed, 1.0, effect, runs=2)
    first, *others = runs_of(machine, seed)
    seen = observe(first).seen
    assert seen is not None
    began = time.perf_counter()
    found = discover(seen, [kind() for kind in BUILT_IN], RULES.false_alarm)
    spent = time.perf_counter() - began
    named = found.verdict.split("+") if found.named is not None else []
    rivals = [p.id for c in found.also[:1] for p in c.parts] if named else []
    outcome = Outcome(simulator, effect, seed, named, rivals, found.partly, seconds=spent)
    fair = set() if simulator == "outside" else {effect, *BACKGROUND}
    outcome.wrong = [n for n in named if n not in fair and effect not in rivals]
    if found.ahead is not None:
        outcome.held = float(np.sqrt(np.nansum(found.ahead**2) / np.nansum(found.ahead_base**2)))
    if others and found.named is not None and effect in LASTING:
        outcome.other = _other_run(others[0], found.named.fit, found.base)
    return outcome


def _other_run(run: Run, learnt: Fit, base: Fit) -> float:
    """Error after READ minutes of another run, of the model learnt over that of the base model, both from the same first run."""
    whole = observe(run).seen
    assert whole is not None
    seen = whole.until(READ)
    errors = [
        ahead_errors(carry(model_file(fit, "first", 0, None, {}), seen, "other", "machine.toml").fit, whole)
        for fit in (learnt, base)
    ]
    return float(np.sqrt(np.nansum(errors[0] ** 2) / np.nansum(errors[1] ** 2)))


def jobs_of(simulators: Sequence[str], each: int, background: int, seed: int) -> list[tuple[str, str | None, int]]:
    """Machines to draw: `each` of every effect, and `background` without any, for every simulator."""
    jobs: list[tuple[str, str | None, int]] = []
    for simulator in simulators:
        kinds = outside.KINDS if simulator == "outside" else tuple(EFFECTS)
        jobs += [(simulator, kind, seed + 1000 * k + i) for k, kind in enumerate(kinds) for i in range(each)]
        if simulator != "outside":
            jobs += [(simulator, None, seed + 50_000 + i) for i in range(background)]
    return jobs


def report(outcomes: Iterable[Outcome]) -> str:
    """Tables of all simulators."""
    lines = []
    by: dict[str, dict[str | None, list[Outcome]]] = defaultdict(lambda: defaultdict(list))
    for o in outcomes:
        by[o.simulator][o.effect].append(o)
    for simulator, groups in by.items():
        lines += [f"**{simulator}**", ""]
        if simulator == "outside":
            lines += ["| hidden cause | machines | an effect named |", "| --- | ---: | ---: |"]
            lines += [f"| {kind} | {len(some)} | {sum(bool(o.named) for o in some)} |" for kind, some in groups.items()]
            lines.append("")
            continue
        lines += [
            "| dominant effect | machines | named | alone | wrong | held-out error over base | to 0.35 | other run halved |",
            "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
        ]
        strong = {k: v for k, v in groups.items() if k is not None}
        for effect, some in [*strong.items(), ("all", [o for v in strong.values() for o in v])]:
            lines.append(_line(str(effect), some))
        alone = groups.get(None, [])
        if alone:
            named = sum(bool(set(o.named) - BACKGROUND) and not set(o.rivals) & BACKGROUND for o in alone)
            lines += ["", f"Background only, {len(alone)} machines: none named in {_share(not o.named for o in alone)}, "]
            lines[-1] += (
                f"one of the background's own in {_share(bool(o.named) and not set(o.named) - BACKGROUND for o in alone)}, "
            )
            lines[-1] += f"another in {named}. Seconds, median: {np.median([o.seconds for v in groups.values() for o in v]):.1f}."
        lines.append("")
    return "\n".join(lines)


def _share(values: Iterable[bool]) -> str:
    some = list(values)
    return f"{100.0 * sum(some) / len(some):.0f} %" if some else "-"


def _line(effect: str, some: list[Outcome]) -> str:
    alone = [o.named and o.named[0] == o.effect and not o.rivals for o in some]
    held = [o.held if np.isfinite(o.held) else 1.0 for o in some]
    other = [o.other for o in some if o.effect in LASTING]
    cells = [
        effect,
        str(len(some)),
        _share(o.right for o in some),
        _share(bool(a) for a in alone),
        str(sum(bool(o.wrong) for o in some)),
    ]
    cells += [f"{np.median(held):.2f}", _share(h <= 0.35 for h in held), _share(o <= 0.5 for o in other)]
    return "| " + " | ".join(cells) + " |"


def with_rule(text: str, rules: object = RULES) -> None:
    """Another value of one of some rules, of the search's by default, in this process: ``least_evidence=0``."""
    if text:
        name, _, value = text.partition("=")
        assert hasattr(rules, name), name
        object.__setattr__(rules, name, float(value))


def cases() -> list[tuple[str, str]]:
    """(folder, name) of every case that others simulated."""
    return [(folder, name) for folder in ("clean", "imperfect") for name in json.loads((CASES / folder / "key.json").read_text())]


def judge_case(case: tuple[str, str]) -> tuple[str, str]:
    """(tier, how it was named) of the first run of a case."""
    folder, name = case
    key = json.loads((CASES / folder / "key.json").read_text())[name]
    clean = folder == "clean"
    effects = set(key["effects"]) if clean else {key["dominant"]} - {None}
    tier = f"clean, {key['tier']}" if clean else "imperfect, dominant" if effects else "imperfect, background"
    seen = observe(tf.read(CASES / folder / f"{name}_a.csv")).seen
    assert seen is not None
    found = discover(seen, [kind() for kind in BUILT_IN], RULES.false_alarm)
    named = set(found.verdict.split("+")) if found.named is not None else set()
    also = {p.id for c in found.also[:1] for p in c.parts} if named else set()
    fair = effects if clean else effects | BACKGROUND
    if not named:
        return tier, "none"
    if effects and effects <= named | also:
        return tier, "right" if effects <= named else "A or B"
    return tier, "a part, or of the background" if named <= fair else "wrong"


def report_cases(found: Sequence[tuple[str, str]]) -> str:
    """A line for each tier."""
    ways = ("right", "A or B", "a part, or of the background", "wrong", "none")
    lines = ["| cases | of | " + " | ".join(ways) + " |", "| --- | ---: |" + " ---: |" * len(ways)]
    for tier in dict.fromkeys(t for t, _ in found):
        some = Counter(way for t, way in found if t == tier)
        lines.append(f"| {tier} | {some.total()} | " + " | ".join(str(some[w]) for w in ways) + " |")
    return "\n".join(lines)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", type=int, default=10)
    parser.add_argument("--background", type=int, default=100)
    parser.add_argument("--seed", type=int, default=700_000)
    parser.add_argument("--simulator", choices=["bar", "network", "outside", "all"], default="all")
    parser.add_argument("--cases", action="store_true", help="../shared/cases in their place")
    parser.add_argument("--rule", default="", metavar="NAME=NUMBER", help="with another value of a rule, to see what it is for")
    given = parser.parse_args()
    if given.cases:
        with ProcessPoolExecutor(initializer=with_rule, initargs=(given.rule,)) as pool:
            print(report_cases(list(pool.map(judge_case, cases(), chunksize=4))))
        return
    simulators = ("bar", "network", "outside") if given.simulator == "all" else (given.simulator,)
    with ProcessPoolExecutor(initializer=with_rule, initargs=(given.rule,)) as pool:
        print(report(pool.map(judge, jobs_of(simulators, given.each, given.background, given.seed), chunksize=4)))


if __name__ == "__main__":
    main()
