"""``sensor_drift``: the reading walks."""

from typing import Any

import numpy as np

from ..core.kernel import Array
from ..drive import Drive
from ..observations import Observations
from .base import Effect, Parameter


class SensorDrift(Effect):
    """The reading of one sensor moves off in a straight line."""

    id = "sensor_drift"
    summary = "the reading of one sensor walks"
    equation = "reading = T + drift t"
    tell_tale = "straight line without end, in one sensor only"
    mistaken_for = ("ambient", "second_mode")
    separate = "swap the probe, or compare it with a second one at the same place"
    reference = "thermocouple drift, e.g. Bentley, Handbook of Temperature Measurement, vol. 3"
    scope = "one"
    places = (2.0, 0.0)
    amplitude = "drift"
    parameters = (
        Parameter("drift", "K/min", -0.5, 0.5, 0.001, "drift of the reading", null=0.0, each="sensor", typical=(0.002, 0.005)),
    )

    def response(self, points: list[dict[str, float]], run: Observations, rate: Array, rise: Array) -> Array:
        return np.broadcast_to(run.time - run.time[0], (1, len(points), len(run.time)))

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        drive.offset = drive.offset + p.drift * (run.time - run.time[0])
