"""``nonlinear_loss``: convection and radiation grow faster than the temperature difference."""

from typing import Any

import numpy as np

from ..core.kernel import Array
from ..drive import Drive
from ..observations import Observations
from .base import Effect, Parameter


class NonlinearLoss(Effect):
    """The loss grows with a power of the temperature difference; b then holds at a difference of 40 K."""

    id = "nonlinear_loss"
    summary = "convection and radiation grow faster than T - sink"
    equation = "g = (|T - sink| / 40 K)^exponent"
    tell_tale = "fast approach early, too slow later; depends on the level between runs"
    mistaken_for = ("second_mode", "friction_decay")
    separate = "run at another speed: the rate of a nonlinear loss depends on the level"
    reference = "natural convection Nu ~ Ra^(1/4), Incropera ch. 9"
    uses_sink = True
    places = (2.0, 0.0)
    amplitude = "exponent"
    parameters = (
        Parameter(
            "exponent", "1", 0.0, 3.0, 0.25, "exponent of the loss; 0.25 is natural convection", null=0.0, typical=(0.3, 0.7)
        ),
    )

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        drive.exponent = drive.exponent + p.exponent

    def equivalent(self, amplitude: float, rate: Array, level: Array, sink: float) -> tuple[Array, Array]:
        above = np.maximum(np.abs(level - sink), 0.5)
        grown = (above / 40.0) ** amplitude
        return rate / ((1.0 + 0.5 * amplitude) * grown), sink + (level - sink) * grown

    def large_starts(self) -> tuple[float, ...]:
        return (0.5,)
