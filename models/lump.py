"""One sensor as one lump: dT/dt = rate (T_inf - T), heating and cooling in one law.

The state is (temperature, slope, rate) with slope = dT/dt. From an early stretch of a rise only the temperature and its slope
are known, and the rate and the steady state lie on a curved ridge; in these coordinates the step is nearly linear
in what is not yet known, in the paper's (T, b, T_inf) it is not. T_inf = T + slope / rate.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .core import kernel
from .core.kernel import Array
from .decay import DecayFit, Interval, start_rule

_NODES = np.linspace(-4.5, 4.5, 91)
_DENSITY = np.exp(-0.5 * _NODES**2) / np.exp(-0.5 * _NODES**2).sum()
#: weight of (deviation of the steady state given the rate, rate)
_MIXTURE = np.outer(_DENSITY, _DENSITY)


@dataclass(frozen=True)
class LumpStart:
    """Start of a filter; the fields of :class:`filters.base.Start`."""

    index: int
    state: Array
    covariance: Array
    noise_variance: float
    dof: float
    weights: Array
    settled: bool


@dataclass(frozen=True)
class LumpStarts:
    """Starts of S filters; the fields of :class:`filters.base.Starts`."""

    index: NDArray[np.intp]
    state: Array
    covariance: Array
    noise_variance: Array
    dof: Array
    weights: Array
    settled: NDArray[np.bool_]


@dataclass(frozen=True)
class Capsules:
    """Compiled steps for a compiled filter loop; the fields of :class:`filters.base.Compiled`."""

    step: Any
    jacobian: Any
    steps: Any = None


@dataclass(frozen=True)
class Lump:
    """The base model in the coordinates (temperature degC, slope K/min, rate 1/min)."""

    state_names = ("temperature_c", "slope_c_per_min", "rate_per_min")

    @property
    def compiled(self) -> Capsules | None:
        return Capsules(kernel.SLOPE_STEP, kernel.SLOPE_JACOBIAN, kernel.SLOPE_STEPS) if kernel.COMPILED else None

    def step(self, state: Array, dt: float) -> Array:
        """States (..., 3) one interval of dt minutes on."""
        rate = np.clip(state[..., 2], -40.0 / dt, 1e3 / dt) if dt > 0 else state[..., 2]
        moved = np.empty_like(state)
        moved[..., 0] = state[..., 0] + state[..., 1] * kernel.growth(rate, dt)
        moved[..., 1] = state[..., 1] * np.exp(-rate * dt)
        moved[..., 2] = state[..., 2]
        return moved

    def jacobian(self, state: Array, dt: float) -> Array:
        """Derivative (3, 3) of the step at one state (3,)."""
        rate = float(np.clip(state[2], -40.0 / dt, 1e3 / dt)) if dt > 0 else float(state[2])
        decay = math.exp(-rate * dt)
        return np.array(
            [
                [1.0, float(kernel.growth(rate, dt)), state[1] * float(kernel.growth_slope(rate, dt))],
                [0.0, decay, -state[1] * dt * decay],
                [0.0, 0.0, 1.0],
            ]
        )

    def steady_state(self, state: Array) -> Array:
        """T_inf (...,) [degC] of states (..., 3)."""
        result: Array = state[..., 0] + state[..., 1] / state[..., 2]
        return result

    def free_run(self, state: Array, dt: Array) -> Array:
        """Temperatures (n,) at intervals dt (n,) [min] after, or before, one state (3,)."""
        run: Array = state[0] + state[1] * kernel.growth(state[2], dt)
        return run

    def curve_covariance(self, state: Array, covariance: Array) -> Array:
        """The covariance itself."""
        return covariance

    def curve_state(self, state: Array) -> Array:
        """The state itself: a free run needs (temperature, slope, rate)."""
        return state

    def deviations(self, state: Array, covariance: Array) -> Array:
        """Standard deviations (3,) of temperature, rate and steady state, the last to first order."""
        with np.errstate(all="ignore"):
            by_state = np.array([1.0, 1.0 / state[2], -state[1] / state[2] ** 2])
            variances = [covariance[0, 0], covariance[2, 2], by_state @ covariance @ by_state]
            result: Array = np.sqrt(np.maximum(variances, 0.0))
            return result

    def intervals(self, state: Array, covariance: Array, quantile: float) -> tuple[Interval, Interval]:
        """Intervals of the steady state and of the rate from a Gaussian state (3,), covariance (3, 3) [K^2 and so on].

        Given the rate the steady state is Gaussian; the mixture over the rate is taken on a grid, so that the
        long upper side of a short record shows. quantile is that of the interval's half-width, 1.96 for 95 %.
        """
        rate, spread = float(state[2]), math.sqrt(max(float(covariance[2, 2]), 0.0))
        rates = Interval(
            rate - quantile * spread if rate - quantile * spread > 0.0 else None,
            rate + quantile * spread if rate > 0.0 else None,
        )
        with np.errstate(all="ignore"):
            b = rate + quantile / 1.96 * spread * _NODES
            slope_by_rate = covariance[:2, 2] / covariance[2, 2] if covariance[2, 2] > 0.0 else np.zeros(2)
            rest = covariance[:2, :2] - np.outer(slope_by_rate, covariance[2, :2])
            means = state[:2, None] + slope_by_rate[:, None] * (b - rate)
            inverse = 1.0 / b
            variance = rest[0, 0] + 2.0 * rest[0, 1] * inverse + rest[1, 1] * inverse**2
            centre = means[0] + means[1] * inverse
            reach = quantile / 1.96 * np.sqrt(np.maximum(variance, 0.0))
            values = centre + reach * _NODES[:, None]
        never = math.inf if state[1] >= 0.0 else -math.inf  # a rate of zero or less does not settle
        values = np.where((b > 0.0) & np.isfinite(values), values, never)
        order = np.argsort(values, axis=None)
        share = np.cumsum(_MIXTURE.ravel()[order])
        low, high = values.ravel()[order][np.searchsorted(share, [0.025, 0.975])]
        return Interval(low if math.isfinite(low) else None, high if math.isfinite(high) else None), rates

    def start(self, time: Array, reading: Array, resolution: float) -> LumpStart:
        """Fit the first readings, as few as fix the rate well enough; outliers are left out.

        Depends on no reading after the index that it returns, so that a filter's state at any time is the same whether
        or not the record goes on. resolution [K] is the logger's step: its rounding is a floor of the noise.

        Raises
        ------
        ValueError: fewer than three readings at different times.
        """
        several = self.starts(time, reading[None], np.array([resolution]))
        k = int(several.index[0])
        if k < 0:
            raise ValueError(f"a start needs three readings at different times, got {len(time)}")
        return LumpStart(
            k,
            several.state[0],
            several.covariance[0],
            float(several.noise_variance[0]),
            float(several.dof[0]),
            several.weights[0, : k + 1],
            bool(several.settled[0]),
        )

    def starts(self, time: Array, reading: Array, resolution: Array) -> LumpStarts:
        """As :meth:`start` for records (S, n) on one grid time (n,); the index is -1 where there is nothing to fit."""
        rows = len(reading)
        weights, used, noise = np.ones(reading.shape), np.empty(rows, np.intp), np.full(rows, np.nan)
        settled, table = np.zeros(rows, np.uint8), np.empty(rows, kernel.FIT)
        t, y = np.ascontiguousarray(time), np.ascontiguousarray(reading)
        kernel.start_decay(t, y, np.ascontiguousarray(resolution), start_rule(), weights, used, noise, settled, table)
        fit = DecayFit.from_table(float(time[0]), table)
        mean, covariance = fit.state(time[np.maximum(used, 1) - 1])
        index = np.where(used > 0, used - 1, -1)
        return LumpStarts(index, mean, covariance, noise, np.maximum(fit.dof, 1.0), weights, settled.astype(bool))


@dataclass(frozen=True)
class PrintedLump:
    """The paper's model (37): state (temperature, rate, steady state), and its start of section 2.1."""

    state_names = ("temperature_c", "rate_per_min", "steady_state_c")
    start_state: tuple[float, float, float] = (10.0, 0.01, 30.0)
    start_variance: tuple[float, float, float] = (0.25, 0.01, 0.01)

    @property
    def compiled(self) -> Capsules | None:
        return Capsules(kernel.PRINTED_STEP, kernel.PRINTED_JACOBIAN) if kernel.COMPILED else None

    def step(self, state: Array, dt: float) -> Array:
        """States (..., 3) one interval of dt minutes on."""
        moved = state.copy()
        moved[..., 0] = state[..., 2] + (state[..., 0] - state[..., 2]) * np.exp(-state[..., 1] * dt)
        return moved

    def jacobian(self, state: Array, dt: float) -> Array:
        """Derivative (3, 3) of the step at one state (3,)."""
        decay = math.exp(-state[1] * dt)
        first = [decay, -(state[0] - state[2]) * dt * decay, 1.0 - decay]
        return np.array([first, [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])

    def curve_covariance(self, state: Array, covariance: Array) -> Array:
        """Covariance (3, 3) of (temperature, slope, rate), to first order."""
        jacobian = np.array([[1.0, 0.0, 0.0], [-state[1], state[2] - state[0], state[1]], [0.0, 1.0, 0.0]])
        result: Array = jacobian @ covariance @ jacobian.T
        return result

    def curve_state(self, state: Array) -> Array:
        """(temperature, slope, rate) of a state (temperature, rate, steady state)."""
        return np.array([state[0], state[1] * (state[2] - state[0]), state[1]])

    def deviations(self, state: Array, covariance: Array) -> Array:
        """Standard deviations (3,) of temperature, rate and steady state."""
        result: Array = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        return result

    def intervals(self, state: Array, covariance: Array, quantile: float) -> tuple[Interval, Interval]:
        """Symmetric intervals of the steady state and of the rate: what the printed filter believes of itself."""
        reach = quantile * np.sqrt(np.maximum(np.diag(covariance), 0.0))
        low = float(state[1] - reach[1])
        return (
            Interval(float(state[2] - reach[2]), float(state[2] + reach[2])),
            Interval(low if low > 0.0 else None, float(state[1] + reach[1]) if state[1] > 0.0 else None),
        )

    def start(self, time: Array, reading: Array, resolution: float) -> LumpStart:
        """The printed constants, whatever the record says."""
        state, covariance = np.array(self.start_state), np.diag(self.start_variance)
        return LumpStart(0, state, covariance, 1.0, 1.0, np.ones(1), True)

    def starts(self, time: Array, reading: Array, resolution: Array) -> None:
        """None: kept for comparison, it is not run over blocks."""
        return
