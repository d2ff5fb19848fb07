"""What was logged: whether the surroundings are a thermometer on the machine, and whether what happened is a column's jump."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .rules import RULES

if TYPE_CHECKING:
    from ..effects.base import Choice
    from ..joint import Fit, Part
    from ..observations import Observations

Array = NDArray[np.float64]


def follows_machine(reading: Array, room: Array) -> bool:
    """Whether a logged room (n,) moves with the machine read (S, n): a thermometer in its warmth tells nothing of the air.

    One that moves much does so in the machine's own shape then, and not as a room that drifts evenly or a door that was opened,
    which machines follow later.
    """
    ends = max(1, len(room) // 20)
    moved = abs(float(np.median(room[-ends:]) - np.median(room[:ends])))
    rises = np.median(reading[:, -ends:], axis=1) - np.median(reading[:, :ends], axis=1)
    if moved <= RULES.room_share * float(np.median(np.abs(rises))) or moved <= RULES.room_least:
        return False
    warmth = ((reading - reading[:, :1]) / np.where(rises == 0.0, 1.0, rises)[:, None]).mean(axis=0)
    left = _left(room, warmth)
    return left < _left(room, np.arange(len(room), dtype=float)) and left < RULES.room_unlike * float(np.var(room)) * len(room)


def _left(column: Array, like: Array) -> float:
    """Sum of squares (1,) that a column (n,) leaves when another is fitted to it."""
    design = np.column_stack([np.ones(len(like)), like])
    return float(np.linalg.lstsq(design, column, rcond=None)[1].sum())


def as_logged(
    before: "Fit",
    best: "tuple[float, Fit, Part]",
    choices: "Callable[[], Iterable[Choice]]",
    value: "Callable[[Fit, Fit, Part], float]",
) -> "tuple[float, Fit, Part]":
    """What was found to happen by itself as following the logged column that jumps then, where it does about as well so.

    Probes are late, and a moment that is searched for is later than that of the column.
    """
    from ..joint import Key, fit_model, with_parts  # identify asks only whether a room is one, and starts without these

    run, at, (least, fit, part) = before.run, len(before.model.parts), best
    effect = part.effect
    if not effect.event or effect.event not in {p.name for p in effect.active(part.choice)}:
        return best
    event, size = float(np.median(fit.values[Key(at, effect.event)])), Key(at, effect.amplitude)
    found: tuple[float, Fit, Part] | None = None
    for choice in choices():
        column = {**run.ambient, **run.inputs}.get(str(choice.constants.get("column", "")))
        if choice.simple or column is None or not _jumps_before(run, column, event):
            continue
        other = replace(part, choice=choice)
        parts = [*before.model.parts, other]
        kept = {key: v for key, v in fit.values.items() if key.part != at}
        again = fit_model(run, parts, {**with_parts(before, parts), **kept, size: fit.values[size]})
        worth = value(before, again, other)
        if worth > least - RULES.worth and (found is None or worth > found[0]):
            found = worth, again, other
    return found or best


def _jumps_before(run: "Observations", column: Array, event: float) -> bool:
    """Whether a column (N,) jumps, while readings were used, at an event [min] or a little before."""
    read = slice(0, run.last + 1)
    jumps = np.abs(np.diff(column[read])) > RULES.jump_share * float(np.ptp(column[read]))
    late = event - run.time[read][:-1]
    return bool((jumps & (late >= -1.5 * run.step) & (late <= RULES.soon * run.span)).any())
