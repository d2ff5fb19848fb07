"""``neighbour_heat``: another measured part, or one on either side, warms this one."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.kernel import Array
from ..drive import Drive
from ..observations import Observations
from .base import MOST_COUPLED, Choice, Effect, Parameter

#: Constants that name a sensor for each sensor; a sensor that is its own `other` has one neighbour.
SENSORS = ("source", "other")
#: Parameters that are not searched where both neighbours of a row are coupled alike, or there is one.
EVEN = ("ratio",)
#: It looks at every pair of sensors: of forty those are 1,560, of each of which it fits a curve.
MOST_SENSORS = 40


class NeighbourHeat(Effect):
    """A link to the measured temperature of another sensor, or, in a row in the order of the columns, to those on both sides."""

    id = "neighbour_heat"
    summary = "another measured part warms this one"
    equation = (
        "dT/dt = ... - kappa (T - T_neighbour), T_neighbour as measured; in a row - kappa ((T - T_before) + ratio (T - T_after)), "
        "ratio 1 where one is enough"
    )
    tell_tale = "follows the neighbour, delayed by 1/b"
    mistaken_for = ("second_mode", "ambient")
    needs = "a second sensor"
    separate = "heat the neighbour alone; measure between the two"
    reference = "thermal networks, e.g. Bacher & Madsen 2011"
    scope = "sensor"
    reads_sensors = True
    most_sensors = MOST_SENSORS
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
        Parameter(
            "ratio", "1", 0.02, 50.0, 1.0, "coupling to the neighbour after over that to the one before", each="sensor", log=True
        ),
    )

    def choices(self, run: Observations) -> Sequence[Choice]:
        n = run.sensors
        if n < 2 or n > MOST_SENSORS:
            return ()
        own = np.arange(n)
        single = [Choice(f"+{d}", {"source": (own + d) % n, "other": own}, EVEN, by_sensor=SENSORS) for d in range(1, n)]
        if n < 3:
            return single
        before, after = np.abs(own - 1), np.minimum(own + 1, n - 1)
        after[0] = 0  # the ends have one neighbour
        row = {"source": before, "other": after}
        return [*single, Choice("row", row, EVEN, by_sensor=SENSORS), Choice("uneven row", row, simple=False, by_sensor=SENSORS)]

    def acting(self, parameter: Parameter, choice: Choice, sensors: int) -> NDArray[np.bool_]:
        if parameter.name not in EVEN:
            return super().acting(parameter, choice, sensors)
        both: NDArray[np.bool_] = np.asarray(choice.constants.get("other", np.arange(sensors))) != np.arange(sensors)
        return both

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        source = np.asarray(p.source)[drive.sensor]
        drive.links.append((p.kappa, run.filled[source]))
        other = np.asarray(getattr(p, "other", np.arange(run.sensors)))[drive.sensor]
        both = other != drive.sensor
        if np.any(both):
            drive.links.append((p.kappa * getattr(p, "ratio", 1.0) * both[:, None], run.filled[other]))

    def borrowed_noise(self, run: Observations, choice: Choice, sensor: int, rate: float, own: dict[str, float]) -> float:
        ends = [int(choice.constants[k][sensor]) for k in SENSORS if k in choice.constants]
        couplings = {i: own["kappa"] * r for i, r in zip(ends, (1.0, own.get("ratio", 1.0)), strict=False) if i != sensor}
        total = sum(couplings.values()) + rate
        return float(np.sqrt(sum((k / total * run.noise[i]) ** 2 for i, k in couplings.items())))

    def physical(self, choice: Choice, who: Any, rate: Array, own: dict[str, Array]) -> bool:
        """Heat is conducted both ways; a sensor that only follows its neighbour, with hardly a loss of its own, is no link."""
        most = np.maximum(own.get("ratio", np.ones_like(rate)), 1.0)
        return bool(np.all((own["kappa"] * most < MOST_COUPLED * rate)[who]))
