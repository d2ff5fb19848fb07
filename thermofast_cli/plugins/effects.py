"""Effects: built in, of installed packages, of a user's own file. All pass one check, which says what to write instead."""

from collections.abc import Sequence
from dataclasses import replace
from functools import wraps
from inspect import isgenerator
from typing import Any

import numpy as np

from thermofast.models import Observations
from thermofast.models.drive import MOST_HIDDEN, Drive
from thermofast.models.effects import BUILT_IN, Effect, Parameter, Values
from thermofast.models.effects.base import Choice

from ..errors import UsageError, nearest
from .entrypoints import Broken, installed, taken
from .files import class_in, is_file
from .guard import PluginError, misspelt, source_of, watched

GUIDE = "docs/add-an-effect.md"
#: What the search may ask of an effect beside ``apply``.
HOOKS = ("choices", "grid", "starts", "response", "borrowed_noise", "physical", "mirrored", "equivalent", "large_starts")
GROUP = "thermofast.effects"
SCOPES = ("run", "sensor", "one")
#: Hidden masses of one effect: of several together there is room for four such effects.
MOST_OWN_HIDDEN = 4
OFF_GRID = 0.0137  # of a range: between two readings of the trial
#: Shares of its range by which a parameter of the trial is moved to see whether it does anything, and the least that this is [K].
MOVES, LEAST_MOVED = (0.2, -0.2, 0.5, -0.5, 0.9, -0.9), 1e-9


def known_effects(extra: Sequence[str] = ()) -> dict[str, Effect]:
    """Built-in effects by id, then those of installed plug-ins, then the user's own from `extra` (file.py[:Class])."""
    known: dict[str, Effect] = {kind.id: kind() for kind in BUILT_IN}
    for effect in installed(GROUP, checked)[0]:
        known.setdefault(effect.id, effect)
    for spec in extra:
        effect = load_effect(spec)
        if effect.id in known:
            raise UsageError(f"{spec}: its id {effect.id!r} is taken", allowed="an id of its own", do="rename it")
        known[effect.id] = effect
    return known


def broken_effects() -> list[Broken]:
    """Installed plug-ins that cannot be used."""
    good, broken = installed(GROUP, checked)
    return [*broken, *taken(good, [kind.id for kind in BUILT_IN], "id")]


def chosen_effects(names: Sequence[str], extra: Sequence[str]) -> list[Effect]:
    """The effects named (ids or file.py[:Class]) in their order; all known ones where none is named.

    Raises
    ------
    UsageError: an unknown id; the message lists the known ones.
    """
    files = [n for n in names if is_file(n)]
    known = known_effects([*extra, *files])
    by_file = {spec: load_effect(spec).id for spec in files}
    if not names:
        return list(known.values())
    found: list[Effect] = []
    for name in names:
        wanted = by_file.get(name, name)
        effect = named_effect(wanted, known)
        if effect is None:
            raise UsageError(
                f"unknown effect {name!r}",
                allowed=", ".join(known) + "; or a file, as in my_effect.py:MyEffect",
                do=nearest(name, known) or "see thermofast effects",
            )
        if effect.id in [e.id for e in found]:
            raise UsageError(f"the effect {effect.id!r} twice", do=f"call the second one {effect.id.partition('.')[0]}.2")
        found.append(effect)
    masses = sum(effect.masses for effect in found)
    if masses > MOST_HIDDEN:
        raise UsageError(f"{masses} hidden masses in one model", allowed=f"{MOST_HIDDEN} at most", do="name fewer of them")
    return found


def named_effect(name: str, known: dict[str, Effect]) -> Effect | None:
    """A known effect by its id; ``second_mode.2`` is the effect ``second_mode`` standing a second time, None an unknown one."""
    base, dot, number = name.partition(".")
    if name in known or not dot:
        return known.get(name)
    if base not in known or not number.isdecimal() or int(number) < 2:
        return None
    return known[base].numbered(int(number))


_LOADED: dict[str, Effect] = {}


def load_effect(spec: str) -> Effect:
    """The effect of ``path/to/file.py`` or ``path/to/file.py:Class``; the same module name in every process."""
    if spec not in _LOADED:
        _LOADED[spec] = checked(class_in(spec, Effect, "effect", GUIDE), spec, spec)
    return _LOADED[spec]


