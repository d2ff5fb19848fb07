"""Heat capacity and thermal resistance of a machine whose logged drive is a power in watts."""

import math
import re
from dataclasses import dataclass

import numpy as np

from thermofast.models import Observations
from thermofast.models.greybox import SINK
from thermofast.models.joint import LEVEL, RATE, Fit, Key

#: Names of columns that are a power: 'power_w', 'P [kW]', 'heater (W)'.
WATTS = re.compile(r"(?:^|[\s_\[(])(?P<kilo>k?)w[\])]?$", re.IGNORECASE)
MOST_DEVIATION = 2.0


@dataclass(frozen=True)
class Constants:
    """Heat capacity C [J/K] and resistance R [K/W] to the surroundings, as one sensor sees them, with their 95 % intervals.

    to_all: R is to all that heat can leave to, parts of the machine that nobody measures too; what they give back is unknown heat.
    """

    capacity: tuple[float, float, float]
    resistance: tuple[float, float, float]
    to_all: bool = False

    def as_columns(self) -> dict[str, float]:
        """As a record has them."""
        names = ("heat_capacity_j_per_k", "heat_capacity_lo_j_per_k", "heat_capacity_hi_j_per_k")
        others = ("resistance_k_per_w", "resistance_lo_k_per_w", "resistance_hi_k_per_w")
        return dict(zip((*names, *others), (*self.capacity, *self.resistance), strict=True))

    def in_words(self) -> str:
        """'heat capacity 812 J/K (780 to 845), resistance 0.42 K/W (0.41 to 0.43)'."""
        c, r = (f"{v:.4g} {u} ({lo:.4g} to {hi:.4g})" for u, (v, lo, hi) in zip(("J/K", "K/W"), self._both, strict=True))
        to = "all around it, unmeasured parts of the machine too," if self.to_all else "the surroundings"
        return f"heat capacity {c}, resistance to {to} {r}"

    @property
    def _both(self) -> tuple[tuple[float, float, float], ...]:
        return self.capacity, self.resistance


def watts(column: str) -> float | None:
    """Watts in a unit of a column, from its name; None where it names no power."""
    found = WATTS.search(column.strip())
    return None if found is None else 1000.0 if found["kilo"] else 1.0


def unit_watts(run: Observations) -> float | None:
    """The power [W] that a heat of 1 is in a run; None where its drive's name tells no power."""
    unit = watts(run.drive) if run.drive else None
    return None if unit is None else unit * run.heat_unit


def thermal_constants(fit: Fit, sensor: int, most: float, wider: float) -> Constants | None:
    """C and R of one sensor from a fit whose heat of 1 is a power of `most` [W]; None where they are not determined.

    The law b = 1 / (R C) and level - sink = R P. wider multiplies the standard errors, which are those under white noise.
    """
    model, values = fit.model, fit.values
    sink_key = Key(-1, SINK.name)
    sink = float(values[sink_key]) if sink_key in values else model.sink_guess
    rate, rise = float(values[RATE][sensor]), float(values[LEVEL][sensor]) - sink
    if not (rise > 0.0 and rate > 0.0 and most > 0.0):
        return None
    slopes = np.zeros((2, len(model.local) + len(model.shared)))  # logarithms of R and C by the search coordinates
    slopes[0, model.column(LEVEL)] = 1.0 / rise
    for j, c in enumerate(model.shared):
        if c.key == sink_key:
            slopes[0, len(model.local) + j] = -1.0 / rise
    slopes[1] = -slopes[0]
    slopes[1, model.column(RATE)] = -1.0
    deviations = wider * np.sqrt(np.diag(slopes @ fit.joint_covariance(sensor) @ slopes.T))
    if not np.all(deviations < MOST_DEVIATION):
        return None
    resistance = rise / most
    centre = resistance, 60.0 / (rate * resistance)
    bounds = [(v, v * math.exp(-1.96 * d), v * math.exp(1.96 * d)) for v, d in zip(centre, deviations, strict=True)]
    return Constants(bounds[1], bounds[0])
