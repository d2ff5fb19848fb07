"""``cooling_switch``: coolant, fan or door changes the loss."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..drive import Drive
from ..observations import Observations
from .base import Choice, Effect, Parameter, tried_columns
from .load_step import STEADILY, endings, held, later, so_far


class CoolingSwitch(Effect):
    """The loss steps at an unknown time, changes steadily until the last reading, or follows a logged column."""

    id = "cooling_switch"
    summary = "coolant, fan or door changes the loss"
    equation = (
        "loss(t) = ratio after event, 1 before; or 1 + (ratio - 1) t/t_last (steadily); "
        "or 1 + (ratio - 1) u(t - delay)/u_max, u a logged column"
    )
    tell_tale = "kink at the event, then a new exponential with another b"
    mistaken_for = ("load_step",)
    separate = "log the coolant or the fan; wait longer after the change"
    reference = "lumped capacitance with a changed film coefficient, Incropera ch. 5"
    event = "event"
    again = True
    in_parts = True
    uses_sink = True
    places = (30.0, 0.0)
    amplitude = "ratio"
    parameters = (
        Parameter(
            "ratio", "1", 0.05, 12.0, 1.3, "loss after the change over the loss before", null=1.0, belongs="run", typical=(1.2, 1.6)
        ),
        Parameter("event", "min", 0.0, 1.0, 0.5, "time of the change", belongs="run", share=True, typical=(0.3, 0.6)),
        Parameter(
            "delay", "min", 0.0, 0.3, 0.02, "time by which the loss follows the column later", share=True, logging_steps=0.289
        ),
    )

    def choices(self, run: Observations) -> Sequence[Choice]:
        steadily = {"column": "", "event": 0.0, "steady": 1.0}
        found = [Choice("", {"column": ""}, ("delay",)), Choice(STEADILY, steadily, ("event", "delay"), simple=False, rare=True)]
        for name, column in tried_columns(run, but=run.heats).items():
            constants = {"column": name, "scale": float(np.abs(column).max()), "event": 0.0}
            ways = [{**constants, "ending": ending} for ending in endings(column)]
            found += [Choice(name, way, ("event", "delay"), coupled=("ratio",)) for way in ways]
            # A delay that is searched says how a column is held, too.
            found += [Choice(f"{name}, later", ways[0] | {"ending": 0.5}, ("event",), simple=False, coupled=("ratio",))]
        return found

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        if p.column:
            changed = later(run, held(run, p.column, p.scale, 1.0, p.ending), getattr(p, "delay", 0.0))
        else:
            changed = so_far(run) if getattr(p, "steady", 0.0) else run.after(p.event)
        drive.loss = drive.loss * np.maximum(1.0 + (p.ratio - 1.0) * changed, 1e-3)