def checked(kind: Any, origin: str, file: str = "") -> Effect:
    """An effect that passed the check, guarded where it is called; `file` is the user's file it came from.

    Raises
    ------
    PluginError: what is wrong with it, and what to write instead.
    """
    problem = declaration_problem(kind)
    if problem:
        raise PluginError(f"{origin}: {problem}", do=f"see {GUIDE}")
    by_row, masses = check(kind(), origin)
    return guarded(kind, by_row, masses, file)()


def guarded(kind: type[Effect], by_row: bool, masses: int, file: str) -> type[Effect]:
    """The class of a user with every hook behind the guard: derived from it, so that it keeps all that it says and does."""

    def hook(name: str) -> Any:
        inner = getattr(kind, name)

        @wraps(inner)
        def call(self: Effect, *args: Any) -> Any:
            with _guarded(self):
                result = inner(self, *args)
                return tuple(result) if isgenerator(result) else result

        return call

    def apply(self: Effect, drive: Drive, run: Observations, p: Any) -> None:
        with _guarded(self):
            if by_row:
                _row_by_row(kind.apply, self, drive, run, p)
            else:
                kind.apply(self, drive, run, p)
        _check_shapes(self, drive, run)

    def reduce(self: Effect) -> Any:  # another process loads the file or the plug-in itself
        return _again, (file, self.id)

    own = {name: hook(name) for name in HOOKS if getattr(kind, name) is not getattr(Effect, name)}
    said = {
        "file": file,
        "by_row": by_row,
        "masses": masses,
        "__guard__": True,
        "__module__": kind.__module__,
        "__doc__": kind.__doc__,
    }
    return type(kind.__name__, (kind,), {**own, **said, "apply": apply, "__reduce__": reduce})


def _again(file: str, name: str) -> Effect:
    if not file:
        known = known_effects()
    else:
        effect = load_effect(file)
        known = {effect.id: effect}
    found = named_effect(name, known)
    assert found is not None
    return found


def _guarded(effect: Effect) -> Any:
    return watched(effect, f"effect {effect.id!r}")


def declaration_problem(kind: Any) -> str | None:
    """What is wrong with the data of a would-be effect, or None."""
    if not (isinstance(kind, type) and issubclass(kind, Effect)):
        return f"found {kind!r}, needed a class derived from thermofast.models.effects.Effect"
    for name in ("id", "summary", "equation", "tell_tale"):
        value = getattr(kind, name, None)
        if not isinstance(value, str) or not value or value == "abstract":
            return f"its {name} must be a non-empty text"
    if not kind.id.isidentifier():
        return f"its id must be one word of letters, digits and _ (found {kind.id!r})"
    if kind.scope not in SCOPES:
        return f"its scope must be one of {', '.join(SCOPES)} (found {kind.scope!r})"
    if kind.apply is Effect.apply:
        return "it has no apply(self, drive, run, p)"
    parameters = kind.parameters
    if isinstance(parameters, Parameter):
        return "its parameters must be a tuple: of one alone, with a comma behind it, (Parameter(...),)"
    if not isinstance(parameters, tuple | list) or not parameters or not all(isinstance(p, Parameter) for p in parameters):
        return "its parameters must be a tuple of Parameter(...), at least one"
    names = [p.name for p in parameters]
    if len(set(names)) < len(names):
        return f"each parameter needs a name of its own (found {names})"
    for p in parameters:
        if not all(isinstance(v, int | float) and not isinstance(v, bool) for v in (p.low, p.high, p.start)):
            return f"parameter {p.name!r}: low, high and start must be numbers (found {p.low!r}, {p.high!r}, {p.start!r})"
    if slip := misspelt(kind, Effect):
        return slip
    if kind.amplitude not in names:
        return f"its amplitude must be one of its parameters {names} (found {kind.amplitude!r})"
    main = parameters[names.index(kind.amplitude)]
    if main.null is None:
        return f"its amplitude {main.name!r} needs a null: the value at which the effect vanishes"
    if kind.event is not None and kind.event not in names:
        return f"its event must be one of its parameters {names} (found {kind.event!r})"
    for p in parameters:
        if not (p.low < p.high and p.low <= p.start <= p.high):
            return f"parameter {p.name!r}: needed low < high and start between them (found {p.low}, {p.high}, {p.start})"
        if p.log and p.low <= 0.0 and not p.least_steps:
            return f"parameter {p.name!r}: a logarithmic scale needs low > 0 (found {p.low})"
        if p.belongs not in ("machine", "run") or p.each not in ("run", "sensor"):
            return f"parameter {p.name!r}: belongs is 'machine' or 'run', each is 'run' or 'sensor'"
        if kind.scope != "run" and p.each != "sensor":
            return f"parameter {p.name!r}: with scope {kind.scope!r} every parameter has each='sensor'"
    return None


