"""What a task of the discovery loop is asked, its run made ready to fit, and what a fit of it says of readings and parameters."""

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Observations
from thermofast.models.effects.base import Effect, columns_not_tried
from thermofast.models.greybox import Model as Greybox
from thermofast.models.joint import LEVEL, RATE, UNTIL_AT_REST, Fit, Key, Part, fit_model, search, settled
from thermofast.models.search.heldout import predicted
from thermofast.models.search.rules import RULES

from ..errors import NeedError, ThermofastError, UsageError, in_one_line, listed, nearest
from ..machine.learnt import carry
from ..machine.model import Model
from ..plugins.effects import chosen_effects
from ..plugins.guard import failed_status
from ..reading import Run
from ..reading.headings.called import column_named
from ..reading.run import ends_before, said_short
from ..records import Record
from .observe import FEWEST_READINGS, Note, Observed, observe

Array = NDArray[np.float64]

#: Share of a time constant by which a sensor answers later than the law has it, 1 sd: a slow body in a quick heater lags by a
#: fiftieth of its own (``FAST`` in ``models/imperfection/shapes.py``).
LATE = 0.02
#: How many times as well as they are known from run to run a learnt model holds its constants where it is compared.
HELD = 100.0


@dataclass(frozen=True)
class LoopTask:
    """One run and what to do with it.

    `names` are effect ids or files, `extra` the user's own effects, `together` all runs of its machine that are searched as one.
    """

    run: Run
    start_min: float = 0.0
    until_min: float | None = None
    names: tuple[str, ...] = ()
    extra: tuple[str, ...] = ()
    model: Model | None = None
    drive: str | None = None
    auto: bool = False
    false_alarm: float = RULES.false_alarm
    input_ranges: tuple[tuple[str, float], ...] = ()
    want_curves: bool = False
    unknown_heat: bool = False
    next_experiment: bool = False
    denoise: bool = False
    together: tuple[str, ...] = ()

    @property
    def again(self) -> str:
        """The run, or all of its machine, and how it was read, as a command line says it again."""
        names = ["RUN" if name == "stdin" else shlex.quote(name) for name in self.together or (self.run.name,)]
        said = [*names, "--together" if self.together else "", self.run.again]
        said += [f"--start {self.start_min:.10g}"] if self.start_min else []
        said += [f"--until {self.until_min:.10g}"] if self.until_min else []
        said += [f"--drive {shlex.quote(self.drive)}"] if self.drive else []
        return " ".join(part for part in said if part)

    @property
    def fitted_min(self) -> float | None:
        """--until, which counts from the first reading, on the clock of a joint fit, which begins with --start."""
        return None if self.until_min is None else self.until_min - self.start_min

    @property
    def channels(self) -> tuple[str, ...]:
        """What a progress bar counts."""
        return tuple(self.run.channels)

    def singles(self) -> list["LoopTask"]:
        """A joint fit has no smaller parts."""
        return [self]


@dataclass(frozen=True)
class Ready:
    """A run made ready: all readings and those up to the identification time on one grid."""

    notes: tuple[Note, ...]
    readings: int
    whole: Observations
    seen: Observations

    def notes_of(self, channel: str | None = None) -> list[str]:
        """What the reader said of the run, and of one sensor or of all."""
        mine = [n for n in self.notes if channel is None or n.channel in (None, channel)]
        return [n.text if n.channel is None else f"{n.channel}: {n.text}" for n in mine]


def drive_of(run: Run, drive: str | None) -> str | None:
    """The logged input that --drive names, in full or before its unit."""
    return column_named(drive, list(run.inputs))


def check_drive(run: Run, drive: str | None, learnt_with: bool = False) -> None:
    """Raises UsageError where --drive, or the drive that a model was learnt with, names no logged input of the run."""
    if drive is not None and drive_of(run, drive) not in run.inputs:
        near = nearest(drive, run.inputs)
        way = near or "name a column with --inputs to make it one"
        raise UsageError(
            f"{run.name}: the model was learnt with the drive {drive!r}, which this run does not log"
            if learnt_with
            else f"{run.name}: --drive {drive!r} is no logged input",
            allowed=", ".join(run.inputs) or "this run logs none",
            do=f"log it in the same unit, or --rename a column to {drive!r} whose values are" if learnt_with else way,
        )


