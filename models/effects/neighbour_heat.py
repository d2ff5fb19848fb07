"""``neighbour_heat``: another measured part warms this one."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..core.kernel import Array
from ..drive import Drive
from ..observations import Observations
from .base import Choice, Effect, Parameter

#: Coupling over own rate from which a link explains anything: true links in simulated and real records reach 15.
MOST_COUPLED = 25.0


class NeighbourHeat(Effect):
    """A link to the measured temperature of another sensor."""

    id = "neighbour_heat"
    summary = "another measured part warms this one"
    equation = "dT/dt = ... - kappa (T - T_neighbour), T_neighbour as measured"
    tell_tale = "follows the neighbour, delayed by 1/b"
    mistaken_for = ("second_mode", "ambient")
    needs = "a second sensor"
    separate = "heat the neighbour alone; measure between the two"
    reference = "thermal networks, e.g. Bacher & Madsen 2011"
    scope = "sensor"
    reads_sensors = True
    places = (8.0, 0.0)
    choice_costs = 0.5
    amplitude = "kappa"
    parameters = (
        Parameter(
            "kappa",
            "1/min",
            0.0,
            2.0,
            0.01,
            "coupling to the neighbour",
            null=0.0,
            each="sensor",
            fastest=2.0,
            typical=(0.008, 0.02),
        ),
    )

    def choices(self, run: Observations) -> Sequence[Choice]:
        n = run.sensors
        if n < 2 or n > 40:
            return ()
        return [Choice(f"+{d}", {"source": (np.arange(n) + d) % n}, by_sensor=("source",)) for d in range(1, n)]

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        source = np.asarray(p.source)[drive.sensor]
        drive.links.append((p.kappa, run.filled[source]))

    def borrowed_noise(self, run: Observations, choice: Choice, sensor: int, rate: float, own: dict[str, float]) -> float:
        source = int(choice.constants["source"][sensor])
        return own["kappa"] / (own["kappa"] + rate) * float(run.noise[source])

    def physical(self, choice: Choice, who: Any, rate: Array, own: dict[str, Array]) -> bool:
        """Heat is conducted both ways; a sensor that only follows its neighbour, with hardly a loss of its own, is no link."""
        return bool(np.all((own["kappa"] < MOST_COUPLED * rate)[who]))
