"""An independent simulator: scipy's stiff solver on the differential equation, sharing no line with the product."""

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]


def lump(
    time: Array, rate: float, rise: float, initial: float, sink: float = 17.9, ramp: float = 0.0, ramp_from: float = 0.0
) -> Array:
    """Temperatures (n,) of one lump at times (n,) [min]: dT/dt = rate (sink(t) + rise - T), sink rising by ramp [K/min]."""

    def slope(t: float, temperature: Array) -> Array:
        surroundings = sink + ramp * max(0.0, t - ramp_from)
        return rate * (surroundings + rise - temperature)

    solved = solve_ivp(slope, (time[0], time[-1]), [initial], "LSODA", time, rtol=1e-10, atol=1e-10, max_step=5.0)
    result: Array = solved.y[0]
    return result


def spindle(rng: np.random.Generator, minutes: float = 400.0, noise: float = 0.02, step_min: float = 1.0) -> tuple[Array, Array]:
    """The paper's sensor 5 with probe noise: (times, readings)."""
    time = np.arange(0.0, minutes + step_min / 2, step_min)
    return time, lump(time, 0.01536, 8.8, 17.9) + noise * rng.standard_normal(len(time))


def held_response(heat, rate, step=1.0, start=20.0):
    """Exact readings [degC] of a lump whose heat (n,) [K/min] is held from one reading to the next, `step` min apart."""
    reading = np.full(len(heat), start)
    for k in range(1, len(heat)):
        end = start + heat[k - 1] / rate
        reading[k] = end + (reading[k - 1] - end) * np.exp(-rate * step)
    return reading