def ready(task: LoopTask) -> tuple[Observed, Ready | None]:
    """What the reader found of a run, and its observations, None where no sensor is usable or too little is read before --until.

    Raises
    ------
    UsageError: --drive names no logged input.
    """
    check_drive(task.run, task.drive, task.model is not None)
    if ends_before(task.run, task.until_min):
        refused = tuple((c, "too_short", said_short(task.run, task.until_min)) for c in task.run.channels)
        return Observed(None, refused, ()), None
    observed = observe(task.run, task.start_min, task.drive, task.fitted_min)
    if observed.seen is None:
        return observed, None
    seen = observed.seen.until(task.fitted_min)
    read = int(seen.used.sum(axis=1).max())
    if task.model is None and read < FEWEST_READINGS:
        why = f"{read} readings before --until {task.until_min:g}: at least {FEWEST_READINGS} are needed to judge a model"
        refused = tuple((c, "too_short", why) for c in seen.channels)
        return replace(observed, seen=None, refused=(*observed.refused, *refused)), None
    return observed, Ready(observed.notes, observed.readings, observed.seen, seen)


def check_inputs(effects: list[Effect], whole: Observations) -> None:
    """Raises NeedError where an effect that was asked for lacks an input."""
    for effect in effects:
        if effect.most_sensors is not None and whole.sensors > effect.most_sensors:
            raise NeedError(
                f"{whole.name}: the effect {effect.id!r} is tried of {effect.most_sensors} sensors at once at most",
                found=f"{whole.sensors} sensors",
                do="choose those that matter with --channels",
            )
        if not effect.choices(whole):
            have = [*whole.ambient, *whole.inputs]
            raise NeedError(
                f"{whole.name}: the effect {effect.id!r} needs {effect.needs or 'an input that this run does not log'}",
                found=f"inputs: {', '.join(have) or 'none'}; sensors: {', '.join(whole.channels[:8])}",
                do="leave the effect out" + _way(effect.needs),
            )


def not_tried(effects: Sequence[Effect], seen: Observations) -> str:
    """What was not looked for because a run has too many sensors or logged columns, in words; empty where all was."""
    many = [e for e in effects if e.most_sensors is not None and seen.sensors > e.most_sensors]
    said = [
        f"{e.id} was not tried: it is of {e.most_sensors} sensors at most, and there are {seen.sensors} (choose with --channels)"
        for e in many
    ]
    left = columns_not_tried(seen)
    if left and any("column" in c.constants for e in effects for c in e.choices(seen)):
        said.append(f"nothing was tried along {listed(left)}: too many columns are logged (--exclude those that cannot matter)")
    return "; ".join(said)


def _way(needs: str) -> str:
    """How a run comes to have what an effect needs."""
    if "temperature" in needs:
        return ", or say which input is a temperature: --units COLUMN=C"
    return "" if "sensor" in needs else ", or name the column with --ambient or --inputs"


def first_model(task: LoopTask, prepared: Ready) -> tuple[Fit, list[str]]:
    """The model to look at: a learnt one, the effects named, or the base model; with what there is to say about it."""
    from thermofast.models.search.candidates import try_add

    if task.model is not None:
        carried = carry(task.model.file, prepared.seen, task.run.name, task.model.source)
        return _with_its_constants(carried.fit), list(carried.notes)
    fit = fit_model(prepared.seen)
    notes = []
    effects = chosen_effects(task.names, task.extra) if task.names else []
    check_inputs(effects, prepared.whole)
    for effect in effects:
        found = try_add(fit, effect)
        if found is None:
            notes.append(f"{effect.id}: nothing to fit")
            continue
        fit = found.fit
    fit = settled(fit)
    return fit, [*notes, *at_rest(fit)]


def _with_its_constants(fit: Fit) -> Fit:
    """A learnt model's fit with the machine's constants as they were learnt.

    What scatters from run to run stays open in a prediction's interval. Here a model that is not the whole machine would bend it
    until the first minutes fit, and what it says of the rest would no longer be the model's.
    """
    return fit if fit.prior is None else search(fit.model, fit.local, fit.shared, fit.prior.times(HELD), UNTIL_AT_REST)


def at_rest(fit: Fit) -> list[str]:
    """What to say of a fit that was broken off."""
    names = " and ".join(dict.fromkeys(ids_of(fit.model.parts))) or "the base model"
    return [] if fit.converged else [f"the fit of {names} has not come to rest: its values are one choice of many that fit alike"]


def ids_of(parts: tuple[Part, ...]) -> list[str]:
    """Effect ids in order."""
    return [part.id for part in parts]


def failure_records(kind: type[Record], task: LoopTask, error: ThermofastError) -> list[Any]:
    """One record that says why a run could not be worked on."""
    status = failed_status(error)
    return [kind(run=task.run.name, channel="", status=status, message=in_one_line(error))]  # type: ignore[call-arg]


def refused_records(kind: type[Record], run: str, observed: Observed) -> list[Any]:
    """Records of sensors that a joint fit leaves out."""
    return [kind(run=run, channel=c, status=status, message=why) for c, status, why in observed.refused]  # type: ignore[call-arg]


def in_order(records: list[Any], run: Run) -> list[Any]:
    """Records in the order of the run's sensors."""
    place = {c: i for i, c in enumerate(run.channels)}
    return sorted(records, key=lambda r: place.get(r.channel, len(place)))


