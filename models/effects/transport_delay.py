"""``transport_delay``: nothing happens for a while."""

from typing import Any

from ..drive import Drive
from ..observations import Observations
from .base import Effect, Parameter


class TransportDelay(Effect):
    """The reading is the temperature of some minutes ago."""

    id = "transport_delay"
    summary = "nothing happens for a while, then the rise begins"
    equation = "reading(t) = T(t - delay), T(0) before"
    tell_tale = "flat, then a corner"
    mistaken_for = ("sensor_lag",)
    separate = "read faster in the first ten minutes; if the machine was started later than the record, say --start MIN"
    reference = "pure dead time, e.g. Ljung, System Identification, ch. 4"
    scope = "sensor"
    places = (6.0, 0.0)
    advice = "if the machine was started later than the record, say --start MIN"
    amplitude = "delay"
    parameters = (
        Parameter("delay", "min", 0.0, 0.7, 0.05, "dead time", null=0.0, each="sensor", share=True, typical=(0.02, 0.06)),
    )

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        drive.delay = drive.delay + p.delay

    def large_starts(self) -> tuple[float, ...]:
        return 0.004, 0.015, 0.04, 0.1, 0.25
