"""``room_step``: the surroundings of all sensors change at once."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..drive import Drive
from ..observations import Observations
from .base import Choice, Effect, Parameter

#: Sensors whose rises differ by less than this share are warmed by a room as by a load.
ALIKE = 0.2


def rise_alike(run: Observations) -> bool:
    """Whether the sensors of a run rise so much alike that a room moves them as their load does; one alone does."""
    rise = run.moved[run.used.any(axis=1)]
    return not len(rise) or not rise.max() > (1.0 + ALIKE) * rise.min()


class RoomStep(Effect):
    """The temperature of the surroundings steps at an unknown time, where nobody logs it."""

    id = "room_step"
    summary = "the room becomes warmer or colder: a door, the heating, the weekend"
    equation = "sink(t) = sink + step after event"
    tell_tale = "kink at the event, then every sensor goes to its old steady state and as many kelvin more, each with its own b"
    mistaken_for = ("load_step", "cooling_switch")
    needs = "two sensors of different rises or more, and no logged room"
    separate = "log the room"
    reference = "ISO 230-3, environmental temperature variation error; step response of a lump, Incropera ch. 5"
    event = "event"
    places = (30.0, 0.0)
    amplitude = moves_room = "step"
    parameters = (
        Parameter("step", "K", -40.0, 40.0, 1.0, "change of the surroundings", null=0.0, belongs="run", typical=(0.5, 3.0)),
        Parameter("event", "min", 0.0, 1.0, 0.5, "time of the change", belongs="run", share=True, typical=(0.3, 0.6)),
    )

    def choices(self, run: Observations) -> Sequence[Choice]:
        return () if run.ambient or rise_alike(run) else (Choice(),)

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        drive.sink = drive.sink + p.step * run.after(p.event)

    def response(
        self, points: list[dict[str, float]], run: Observations, rate: NDArray[np.float64], rise: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        since = np.maximum(run.time - np.array([point["event"] for point in points])[:, None], 0.0)
        found: NDArray[np.float64] = -np.expm1(-rate[:, None, None] * since)
        return found
