"""What the discovery loop says of simulated machines whose hidden effect is known, and how often it is right.

``python -m benchmarks.discovery.proof`` runs all and writes docs/proof.md; ``--quick`` a small sample to the screen. The simulator
(tests/machines.py) shares no line with the product: a network of lumps integrated by scipy's stiff solver.
"""

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import argparse
import sys
import time
from collections import Counter, defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from machines import EFFECTS, OUTSIDE, Case, draw, second_run

from thermofast.machine.learnt import carry
from thermofast.machine.modelfile import model_file
from thermofast.models.effects import BUILT_IN, Choice
from thermofast.models.joint import LEVEL, RATE, START, Fit, Part, fit_model
from thermofast.models.search.discover import discover
from thermofast.models.search.heldout import held_out_errors
from thermofast.observing.observe import observe
from thermofast.observing.task import ahead_errors
from thermofast.reading import Run

KIND = {kind.id: kind for kind in BUILT_IN}
EVENTS = ("load_step", "cooling_switch", "reading_jump")
PAIRS = (
    ("ambient", "second_mode"),
    ("load_step", "cyclic_load"),
    ("cooling_switch", "reading_jump"),
    ("friction_decay", "sensor_drift"),
    ("sensor_lag", "nonlinear_loss"),
    ("neighbour_heat", "ambient"),
    ("load_step", "sensor_lag"),
    ("second_mode", "cyclic_load"),
)


@dataclass(frozen=True)
class Job:
    """One record to draw and to judge."""

    part: str
    kind: tuple[str, ...]
    size: str | None
    seed: int


@dataclass
class Outcome:
    """What was found; ratios are nan where they do not apply."""

    job: Job
    verdict: str
    also: list[str]
    seconds: float
    sensors: int
    readings: int
    clear: float
    held_out_ratio: float = np.nan
    other_run_ratio: float = np.nan
    event_errors: list[tuple[float, float]] = field(default_factory=list)
    broken: str = ""


def as_run(case: Case, name: str = "simulated") -> Run:
    """A case as the reader would hand it over."""
    columns = case.columns
    sensors = {k: v for k, v in columns.items() if k[0] == "T" and k[1:].isdigit()}
    return Run(name, columns["time_min"] * 60.0, sensors, {"ambient": columns["ambient"]})


def true_fit(case: Case, run: Any) -> Fit | None:
    """The true model's own fit, from the true parameters."""
    n, parts, start = run.sensors, [], {}
    truth = case.truth
    start[RATE] = np.array(truth["b"], dtype=float)
    start[LEVEL] = truth["room"] + np.array(truth["R"], dtype=float)
    start[START] = np.full(n, float(np.ravel(truth["T0"])[0]))
    for k, (name, p) in enumerate(truth["effects"].items()):
        if name not in KIND:
            return None
        effect = KIND[name]()
        choices = effect.choices(run)
        if not choices:
            return None
        choice = choices[0]
        who = tuple(bool(i in np.ravel(p["sensors"])) for i in range(n)) if "sensors" in p and effect.scope != "run" else None
        values, choice = _true_values(name, p, n, choice, effect, run)
        if k and effect.changes_heat:
            choice = Choice(choice.label, {**choice.constants, "product": True}, choice.omitted)
        parts.append(Part(effect, choice, who))
        start |= {(k, key): value for key, value in values.items()}
    best = None
    phases = [0.0, 0.25, 0.5, 0.75] if "cyclic_load" in truth["effects"] else [0.0]
    for phase in phases:
        for k, part in enumerate(parts):
            if part.id == "cyclic_load":
                start[k, "phase"] = phase
        fit = fit_model(run, parts, start, most=60)
        if best is None or fit.rss.sum() < best.rss.sum():
            best = fit
    return best


