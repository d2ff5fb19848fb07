"""Effects: built in, of installed packages, of a user's own file. All pass one check, which says what to write instead."""

from collections.abc import Sequence
from functools import wraps
from inspect import isgenerator
from typing import Any

from thermofast.models import Observations
from thermofast.models.drive import MOST_HIDDEN, Drive
from thermofast.models.effects import BUILT_IN, Effect, Parameter

from ..errors import UsageError, nearest
from .entrypoints import Broken, installed, taken
from .files import class_in, is_file
from .guard import PluginError, misspelt
from .trial import GUIDE, check, check_columns, check_finite, check_shapes, finite, guarded_call, row_by_row

#: What the search may ask of an effect beside ``apply``.
HOOKS = ("choices", "grid", "starts", "response", "borrowed_noise", "physical", "mirrored", "equivalent", "large_starts")
GROUP = "thermofast.effects"
SCOPES = ("run", "sensor", "one")


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
            with guarded_call(self):
                result = inner(self, *args)
                result = tuple(result) if isgenerator(result) else result
            if name == "choices":
                check_columns(self, result, args[0])
            return result

        return call

    def apply(self: Effect, drive: Drive, run: Observations, p: Any) -> None:
        before = finite(drive)
        with guarded_call(self):
            if by_row:
                row_by_row(kind.apply, self, drive, run, p)
            else:
                kind.apply(self, drive, run, p)
        check_shapes(self, drive, run)
        check_finite(self, drive, before, p)

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


def declaration_problem(kind: Any) -> str | None:
    """What is wrong with the data of a would-be effect, or None."""
    if not (isinstance(kind, type) and issubclass(kind, Effect)):
        return f"found {kind!r}, needed a class derived from thermofast.models.effects.Effect"
    return (
        _kind_problem(kind)
        or _parameters_problem(kind.parameters)
        or misspelt(kind, Effect)
        or _references_problem(kind, [p.name for p in kind.parameters])
        or next((said for p in kind.parameters if (said := _parameter_problem(kind, p))), None)
    )


def _kind_problem(kind: type[Effect]) -> str | None:
    """What is wrong with what an effect says of itself."""
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
    return None


def _parameters_problem(parameters: Any) -> str | None:
    """What is wrong with what should be a tuple of parameters."""
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
        if p.null is not None and (not isinstance(p.null, int | float) or isinstance(p.null, bool)):
            return f"parameter {p.name!r}: its null must be a number (found {p.null!r})"
    return None


def _references_problem(kind: type[Effect], names: list[str]) -> str | None:
    """What is wrong with those parameters, of these names, that an effect names."""
    if kind.amplitude not in names:
        return f"its amplitude must be one of its parameters {names} (found {kind.amplitude!r})"
    main = kind.parameters[names.index(kind.amplitude)]
    if main.null is None:
        return f"its amplitude {main.name!r} needs a null: the value at which the effect vanishes"
    if kind.event is not None and kind.event not in names:
        return f"its event must be one of its parameters {names} (found {kind.event!r})"
    if kind.moves_room and kind.moves_room not in names:
        return f"its moves_room must be one of its parameters {names} (found {kind.moves_room!r})"
    return None


def _parameter_problem(kind: type[Effect], p: Parameter) -> str | None:
    """What is wrong with one parameter of an effect."""
    if p.settles not in ("", "rate", "time"):
        return f"parameter {p.name!r}: settles is 'rate' or 'time' (found {p.settles!r})"
    if not (p.low < p.high and p.low <= p.start <= p.high):
        return f"parameter {p.name!r}: needed low < high and start between them (found {p.low}, {p.high}, {p.start})"
    if p.log and p.low <= 0.0 and not p.least_steps:
        return f"parameter {p.name!r}: a logarithmic scale needs low > 0 (found {p.low})"
    if p.belongs not in ("machine", "run") or p.each not in ("run", "sensor"):
        return f"parameter {p.name!r}: belongs is 'machine' or 'run', each is 'run' or 'sensor'"
    if kind.scope != "run" and p.each != "sensor":
        return f"parameter {p.name!r}: with scope {kind.scope!r} every parameter has each='sensor'"
    return None
