"""Whether what was logged as the surroundings is a thermometer on the machine."""

import numpy as np
from numpy.typing import NDArray

from .rules import RULES

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
