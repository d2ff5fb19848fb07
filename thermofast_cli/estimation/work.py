"""What a worker process does: a task is some sensors of one run and what to do with them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..records import IdentifyRecord, SweepRecord
from ..standards.stopping import Rule
from .identify import Found, Identified, Method, identify_sensors
from .sweep import Swept, SweptBlock, sweep_sensors

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Task:
    """Sensors `channels` of one run: values (len(channels), N) [degC] at time_min (N,)."""

    run: str
    time_min: Array
    channels: tuple[str, ...]
    values: Array
    notes: tuple[str, ...]
    method: Method
    start_min: float
    room: Array | None

    def singles(self) -> list[Any]:
        """The same task for each sensor alone."""
        return [
            replace(self, channels=(c,), values=self.values[i : i + 1], notes=(self.notes[i],)) for i, c in enumerate(self.channels)
        ]


@dataclass(frozen=True)
class IdentifyTask(Task):
    """Sensors to identify."""

    until_min: float | None = None
    want_trace: bool = False
    together: bool = False
    at_min: float | None = None
    room_c: float | None = None
    rule: Rule | None = None


@dataclass(frozen=True)
class SweepTask(Task):
    """Sensors to sweep."""

    windows: tuple[float, ...] = ()
    times: tuple[float, ...] = ()
    tolerance_c: float = 0.1
    want_curves: bool = False


def together(tasks: Sequence[Task]) -> Task:
    """One task of the sensors of several, all of one run."""
    return replace(
        tasks[0],
        channels=tuple(c for task in tasks for c in task.channels),
        values=np.concatenate([task.values for task in tasks]),
        notes=tuple(n for task in tasks for n in task.notes),
    )


def identify_task(task: IdentifyTask) -> Found:
    """Each sensor of the task identified."""
    return identify_sensors(
        task.run,
        task.channels,
        task.time_min,
        task.values,
        task.method,
        task.until_min,
        task.start_min,
        notes=task.notes,
        want_trace=task.want_trace,
        together=task.together,
        at_min=task.at_min,
        room=task.room,
        room_c=task.room_c,
        rule=task.rule,
    )


def identify_lost(task: IdentifyTask, why: str) -> list[Identified]:
    """Records of sensors whose worker died."""
    return [Identified(IdentifyRecord(task.run, c, task.method.filter.name, status="failed", message=why)) for c in task.channels]


def sweep_task(task: SweepTask) -> Sequence[Swept]:
    """Each sensor of the task swept."""
    swept = sweep_sensors(
        task.run,
        task.channels,
        task.time_min,
        task.values,
        task.method,
        task.windows,
        task.times,
        task.tolerance_c,
        task.start_min,
        task.notes,
        task.room,
    )
    # Curves travel back from the worker only where a picture wants them.
    return swept if task.want_curves or not len(swept) else SweptBlock.of(swept).without_curves()


_NONE = np.empty(0)


def sweep_lost(task: SweepTask, why: str) -> list[Swept]:
    """Records of sensors whose worker died."""
    return [
        Swept(
            tuple(
                SweepRecord(task.run, c, task.method.filter.name, window_min=w, status="failed", message=why) for w in task.windows
            ),
            _NONE,
            _NONE,
            _NONE,
        )
        for c in task.channels
    ]
