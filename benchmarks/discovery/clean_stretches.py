"""How often ``compare`` shows a failing stretch where nothing fails: ``python -m benchmarks.discovery.clean_stretches [RECORDS]``.

Clean records of the base law (as in benchmarks.discovery.false_alarms, unrounded), fitted and compared as the command does; and
white residuals against the adaptive threshold alone, beside what Student's t says of it.
"""

import math
import sys

import numpy as np
from scipy.special import stdtr

from thermofast.discovery.stretches import DEVIATIONS, IN_A_ROW, WINDOW, failing_stretches
from thermofast.models.joint import fit_model
from thermofast.models.noise.threshold import adaptive_threshold

from .false_alarms import record


def false_alarm_rate(window: int, deviations: float) -> float:
    """Share of white Gaussian residuals outside :func:`adaptive_threshold` with an open guard: a tail of Student's t.

    A reading and the mean of the `window` before it differ with 1 + 1 / window times the variance of one. A guard far outside
    the limits adds little: its readings are rare.
    """
    return 2.0 * float(stdtr(window - 1, -deviations / math.sqrt(1.0 + 1.0 / window)))


def stretches(seed: int) -> tuple[int, int]:
    """(sensors with a stretch, sensors) of one clean record."""
    run = record(2 * seed)
    fit = fit_model(run)
    found = [
        bool(failing_stretches(run.time, fit.residual[i], run.weight[i], float(run.noise[i]), fit.curve_deviation(i)))
        for i in range(run.sensors)
    ]
    return sum(found), len(found)


def main(records: int = 300) -> None:
    """Print both counts."""
    told = np.array([stretches(seed) for seed in range(records)])
    sensors, count = told[:, 0].sum(), (told[:, 0] > 0).sum()
    print(f"{sensors} of {told[:, 1].sum()} clean sensors show a failing stretch ({count} of {records} records)\n")
    residual = np.random.default_rng(1).standard_normal(20_000)
    print("| deviations | single readings outside, counted | by Student's t | runs of 3 in 20,000 |")
    print("| ---: | ---: | ---: | ---: |")
    for deviations in (2.0, DEVIATIONS, 4.0):
        low, high = adaptive_threshold(residual, WINDOW, deviations, guard=np.inf)
        outside = np.array([residual > high, residual < low])
        runs = sum(int((np.convolve(side, np.ones(IN_A_ROW), "valid") == IN_A_ROW).sum()) for side in outside)
        print(f"| {deviations:g} | {outside.any(axis=0).mean():.5f} | {false_alarm_rate(WINDOW, deviations):.5f} | {runs} |")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
