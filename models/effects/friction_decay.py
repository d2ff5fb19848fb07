"""``friction_decay``: grease and preload run in."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..drive import Drive
from ..observations import Observations
from .base import Choice, Effect, Parameter, driven, heated


class FrictionDecay(Effect):
    """The heat is larger at first and decays."""

    id = "friction_decay"
    summary = "grease and preload run in: more heat at first"
    equation = "heat(t) = 1 + extra exp(-t / time_constant), extra > 0"
    tell_tale = "overshoot, or too fast a start"
    mistaken_for = ("second_mode", "nonlinear_loss", "ambient")
    separate = "run warm once more without a pause: grease that has run in does not run in again"
    reference = "Lundberg & Palmgren viscous friction; Harris, Rolling Bearing Analysis, ch. 10"
    uses_sink = True
    changes_heat = True
    places = (6.0, 0.0)
    amplitude = "extra"
    parameters = (
        Parameter("extra", "1", 0.0, 8.0, 0.3, "extra heat at the start over the lasting heat", null=0.0, typical=(0.5, 1.0)),
        Parameter(
            "time_constant",
            "min",
            0.003,
            3.0,
            0.1,
            "time constant of the running-in",
            log=True,
            share=True,
            least_steps=0.7,
            typical=(0.08, 0.2),
            settles="time",
        ),
    )

    def choices(self, run: Observations) -> Sequence[Choice]:
        return (Choice("", driven(run)),)

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        length = np.maximum(np.diff(run.time, prepend=run.time[0] - run.step), 1e-12)
        begin = np.maximum(run.before(run.time[0]), -run.step)
        mean = np.exp(-begin / p.time_constant) * -np.expm1(-length / p.time_constant) * p.time_constant / length
        drive.heat = heated(drive, p.extra * mean, p)
