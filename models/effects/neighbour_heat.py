"""``neighbour_heat``: another measured part warms this one."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..drive import Drive
from ..observations import Observations
from .base import Choice, Effect, Parameter


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
    amplitude = "kappa"
    parameters = (Parameter("kappa", "1/min", 0.0, 2.0, 0.01, "coupling to the neighbour", null=0.0, each="sensor", fastest=2.0),)

    def choices(self, run: Observations) -> Sequence[Choice]:
        n = run.sensors
        if n < 2 or n > 40:
            return ()
        return [Choice(f"+{d}", {"source": (np.arange(n) + d) % n}) for d in range(1, n)]

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        source = np.asarray(p.source)[drive.sensor]
        drive.links.append((p.kappa, run_filled(run)[source]))


def run_filled(run: Observations) -> Any:
    """Readings (S, N) [degC] with holes filled by straight lines."""
    held = run.__dict__.get("_filled")
    if held is None:
        held = np.array(run.reading)
        for row in held:
            bad = ~np.isfinite(row)
            if bad.any() and not bad.all():
                row[bad] = np.interp(run.time[bad], run.time[~bad], row[~bad])
        run.__dict__["_filled"] = held
    return held
