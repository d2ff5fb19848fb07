"""Analyses around the result, and simulated records. What each needs is imported when it is called: some of it is slow to load."""

import math
from collections.abc import Sequence
from numbers import Real
from typing import TYPE_CHECKING, Any

from ..errors import UsageError, listed
from ..experiments.simulated import Simulated
from ..reading.headings.called import columns_named
from ..records import IdentifyRecord
from ..results import Bench, Calibration, Changes, Displacement, Plan, Sensitivity, Validation
from ..workers.engine import Started, Work, over_runs, sharing
from ..workers.pool import cores

if TYPE_CHECKING:
    from numpy import float64
    from numpy.typing import NDArray

    from thermofast.models.imperfection import Imperfection

    from ..analysis.sensitivity import Sizes
    from ..estimation.request import Method
    from ..experiments.planning import Design
    from ..machine.model import Model


def bench_runs(started: Sequence[Started], until_min: float | None = None, how: Work | None = None) -> Bench:
    """Every filter on each run, identified on its first `until_min` minutes, half of it by default.

    Raises
    ------
    UsageError: an identification time that leaves nothing before or after it.
    """
    from ..analysis.bench import bench_run
    from ..plugins.filters import known_filters

    for run, start in started:
        length = float(run.time_s[-1]) / 60.0
        if until_min is not None and not start < until_min < length:
            raise UsageError(
                f"{run.name}: --until {until_min:g} leaves nothing ahead of it, or nothing before it",
                allowed=f"{start:.4g} to {length:.4g} min",
            )
    advance = (how or Work()).advance
    known = known_filters()
    records = [r for run, start in started for r in bench_run(run, start, until_min, known, advance)]
    return Bench(tuple(records), tuple(run for run, _ in started))


def calibrate_runs(started: Sequence[Started], method: "Method", how: Work | None = None) -> Calibration:
    """How imperfect a lab's machines are, from complete runs of them.

    Raises
    ------
    UsageError: fewer than two runs that are complete.
    """
    from ..analysis.calibration import Past, learn, past_run, to_choose
    from ..records import CalibrateRecord

    past, left_out = [], []
    advance = (how or Work()).advance
    for one in started:
        found = past_run(one, method, to_choose(len(started)))
        advance(1)
        if isinstance(found, Past):
            past.append(found)
        else:
            left_out.append((one[0].name, found))
    if len(past) < 2:
        raise UsageError(
            f"calibrate learns from two complete runs at least, and of {len(started)} given {len(past)} can be used",
            found="; ".join(f"{name}: {why}" for name, why in left_out) or "one run",
            allowed="two runs or more that went on until nothing changed",
            do="measure to the end a few times, or stay with --imperfection typical",
        )
    lab = learn(past)
    unused = [CalibrateRecord(name, "all", status="not_used", message=why) for name, why in left_out]
    return Calibration((*lab.records, *unused), tuple(run for run, _ in started), prior=lab.prior, learnt_from=lab.names)


def changed_runs(old: Sequence[Started], new: Sequence[Started], model: "Model | None" = None) -> Changes:
    """What is different in a machine since other runs of it, or since a model was learnt from them.

    Raises
    ------
    UsageError: runs that cannot be compared.
    """
    from ..analysis.changed import compare_runs
    from ..reading.headings.names import named_as

    names = model.channels if model is not None else tuple(old[0][0].channels) if old else ()
    old, new = ([(named_as(run, names), start) for run, start in runs] for runs in (old, new))
    records, difference = compare_runs(old, new, model)
    return Changes(tuple(records), tuple(run for run, _ in (*old, *new)), difference=difference)


#: Deviations of the noise that a sensor must rise by to tell of the machine.
RISEN = 10.0


def _rise(record: IdentifyRecord) -> float:
    """How far the steady state lies from the start [K]."""
    return abs((record.steady_state_c or 0.0) - (record.initial_c or 0.0))


