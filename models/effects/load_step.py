"""``load_step``: the load changes during the run."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..drive import Drive
from ..observations import Observations
from .base import Choice, Effect, Parameter, driven, heated, tried_columns


class LoadStep(Effect):
    """The heat steps at an unknown time, or follows a logged column."""

    id = "load_step"
    summary = "the load changes during the run"
    equation = "heat(t) = 1 + change after event; or 1 + change ((u/u0)^power - 1), u a logged column"
    tell_tale = "kink in slope at the event, then a new exponential with the same b"
    mistaken_for = ("cooling_switch", "reading_jump")
    separate = "log the speed or the power"
    reference = "step response of a lump, e.g. Incropera, Fundamentals of Heat and Mass Transfer, ch. 5"
    event = "event"
    uses_sink = True
    changes_heat = True
    again = True
    places = (30.0, 0.0)
    amplitude = "change"
    parameters = (
        Parameter(
            "change",
            "1",
            -1.5,
            8.0,
            0.2,
            "change of the heat, relative to the heat at the start",
            null=0.0,
            belongs="run",
            typical=(0.15, 0.4),
        ),
        Parameter("event", "min", 0.0, 1.0, 0.5, "time of the change", belongs="run", share=True, typical=(0.3, 0.6)),
        Parameter("power", "1", 0.25, 4.0, 1.0, "exponent of the logged column", log=True),
    )

    def choices(self, run: Observations) -> Sequence[Choice]:
        free = Choice("", {"column": "", "power": 1.0, "ending": 0.5, **driven(run)}, ("power",))
        found = [free]
        for name, column in tried_columns(run).items():
            top = float(np.abs(column).max())
            constants = {"column": name, "scale": top, "event": 0.0}
            ways = [{**constants, "power": 1.0, "ending": ending} for ending in endings(column)]
            found += [Choice(name, way, ("event", "power"), coupled=("change",)) for way in ways]
            if len(np.unique(column)) > 2 and float(column.min()) >= 0.0:
                raised = [{**constants, "ending": ending} for ending in endings(column)]
                found += [Choice(f"{name}, to a power", way, ("event",), simple=False, coupled=("change",)) for way in raised]
        return found

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        if not p.column:
            drive.heat = heated(drive, p.change * run.after(p.event), p)
            return
        drive.heat = heated(drive, p.change * (held(run, p.column, p.scale, p.power, p.ending) - 1.0), p)


def endings(column: Any) -> tuple[float, ...]:
    """Shares that a reading may have in the interval it ends: of a column in steps, how it is held is not known."""
    return (0.5, 0.0, 1.0) if float(np.mean(np.diff(column) == 0.0)) > 0.8 else (0.5,)


def held(run: Observations, name: str, scale: float, power: Any, ending: float = 0.5) -> Any:
    """A logged column over `scale`, to a power, as mean over the interval that ends at each reading; (1 or B, N)."""
    level = np.maximum(run.inputs[name] / scale, 0.0) if np.any(np.asarray(power) != 1.0) else run.inputs[name] / scale
    return run.over_intervals(level**power, ending)
