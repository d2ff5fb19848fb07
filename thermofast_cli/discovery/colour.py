"""The colour of a residual: is it the sensor's noise, smoothed by its logger, or a misfit of the model?"""

import math
from dataclasses import dataclass

import numpy as np

from thermofast.models.core.kernel import Array
from thermofast.models.joint import RATE, Fit
from thermofast.models.noise.residual_noise import NoiseModel, long_run_factor, select_arma, whitened
from thermofast.models.noise.whiteness import pattern_p_value
from thermofast.models.search.rules import RULES

from ..errors import rounded

#: Above this p value a residual is taken for white and no model of its colour is looked for.
PLAIN = 0.05
#: Noise of a sensor and its logger has died away within this share of the lump's time constant; slower is a misfit.
SHORT = 0.1
#: Autocorrelation at which it has died away.
DIED = 0.1
#: A logger's smoothing makes neighbours alike; an autocorrelation below this is a cycle.
SWINGS = -0.2
FEWEST = 60
#: Orders that are tried: larger ones win by roots at the edge of stability.
MOST_AR, MOST_MA = 2, 1


@dataclass(frozen=True)
class Colour:
    """Colour of one sensor's residual: ARMA order in words, whether it is short enough to be noise, p value of what is left white.

    A residual whitened by a model of itself says whether that order is enough, not whether the physics is right: a misfit would
    be whitened too. That is why only a colour that dies away quickly is taken for the sensor's.

    long_run_factor is that by which errors of slow parameters are larger in variance than under white noise.
    """

    order: str = "white"
    short: bool = False
    whitened_p: float = math.nan
    long_run_factor: float = 1.0
    cycles: bool = False
    words: str = ""
    model: NoiseModel | None = None


def colour_of(fit: Fit, sensor: int, whiteness_p: float, own: Array | None = None) -> Colour:
    """Colour of a sensor's residual where it does not look white; whiteness_p is its p value under white noise.

    own (N,) [K] are the residuals where they are known better than the fit tells them.
    """
    used = fit.run.used[sensor]
    if int(used.sum()) < FEWEST:
        return Colour()
    residual = np.where(used, fit.unrounded[sensor] if own is None else own, np.nan)
    span = slice(*(np.flatnonzero(used)[[0, -1]] + [0, 1]))
    series, weight = residual[span], np.sqrt(fit.run.weight[sensor][span])
    if whiteness_p >= RULES.pattern:
        line = spectral_line(np.nan_to_num(series * weight))
        if line[0] < RULES.pattern:
            period = line[1] * fit.run.step
            return Colour(cycles=True, words=f"the residual holds a cycle of about {period:.3g} min: see the effect cyclic_load")
    if whiteness_p >= PLAIN:
        return Colour()
    if not float(np.nanstd(series)) > 0.0:
        return Colour()
    model = select_arma(series * weight, MOST_AR, MOST_MA)
    p, q = model.order
    if p + q == 0:
        return Colour()
    lasts = _dies_after(model, len(series)) * fit.run.step
    length = float(np.ptp(fit.run.time[used]))
    # Of a record that a fit has no shape for, the rate says nothing: no noise lasts a tenth of what was seen.
    short = lasts <= SHORT * min(1.0 / float(fit.values[RATE][sensor]), length)
    name = f"ARMA({p},{q})"
    lowest = model.autocovariance(max(2, len(series) // 2))
    if float(lowest.min()) < SWINGS * lowest[0] and int(np.argmin(lowest)) > 1:
        period = 2.0 * int(np.argmin(lowest)) * fit.run.step
        if 2.0 * period > length:  # less than two of them were seen
            return Colour(name, False, words=f"the residual's pattern lasts {lasts:.3g} min: a misfit, not noise")
        return Colour(name, False, words=f"the residual swings with a period of about {rounded(period)} min: a cycle, not noise")
    if not short:
        return Colour(name, False, words=f"the residual's pattern lasts {lasts:.3g} min: a misfit, not noise")
    tangent = np.concatenate([fit.by_local[:, sensor], fit.by_shared[:, sensor]]).T[span]
    tangent = np.where(np.isfinite(series)[:, None], tangent, np.nan)
    white = whitened(series * weight, model)
    columns = whitened(tangent[:, np.abs(np.nan_to_num(tangent)).max(axis=0) > 0.0] * weight[:, None], model)
    good = np.isfinite(white)
    factor = float(long_run_factor(series * weight))
    times = math.sqrt(factor)
    told = (
        f"the noise is {name}, gone after {lasts:.3g} min: slow parameters err {rounded(times)} times as much as under white noise"
    )
    return Colour(name, True, pattern_p_value(white[good], columns[good]), factor, words=told, model=model)


def spectral_line(series: Array) -> tuple[float, float]:
    """Chance that white noise (n,) would have so high a line in its spectrum, and that line's period in readings.

    Fisher's g test of the largest ordinate of the periodogram (Fisher 1929, Proc. R. Soc. A 125), to first order.
    """
    # The frequency of every other reading, which an even number has, is no pair of sine and cosine.
    power = np.abs(np.fft.rfft(series - series.mean()))[1 : (len(series) + 1) // 2] ** 2
    total = float(power.sum())
    if len(power) < 8 or not total > 0.0:
        return 1.0, math.inf
    highest = int(np.argmax(power))
    share = float(power[highest]) / total
    return min(1.0, len(power) * (1.0 - share) ** (len(power) - 1)), len(series) / (highest + 1)


def _dies_after(model: NoiseModel, readings: int) -> int:
    """Readings after which the autocorrelation stays below DIED."""
    covariance = model.autocovariance(max(2, readings // 2))
    beyond = np.flatnonzero(np.abs(covariance) > DIED * covariance[0])
    return int(beyond[-1]) + 1