def design_like(one: Started, prior: "Imperfection | None" = None) -> "tuple[Design, NDArray[float64]]":
    """Sensors, interval, noise, rise and time constant of a record, and its half-widths (n,) [K] at the times that a plan looks at.

    Raises
    ------
    UsageError: no sensor of it shows where it settles.
    """
    from dataclasses import replace

    import numpy as np

    from thermofast.models import third_difference_noise

    from ..estimation.identify import identify_sensors
    from ..estimation.request import Question
    from ..estimation.sensor import Signals
    from ..experiments.planning import TURNS, Design, of_all
    from .methods import choose

    run, start = one
    signals, method = Signals.of(run, start), choose("afukf", None, ())
    minutes, values = signals.time_min, signals.values
    found = identify_sensors(signals, method).records
    told = [r for r in found if r.rate_per_min and r.steady_state_c is not None and r.initial_c is not None]
    noise = {
        r.channel: third_difference_noise(v[k], minutes[k])
        for r, v in zip(found, values, strict=True)
        if (k := np.isfinite(v)).sum() > 8
    }
    # What stays within its noise, or bounds no rate, tells of no machine.
    told = [r for r in told if r.status != "not_determined" and _rise(r) > RISEN * noise.get(r.channel, math.inf)]
    if not told:
        raise UsageError(f"{run.name}: no sensor of it shows where it settles", do="say --tau, --rise and --noise")
    noises = [noise[r.channel] for r in told]
    design = Design(
        len(run.channels),
        60.0 * float(np.median(np.diff(minutes))),
        max(float(np.median(noises)), 1e-6),
        float(np.median([_rise(r) for r in told])),
        1.0 / float(np.median([r.rate_per_min for r in told])),
    )
    half = np.full(len(TURNS), np.nan)
    if prior is not None:
        method = replace(method, imperfection=prior)
        for k, turn in enumerate(TURNS):
            until = turn * design.tau_min
            if until > float(minutes[-1]) - start or not (minutes - start <= until).sum() > 8:
                continue
            until += start
            found = identify_sensors(signals, method, Question(until)).records
            sides = [(r.steady_state_lo_c, r.steady_state_hi_c) for r in found]
            widths = np.array([0.5 * (b - a) if a is not None and b is not None else np.inf for a, b in sides])
            half[k] = of_all(widths, prior.none)
    return design, np.where(np.isfinite(half), half, np.nan)


def plan_design(
    given: dict[str, Any],
    tolerances_c: tuple[float, ...],
    prior: "Imperfection",
    base: "Design | None" = None,
    how: Work | None = None,
    replayed: "NDArray[float64] | None" = None,
    model: "Model | None" = None,
) -> Plan:
    """How long a test must run; given are what is said of the :class:`Design`, the rest is `base`'s or the default.

    replayed: half-widths of the record that `base` is of; model: learnt from past runs of the machine, which tell its time constant
    and number of sensors, how far these rise, how often and how well they were read, and are counted.

    Raises
    ------
    UsageError: an unknown word, a number that is none, or a model of before that does not say how far its runs rose.
    """
    from dataclasses import fields, replace
    from statistics import median

    from ..experiments.planning import Design, plan
    from ..learning.past import past_of_model, rises_of_model

    known = [f.name for f in fields(Design) if f.name != "rises_c"]
    for name, value in given.items():
        if name not in known:
            raise UsageError(f"unknown word of a design {name!r}", allowed=", ".join(known))
        if isinstance(value, bool) or not isinstance(value, Real) or not 0.0 < float(value) < math.inf:
            raise UsageError(f"{name} is not such a number", found=repr(value), allowed="above zero")
        if name == "sensors" and not float(value).is_integer():
            raise UsageError("sensors is no number of them", found=repr(value), allowed="a whole number above zero")
    given = {name: int(value) if name == "sensors" else value for name, value in given.items()}
    past = None
    if model is not None:
        past = past_of_model(model)
        log_rate = median([s.log_rate for s in past.shapes.values()])
        told: dict[str, Any] = {"sensors": len(past.shapes), "tau_min": math.exp(-log_rate)}
        if base is None:
            first, rises = model.file.learnt_from, rises_of_model(model)
            if not rises and "rise_c" not in given:
                raise UsageError(f"{model.source} does not say how far its runs rose", do="say --rise, or learn it anew")
            if rises:
                past = replace(past, shapes={c: s for c, s in past.shapes.items() if c in rises})
                own = tuple(rises[c] for c in past.shapes)
                told |= {"sensors": len(own), "rises_c": own, "rise_c": median(own)}
            told |= {"interval_s": 60.0 * first.length_min / (first.readings - 1)} if first.readings > 1 else {}
            noises = [s.noise_c for s in past.shapes.values() if s.noise_c > 0.0]
            told |= {"noise_c": median(noises)} if noises else {}
        given = {**told, **given}
    how = how or Work(1)
    with sharing((), how.jobs if how.jobs is not None else cores(), True) as spread:
        rows, curves = plan(replace(base or Design(), **given), tolerances_c, prior, how.advance, past, replayed, spread)
    return Plan(tuple(rows), curves=tuple(curves))


