"""``sensor_lag``: a sensor is late."""

from typing import Any

import numpy as np

from ..core.kernel import Array
from ..drive import Drive
from ..observations import Observations
from .base import Choice, Effect, Parameter


class SensorLag(Effect):
    """The probe follows the machine with a time constant of its own; heat that has far to go looks the same."""

    id = "sensor_lag"
    summary = "the sensor is late: its probe, or heat that has far to go"
    equation = "d reading/dt = (T - reading) / lag"
    tell_tale = "starts flat, S-shaped; only the start is wrong"
    mistaken_for = ("transport_delay", "second_mode")
    separate = "read faster in the first ten minutes; press the probe on better, if it is not far from the heat"
    reference = "first-order probe, e.g. Bentley, Principles of Measurement Systems, ch. 4"
    scope = "sensor"
    places = (3.0, 0.0)
    amplitude = "lag"
    parameters = (
        Parameter("lag", "min", 0.0, 240.0, 2.0, "time constant of the probe", null=0.0, each="sensor", typical=(6.0, 15.0)),
    )

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        drive.lag = drive.lag + p.lag

    def physical(self, choice: Choice, who: Any, rate: Array, own: dict[str, Array]) -> bool:
        """A probe is faster than the machine."""
        return not np.any(own["lag"][who] * rate[who] > 1.0)

    def mirrored(self, rate: Array, own: dict[str, Array]) -> tuple[Array, dict[str, Array]] | None:
        """A probe is faster than the machine: lag and 1/rate may change places without a trace."""
        lag = own["lag"]
        swap = lag * rate > 1.0
        if not swap.any():
            return None
        safe = np.where(swap, lag, 1.0)
        return np.where(swap, 1.0 / safe, rate), {"lag": np.where(swap, 1.0 / np.maximum(rate, 1e-12), lag)}

    def large_starts(self) -> tuple[float, ...]:
        return 1.0, 4.0, 12.0
