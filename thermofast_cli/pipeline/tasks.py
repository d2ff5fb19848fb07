"""What a worker process does: a task is some sensors of one run and what to do with them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..estimation.identify import Found, Identified, identify_sensors
from ..estimation.request import EVERYTHING, Method, Question
from ..estimation.sensor import Signals
from ..estimation.sweep import Swept, SweptBlock, sweep_sensors
from ..records import IdentifyRecord, SweepRecord


@dataclass(frozen=True)
class Task:
    """Sensors of one run, and what they are treated with."""

    signals: Signals
    method: Method

    def singles(self) -> list[Any]:
        """The same task for each sensor alone."""
        return [replace(self, signals=self.signals.one(i)) for i in range(len(self.signals.channels))]


@dataclass(frozen=True)
class IdentifyTask(Task):
    """Sensors to identify."""

    question: Question = EVERYTHING


@dataclass(frozen=True)
class SweepTask(Task):
    """Sensors to sweep: windows and times [min] ascending."""

    windows: tuple[float, ...] = ()
    times: tuple[float, ...] = ()
    tolerance_c: float = 0.1
    want_curves: bool = False


def together(tasks: Sequence[Task]) -> Task:
    """One task of the sensors of several, all of one run."""
    return replace(tasks[0], signals=Signals.joined([task.signals for task in tasks]))


def identify_task(task: IdentifyTask) -> Found:
    """Each sensor of the task identified."""
    return identify_sensors(task.signals, task.method, task.question)


def identify_lost(task: IdentifyTask, why: str) -> list[Identified]:
    """Records of sensors whose worker died."""
    run, name = task.signals.run, task.method.filter.name
    return [Identified(IdentifyRecord(run, c, name, status="failed", message=why)) for c in task.signals.channels]


def sweep_task(task: SweepTask) -> Sequence[Swept]:
    """Each sensor of the task swept."""
    swept = sweep_sensors(task.signals, task.method, task.windows, task.times, task.tolerance_c)
    # Curves travel back from the worker only where a picture wants them.
    return swept if task.want_curves or not len(swept) else SweptBlock.of(swept).without_curves()


_NONE = np.empty(0)


def sweep_lost(task: SweepTask, why: str) -> list[Swept]:
    """Records of sensors whose worker died."""
    run, name = task.signals.run, task.method.filter.name
    return [
        Swept(
            tuple(SweepRecord(run, c, name, window_min=w, status="failed", message=why) for w in task.windows), _NONE, _NONE, _NONE
        )
        for c in task.signals.channels
    ]