def validate_runs(
    started: Sequence[Started],
    model: "Model",
    until_min: float,
    input_ranges: tuple[tuple[str, float], ...] = (),
    how: Work | None = None,
) -> Validation:
    """A learnt model against a set of runs, on what lies ahead of `until_min` in each.

    Raises
    ------
    UsageError: a range of a column that is not logged, and as :func:`loop_tasks`.
    """
    from ..analysis.validate import judge, validate_lost, validate_task
    from ..records import ValidateRecord
    from .loop import loop_tasks, ranges_named

    input_ranges = ranges_named(started, input_ranges)
    lengths = {run.name: float(run.time_s[-1]) / 60.0 for run, _ in started}
    enough = [one for one in started if lengths[one[0].name] > until_min] or list(started)
    kept = {run.name for run, _ in enough}
    short = [run.name for run, _ in started if run.name not in kept]
    tasks = loop_tasks(enough, until_min=until_min, model=model, input_ranges=input_ranges)
    found, interrupted = over_runs(validate_task, tasks, validate_lost, how or Work())
    records, areas = judge(found, until_min, [name for name, _ in input_ranges])
    records += [
        ValidateRecord(name, "", status="too_short", message=f"it ends at {lengths[name]:.4g} min, before --until {until_min:g}")
        for name in short
    ]
    return Validation(tuple(records), tuple(run for run, _ in started), interrupted, tuple(areas))


def sensitivity_runs(
    started: Sequence[Started],
    method: "Method",
    sizes: "Sizes",
    until_min: float | None = None,
    model: "Model | None" = None,
    how: Work | None = None,
) -> Sensitivity:
    """How much each uncertain thing contributes to the spread of the result.

    Raises
    ------
    UsageError: as :func:`loop_tasks`.
    """
    from ..analysis.sensitivity import SensitivityTask, sensitivity_lost, sensitivity_task
    from .loop import loop_tasks

    work = [SensitivityTask(task, method, sizes) for task in loop_tasks(started, until_min=until_min, model=model)]
    found, interrupted = over_runs(sensitivity_task, work, sensitivity_lost, how or Work())
    return Sensitivity(tuple(r for records in found for r in records), tuple(run for run, _ in started), interrupted)