def as_told(fit: Fit, part: int, name: str, value: float) -> float:
    """A parameter's value as it is told: the moment of an event on the clock of the run."""
    return value + (fit.run.start_min if name == fit.model.parts[part].effect.event else 0.0)


def parameters_of(
    fit: Fit, sensor: int | None = None, wider: float = 1.0, beside: Mapping[Key, Any] | None = None
) -> dict[str, dict[str, Any]]:
    """{effect.parameter: {value, se, unit}} of a fit's effects; for one sensor, its own and the shared ones.

    wider multiplies the standard errors, which are those under white noise; beside are a disturbance's, in search coordinates.
    """
    found: dict[str, dict[str, Any]] = {}
    values, errors = fit.values, fit.deviations
    for j, c in enumerate((*fit.model.local, *fit.model.shared)):
        if c.part < 0:
            continue
        key = c.key
        part = fit.model.parts[c.part]
        if c.parameter.each == "sensor":
            if sensor is None or not fit.model.active[sensor, j]:
                continue
            value, error = float(values[key][sensor]), wider * float(errors[key][sensor])
            error = math.hypot(error, float(beside[key][sensor]) if beside else 0.0)
        elif sensor is not None and not part.concerns(fit.run.sensors)[sensor]:
            continue
        else:
            value, error = float(values[key]), math.hypot(wider * float(errors[key]), float(beside[key]) if beside else 0.0)
        if c.parameter.log:
            error *= value
        known = bool(np.isfinite(error) and error < 1e6 * max(abs(value), 1e-9))
        value = as_told(fit, c.part, c.parameter.name, value)
        name = f"{part.id}.{c.parameter.name}"
        found[name] = {
            "value": float(f"{value:.6g}"),
            "standard_error": float(f"{math.hypot(error, unseen_delay(fit, c.part, c.parameter.name)):.2g}") if known else None,
            "unit": c.parameter.unit,
        }
    return found


def unseen_delay(fit: Fit, part: int, parameter: str) -> float:
    """What a fit's standard error of the time of an event [min] does not count; 0 of other parameters.

    The event lies anywhere between two readings, and what is between a heat, or a room, and a probe answers later than the law.
    """
    effect = fit.model.parts[part].effect
    if effect.event != parameter:
        return 0.0
    who = fit.model.parts[part].concerns(fit.run.sensors)
    late = LATE * float(np.median(1.0 / fit.values[RATE][who])) if effect.scope == "run" else 0.0
    return math.hypot(late, fit.run.step / math.sqrt(12.0))


def pooled(errors: Any) -> float:
    """Root mean square over sensors (S,) [K] of those that have an error; nan where none has."""
    good = np.asarray(errors, dtype=float)
    good = good[np.isfinite(good)]
    return float(np.sqrt(np.mean(good**2))) if len(good) else float("nan")


def curve_ahead(fit: Fit) -> Array:
    """The model (S, N) [degC], after the last reading used without a neighbour's readings either."""
    return predicted(fit, np.arange(len(fit.run.time)) > fit.run.last)


def curve_shifts(fit: Fit, ranges: dict[str, float], shares: Sequence[float]) -> list[Array]:
    """What is added to the curves (S, N) [K] where the logged inputs named lie by such shares of their range beside their log."""
    run = fit.run
    if not ranges:
        return [np.zeros_like(fit.curve) for _ in shares]
    shifts = []
    for share in shares:
        moved = replace(
            run,
            ambient={n: c + share * ranges.get(n, 0.0) for n, c in run.ambient.items()},
            inputs={n: c + share * ranges.get(n, 0.0) for n, c in run.inputs.items()},
        )
        shared = np.broadcast_to(fit.shared, (run.sensors, len(fit.shared)))
        model = Greybox(moved, fit.model.parts)
        local = fit.local.copy()
        # The heating is what it was: surroundings that are warmer make the machine warmer.
        local[:, model.column(LEVEL)] += (
            model.sink_guess - fit.model.sink_guess if run.sink_c is not None and fit.model.parts else 0.0
        )
        shifts.append(model.forward(local, shared, np.arange(run.sensors)) - fit.curve)
    return shifts


def ahead_errors(fit: Fit, whole: Observations) -> Array:
    """Root mean square error (S,) [K] on the readings that the fit did not see, the model running freely with logged inputs."""
    after = np.where(fit.run.used, 0.0, whole.weight) > 0.0
    error = np.where(after, np.nan_to_num(whole.reading) - curve_ahead(fit), 0.0)
    count = after.sum(axis=1)
    return np.asarray(np.sqrt(np.where(count > 0, (error**2).sum(axis=1) / np.maximum(count, 1), np.nan)))
