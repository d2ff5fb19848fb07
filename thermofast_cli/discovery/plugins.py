"""A user's own effect: loaded from a file or an installed package, checked with a message that explains what is wrong."""

import hashlib
import importlib.util
import inspect
import signal
import sys
import threading
import traceback
from collections.abc import Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from thermofast.models import Observations
from thermofast.models.drive import Drive
from thermofast.models.effects import BUILT_IN, Effect, Parameter, Values

from ..entrypoints import Broken, installed
from ..errors import ThermofastError, UsageError, listed, nearest

GROUP = "thermofast.effects"
#: Seconds after which an effect's ``apply`` is taken to loop for ever.
PATIENCE_S = 10.0
SCOPES = ("run", "sensor", "one")


class EffectError(ThermofastError):
    """An effect that raised, took too long or returned nonsense; it names the file and the line."""


class Guarded(Effect):
    """A user's effect behind a guard: what it raises is told with its line, and it may not run for ever."""

    def __init__(self, inner: Effect, by_row: bool, file: str = "") -> None:
        self.inner, self.by_row, self.file = inner, by_row, file
        for name in ("id", "scope", "event", "uses_sink", "changes_heat", "amplitude", "parameters", "mistaken_for", "separate"):
            setattr(self, name, getattr(inner, name))
        for name in ("summary", "equation", "tell_tale", "needs", "reference"):
            setattr(self, name, getattr(inner, name))

    def __reduce__(self) -> Any:
        """Another process loads the file or the plug-in itself."""
        return _again, (self.file, self.id)

    def choices(self, run: Observations) -> Any:
        with _watched(self.inner):
            return tuple(self.inner.choices(run))

    def grid(self, run: Observations, choice: Any) -> Any:
        with _watched(self.inner):
            return self.inner.grid(run, choice)

    def large_starts(self) -> tuple[float, ...]:
        with _watched(self.inner):
            return tuple(self.inner.large_starts())

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        with _watched(self.inner):
            if not self.by_row:
                self.inner.apply(drive, run, p)
            else:
                _row_by_row(self.inner, drive, run, p)
        _check_shapes(self.inner, drive, run)


def _again(file: str, name: str) -> Effect:
    return load_effect(file) if file else known_effects()[name]


def known_effects(extra: Sequence[str] = ()) -> dict[str, Effect]:
    """Built-in effects by id, then those of installed plug-ins, then the user's own from `extra` (file.py[:Class])."""
    known: dict[str, Effect] = {kind.id: kind() for kind in BUILT_IN}
    for effect in installed(GROUP, _checked)[0]:
        known.setdefault(effect.id, effect)
    for spec in extra:
        effect = load_effect(spec)
        if effect.id in known:
            raise UsageError(f"{spec}: its id {effect.id!r} is taken", allowed="an id of its own", do="rename it")
        known[effect.id] = effect
    return known


def broken_effects() -> list[Broken]:
    """Installed plug-ins that cannot be used."""
    return installed(GROUP, _checked)[1]


def chosen_effects(names: Sequence[str], extra: Sequence[str]) -> list[Effect]:
    """The effects named (ids or file.py[:Class]) in their order; all known ones where none is named.

    Raises
    ------
    UsageError: an unknown id; the message lists the known ones.
    """
    files = [n for n in names if _is_file(n)]
    known = known_effects([*extra, *files])
    by_file = {spec: load_effect(spec).id for spec in files}
    if not names:
        return list(known.values())
    found: list[Effect] = []
    for name in names:
        wanted = by_file.get(name, name)
        if wanted not in known:
            raise UsageError(
                f"unknown effect {name!r}",
                allowed=", ".join(known) + "; or a file, as in my_effect.py:MyEffect",
                do=nearest(name, known) or "see thermofast effects",
            )
        if wanted in [e.id for e in found]:
            raise UsageError(f"the effect {wanted!r} twice", do="name it once: an effect occurs once in a model")
        found.append(known[wanted])
    return found


def _is_file(name: str) -> bool:
    return name.partition(":")[0].endswith(".py")


_LOADED: dict[str, Effect] = {}