def _true_values(name: str, p: dict[str, Any], n: int, choice: Choice, effect: Any, run: Any) -> tuple[dict[str, Any], Choice]:
    def spread(value: Any, fill: float) -> np.ndarray:
        out = np.full(n, fill)
        out[np.ravel(p["sensors"])] = np.ravel(value)
        return out

    if name == "ambient":
        return {"gain": 1.0}, choice
    if name == "second_mode":
        return {"kappa": spread(p["kappa"], 0.01), "rate": spread(p["rate"], 0.01)}, choice
    if name == "load_step":
        return {"change": p["ratio"] - 1.0, "event": p["event_min"]}, choice
    if name == "cooling_switch":
        return {"ratio": p["ratio"], "event": p["event_min"]}, choice
    if name == "sensor_lag":
        return {"lag": spread(p["tau_s"], 1.0)}, choice
    if name == "transport_delay":
        return {"delay": spread(next(v for k, v in p.items() if k != "sensors"), 1.0)}, choice
    if name == "nonlinear_loss":
        return {"exponent": next(iter(p.values()))}, choice
    if name == "neighbour_heat":
        source = (np.arange(n) + 1) % n
        source[np.ravel(p["sensors"])] = np.ravel(p["source"])
        return {"kappa": spread(p["kappa"], 0.01)}, Choice("", {"source": source}, by_sensor=("source",))
    if name == "cyclic_load":
        wave = next(c for c in effect.choices(run) if c.constants["wave"] == p["wave"])
        return {"depth": p["depth"], "period": p["period_min"]}, wave
    if name == "friction_decay":
        return {"extra": p["a"], "time_constant": p["tau_r"]}, choice
    if name == "sensor_drift":
        return {"drift": spread(p["d"], 0.0)}, choice
    return {"jump": spread(p["jump"], 0.0), "event": spread(p["event_min"], 100.0)}, choice


def judge(job: Job) -> Outcome:
    """Draw a record, search it, and measure what can be measured of the answer."""
    rng = np.random.default_rng([job.seed, *map(ord, job.part), *(ord(c) for k in job.kind for c in k)])
    seen = None
    while seen is None:  # a record that is refused as too short is no trial of the search: another is drawn
        case = draw(job.kind, rng, job.size)
        seen = observe(as_run(case)).seen
    began = time.perf_counter()
    found = discover(seen, [kind() for kind in BUILT_IN])
    spent = time.perf_counter() - began
    verdict = "+".join(sorted(found.verdict.split("+")))
    also = ["+".join(sorted(c.ids)) for c in found.also]
    outcome = Outcome(job, verdict, also, spent, seen.sensors, len(case.columns["time_min"]), case.clear_size)
    if found.named is None or job.size != "clear" or verdict != "+".join(sorted(job.kind)):
        return outcome
    truth = true_fit(case, seen)
    if truth is not None and found.ahead is not None:
        ideal = held_out_errors(truth)
        outcome.held_out_ratio = float(np.sqrt(np.nansum(found.ahead**2) / np.nansum(ideal**2)))
    for k, part in enumerate(found.named.parts):
        if part.id in EVENTS:
            values, errors = found.named.fit.values[k, "event"], found.named.fit.deviations[k, "event"]
            i = int(np.flatnonzero(part.concerns(seen.sensors))[0])
            value, error = (float(v[i]) if np.ndim(v) else float(v) for v in (values, errors))
            bound = max(2.0 * seen.step, 2.5 * min(error, 1e6))
            outcome.event_errors.append((abs(value - float(np.ravel(case.truth["effects"][part.id]["event_min"])[0])), bound))
    if len(job.kind) == 1 and job.kind[0] not in EVENTS:
        outcome.other_run_ratio = _other_run(case, found.named.fit, found.base, rng)
    return outcome


def _other_run(case: Case, learnt: Fit, base: Fit, rng: np.random.Generator) -> float:
    """Error ahead of minute 60 on another run of the machine: with the learnt model, over that with the base model."""
    other = second_run(case, rng)
    whole = observe(as_run(other, "other")).seen
    assert whole is not None
    seen = whole.until(60.0)
    # Errors of the curve itself: a reading's noise is in both and would hide how they differ.
    true = [np.interp(whole.time, other.columns["time_min"], row) for row in other.clean]
    whole = replace(whole, reading=np.where(whole.used, np.array(true), np.nan))
    errors = []
    for fit in (learnt, base):
        file = model_file(fit, "first", 0, None, {})
        errors.append(ahead_errors(carry(file, seen, "other", "machine.toml").fit, whole))
    return float(np.sqrt(np.nansum(errors[0] ** 2) / np.nansum(errors[1] ** 2)))


def guarded(job: Job) -> Outcome:
    """As :func:`judge`; an exception is an outcome."""
    try:
        return judge(job)
    except Exception as error:
        return Outcome(job, "error", [], 0.0, 0, 0, np.nan, broken=f"{type(error).__name__}: {error}")