def displacement_runs(
    started: Sequence[Started],
    columns: tuple[str, ...] = (),
    methods: Sequence[str] = (),
    order: tuple[int, int] | None = None,
    together: bool = False,
) -> Displacement:
    """Thermal displacement from the temperatures of each run: the columns named, or those that the reader took for displacements.

    methods are names, those of one run or of several together where none is named; order (outputs, inputs) is that of arx.
    together: the runs are of one machine, learned from as one, and left out in turn.

    Raises
    ------
    UsageError: a name that is no column or no method, an order without arx, columns that not all runs have together.
    """
    from ..displacements.report import displacement_runs as of_runs
    from ..displacements.report import methods_of

    tried = methods_of(methods, order, together)
    chosen = []
    for run, _ in started:
        known = {**run.displacements, **run.channels}
        mine = tuple(n for c in columns for n in columns_named(c, list(known), known)) or tuple(run.displacements)
        missing = [c for c in mine if c not in known]
        if missing:
            raise UsageError(
                f"{run.name}: --displacements {missing[0]!r} is none of the columns that are used",
                allowed=listed(known),
                do="if it is one of the file, say --channels with the temperatures and it",
            )
        chosen.append(mine)
    groups = [list(started)] if together and started else [[one] for one in started]
    common = tuple(c for c in chosen[0] if all(c in mine for mine in chosen)) if chosen else ()
    if together and chosen and chosen[0] and not common:
        raise UsageError("no displacement column is in all runs", found=", ".join(chosen[0]), do="name it with --displacements")
    found = [
        of_runs(group, common if together else mine, tried, bool(methods) or order is not None)
        for group, mine in zip(groups, chosen, strict=False)
    ]
    return Displacement(
        tuple(r for one in found for r in one.records),
        tuple(run for run, _ in started),
        panels=tuple(p for one in found for p in one.panels),
    )


def simulate_record(
    effects: tuple[str, ...] = (),
    seed: int = 0,
    sensors: int = 10,
    duration_min: float = 400.0,
    interval_s: float = 60.0,
    ambient_c: float = 17.9,
    rise_c: float = 9.0,
    t95_min: float = 195.0,
    noise_c: float = 0.02,
    step_c: float = 0.01,
    cooling: bool = False,
    fixed: Sequence[tuple[str, float, float]] = (),
) -> Simulated:
    """A record of the base model, or with hidden effects, and the truth behind it.

    fixed: (name, steady state [degC], t95 [min]) of sensors that are given and not drawn.

    Raises
    ------
    UsageError: too many readings, a name twice or none, an unknown effect, or one that needs more sensors.
    """
    import numpy as np

    from ..experiments.hidden import simulate_hidden
    from ..experiments.simulation import Probe, draw_probes, simulate
    from ..plugins.effects import chosen_effects

    if duration_min * 60.0 / interval_s > 1e7:
        raise UsageError("too many readings", found=f"{duration_min * 60.0 / interval_s:.3g}", allowed="ten million a sensor")
    for name, _, settle in fixed:
        plain = name and name.isprintable() and not set(name) & set(',;"=@') and name not in ("ambient", "time_min", "time_s")
        if not plain or not 0.0 < settle < math.inf:
            raise UsageError(f"--sensor {name!r}", allowed="NAME=DEGC:MIN, as in --sensor T5=26.7:195")
    taken = {name for name, _, _ in fixed}
    if len(taken) < len(fixed):
        raise UsageError("--sensor: the same name twice", found=", ".join(name for name, _, _ in fixed))
    drawn = draw_probes(np.random.default_rng([seed, 1]), sensors, ambient_c, rise_c, t95_min, noise_c, cooling)
    given = [Probe(name, ambient_c, steady, settle, noise_c) for name, steady, settle in fixed]
    # A drawn sensor makes way for the given one of its name first, then from the end.
    rest = [p for p in drawn if p.channel not in taken][: max(0, sensors - len(given))]
    probes = sorted(given + rest, key=lambda p: (len(p.channel), p.channel))
    if effects:
        chosen = chosen_effects(effects, ())
        made = simulate_hidden(probes, duration_min, interval_s, ambient_c, step_c, seed, chosen)
    else:
        made = simulate(probes, duration_min, interval_s, ambient_c, step_c, seed)
    return Simulated(made.columns, made.truth)
