"""The model file: what was learnt of a machine, in TOML that a person can read and that is read back strictly."""

import hashlib
import math
import tomllib
from collections.abc import Iterable
from dataclasses import astuple, fields
from datetime import date
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from thermofast.models import Observations
from thermofast.models.effects.base import Choice, Parameter
from thermofast.models.greybox import Column
from thermofast.models.greybox import Model as FitModel
from thermofast.models.imperfection import FAST_MODES, SLOW_MODES, Past, Rest, SensorShape, to_the_limit
from thermofast.models.joint import Fit
from thermofast.models.uncertainty.pooled import Pooled

from .. import __version__
from ..errors import UsageError
from ..output.files import write_text_whole
from ..plugins.files import path_and_class
from ..reading.source import sha256_of

SCHEMA = "thermofast.model/1"
NOT_FOR = (
    "another machine, or this one after a rebuild: its constants are those of the machine it was learnt on",
    "levels and loads far from those of the run it was learnt on",
    "probes that were moved since: an effect of a probe belongs to its place",
)


class LearntFrom(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """The run a model was learnt from: its file, and its times and readings, which may be given otherwise too."""

    file: str
    sha256: str
    date: str
    readings: int
    length_min: float
    until_min: float | None = None
    drive: str | None = None
    readings_sha256: str = ""

    def is_of(self, source: str, run: Observations) -> bool:
        """Whether it was this run, by its file or by its readings."""
        return (bool(self.sha256) and sha256_of(source) == self.sha256) or self.readings_sha256 == sha256_of_readings(run)


class Number(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """One parameter: of one sensor where `channel` is given, else of all."""

    name: str
    unit: str
    belongs: Literal["machine", "run"]
    value: float
    standard_error: float | None = None
    channel: str | None = None


class EffectEntry(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """One effect, how it acts, whom it concerns, and its parameters."""

    id: str
    summary: str
    parameters: tuple[Number, ...]
    file: str | None = None
    sha256: str | None = None
    acts: str = ""
    constants: dict[str, Any] = {}
    searched: tuple[str, ...] = ()
    channels: tuple[str, ...] | None = None


class Correlations(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """How the errors of one sensor's own machine constants go together: matrix in the order of names."""

    channel: str
    names: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]


class ShapeEntry(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """The rise of one sensor over its model's: amplitudes of slow and fast modes and of the loss exponent, and their covariance.

    first_c, moved_c, noise_c: what the runs learnt from read at first, how far they then went, and the noise of a reading, on
    average. rest: what their readings alone left open of where they end: of the limit, below and above that of the shape, as shares
    of the rise; in time constants, when 95 % are done, at least and at most, and how long they were.
    """

    channel: str
    rate_per_min: float
    log_rate_deviation: float
    amplitudes: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    first_c: float | None = None
    rest: tuple[float, ...] = ()
    moved_c: float | None = None
    noise_c: float | None = None


class PastEntry(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """What the runs learnt from say of the next one; see ``models/imperfection/machine/past.py``.

    relative_to: "limit" where amplitudes are relative to the whole rise; files of before have them relative to what the law has of
    it. without_effects: it is the shape of the runs as a whole, which foretold them better from their first part than the effects.
    without_events: what happened in each of these runs at another time, and when, which was taken out of that shape.
    """

    runs: int
    log_rate_scatter: float
    log_rate_spread: float
    disturbance: float
    disturbance_log_deviation: float
    slow_modes: tuple[float, ...]
    fast_modes: tuple[float, ...]
    stretches: tuple[float, ...] = ()
    factors: tuple[tuple[float, float], ...] = ()
    unexplained: tuple[str, ...] = ()
    shapes: tuple[ShapeEntry, ...] = ()
    relative_to: Literal["", "limit"] = ""
    without_effects: bool = False
    without_events: tuple[str, ...] = ()


class ModelFile(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """The whole file."""

    schema: str
    program: str
    learnt_from: LearntFrom
    must_not_be_used_for: tuple[str, ...]
    channels: tuple[str, ...]
    base: tuple[Number, ...]
    effects: tuple[EffectEntry, ...] = ()
    correlations: tuple[Correlations, ...] = ()
    also_from: tuple[LearntFrom, ...] = ()
    past: PastEntry | None = None


def sha256_of_readings(run: Observations) -> str:
    """Of the times and readings of a run, whatever it was read from."""
    found = hashlib.sha256()
    for name in sorted(run.channels):
        found.update(name.encode(errors="replace") + b"\0")
        found.update(np.round(run.reading[run.channels.index(name)], 6).tobytes())
    found.update(np.round(run.time, 6).tobytes())
    return found.hexdigest()


def refuse_copies(runs: Iterable[tuple[str, Observations]]) -> None:
    """Raises UsageError where two of the runs, by their names, are the same readings."""
    seen: dict[str, str] = {}
    for name, run in runs:
        key = sha256_of_readings(run)
        if key in seen:
            raise UsageError(f"{name} is a copy of {seen[key]}", do="give each run once: a copy is no further evidence")
        seen[key] = name


def learnt_from(run: Observations, source: str, readings: int, until_min: float | None) -> LearntFrom:
    """Which run, as the file tells it."""
    return LearntFrom(
        file=source,
        sha256=sha256_of(source),
        date=date.today().isoformat(),
        readings=readings,
        length_min=round(run.span, 3),
        until_min=until_min,
        drive=run.drive,
        readings_sha256=sha256_of_readings(run),
    )


def model_file(
    fit: Fit,
    source: str,
    readings: int,
    until_min: float | None,
    files: dict[str, str],
    past: Past | None = None,
    pooled: Pooled | None = None,
) -> ModelFile:
    """What a fit has learnt; `files` are the paths of a user's own effects by id, past what the run says of the next one.

    pooled: constants of the machine over several runs of it, which take the place of those of this fit.
    """
    run, model = fit.run, fit.model
    deviations = fit.covariance
    local, shared = fit.local, fit.shared
    local_error = np.sqrt(np.maximum(np.diagonal(deviations[0], axis1=1, axis2=2), 0.0))
    shared_error = np.sqrt(np.maximum(np.diagonal(deviations[1]), 0.0))
    if pooled is not None:
        both, common = np.hypot(pooled.error, pooled.scatter), np.hypot(pooled.shared_error, pooled.shared_scatter)
        local, local_error = (np.where(np.isnan(pooled.mean), a, b) for a, b in ((local, pooled.mean), (local_error, both)))
        known = np.isnan(pooled.shared_mean)
        shared, shared_error = (np.where(known, a, b) for a, b in ((shared, pooled.shared_mean), (shared_error, common)))
    values = model.named(local, shared)

    def numbers(part: int) -> tuple[Number, ...]:
        found = []
        for j, c in enumerate(model.local):
            if c.part == part:
                p, belongs = c.parameter, _belongs(model, c)
                for i in np.flatnonzero(model.active[:, j]):
                    value, error = float(values[c.key][i]), float(local_error[i, j])
                    found.append(_number(p, belongs, value, error * value if p.log else error, run.channels[i]))
        for j, c in enumerate(model.shared):
            if c.part == part:
                p = c.parameter
                value, error = float(values[c.key]), float(shared_error[j])
                found.append(_number(p, _belongs(model, c), value, error * value if p.log else error, None))
        return tuple(found)

    effects = []
    for k, part in enumerate(model.parts):
        who = part.concerns(run.sensors)
        effects.append(
            EffectEntry(
                id=part.id,
                summary=part.effect.summary,
                file=files.get(part.id),
                sha256=sha256_of(path_and_class(files[part.id])[0]) if part.id in files else None,
                acts=part.choice.label,
                constants=_plain(part.choice, run.channels),
                searched=tuple(p.name for p in part.effect.active(part.choice)),
                channels=None if part.concerned is None else tuple(c for c, w in zip(run.channels, who, strict=True) if w),
                parameters=numbers(k),
            )
        )
    return ModelFile(
        schema=SCHEMA,
        program=__version__,
        learnt_from=learnt_from(run, source, readings, until_min),
        must_not_be_used_for=NOT_FOR,
        channels=run.channels,
        base=numbers(-1),
        effects=tuple(effects),
        correlations=tuple(_correlations(fit, i, pooled) for i in range(run.sensors)),
        past=None if past is None else past_entry(past),
    )


def _belongs(model: FitModel, column: Column) -> Literal["machine", "run"]:
    return "machine" if model.of_machine(column) else "run"


def past_entry(past: Past, without_effects: bool = False, without_events: tuple[str, ...] = ()) -> PastEntry:
    """As the file tells it."""

    def short(value: float) -> float:
        return float(f"{value:.7g}")

    shapes = [
        ShapeEntry(
            channel=channel,
            rate_per_min=short(math.exp(shape.log_rate)),
            log_rate_deviation=short(shape.deviation),
            amplitudes=tuple(short(a) for a in shape.amplitudes),
            covariance=tuple(tuple(short(v) for v in row[: i + 1]) for i, row in enumerate(shape.covariance)),
            first_c=short(shape.first_c) if math.isfinite(shape.first_c) else None,
            rest=() if shape.rest is None else tuple(short(v) for v in astuple(shape.rest)),
            moved_c=short(shape.moved_c) if math.isfinite(shape.moved_c) else None,
            noise_c=short(shape.noise_c) if math.isfinite(shape.noise_c) else None,
        )
        for channel, shape in past.shapes.items()
    ]
    return PastEntry(
        runs=past.runs,
        log_rate_scatter=short(past.scatter),
        log_rate_spread=short(past.spread),
        disturbance=short(past.scale),
        disturbance_log_deviation=short(past.scale_spread),
        slow_modes=SLOW_MODES,
        fast_modes=FAST_MODES,
        stretches=tuple(short(v) for v in past.stretches),
        factors=tuple((turn, short(factor)) for turn, factor in past.factors),
        unexplained=past.unexplained,
        shapes=tuple(shapes),
        relative_to="limit",
        without_effects=without_effects,
        without_events=without_events,
    )


def past_of(entry: PastEntry) -> Past:
    """Back from the file.

    Raises
    ------
    UsageError: it was written with other modes than this version knows, or numbers are missing.
    """
    count = len(SLOW_MODES) + len(FAST_MODES) + 1
    sizes = {(len(s.amplitudes), len(s.covariance), *(len(row) for row in s.covariance)) for s in entry.shapes}
    if (
        (entry.slow_modes, entry.fast_modes) != (SLOW_MODES, FAST_MODES)
        or sizes - {(count, count, *range(1, count + 1))}
        or {len(s.rest) for s in entry.shapes} - {0, len(fields(Rest))}
    ):
        raise UsageError("model file: [past] is of another version", do="learn the model anew with thermofast improve")
    numbers = [entry.log_rate_scatter, entry.log_rate_spread, entry.disturbance, entry.disturbance_log_deviation]
    numbers += [s.rate_per_min for s in entry.shapes]
    others = [v for s in entry.shapes for v in (s.log_rate_deviation, *s.amplitudes, *(x for row in s.covariance for x in row))]
    others += [v for pair in entry.factors for v in pair] + [v for s in entry.shapes for v in s.rest]
    if not all(0.0 < v < math.inf for v in numbers) or not all(map(math.isfinite, others)):
        raise UsageError("model file: [past] holds a number that cannot be", do="learn the model anew with thermofast improve")
    shapes = {}
    for s in entry.shapes:
        lower = np.zeros((count, count))
        for i, row in enumerate(s.covariance):
            lower[i, : i + 1] = row
        covariance = lower + np.tril(lower, -1).T
        if np.linalg.eigvalsh(covariance).min() < -1e-6:
            raise UsageError(
                "model file: [past] holds a covariance that is none", do="learn the model anew with thermofast improve"
            )
        limited = (np.array(s.amplitudes), covariance) if entry.relative_to else to_the_limit(np.array(s.amplitudes), covariance)
        if limited is None:
            raise UsageError(f"model file: the shape of {s.channel} is no rise", do="learn the model anew with thermofast improve")
        first, *others = (math.nan if v is None else v for v in (s.first_c, s.moved_c, s.noise_c))
        amplitudes, spread = limited
        rest = Rest(*s.rest) if s.rest else None
        shapes[s.channel] = SensorShape(math.log(s.rate_per_min), s.log_rate_deviation, amplitudes, spread, first, rest, *others)
    scale = entry.disturbance, entry.disturbance_log_deviation
    scatter = entry.log_rate_scatter, entry.log_rate_spread
    return Past(shapes, entry.runs, *scatter, *scale, entry.stretches, entry.factors, unexplained=entry.unexplained)


def _correlations(fit: Fit, sensor: int, pooled: Pooled | None) -> Correlations:
    """Of the machine's constants of one sensor and those that all share, in search coordinates."""
    model = fit.model
    columns = [*model.local, *model.shared]
    active = [*model.active[sensor], *(True for _ in model.shared)]
    at = [j for j, c in enumerate(columns) if model.of_machine(c) and active[j]]
    names = [columns[j].parameter.name if columns[j].part < 0 else _named(fit, columns[j]) for j in at]
    block = (fit.joint_covariance(sensor) if pooled is None else pooled.correlation[sensor])[np.ix_(at, at)]
    deviation = np.sqrt(np.maximum(np.diag(block), 1e-300))
    with np.errstate(all="ignore"):  # of a sensor without readings nothing is known
        matrix = np.nan_to_num(block / np.outer(deviation, deviation))
    np.fill_diagonal(matrix, 1.0)
    rounded = tuple(tuple(float(f"{v:.9f}") for v in row) for row in matrix)
    return Correlations(channel=fit.run.channels[sensor], names=tuple(names), matrix=rounded)


def _named(fit: Fit, column: Column) -> str:
    return f"{fit.model.parts[column.part].id}.{column.parameter.name}"


def _number(p: Parameter, belongs: Literal["machine", "run"], value: float, error: float, channel: str | None) -> Number:
    shown = float(f"{error:.6g}") if math.isfinite(error) and error < 1e9 else None
    return Number(name=p.name, unit=p.unit, belongs=belongs, value=float(f"{value:.9g}"), standard_error=shown, channel=channel)


def _plain(choice: Choice, channels: tuple[str, ...]) -> dict[str, Any]:
    """The constants of a choice in TOML's types; neighbours by their names."""
    found: dict[str, Any] = {}
    for key, value in choice.constants.items():
        if key in choice.by_sensor:
            found[key] = {channels[i]: channels[int(s)] for i, s in enumerate(np.asarray(value))}
        else:
            found[key] = value.item() if isinstance(value, np.generic) else value
    return found


def constants_of(entry: EffectEntry, channels: tuple[str, ...]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Back from the file, and the names of those that are per sensor: neighbours as indices into `channels`."""
    place = {c: i for i, c in enumerate(channels)}
    found, by_sensor = dict(entry.constants), tuple(k for k, v in entry.constants.items() if isinstance(v, dict))
    for key in by_sensor:
        other = entry.constants[key]
        found[key] = np.array([place.get(other.get(c, ""), (i + 1) % len(channels)) for i, c in enumerate(channels)])
    return found, by_sensor


def write_model(path: str, model: ModelFile) -> None:
    """The file, whole or not at all."""
    import tomli_w

    head = (
        "# What thermofast learnt of one machine. 'machine' numbers are carried to other runs of it; 'run' numbers are\n"
        "# found anew from each run's first minutes. Read back strictly: thermofast compare other.csv --model THIS.toml\n\n"
    )
    write_text_whole(path, head + tomli_w.dumps(_without_none(msgspec.to_builtins(model))))


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _without_none(v) for k, v in value.items() if v is not None}
    if isinstance(value, list | tuple):
        return [_without_none(v) for v in value]
    return value


def read_model(path: str) -> ModelFile:
    """A model file, checked.

    Raises
    ------
    UsageError: no such file, not TOML, another version, an unknown or missing key, a number that is none.
    """
    target = Path(path)
    if not target.is_file():
        raise UsageError(f"{path}: no such model file", do="make one with: thermofast improve RUN --auto -o machine.toml")
    try:
        raw = tomllib.loads(target.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        if Path(path).suffix.lower() != ".toml":
            do = "name the model that thermofast improve wrote, as machine.toml; of validate it comes before the runs"
            raise UsageError(f"{path}: not a model file", do=do) from None
        raise UsageError(f"{path}: not valid TOML", found=str(error), do="mend the line, or learn the model anew") from None
    schema = raw.get("schema")
    if schema != SCHEMA:
        raise UsageError(
            f"{path}: not a model file of this version",
            found=repr(schema) if schema is not None else "no schema",
            allowed=SCHEMA,
            do="learn the model anew with thermofast improve",
        )
    try:
        model = msgspec.convert(raw, ModelFile)
    except msgspec.ValidationError as error:
        raise UsageError(f"{path}: {error}", allowed=_known_keys(), do="mend the key, or learn the model anew") from None
    for number in (*model.base, *(n for e in model.effects for n in e.parameters)):
        if not math.isfinite(number.value):
            raise UsageError(f"{path}: {number.name} is not a number", found=repr(number.value), do="learn the model anew")
    for channel in model.channels:
        if not any(n.name == "rate" and n.channel in (None, channel) for n in model.base):
            raise UsageError(f"{path}: no rate of {channel}", do="the file is not whole: learn the model anew")
    ids = [e.id for e in model.effects]
    if len(set(ids)) < len(ids):
        raise UsageError(f"{path}: an effect twice", found=", ".join(ids), allowed="each effect once")
    return model


def _known_keys() -> str:
    tables = {
        "": ModelFile,
        "learnt_from": LearntFrom,
        "base": Number,
        "effects": EffectEntry,
        "effects.parameters": Number,
        "correlations": Correlations,
        "also_from": LearntFrom,
        "past": PastEntry,
        "past.shapes": ShapeEntry,
    }
    return "; ".join(f"[{n}] {' '.join(t.__struct_fields__)}".replace("[] ", "") for n, t in tables.items())
