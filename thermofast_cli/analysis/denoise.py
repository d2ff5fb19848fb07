"""``compare --denoise``: a record without its sensors' noise, where a test says that it is the sensors' and not the machine's."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thermofast.models.joint import RATE, Fit
from thermofast.models.noise.denoise import smoothed
from thermofast.models.noise.residual_noise import FEWEST, NoiseModel, stationarity
from thermofast.models.search.rules import RULES

from ..discovery.colour import Colour

Array = NDArray[np.float64]

#: Two-sided 95 % point of the normal distribution.
NORMAL_95 = 1.959964
MISFIT = "not denoised: what the model leaves is not the sensor's noise alone; diagnose looks for what is missing"
WALKS = "not denoised: what the model leaves walks: it is stationary only once differenced"
SHORT = f"not denoised: fewer than {FEWEST} readings say nothing of the noise's colour"


@dataclass(frozen=True)
class Denoised:
    """A run without its sensors' noise: time (N,) [min] and, by sensor, temperature and its band's ends (N,) [degC]."""

    run: str
    time: Array
    sensors: dict[str, tuple[Array, Array, Array]] = field(default_factory=dict)

    @property
    def columns(self) -> dict[str, Array]:
        """As columns of a record."""
        found = {"time_min": self.time}
        for channel, three in self.sensors.items():
            found |= {f"{channel}{end}": values for end, values in zip(("", "_lo", "_hi"), three, strict=True)}
        return found


def denoised(fit: Fit, sensor: int, colour: Colour, whiteness_p: float) -> tuple[tuple[Array, Array, Array] | None, str]:
    """(temperature, low, high) (N,) [degC] of a sensor fitted to all of its readings; None, and why, where it is left as it is."""
    used, weight = fit.run.used[sensor], fit.run.weight[sensor]
    residual = np.where(used, fit.residual[sensor], np.nan)
    if used.sum() < FEWEST:
        return None, SHORT
    white = whiteness_p >= RULES.pattern and not colour.cycles
    if not (white or (colour.short and colour.whitened_p >= RULES.pattern)):
        return None, MISFIT
    at = np.arange(len(residual))
    if float(np.nanstd(residual)) > 0.0 and not stationarity(np.interp(at, at[used], residual[used])).stationary:
        return None, WALKS
    usual = float(np.median(weight[used]))
    size = float(fit.noise[sensor]) ** 2 / usual
    noise = colour.model if colour.model is not None and not white else NoiseModel(np.zeros(0), np.zeros(0), size)
    if colour.model is not None and not white:
        noise = NoiseModel(noise.phi, noise.theta, noise.innovation_variance / usual)
    decay = math.exp(-float(fit.values[RATE][sensor]) * fit.run.step)
    deviation, spread = smoothed(residual, np.where(used, weight / usual, 1.0), noise, decay)
    unsure = fit.curve_deviation(sensor) * math.sqrt(max(1.0, colour.long_run_factor))
    half = NORMAL_95 * np.hypot(spread, unsure)
    estimate = fit.curve[sensor] + deviation
    return (estimate, estimate - half, estimate + half), ""