def load_effect(spec: str) -> Effect:
    """The effect of ``path/to/file.py`` or ``path/to/file.py:Class``; the same module name in every process."""
    if spec in _LOADED:
        return _LOADED[spec]
    path, _, wanted = spec.partition(":")
    file = Path(path)
    if not file.is_file():
        raise UsageError(f"{path}: no such file", do="name a Python file with one effect class, as in my_effect.py:MyEffect")
    name = f"thermofast_user_{file.stem}_{hashlib.sha256(str(file.resolve()).encode()).hexdigest()[:8]}"
    module_spec = importlib.util.spec_from_file_location(name, file)
    assert module_spec is not None
    assert module_spec.loader is not None
    module = importlib.util.module_from_spec(module_spec)
    sys.modules[name] = module
    try:
        with _alarm(f"{path}: still importing"):
            module_spec.loader.exec_module(module)
    except EffectError:
        raise
    except BaseException as error:
        renamed = new_name(error)
        do = f"write {renamed}: the packages were renamed" if renamed else "run it with python to see more"
        raise EffectError(f"{path}: cannot be imported", found=_where(error, path), do=do) from None
    kinds = [
        v
        for v in vars(module).values()
        if inspect.isclass(v) and issubclass(v, Effect) and v.__module__ == name and v is not Effect
    ]
    if wanted:
        kinds = [k for k in kinds if k.__name__ == wanted]
    if len(kinds) != 1:
        have = listed(
            [k.__name__ for k in vars(module).values() if inspect.isclass(k) and issubclass(k, Effect) and k is not Effect]
        )
        raise UsageError(
            f"{spec}: {'no' if not kinds else 'more than one'} effect class {wanted or ''}".rstrip(),
            found=have or "no class derived from thermofast.models.effects.Effect",
            allowed="one class, or its name after a colon",
            do="see docs/add-an-effect.md",
        )
    _LOADED[spec] = _checked(kinds[0], spec, spec)
    return _LOADED[spec]


def new_name(error: BaseException) -> str:
    """What to import in the place of a name that thermofast up to 0.3 had at the top level; empty for any other error."""
    first, _, rest = (getattr(error, "name", None) or "").partition(".")
    new = {"models": "thermofast.models", "filters": "thermofast.filters", "thermofast_cli": "thermofast"}.get(first)
    if not isinstance(error, ModuleNotFoundError) or new is None:
        return ""
    return f"'from {new}.{rest} import ...'" if rest else f"'from {new} import ...'"


def _checked(kind: Any, origin: str, file: str = "") -> Effect:
    problem = _declaration_problem(kind)
    if problem:
        raise EffectError(f"{origin}: {problem}", do="see docs/add-an-effect.md")
    effect = kind()
    by_row = _try(effect, origin)
    return Guarded(effect, by_row, file)


def _declaration_problem(kind: Any) -> str | None:
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
    if not parameters or not all(isinstance(p, Parameter) for p in parameters):
        return "its parameters must be a tuple of Parameter(...), at least one"
    names = [p.name for p in parameters]
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
        if p.log and p.low <= 0.0:
            return f"parameter {p.name!r}: a logarithmic scale needs low > 0 (found {p.low})"
        if p.belongs not in ("machine", "run") or p.each not in ("run", "sensor"):
            return f"parameter {p.name!r}: belongs is 'machine' or 'run', each is 'run' or 'sensor'"
        if kind.scope != "run" and p.each != "sensor":
            return f"parameter {p.name!r}: with scope {kind.scope!r} every parameter has each='sensor'"
    return None


def _try(effect: Effect, origin: str) -> bool:
    """Runs an effect on a small made-up record; True if it must be called row by row.

    Raises
    ------
    EffectError: it raises, never ends, or gives arrays of the wrong shape or with nan; or its null changes something.
    """
    time = np.linspace(0.0, 120.0, 61)
    reading = np.array([20.0 + 5.0 * (1.0 - np.exp(-0.02 * time)), 20.0 + 3.0 * (1.0 - np.exp(-0.03 * time))])
    plenty: dict[str, Any] = {"ambient": 20.0 + np.sin(time / 20.0)}
    columns: dict[str, Any] = dict.fromkeys(("speed", "power", "coolant", "duty", "fan"), 1.0 + (time > 60.0))
    full = np.full(2, 0.01)
    run = Observations("trial", ("T1", "T2"), time, reading, np.ones_like(reading), full, full * 0.0, plenty, columns)
    with _watched(effect):
        choices = list(effect.choices(run))
    for choice in choices[:1]:
        values = {p.name: np.array([[p.start], [p.start]]) * (run.span if p.share else 1.0) for p in effect.active(choice)}
        main = effect.parameter(effect.amplitude)
        still = {**values, main.name: np.full((2, 1), main.null) * (run.span if main.share else 1.0)}
        by_row = False
        try:
            both = _curves(effect, run, values, choice.constants, False)
            one = _curves(effect, run, values, choice.constants, True)
            by_row = not np.allclose(both, one, atol=1e-9)
        except EffectError:
            one = _curves(effect, run, values, choice.constants, True)
            by_row = True
        if not np.isfinite(one).all():
            raise EffectError(f"{origin}: with its start values the curve is not finite", do="check apply for 0/0 and overflow")
        nothing = _curves(effect, run, still, choice.constants, by_row)
        plain = Drive.plain(run, np.array([0, 1]), np.full((2, 1), 20.0))
        base = plain.forward(run, np.array([0.02, 0.03]), np.array([5.0, 3.0]), np.array([20.0, 20.0]))
        if np.abs(nothing - base).max() > 1e-6:
            raise EffectError(
                f"{origin}: at {main.name} = {main.null:g} it must change nothing",
                found=f"a change of {np.abs(nothing - base).max():.3g} K",
                do="declare the null of the amplitude, or write apply so",
            )
        return by_row
    return False


