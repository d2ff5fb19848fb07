"""``transport_delay``: nothing happens for a while."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..drive import Drive
from ..observations import Observations
from .base import Choice, Effect, Parameter, tried_columns


class TransportDelay(Effect):
    """The reading is the temperature of some minutes ago, or, in plug flow, of when what arrives now passed by.

    Where the delay follows a logged flow, what arrives at t left at s with the same volume between: the flow's integral from s to t
    is `delay` times the largest flow logged.
    """

    id = "transport_delay"
    summary = "nothing happens for a while, then the rise begins"
    equation = "reading(t) = T(t - delay), T(0) before; with a flow q: the integral of q over the delay is the volume between"
    tell_tale = "flat, then a corner"
    mistaken_for = ("sensor_lag",)
    separate = "read faster in the first ten minutes; if the machine was started later than the record, say --start MIN"
    reference = "pure dead time, e.g. Ljung, System Identification, ch. 4"
    scope = "sensor"
    places = (6.0, 0.0)
    advice = "if the machine was started later than the record, say --start MIN"
    amplitude = "delay"
    parameters = (
        Parameter(
            "delay",
            "min",
            0.0,
            0.7,
            0.05,
            "dead time (at the largest flow)",
            null=0.0,
            each="sensor",
            share=True,
            typical=(0.02, 0.06),
        ),
    )

    def choices(self, run: Observations) -> Sequence[Choice]:
        found = [Choice("", {"column": ""})]
        flows = [(n, c) for n, c in tried_columns(run).items() if float(c.min()) >= 0.0]
        return [*found, *(Choice(n, {"column": n, "scale": float(c.max())}, simple=False) for n, c in flows)]

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        column = getattr(p, "column", "")
        if not column:
            drive.delay = drive.delay + p.delay
            return
        share = run.inputs[column] / p.scale
        passed = np.concatenate([[0.0], np.cumsum(0.5 * (share[1:] + share[:-1]) * np.diff(run.time))])
        drive.delay = drive.delay + run.time - np.interp(passed - p.delay, passed, run.time)

    def large_starts(self) -> tuple[float, ...]:
        return 0.004, 0.015, 0.04, 0.1, 0.25
