"""Recursive least squares: the parameters of a difference equation, reading by reading."""

import math
from dataclasses import dataclass

import numpy as np

from .base import Array, Closing, Filter, StateModel, Track, setting


@dataclass
class RecursiveLeastSquares:
    """Least squares in which one reading at a time is added: Yang et al. 2014, J. Jilin Univ. (Eng.) 44(2), equations (7)-(10).

    theta (n,) is the estimate, covariance (n, n) its covariance per unit of the noise variance, forgetting in (0, 1] the
    weight that is left of a reading after the next one. With a forgetting of 1 the estimate is that of ridge regression,
    (P0^-1 + sum phi phi')^-1 (P0^-1 theta0 + sum phi y): unbiased only where the noise of the outputs among the regressors is
    that of the equation itself, biased towards 0 where it is noise of measurement.

    The paper prints the gain (9) as P phi / (1 - phi' P phi). The sign is wrong: the gain then has a pole at phi' P phi = 1, and
    beyond it, where every start from a large P0 is, it points away from the reading: the error doubles with each one. Right is
    P phi / (forgetting + phi' P phi), by the lemma of Sherman and Morrison for the inverse of P^-1 + phi phi'.

    Raises
    ------
    ValueError: shapes that do not fit, forgetting outside (0, 1].
    """

    theta: Array
    covariance: Array
    forgetting: float = 1.0

    def __post_init__(self) -> None:
        n = len(self.theta)
        if self.covariance.shape != (n, n):
            raise ValueError(f"covariance is {self.covariance.shape}, but theta of length {n} needs ({n}, {n})")
        if not 0.0 < self.forgetting <= 1.0:
            raise ValueError(f"forgetting is {self.forgetting:g}; it must be above 0 and at most 1")

    def update(self, regressor: Array, output: float) -> float:
        """Take one reading in; returns the innovation, its output less the one foretold from regressor (n,)."""
        reach = self.covariance @ regressor
        denominator = self.forgetting + float(regressor @ reach)
        innovation = output - float(regressor @ self.theta)
        self.theta = self.theta + reach * (innovation / denominator)
        # The outer product of one vector keeps the covariance symmetric to the last digit, which K phi' P does not.
        self.covariance = (self.covariance - np.outer(reach, reach) / denominator) / self.forgetting
        return innovation


def arx_regressor(outputs: Array, inputs: Array, na: int, nb: int) -> Array:
    """Regressor (na + nb,) of the next output: the last na outputs, then the last nb inputs, the latest first.

    It belongs to theta = (-a_1 .. -a_na, b_1 .. b_nb) of y_k = sum b_i u_{k-i} - sum a_i y_{k-i}: equations (6), (7).
    outputs and inputs are in order of time and end with the reading before the one to be foretold.

    Raises
    ------
    ValueError: fewer outputs than na or inputs than nb.
    """
    if len(outputs) < na or len(inputs) < nb:
        raise ValueError(f"{len(outputs)} outputs and {len(inputs)} inputs; the regressor needs {na} and {nb}")
    return np.concatenate([outputs[len(outputs) - na :][::-1], inputs[len(inputs) - nb :][::-1]])


@dataclass(frozen=True)
class Rls(Filter):
    """The lump's law integrated once is linear in its parameters: T(t) = T0 + b T_inf t - b int T dt.

    Least squares on (1, t, int T dt) needs no even sampling, unlike the difference equation. The readings' noise
    is also in the integral, where it is averaged: the estimate is biased a little, which the closing likelihood step mends. It
    weighs all readings alike: where old ones are forgotten the filter's own estimate stands.
    """

    name = "rls"
    summary = "recursive least squares on the integrated law: no start value, no linearisation"
    reference = "Yang et al. 2014, J. Jilin Univ. (Eng.) 44(2), equations (7)-(10), the sign of the gain mended"

    forgetting: float = setting(1.0, "weight left of a reading after the next one", 0.8, 1.0)
    closing_step: bool = True

    @property
    def closing(self) -> Closing:
        return "always" if self.closing_step and self.forgetting == 1.0 else "never"

    def track(self, model: StateModel, time: Array, reading: Array, resolution: float = 0.0) -> Track:
        """See :class:`filters.base.Track`; for models whose state is (temperature, slope, rate).

        Raises
        ------
        ValueError: the model's state is another one.
        """
        if len(model.state_names) != 3 or "rate" not in model.state_names[2]:
            raise ValueError(f"recursive least squares finds temperature, slope and rate, not {', '.join(model.state_names)}")
        start = model.start(time, reading, resolution)
        count = len(time)
        area = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(time) * (reading[1:] + reading[:-1]))])
        # Centred on the first reading, the three regressors differ in size by less.
        rows = np.stack([np.ones(count), time - time[0], area - reading[0] * (time - time[0])], axis=1)
        states, covariances = np.full((count, 3), np.nan), np.full((count, 3, 3), np.nan)
        variance, innovation = np.full(count, start.noise_variance), np.full(count, np.nan)
        spread = np.full(count, np.nan)
        fit = RecursiveLeastSquares(np.zeros(3), np.diag([1e6, 1e6, 1e6]), self.forgetting)
        squares, broken, seen = 0.0, None, np.zeros((3, 3))
        for k in range(count):
            # The noise of a reading that is half forgotten counts a quarter: covariance P Q P, Q of the squared weights.
            seen = self.forgetting**2 * seen + np.outer(rows[k], rows[k])
            size = 1.0 + float(rows[k] @ fit.covariance @ rows[k])
            e = fit.update(rows[k], float(reading[k] - reading[0]))
            squares += e * e / size if k >= 3 else 0.0
            if k < start.index:
                continue
            variance[k] = squares / max(k - 2, 1)
            innovation[k], spread[k] = e, size * variance[k]
            spread_of = fit.covariance if self.forgetting == 1.0 else fit.covariance @ seen @ fit.covariance
            states[k], covariances[k] = _lump_state(fit, rows[k], float(reading[0]), spread_of)
            if not np.isfinite(states[k]).all():
                broken = k
                break
        if broken is not None:
            states[broken:], covariances[broken:] = np.nan, np.nan
        one = np.ones(count)
        return Track(start.index, states, covariances, variance, innovation, spread, one, 0.0 * one, one, one, 0.0 * one, broken)


def _lump_state(fit: RecursiveLeastSquares, row: Array, first: float, covariance: Array) -> tuple[Array, Array]:
    """(temperature, slope, rate) and its covariance per unit of the noise variance from the integrated law's parameters."""
    level, drive, minus_rate = fit.theta
    temperature = float(row @ fit.theta)
    slope = float(drive + minus_rate * temperature)
    by = np.array([row, row * minus_rate + np.array([0.0, 1.0, temperature]), [0.0, 0.0, -1.0]])
    if not math.isfinite(level):
        by = np.full((3, 3), np.nan)
    return np.array([first + temperature, slope, -minus_rate]), by @ covariance @ by.T