def jobs_of(nothing: int, clear: int, faint: int, pairs: int, outside: int, seed: int) -> list[Job]:
    """All records of the proof."""
    jobs = [Job("nothing", (), None, seed + i) for i in range(nothing)]
    jobs += [Job("clear", (e,), "clear", seed + i) for e in EFFECTS for i in range(clear)]
    jobs += [Job("faint", (e,), "faint", seed + i) for e in EFFECTS for i in range(faint)]
    jobs += [Job("pairs", p, "clear", seed + i) for p in PAIRS for i in range(pairs)]
    return jobs + [Job("outside", (o,), "clear", seed + i) for o in OUTSIDE for i in range(outside)]


def report(outcomes: list[Outcome]) -> str:
    """The tables of docs/proof.md."""
    by: dict[str, list[Outcome]] = defaultdict(list)
    for o in outcomes:
        by[o.job.part].append(o)

    def right(o: Outcome) -> bool:
        return o.verdict == ("+".join(sorted(o.job.kind)) or "none")

    def confident_wrong(o: Outcome) -> bool:
        truth = "+".join(sorted(o.job.kind)) or "none"
        return o.verdict not in (truth, "none", "unexplained") and truth not in o.also

    lines: list[str] = []

    def row(what: str, reach: str, got: str) -> None:
        lines.append(f"| {what} | {reach} | {got} |")

    def share(hits: int, all_: int) -> str:
        return f"{hits} of {all_} ({100.0 * hits / max(all_, 1):.1f} %)"

    lines += ["| what | to reach | reached |", "| --- | --- | --- |"]
    if by["nothing"]:
        o = by["nothing"]
        row("nothing hidden: an effect named", "<= 1 %", share(sum(x.verdict not in ("none", "unexplained") for x in o), len(o)))
        row("nothing hidden: `unexplained`", "-", share(sum(x.verdict == "unexplained" for x in o), len(o)))
    if by["clear"]:
        o = by["clear"]
        row("one clear effect: right verdict", ">= 97 %", share(sum(map(right, o)), len(o)))
        worst = min(EFFECTS, key=lambda e: np.mean([right(x) for x in o if x.job.kind == (e,)]))
        row(f"the least certain of the twelve ({worst})", ">= 90 %", share(*_count(o, worst, right)))
        ratios = np.array([x.held_out_ratio for x in o])
        ratios = ratios[np.isfinite(ratios)]
        row("held-out error over that of the true model <= 1.15", ">= 95 %", share(int((ratios <= 1.15).sum()), len(ratios)))
        other = np.array([x.other_run_ratio for x in o])
        other = other[np.isfinite(other)]
        row("another run: error ahead over the base model's <= 0.5", ">= 95 %", share(int((other <= 0.5).sum()), len(other)))
        events = [e for x in o for e in x.event_errors]
        row("event within max(2 samples, 2.5 deviations)", ">= 95 %", share(sum(a <= b for a, b in events), len(events)))
    if by["faint"]:
        o = by["faint"]
        named = sum(right(x) or "+".join(x.job.kind) in x.also for x in o)
        row("one faint effect: right or among `also_possible`", ">= 80 %", share(named, len(o)))
        row("one faint effect: a confident wrong name", "<= 5 %", share(sum(map(confident_wrong, o)), len(o)))
    if by["pairs"]:
        o = by["pairs"]
        row("two clear effects: the exact pair", ">= 85 %", share(sum(map(right, o)), len(o)))
    if by["outside"]:
        o = by["outside"]
        row("outside the catalogue: `unexplained`", ">= 90 %", share(sum(x.verdict == "unexplained" for x in o), len(o)))
        row(
            "outside the catalogue: a confident wrong name",
            "<= 5 %",
            share(sum(x.verdict not in ("none", "unexplained") and not x.also for x in o), len(o)),
        )
    seconds = [x.seconds for x in outcomes if x.seconds]
    row(
        "seconds a run, one core: median, 95 %, longest",
        "-",
        " / ".join(f"{np.quantile(seconds, q):.1f}" for q in (0.5, 0.95, 1.0)),
    )
    for part, title in (
        ("clear", "One clear effect"),
        ("faint", "One faint effect"),
        ("pairs", "Two clear effects"),
        ("outside", "Outside the catalogue"),
    ):
        if by[part]:
            lines += ["", f"## {title}", "", "| hidden | verdicts | right or also possible |", "| --- | --- | --- |"]
            for kind in dict.fromkeys(x.job.kind for x in by[part]):
                mine = [x for x in by[part] if x.job.kind == kind]
                told = ", ".join(f"{v} {c}" for v, c in Counter(x.verdict for x in mine).most_common())
                near = sum(right(x) or "+".join(sorted(x.job.kind)) in x.also for x in mine)
                lines.append(f"| {' + '.join(kind)} | {told} | {share(near, len(mine))} |")
    other = [(x.job.kind[0], x.other_run_ratio) for x in by["clear"] if np.isfinite(x.other_run_ratio)]
    if other:
        lines += ["", "## Another run of the same machine", "", "| effect | median ratio | share <= 0.5 |", "| --- | ---: | ---: |"]
        for effect in dict.fromkeys(k for k, _ in other):
            r = np.array([v for k, v in other if k == effect])
            lines.append(f"| {effect} | {np.median(r):.3f} | {share(int((r <= 0.5).sum()), len(r))} |")
    broken = [x for x in outcomes if x.broken]
    if broken:
        lines += ["", f"{len(broken)} runs ended in an error: {broken[0].job} {broken[0].broken}"]
    return "\n".join(lines) + "\n"


