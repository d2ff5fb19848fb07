"""``coolant_heat``: a coolant, a bed or another body of a logged temperature takes heat, or brings some."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..drive import Drive
from ..observations import Observations
from .base import MOST_COUPLED, Choice, Effect, Parameter, tried_columns


class CoolantHeat(Effect):
    """A link to a temperature that is logged beside the sensors, each sensor's its own."""

    id = "coolant_heat"
    summary = "what is at a logged temperature (coolant, bed) takes or brings heat"
    equation = "dT/dt = ... - kappa (T - C), C(t) the logged temperature"
    tell_tale = "follows the logged temperature, delayed by 1/b, each sensor by a share of its own"
    mistaken_for = ("ambient", "load_step")
    needs = "an input that is a temperature, as of a coolant"
    separate = "change the coolant's temperature alone"
    reference = "thermal networks with a boundary temperature, e.g. Bacher & Madsen 2011"
    scope = "sensor"
    logged = True
    places = (2.0, 0.0)
    amplitude = "kappa"
    parameters = (
        Parameter(
            "kappa",
            "1/min",
            0.0,
            2.0,
            0.005,
            "coupling to what is at the logged temperature",
            null=0.0,
            each="sensor",
            fastest=2.0,
            typical=(0.004, 0.015),
        ),
    )

    def choices(self, run: Observations) -> Sequence[Choice]:
        return [Choice(n, {"column": n}) for n in tried_columns(run, warm=True)]

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        drive.links.append((p.kappa, run.inputs[p.column][None, :]))

    def physical(self, choice: Choice, who: Any, rate: Any, own: dict[str, Any]) -> bool:
        """A sensor that only follows the column is no part of the machine that the law describes, but one beside it."""
        return bool(np.all((own["kappa"] < MOST_COUPLED * rate)[who]))
