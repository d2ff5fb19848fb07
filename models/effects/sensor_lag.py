"""``sensor_lag``: the probe is late."""

from typing import Any

from ..drive import Drive
from ..observations import Observations
from .base import Effect, Parameter


class SensorLag(Effect):
    """The probe follows the machine with a time constant of its own."""

    id = "sensor_lag"
    summary = "the probe is late"
    equation = "d reading/dt = (T - reading) / lag"
    tell_tale = "starts flat, S-shaped; only the start is wrong"
    mistaken_for = ("transport_delay", "second_mode")
    separate = "read faster in the first ten minutes; press the probe on better"
    reference = "first-order probe, e.g. Bentley, Principles of Measurement Systems, ch. 4"
    scope = "sensor"
    amplitude = "lag"
    parameters = (Parameter("lag", "min", 0.0, 240.0, 2.0, "time constant of the probe", null=0.0, each="sensor"),)

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        drive.lag = drive.lag + p.lag

    def large_starts(self) -> tuple[float, ...]:
        return 1.0, 4.0, 12.0