def _count(outcomes: list[Outcome], effect: str, right: Any) -> tuple[int, int]:
    mine = [x for x in outcomes if x.job.kind == (effect,)]
    return sum(map(right, mine)), len(mine)


HEAD = """# How often the discovery loop is right

Simulated machines of two to ten sensors, noise 10 to 40 mK, logger steps of 0.01 and 0.05 K, gaps, and one hidden effect,
two, none, or one that the catalogue does not hold; every record judged as `thermofast diagnose` would. The simulator is another
program than the product (`tests/machines.py`: a network of lumps integrated by scipy's stiff solver). *Clear*: refitting the base
law to the noise-free signal leaves at least 3 times the noise in some sensor; *faint*: the summed square of what it leaves is 40 to
200 noise variances. *Held-out error*: on contiguous blocks left out of the fit. *Another run*: the error of the curve after
minute 60, machine constants from the first run, level and start from the first hour, over that of the base model learnt on the
same first run.

Made by `make proof` (`python -m benchmarks.discovery.proof`), seed {seed}, in {minutes:.0f} min on {cores} cores.

"""


NOTES = """
## Reading the tables

- These machines hold nothing but what is hidden in them. Machines with a background, as real ones have, stand in
  [proof-imperfect.md](proof-imperfect.md).
- A verdict that shares its place with others is told so (`also_possible`, status `not_determined`); *confident* means that it
  stands alone.
- Faint effects are often named by a cousin: with so little signal a slow mode, a drift and a neighbour draw the same curve. The
  true one is then among `also_possible`; least often for a faint `second_mode`.
- `second_mode` beside `ambient` can be undecidable although each alone would be clear: together they may draw what one draws.
- A `worsening_contact` that at this noise and step is a straight line to the last digit is called `sensor_drift`.
- A record of fewer than 24 readings is refused as too short, and another one drawn in its place.
"""


def main() -> None:
    """Run the proof and write its page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a small sample, to the screen only")
    parser.add_argument("--seed", type=int, default=20_000)
    for name, count in (("nothing", 1000), ("clear", 50), ("faint", 50), ("pairs", 50), ("outside", 50)):
        parser.add_argument(f"--{name}", type=int, default=count)
    given = parser.parse_args()
    numbers = (20, 1, 1, 1, 2) if given.quick else (given.nothing, given.clear, given.faint, given.pairs, given.outside)
    jobs = jobs_of(*numbers, given.seed)
    began, cores = time.perf_counter(), len(os.sched_getaffinity(0))
    order = np.random.default_rng(0).permutation(len(jobs))
    with ProcessPoolExecutor(cores) as pool:
        outcomes = list(pool.map(guarded, [jobs[i] for i in order], chunksize=2))
    outcomes = [outcomes[i] for i in np.argsort(order)]
    page = report(outcomes)
    print(page)
    if not given.quick:
        head = HEAD.format(seed=given.seed, minutes=(time.perf_counter() - began) / 60.0, cores=cores)
        (ROOT / "docs" / "proof.md").write_text(head + page + NOTES)


if __name__ == "__main__":
    main()
