"""``ambient``: the surroundings move."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..core import kernel
from ..drive import Drive
from ..observations import Observations
from .base import Choice, Effect, Parameter, varying


class Ambient(Effect):
    """The temperature of the surroundings follows the logged one."""

    id = "ambient"
    summary = "the surroundings move"
    equation = "sink(t) = mean + gain (A(t) - mean), A the ambient column, late by a first-order lag where needed"
    tell_tale = "follows the ambient, delayed by 1/b; alike in all sensors"
    mistaken_for = ("sensor_drift", "second_mode")
    needs = "a logged ambient column"
    separate = "log the ambient near the machine"
    reference = "Brauner et al.; ISO 230-3, environmental temperature variation error"
    logged = True
    follows_ambient = True
    places = (2.0, 0.0)
    amplitude = "gain"
    parameters = (
        Parameter(
            "gain", "K/K", 0.0, 2.0, 1.0, "share of the ambient's movement that reaches the machine", null=0.0, typical=(1.0, 1.0)
        ),
        Parameter("lag", "min", 0.2, 600.0, 20.0, "lag of the surroundings behind the column", log=True, least_steps=0.5),
    )

    def choices(self, run: Observations) -> Sequence[Choice]:
        columns = list(varying(run.ambient))[:4]
        direct = [Choice(c, {"column": c, "lag": 0.0}, ("lag",)) for c in columns]
        return direct + [Choice(f"{c}, lagged", {"column": c}, simple=False) for c in columns]

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        column = run.ambient[p.column]
        if np.any(np.asarray(p.lag) > 0.0):
            lag = np.ascontiguousarray(np.broadcast_to(p.lag, (len(drive.sensor), 1))[:, 0])
            moved = np.empty((len(lag), len(column)))
            kernel.followed(run.time, np.ascontiguousarray(column), lag, moved)
        else:
            moved = column[None, :]
        drive.sink = drive.sink + p.gain * (moved - float(np.mean(column[: run.last + 1])))

    def borrowed_noise(self, run: Observations, choice: Choice, sensor: int, rate: float, own: dict[str, float]) -> float:
        return abs(own["gain"]) * run.ambient_noise

    def large_starts(self) -> tuple[float, ...]:
        return (1.0,)