class _Plenty(dict[str, Any]):
    """Logged columns of the trial record: one of any name that an effect may ask for."""

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str)

    def __missing__(self, name: str) -> Any:
        return next(iter(self.values()))

    def get(self, name: str, default: Any = None) -> Any:
        return self[name]


def check(effect: Effect, origin: str) -> tuple[bool, int]:
    """Runs an effect, built in or not, on a small made-up record: (whether it must be called row by row, its hidden masses).

    Raises
    ------
    PluginError: it raises, never ends, or gives arrays of the wrong shape or with nan; or its null changes something, or a
    parameter nothing.
    """
    time = np.linspace(0.0, 120.0, 61)
    reading = np.array([20.0 + 5.0 * (1.0 - np.exp(-0.02 * time)), 20.0 + 3.0 * (1.0 - np.exp(-0.03 * time))])
    plenty: dict[str, Any] = {"ambient": 20.0 + np.sin(time / 20.0)}
    columns: dict[str, Any] = dict.fromkeys(("speed", "power", "coolant", "duty", "fan"), 1.0 + (time > 60.0))
    full = np.full(2, 0.01)
    run = Observations("trial", ("T1", "T2"), time, reading, np.ones_like(reading), full, full * 0.0, plenty, columns)
    run = replace(run, inputs={**columns, "oil_degC": plenty["ambient"] - 2.0}, temperatures=("oil_degC",))
    vars(run).update(inputs=_Plenty(run.inputs), ambient=_Plenty(run.ambient))
    with _guarded(effect):
        choices = list(effect.choices(run))
        if not choices:  # what needs that nothing is logged
            run = replace(run, ambient={})
            choices = list(effect.choices(run))
    if not all(isinstance(choice, Choice) for choice in choices):
        raise PluginError(f"{origin}: choices must give Choice(...)", found=repr(choices[0])[:60], do=f"see {GUIDE}")
    for choice in choices[:1]:
        values = {p.name: np.array([[p.start], [p.start]]) * (run.span if p.share else 1.0) for p in effect.active(choice)}
        main = effect.parameter(effect.amplitude)
        still = {**values, main.name: np.full((2, 1), main.null) * (run.span if main.share else 1.0)}
        one, by_row = _either_way(effect, run, values, choice.constants)
        if not np.isfinite(one).all():
            raise PluginError(f"{origin}: with its start values the curve is not finite", do="check apply for 0/0 and overflow")
        nothing = _curves(effect, run, still, choice.constants, by_row)
        base = _forward(_trial(run), run)
        if np.abs(nothing - base).max() > 1e-6:
            raise PluginError(
                f"{origin}: at {main.name} = {main.null:g} it must change nothing",
                found=f"a change of {np.abs(nothing - base).max():.3g} K",
                do="declare the null of the amplitude, or write apply so",
            )
        behind = _forward(_applied(effect, run, still, choice.constants, by_row, True), run)
        if np.abs(behind - _forward(_trial(run, True), run)).max() > 1e-6:
            raise PluginError(
                f"{origin}: behind another effect, at {main.name} = {main.null:g}, it takes back what that one did",
                allowed="a change of what is there, as drive.heat = drive.heat + ...",
                do="add to drive.heat, drive.loss and drive.sink, and never assign what begins anew",
            )
        if not np.array_equal(one, _curves(effect, run, values, choice.constants, by_row), equal_nan=True):
            raise PluginError(
                f"{origin}: the same values give another curve each time", do="take chance and time of day out of apply"
            )
        _has_derivatives(effect, run, choice, values, by_row, origin)
        return by_row, _masses(effect, run, values, choice.constants, by_row)
    raise PluginError(
        f"{origin}: choices gives none on a record that has every column",
        allowed="at least one way in which it could act",
        do="write choices so that it gives one where what it needs is logged",
    )


