"""The trial that every effect passes, built in or not: run on a small made-up record, watched, and told what to write instead."""

import sys
from dataclasses import replace
from inspect import isfunction
from itertools import chain
from typing import Any

import numpy as np

from thermofast.models import Observations
from thermofast.models.drive import Drive
from thermofast.models.effects import Effect, Parameter, Values
from thermofast.models.effects.base import Choice

from .guard import PluginError, PluginTimeoutError, source_of, watched

GUIDE = "docs/add-an-effect.md"
#: Sizes of the columns of the trial record that are tried: a share, a speed in rpm.
SIZES = (1.0, 30.0, 1e3, 3e4)
TOO = "and as many times 30, 1000 and 30000"
#: Hidden masses of one effect: of several together there is room for four such effects.
MOST_OWN_HIDDEN = 4
OFF_GRID = 0.0137  # of a range: between two readings of the trial
#: Characters of a text that may be a column's name.
LONGEST_NAME = 80
#: Shares of its range by which a parameter of the trial is moved to see whether it does anything, and the least that this is [K].
MOVES, LEAST_MOVED = (0.2, -0.2, 0.5, -0.5, 0.9, -0.9), 1e-9
#: Calls with the same values: chance in an effect may well give the same curve twice, where it decides of little.
TIMES_AGAIN = 12


def guarded_call(effect: Effect) -> Any:
    return watched(effect, f"effect {effect.id!r}")


def check_columns(effect: Effect, choices: Any, run: Observations) -> None:
    """Raises PluginError where a way to act follows a column that a run does not have."""
    for choice in choices if isinstance(choices, list | tuple) else ():
        column = choice.constants.get("column") if isinstance(choice, Choice) else None
        if isinstance(column, str) and column not in run.inputs and column not in run.ambient:
            raise PluginError(
                f"effect {effect.id!r}: choices gives the column {column!r}, which this run does not have",
                found=", ".join([*run.inputs, *run.ambient]) or "no logged column",
                do="give a Choice for what is there, as in [Choice(name, {'column': name}) for name in run.inputs]",
            )


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
    asked = {name: columns["speed"] for name in sorted(_names_in(effect)) if name not in run.ambient}
    vars(run).update(inputs=_Plenty(asked | run.inputs), ambient=_Plenty(run.ambient))
    with guarded_call(effect):
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
        again = (_curves(effect, run, values, choice.constants, by_row) for _ in range(TIMES_AGAIN))
        if not all(np.array_equal(one, curves, equal_nan=True) for curves in again):
            raise PluginError(
                f"{origin}: the same values give another curve each time", do="take chance and time of day out of apply"
            )
        for size in SIZES:
            try:
                _has_derivatives(effect, _larger(run, size), choice, values, by_row, origin)
                break
            except PluginError:  # 1 rpm may be far below what an effect asks for
                if size == SIZES[-1]:
                    raise
        return by_row, _masses(effect, run, values, choice.constants, by_row)
    return False, 0  # it needs what no trial record has: the guard watches it all the same


def _larger(run: Observations, size: float) -> Observations:
    """The trial record with columns that are no temperatures so many times as large."""
    larger = replace(run)
    scaled = {n: c if n in run.temperatures else size * c for n, c in run.inputs.items()}
    vars(larger).update(inputs=_Plenty(scaled))
    return larger


def _names_in(effect: Effect) -> set[str]:
    """Texts that an effect's code and its file hold: the columns that it looks for are among them."""
    kind = type(effect)
    codes = [member.__code__.co_consts for member in vars(kind).values() if isfunction(member)]
    module = sys.modules.get(kind.__module__)
    held = [vars(module).values()] if module is not None else []
    found: set[str] = set()
    for value in chain.from_iterable([*codes, *held]):
        found |= {text for text in (value if isinstance(value, tuple | list) else (value,)) if isinstance(text, str)}
    return {text for text in found if 0 < len(text) <= LONGEST_NAME}


def _either_way(effect: Effect, run: Observations, values: dict[str, Any], constants: dict[str, Any]) -> tuple[Any, bool]:
    """(curves, whether it must be called row by row): all rows at once where that is right, else with plain numbers."""
    try:
        both = _curves(effect, run, values, constants, False)
    except PluginTimeoutError:
        raise
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
                f"{origin}: parameter {p.name!r} changes nothing, whatever it is (columns of the trial go from 1 to 2 {TOO})",
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
    logged = {name: dict(columns) for name, columns in (("ambient", run.ambient), ("inputs", run.inputs))}
    with guarded_call(effect):
        if by_row:
            row_by_row(type(effect).apply, effect, drive, run, p)
        else:
            effect.apply(drive, run, p)
    for name, before in logged.items():
        after = getattr(run, name)
        if after.keys() != before.keys() or any(after[c] is not column for c, column in before.items()):
            after.clear()
            after.update(before)
            raise PluginError(
                f"effect {effect.id!r} ({source_of(effect)}): it writes to run.{name}, which other effects use, too",
                allowed="to read it",
                do="change drive.heat, drive.loss or drive.sink instead",
            )
    check_shapes(effect, drive, run)
    return drive