def _curves(effect: Effect, run: Observations, values: dict[str, Any], constants: dict[str, Any], by_row: bool) -> Any:
    drive = Drive.plain(run, np.array([0, 1]), np.full((2, 1), 20.0))
    p = Values(values, constants)
    with _watched(effect):
        if by_row:
            _row_by_row(effect, drive, run, p)
        else:
            effect.apply(drive, run, p)
    _check_shapes(effect, drive, run)
    return drive.forward(run, np.array([0.02, 0.03]), np.array([5.0, 3.0]), np.array([20.0, 20.0]))


FIELDS = ("heat", "loss", "sink", "offset")
NUMBERS = ("exponent", "hidden", "hidden_rate", "lag", "delay")


def _row_by_row(effect: Effect, drive: Drive, run: Observations, p: Any) -> None:
    """Calls an effect that is written for one sensor once for each row, with plain numbers."""
    rows, n = len(drive.sensor), len(run.time)
    wide = {f: np.array(np.broadcast_to(getattr(drive, f), (rows, n))) for f in FIELDS}
    tall = {f: np.array(np.broadcast_to(getattr(drive, f), (rows, 1))) for f in NUMBERS}
    links: list[tuple[Any, Any]] = []
    for i in range(rows):
        single = Drive(
            drive.sensor[i : i + 1],
            drive.sink_c[i : i + 1],
            *(wide[f][i] for f in FIELDS),
            *(float(tall[f][i, 0]) for f in NUMBERS),
        )
        named = {k: float(v[i, 0]) if isinstance(v, np.ndarray) and v.shape == (rows, 1) else v for k, v in vars(p).items()}
        effect.apply(single, run, Values(named, {}))
        for f in FIELDS:
            wide[f][i] = getattr(single, f)
        for f in NUMBERS:
            tall[f][i, 0] = float(np.ravel(getattr(single, f))[0])
        for coupling, neighbour in single.links:
            column = np.zeros((rows, 1))
            column[i] = coupling
            links.append((column, np.atleast_2d(neighbour)))
    for f in FIELDS:
        setattr(drive, f, wide[f])
    for f in NUMBERS:
        setattr(drive, f, tall[f])
    drive.links.extend(links)


def _check_shapes(effect: Effect, drive: Drive, run: Observations) -> None:
    shape = (len(drive.sensor), len(run.time))
    for f in FIELDS:
        value = getattr(drive, f)
        try:
            np.broadcast_to(np.asarray(value, dtype=float), shape)
        except (ValueError, TypeError):
            found = np.shape(value)
            place = inspect.getsourcefile(type(effect)) or "?"
            raise EffectError(
                f"effect {effect.id!r} ({place}): drive.{f} has the wrong shape",
                found=str(found),
                allowed=f"what broadcasts to (rows, readings) = {shape}: p.<name> are (rows, 1), run.time is (readings,)",
            ) from None


@contextmanager
def _watched(effect: Effect) -> Any:
    """Turns whatever an effect raises into an :class:`EffectError` that names its line."""
    file = inspect.getsourcefile(type(effect)) or "?"
    try:
        with _alarm(f"effect {effect.id!r} ({file})"):
            yield
    except EffectError:
        raise
    except (Exception, SystemExit) as error:
        raise EffectError(f"effect {effect.id!r} raised {type(error).__name__}", found=_where(error, file)) from None


@contextmanager
def _alarm(what: str) -> Any:
    """An EffectError after PATIENCE_S seconds, where the system can (not on Windows, not outside the main thread)."""
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def ring(*_: Any) -> None:
        frames = traceback.extract_stack()
        user = [f for f in frames if "thermofast_user_" in (f.name or "") or f.filename.endswith(".py")]
        line = f"line {user[-2].lineno} of {user[-2].filename}" if len(user) > 1 else ""
        raise EffectError(f"{what}: did not come back within {PATIENCE_S:g} s", found=line, do="look for a loop without end")

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _where(error: BaseException, file: str) -> str:
    """'line 12: message', the line in the user's file where it can be told."""
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if Path(f.filename).name == Path(file).name]
    place = f"{Path(file).name}, line {lines[-1]}: " if lines else f"{Path(file).name}: "
    if isinstance(error, SyntaxError) and error.lineno:
        place = f"{Path(file).name}, line {error.lineno}: "
    return f"{place}{type(error).__name__}: {error}"
