"""Logged columns that step where a model begins to fail: the first thing to look at."""

import numpy as np

from thermofast.models import Observations

#: A change of this share of a column's range between two readings is a step.
STEP_SHARE = 0.25
#: A step may precede the failing stretch by this share of the record, and follow its start by a few readings.
BEFORE_SHARE, AFTER_READINGS = 0.06, 3


def steps_near(run: Observations, begins_min: float) -> list[str]:
    """``spindle_speed steps from 2000 to 5000 at 180 min``, for each logged column that steps where a stretch begins [min]."""
    found = []
    for name, column in {**run.inputs, **run.ambient}.items():
        span = float(np.ptp(column))
        if span <= 0.0:
            continue
        at = np.flatnonzero(np.abs(np.diff(column)) > STEP_SHARE * span)
        if len(at) > 12:  # a column that jumps all the time steps nowhere in particular
            continue
        early, late = begins_min - BEFORE_SHARE * run.span, begins_min + AFTER_READINGS * run.step
        near = [k for k in at if early <= run.time[k + 1] <= late]
        if near:
            k = near[-1]
            found.append(f"{name} steps from {column[k]:.4g} to {column[k + 1]:.4g} at {run.time[k + 1]:.4g} min")
    return found