def _either_way(effect: Effect, run: Observations, values: dict[str, Any], constants: dict[str, Any]) -> tuple[Any, bool]:
    """(curves, whether it must be called row by row): all rows at once where that is right, else with plain numbers."""
    try:
        both = _curves(effect, run, values, constants, False)
    except PluginError:
        return _curves(effect, run, values, constants, True), True
    try:
        one = _curves(effect, run, values, constants, True)
    except PluginError:  # written for arrays, as it should be
        return both, False
    by_row = not np.allclose(both, one, atol=1e-9)
    return one if by_row else both, by_row


def _has_derivatives(effect: Effect, run: Observations, choice: Choice, values: dict[str, Any], by_row: bool, origin: str) -> None:
    """Raises PluginError where a parameter moves the curve in jumps only, so that no search can follow it."""
    strong = dict(values)
    main = effect.parameter(effect.amplitude)
    if np.allclose(strong[main.name], (main.null or 0.0) * (run.span if main.share else 1.0)):
        low, high = main.bounds(run)
        strong[main.name] = np.full((2, 1), 0.5 * (low + high))
    at = _curves(effect, run, strong, choice.constants, by_row)
    for p in effect.active(choice):
        low, high = p.bounds(run)

        def moved(share: float, p: Parameter = p, low: float = low, high: float = high) -> float:
            value = float(strong[p.name][0, 0])
            aside = value + share * (high - low)
            aside = aside if low <= aside <= high else value - share * (high - low)
            changed = {**strong, p.name: np.full((2, 1), np.clip(aside, low, high))}
            return float(np.abs(_curves(effect, run, changed, choice.constants, by_row) - at).max())

        if max(map(moved, MOVES)) < LEAST_MOVED:
            raise PluginError(
                f"{origin}: parameter {p.name!r} changes nothing, whatever it is",
                allowed="a parameter that the curve depends on",
                do=f"use p.{p.name} in apply, assign what it makes to drive.<name>, or leave the parameter out",
            )
        if max(moved(0.2), moved(-0.2)) > 1e-3 and _stands_still(effect, run, choice, {**strong}, p, by_row):
            raise PluginError(
                f"{origin}: parameter {p.name!r} has no derivative: a small change of it changes nothing, a large one does",
                found="a condition such as run.time > p.event",
                allowed="what moves smoothly with the parameter",
                do=f"write run.after(p.{p.name}), the share of each interval after that time, for a step",
            )


def _stands_still(effect: Effect, run: Observations, choice: Choice, values: dict[str, Any], p: Parameter, by_row: bool) -> bool:
    """Whether small changes of a parameter change nothing, at a value between the readings' times, either way."""
    low, high = p.bounds(run)
    value = float(values[p.name][0, 0])
    aside = value + OFF_GRID * (high - low)
    value = aside if aside <= high else value - OFF_GRID * (high - low)

    def curve(at: float) -> Any:
        return _curves(effect, run, {**values, p.name: np.full((2, 1), at)}, choice.constants, by_row)

    here = curve(value)
    return all(np.array_equal(curve(value + share * (high - low)), here) for share in (1e-4, -1e-4, 2e-4))


def _masses(effect: Effect, run: Observations, values: dict[str, Any], constants: dict[str, Any], by_row: bool) -> int:
    return len(_applied(effect, run, values, constants, by_row).hidden)


def _curves(effect: Effect, run: Observations, values: dict[str, Any], constants: dict[str, Any], by_row: bool) -> Any:
    return _forward(_applied(effect, run, values, constants, by_row), run)


def _forward(drive: Drive, run: Observations) -> Any:
    return drive.forward(run, np.array([0.02, 0.03]), np.array([5.0, 3.0]), np.array([20.0, 20.0]))


def _trial(run: Observations, changed: bool = False) -> Drive:
    """The drive of two sensors; changed: as another effect left it."""
    drive = Drive.plain(run, np.array([0, 1]), np.full((2, 1), 20.0))
    if changed:
        drive.heat, drive.loss, drive.sink = 1.3 * drive.heat, 1.1 * drive.loss, drive.sink + 0.5
    return drive


def _applied(
    effect: Effect, run: Observations, values: dict[str, Any], constants: dict[str, Any], by_row: bool, changed: bool = False
) -> Drive:
    drive = _trial(run, changed)
    p = Values(values, constants)
    with _guarded(effect):
        if by_row:
            _row_by_row(type(effect).apply, effect, drive, run, p)
        else:
            effect.apply(drive, run, p)
    _check_shapes(effect, drive, run)
    return drive