FIELDS = ("heat", "loss", "sink", "offset")
NUMBERS = ("exponent", "lag", "delay")
#: Lists of pairs: hidden masses (coupling, rate), neighbours (coupling, temperature).
PAIRS = ("hidden", "links")


def row_by_row(apply: Any, effect: Effect, drive: Drive, run: Observations, p: Any) -> None:
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
        check_shapes(effect, single, run)
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


def _numbers(drive: Drive) -> dict[str, list[Any]]:
    """What a drive holds of each name."""
    return {
        **{f: [getattr(drive, f)] for f in (*FIELDS, *NUMBERS)},
        **{f: [v for pair in getattr(drive, f) for v in pair] for f in PAIRS},
    }


def finite(drive: Drive) -> dict[str, bool]:
    """Whether all that a drive holds of each name is finite."""
    return {f: all(np.isfinite(v).all() for v in values) for f, values in _numbers(drive).items()}


def check_finite(effect: Effect, drive: Drive, before: dict[str, bool], p: Any) -> None:
    """Raises PluginError for what an effect made nan or infinite; `before` is :func:`finite` of the drive that it was given."""
    for f, good in finite(drive).items():
        if before[f] and not good:
            told = ", ".join(f"{k} = {float(np.ravel(v)[0]):.4g}" for k, v in vars(p).items() if np.ndim(v) == 2)
            raise PluginError(
                f"effect {effect.id!r} ({source_of(effect)}): drive.{f} is not finite",
                found=f"nan or inf where {told}" if told else "nan or inf",
                do="look in apply for 0/0 and overflow, also at the ends of each parameter's range and in long records",
            )


def _check_real(effect: Effect, drive: Drive) -> None:
    """Raises PluginError for complex numbers, whose imaginary parts would be dropped."""
    for f, values in _numbers(drive).items():
        if any(np.iscomplexobj(v) for v in values):
            raise PluginError(
                f"effect {effect.id!r} ({source_of(effect)}): drive.{f} is complex",
                found=str(next(v for v in values if np.iscomplexobj(v)))[:60],
                allowed="real numbers",
                do="look in apply for the root or the power of a negative number",
            )


def check_shapes(effect: Effect, drive: Drive, run: Observations) -> None:
    """Raises PluginError where what an effect left of a drive does not fit its rows and readings."""
    rows, n = len(drive.sensor), len(run.time)
    place = f"effect {effect.id!r} ({source_of(effect)})"
    for f in (*FIELDS, *NUMBERS, *PAIRS):
        if not hasattr(drive, f):
            raise PluginError(f"{place}: drive.{f} is gone", do=f"write drive.{f} = drive.{f} + ..., and delete nothing")
    _check_pairs(effect, drive)
    _check_real(effect, drive)
    wide, tall = (rows, n), (rows, 1)
    told = [(f"drive.{f}", getattr(drive, f), wide) for f in FIELDS]
    told += [(f"drive.{f}", getattr(drive, f), wide if f == "delay" and np.ndim(drive.delay) == 2 else tall) for f in NUMBERS]
    told += [(f"drive.hidden[{i}]", v, tall) for i, pair in enumerate(drive.hidden) for v in pair]
    told += [(f"drive.links[{i}]", v, s) for i, pair in enumerate(drive.links) for v, s in zip(pair, (tall, wide), strict=True)]
    for name, value, shape in told:
        try:
            numbers = np.asarray(value, dtype=float)
            # One number of each row may also stand in a line.
            np.broadcast_to(numbers[:, None] if shape == tall and numbers.shape == (rows,) else numbers, shape)
        except (ValueError, TypeError):
            raise PluginError(
                f"{place}: {name} has the wrong shape",
                found=str(np.shape(value)) if np.shape(value) else repr(value)[:60],
                allowed=f"what broadcasts to {'(rows, readings)' if shape == wide else '(rows, 1)'} = {shape}: "
                "p.<name> are (rows, 1), run.time is (readings,)",
            ) from None
    drive.links[:] = [(np.reshape(c, tall) if np.shape(c) == (rows,) else c, other) for c, other in drive.links]
