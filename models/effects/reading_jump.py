"""``reading_jump``: the probe slips or is touched."""

from typing import Any

import numpy as np

from ..core.kernel import Array
from ..drive import Drive
from ..observations import Observations
from .base import Choice, Effect, Parameter


class ReadingJump(Effect):
    """The reading of one sensor steps within one reading."""

    id = "reading_jump"
    summary = "the probe slips or is touched"
    equation = "reading = T + jump after event"
    tell_tale = "step within one reading, in one sensor only, b unchanged"
    mistaken_for = ("load_step",)
    separate = "fix the probe and look whether it happens again"
    reference = "level shift, e.g. Chen & Liu 1993, JASA 88"
    scope = "one"
    event = "event"
    places = (2.0, 1.0)
    amplitude = "jump"
    parameters = (
        Parameter("jump", "K", -60.0, 60.0, 0.1, "size of the step", null=0.0, belongs="run", each="sensor", typical=(0.3, 0.8)),
        Parameter("event", "min", 0.0, 1.0, 0.5, "time of the step", belongs="run", each="sensor", share=True, typical=(0.3, 0.7)),
    )

    def grid(self, run: Observations, choice: Choice) -> list[dict[str, float]]:
        """Every interval between readings that are used."""
        time = run.time[: run.last + 1]
        every = max(1, len(time) // 600)
        return [{"event": float(t)} for t in 0.5 * (time[2:-2:every] + time[1:-3:every])]

    def response(self, points: list[dict[str, float]], run: Observations, rate: Array, rise: Array) -> Array:
        return run.after(np.array([[p["event"]] for p in points]))[None]

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        drive.offset = drive.offset + p.jump * run.after(p.event)
