"""How far the parameters of a joint fit are off by what a machine does beside its effects, which its residuals hardly show.

A room that wanders and a load that flutters are taken up by the parameters as far as these can imitate them: what is left is small,
and an error that is told from it alone far too small. The usual disturbance (the background of ``TYPICAL``) is sent through the
fit's own linear equations, shape by shape, and sized by what the fit left of the readings against what it would have left of it.
"""

from typing import Any

import numpy as np

from ..core.kernel import Array
from ..imperfection.prior import TYPICAL
from ..imperfection.shapes import LOAD_MEMORY, UNLOGGED
from ..joint import RATE, Fit, Key
from ..noise.discrepancy import Flutter, Noise, RandomWalk
from ..search.dominant import misfit

#: Sizes of the disturbance against the usual one that are thought of, whatever is left.
LEAST, MOST = 0.1, 3.0


def disturbed_deviations(fit: Fit, around: Fit | None = None) -> dict[Key, Any]:
    """Standard deviations in search coordinates by (part, name), as :attr:`Fit.deviations`, that a disturbance adds to those.

    around is a fit with more effects that leaves no pattern: what `fit` has may be as far off as it is from what that has.
    """
    run, rate = fit.run, fit.values[RATE]
    tau = float(np.median(1.0 / rate))
    usual = TYPICAL.background
    room = usual.room / np.sqrt(tau / 60.0) * (UNLOGGED if run.ambient else 1.0)
    processes = RandomWalk(room), Flutter(usual.load, memory=LOAD_MEMORY * tau / 60.0)
    shapes = Noise(processes).columns(run.time - run.time[0], rate, np.ptp(fit.curve, axis=1)).shared
    own, shared = _taken_up(fit, shapes)
    left = shapes - np.einsum("jsn,ksj->ksn", fit.by_local, own) - np.einsum("jsn,kj->ksn", fit.by_shared, shared)
    used = run.used
    expected = float(np.sqrt(((left**2).sum(axis=0) * used).sum() / used.sum()))
    remains = float(np.sqrt((misfit(fit) ** 2 * fit.readings).sum() / fit.readings.sum()))
    size = float(np.clip(remains / max(expected, 1e-12), LEAST, MOST))
    of_own, of_shared = (size * np.sqrt((moved**2).sum(axis=0)) for moved in (own, shared))
    found: dict[Key, Any] = {c.key: of_own[:, j] for j, c in enumerate(fit.model.local)}
    found |= {c.key: float(of_shared[j]) for j, c in enumerate(fit.model.shared)}
    return found if around is None else {key: np.hypot(value, _apart(fit, around, key)) for key, value in found.items()}


def _apart(fit: Fit, around: Fit, key: Key) -> Any:
    """How far the values of a fit's effect are from those that a fit with more effects has, in search coordinates."""
    ids = [p.id for p in around.model.parts]
    if key.part < 0 or fit.model.parts[key.part].id not in ids:
        return 0.0
    one, other = fit.values[key], around.values.get(Key(ids.index(fit.model.parts[key.part].id), key.name))
    column = next(c for c in (*fit.model.local, *fit.model.shared) if c.key == key)
    if other is None or column.parameter.periodic:
        return 0.0
    if not column.parameter.log:
        return np.abs(np.asarray(other) - one)
    with np.errstate(all="ignore"):  # a sensor that does not have it, here or there, is not apart
        return np.nan_to_num(np.abs(np.log(np.asarray(other) / one)), nan=0.0, posinf=0.0)


def _taken_up(fit: Fit, shapes: Array) -> tuple[Array, Array]:
    """Changes of the parameters, own (k, S, a) and shared (k, b), with which a fit follows shapes (k, S, N) [K] to first order."""
    weight = fit.run.weight / fit.noise[:, None] ** 2
    local, common, cross = (np.nan_to_num(c, posinf=0.0, neginf=0.0) for c in fit.covariance)
    by_own = np.einsum("jsn,ksn->ksj", fit.by_local, shapes * weight)
    by_common = np.einsum("jsn,ksn->kj", fit.by_shared, shapes * weight)
    moved = np.einsum("sab,ksa->kb", cross, by_own) + by_common @ common
    through = cross @ np.linalg.pinv(common) if common.size else cross
    # Sensors move each other through what they share: all of that is in `moved`, a sensor's own share of it counted once.
    alone = local - np.einsum("sab,scb->sac", through, cross)
    own = np.einsum("sab,ksb->ksa", alone, by_own) + np.einsum("sab,kb->ksa", through, moved)
    return own, moved
