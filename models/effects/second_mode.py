"""``second_mode``: heat soaks into a slow mass."""

from typing import Any

from ..drive import Drive
from ..observations import Observations
from .base import Effect, Parameter


class SecondMode(Effect):
    """A hidden lump that takes heat from the measured one and gives it back."""

    id = "second_mode"
    summary = "heat soaks into a second, hidden mass"
    equation = "dT/dt = ... - kappa (T - Z), dZ/dt = rate (T - Z), Z(0) = T(0)"
    tell_tale = "fast rise, long creeping tail; sign pattern + - +"
    mistaken_for = ("friction_decay", "ambient", "neighbour_heat")
    separate = "stop the spindle and watch it cool; measure at a second place"
    reference = "Bacher & Madsen 2011, Energy and Buildings 43, two-state grey-box models"
    scope = "sensor"
    masses = 1
    again = True
    places = (4.0, 0.0)
    amplitude = "kappa"
    parameters = (
        Parameter(
            "kappa",
            "1/min",
            0.0,
            2.0,
            0.01,
            "coupling to the hidden mass",
            null=0.0,
            each="sensor",
            fastest=2.0,
            typical=(0.004, 0.012),
        ),
        Parameter(
            "rate",
            "1/min",
            2e-4,
            2.0,
            0.01,
            "rate of the hidden mass",
            each="sensor",
            log=True,
            fastest=2.0,
            typical=(0.003, 0.009),
            settles="rate",
        ),
    )

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        drive.hidden.append((p.kappa, p.rate))

    def large_starts(self) -> tuple[float, ...]:
        return 0.004, 0.02, 0.08
