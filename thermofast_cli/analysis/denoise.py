"""``compare --denoise``: a record without its sensors' noise, where that explains all that is not smooth."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thermofast.models.joint import RATE, Fit
from thermofast.models.noise.denoise import smoothed
from thermofast.models.noise.whiteness import pattern_p_value
from thermofast.models.search.rules import RULES

from ..errors import UsageError

Array = NDArray[np.float64]

#: Two-sided 95 % point of the normal distribution.
NORMAL_95 = 1.959964
#: A machine's smooth deviation beside short noise leaves no innovation this far out in a record of any length; a jump does.
FARTHEST = 5.5
#: How much likelier than before the readings may have made the longest memory that counts as noise: beyond, the noise may be the
#: machine's.
MOST_LONGEST = 3.0
#: Noise over the logger's step from which rounding is one more noise, independent of it: half a step (Widrow & Kollar 2008).
LEAST_NOISE = 0.5
#: What a fit leaves of a record by rounding alone, over its range.
ROUNDING = 1e-9
MISFIT = "not denoised: noise beside a smooth deviation does not explain what the model leaves; diagnose looks for what is missing"
JUMPS = "not denoised: what the model leaves jumps; diagnose looks for what is missing"
LONG = "not denoised: what the model leaves remembers too long to be a sensor's noise, and changes too fast to be the machine's"
EXACT = "not denoised: the readings are the model, to the last digit: there is no noise"
STEPS = "not denoised: the logger's step is more than twice the noise, and what it rounds away is not noise"


@dataclass(frozen=True)
class Denoised:
    """A run without its sensors' noise: time (N,) [min] and, by sensor, temperature and its band's ends (N,) [degC].

    logged (N,): what stands beside the sensors, as it was read.
    """

    run: str
    time: Array
    logged: dict[str, Array] = field(default_factory=dict)
    sensors: dict[str, tuple[Array, Array, Array]] = field(default_factory=dict)

    @property
    def columns(self) -> dict[str, Array]:
        """As columns of a record.

        Raises
        ------
        UsageError: a sensor has the name of another's band.
        """
        found = {"time_min": self.time}
        taken = next((c + end for c in self.sensors for end in ("_lo", "_hi") if c + end in self.sensors), "")
        if taken:
            raise UsageError(
                f"the band of {taken[:-3]!r} would be called as the sensor {taken!r}",
                do=f"rename it: --rename '{taken}=another name'",
            )
        for channel, three in self.sensors.items():
            found |= {f"{channel}{end}": values for end, values in zip(("", "_lo", "_hi"), three, strict=True)}
        return found | {n: values for n, values in self.logged.items() if n not in found}


def denoised(fit: Fit, sensor: int) -> tuple[tuple[Array, Array, Array] | None, str]:
    """(temperature, low, high) (N,) [degC] of a sensor fitted to all of its readings; None, and why, where it is left as it is."""
    used, weight = fit.run.used[sensor], fit.run.weight[sensor]
    residual = np.where(used, fit.residual[sensor], np.nan)
    if float(np.nanstd(residual)) <= ROUNDING * float(np.ptp(fit.curve[sensor])):
        return None, EXACT
    tangent = np.concatenate([fit.by_local[fit.model.active[sensor], sensor], fit.by_shared[:, sensor]]).T
    # A record that hardly bends has a rate near nought, and still a length within which a deviation may bend.
    usual, rate = float(np.median(weight[used])), max(float(fit.values[RATE][sensor]), 1.0 / fit.run.span)
    parts = smoothed(fit.run.time, residual, np.where(used, weight / usual, 1.0), tangent, rate)
    if parts.noise**2 * usual < (LEAST_NOISE**2 + 1.0 / 12.0) * float(fit.run.resolution[sensor]) ** 2:
        return None, STEPS
    if np.abs(parts.innovation).max() > FARTHEST:
        return None, JUMPS
    if float(pattern_p_value(parts.innovation, parts.taken)) < RULES.pattern:
        return None, MISFIT
    if parts.longest > MOST_LONGEST:
        return None, LONG
    estimate, half = fit.curve[sensor] + parts.mean, NORMAL_95 * parts.deviation
    return (estimate, estimate - half, estimate + half), ""