FIELDS = ("heat", "loss", "sink", "offset")
NUMBERS = ("exponent", "lag", "delay")
#: Lists of pairs: hidden masses (coupling, rate), neighbours (coupling, temperature).
PAIRS = ("hidden", "links")


def _row_by_row(apply: Any, effect: Effect, drive: Drive, run: Observations, p: Any) -> None:
    """Calls an effect that is written for one sensor once for each row, with plain numbers."""
    rows, n = len(drive.sensor), len(run.time)
    wide = {f: np.array(np.broadcast_to(getattr(drive, f), (rows, n))) for f in FIELDS}
    tall = {f: np.array(np.broadcast_to(getattr(drive, f), (rows, 1))) for f in NUMBERS}
    pairs: dict[str, list[tuple[Any, Any]]] = {f: [] for f in PAIRS}
    for i in range(rows):
        single = Drive(
            drive.sensor[i : i + 1],
            drive.sink_c[i : i + 1],
            *(wide[f][i] for f in FIELDS),
            *(float(tall[f][i, 0]) for f in NUMBERS),
        )
        named = {k: float(v[i, 0]) if isinstance(v, np.ndarray) and v.shape == (rows, 1) else v for k, v in vars(p).items()}
        apply(effect, single, run, Values(named, {}))
        _check_pairs(effect, single)
        for f in FIELDS:
            wide[f][i] = getattr(single, f)
        for f in NUMBERS:
            tall[f][i, 0] = float(np.ravel(getattr(single, f))[0])
        for f in PAIRS:
            for coupling, other in getattr(single, f):
                column = np.zeros((rows, 1))
                column[i] = coupling
                pairs[f].append((column, np.atleast_2d(other)))
    for f in FIELDS:
        setattr(drive, f, wide[f])
    for f in NUMBERS:
        setattr(drive, f, tall[f])
    # Row by row each sensor has its own; they are put together again, sensor by sensor, in the order they were written.
    drive.hidden.extend(_folded(pairs["hidden"], rows))
    drive.links.extend(pairs["links"])


def _folded(masses: list[tuple[Any, Any]], rows: int) -> list[tuple[Any, Any]]:
    """Hidden masses of single rows as masses of all rows, as few as there are of one row."""
    own: list[list[tuple[float, float]]] = [[] for _ in range(rows)]
    for coupling, rate in masses:
        i = int(np.argmax(coupling != 0.0)) if coupling.any() else 0
        own[i].append((float(coupling[i, 0]), float(rate[0, 0])))
    most = max(map(len, own))
    filled = [[*one, *[(0.0, 0.0)] * (most - len(one))] for one in own]
    return [tuple(np.array([[row[k][side]] for row in filled]) for side in (0, 1)) for k in range(most)]  # type: ignore[misc]


def _check_pairs(effect: Effect, drive: Drive) -> None:
    """Raises PluginError where what is a list of pairs no longer is one."""
    for f, other in (("hidden", "its rate [1/min]"), ("links", "the neighbour's temperature")):
        value = getattr(drive, f)
        if not isinstance(value, list) or any(not isinstance(v, tuple) or len(v) != 2 for v in value):
            raise PluginError(
                f"effect {effect.id!r} ({source_of(effect)}): drive.{f} is a list of pairs",
                found=type(value).__name__,
                allowed=f"(coupling [1/min], {other}) appended to it",
                do=f"write drive.{f}.append((p.kappa, ...))",
            )
    if len(drive.hidden) > MOST_OWN_HIDDEN:
        raise PluginError(
            f"effect {effect.id!r} ({source_of(effect)}): too many hidden masses",
            found=str(len(drive.hidden)),
            allowed=f"{MOST_OWN_HIDDEN} of one effect",
            do="make two effects of it",
        )


def _check_shapes(effect: Effect, drive: Drive, run: Observations) -> None:
    shape = (len(drive.sensor), len(run.time))
    _check_pairs(effect, drive)
    for f in FIELDS:
        value = getattr(drive, f)
        try:
            np.broadcast_to(np.asarray(value, dtype=float), shape)
        except (ValueError, TypeError):
            found = np.shape(value)
            place = source_of(effect)
            raise PluginError(
                f"effect {effect.id!r} ({place}): drive.{f} has the wrong shape",
                found=str(found),
                allowed=f"what broadcasts to (rows, readings) = {shape}: p.<name> are (rows, 1), run.time is (readings,)",
            ) from None
