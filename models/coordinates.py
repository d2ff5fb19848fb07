"""What a joint fit searches: the parameters of the model, the amplitudes of coloured noise, and what is known of them before."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .core.kernel import Array
from .greybox import Model
from .noise.discrepancy import Columns


@dataclass(frozen=True)
class Prior:
    """What is known of the parameters before the fit, in search coordinates: means like the parameters, and the inverse of
    their covariance, per sensor local_precision (S, kl, kl) and shared_precision (ks, ks); 0 where nothing is known.

    before (S, kl + ks, kl + ks): the covariance of each sensor's own and the shared together, which a fit does not use; 0 as above.
    """

    local: Array
    local_precision: Array
    shared: Array
    shared_precision: Array
    before: Array | None = None

    @classmethod
    def nothing(cls, sensors: int, kl: int, ks: int) -> "Prior":
        """Nothing is known."""
        return cls(np.zeros((sensors, kl)), np.zeros((sensors, kl, kl)), np.zeros(ks), np.zeros((ks, ks)))

    def times(self, factor: float) -> "Prior":
        """As much as if errors of the readings were so many times as large."""
        return replace(self, local_precision=factor**2 * self.local_precision, shared_precision=factor**2 * self.shared_precision)

    def cost(self, local: Array, shared: Array) -> Array:
        """Squared distances from what is known (S,), the shared part spread evenly."""
        off, off_shared = local - self.local, shared - self.shared
        own = np.einsum("si,sij,sj->s", off, self.local_precision, off)
        return np.asarray(own + float(off_shared @ self.shared_precision @ off_shared) / len(local))


class SearchSpace:
    """The coordinates that a search moves: those of the model and, beside them, the amplitudes of the noise's columns."""

    def __init__(self, model: Model, columns: Columns | None, prior: Prior | None) -> None:
        n = model.run.sensors
        self.model, self.columns = model, columns or Columns.none(n, len(model.run.time))
        own, shared = len(self.columns.own), len(self.columns.shared)
        self.kl, self.ks = len(model.local), len(model.shared)
        self.active = np.concatenate([model.active, np.ones((n, own), dtype=bool)], axis=1)
        wide, wide_shared = np.full(own, np.inf), np.full(shared, np.inf)
        self.low_local, self.high_local = np.append(model.low_local, -wide), np.append(model.high_local, wide)
        self.low_shared, self.high_shared = np.append(model.low_shared, -wide_shared), np.append(model.high_shared, wide_shared)
        self.prior = prior
        if columns is not None:
            told = prior or Prior.nothing(n, self.kl, self.ks)
            self.prior = Prior(
                np.pad(told.local, ((0, 0), (0, own))),
                np.array([_beside(p, own) for p in told.local_precision]),
                np.pad(told.shared, (0, shared)),
                _beside(told.shared_precision, shared),
            )

    def joined(self, local: Array, shared: Array, own: Array | None, amplitudes: Array | None) -> tuple[Array, Array]:
        """Parameters with amplitudes (0 where none are told) behind them."""
        rows, m, k = len(local), len(self.columns.own), len(self.columns.shared)
        own = np.zeros((rows, m)) if own is None else own
        amplitudes = np.zeros(k) if amplitudes is None else amplitudes
        return np.concatenate([local, own], axis=1), np.concatenate([shared, amplitudes])

    def curve(self, local: Array, shared: Array, sensor: Any) -> tuple[Array, Array | float]:
        """Model (R, N) and disturbance (R, N), or 0."""
        common = np.broadcast_to(shared[: self.ks], (len(local), self.ks))
        curve = self.model.forward(local[:, : self.kl], common, sensor)
        if not len(self.columns.own) and not len(self.columns.shared):
            return curve, 0.0
        own, all_ = self.columns.own[:, sensor], self.columns.shared[:, sensor]
        return curve, np.einsum("rm,mrn->rn", local[:, self.kl :], own) + np.einsum("k,krn->rn", shared[self.ks :], all_)

    def slopes(self, local: Array, shared: Array, sensor: Any, curve: Array, by_shared: bool = True) -> tuple[Array, Array]:
        """Derivatives by all local (a, R, N) and by all shared (b, R, N) coordinates, where the model is `curve` (R, N).

        Without `by_shared` those by parameters of the model that sensors share are not worked out, but 0.
        """
        common = np.broadcast_to(shared[: self.ks], (len(local), self.ks))
        _, of_own, of_all = self.model.with_jacobian(local[:, : self.kl], common, sensor, curve, by_shared)
        if not len(self.columns.own) and not len(self.columns.shared):
            return of_own, of_all
        own, all_ = self.columns.own[:, sensor], self.columns.shared[:, sensor]
        return np.concatenate([of_own, own]), np.concatenate([of_all, all_])


def _beside(precision: Array, more: int) -> Array:
    """A precision with that of `more` standard normal amplitudes beside it."""
    size = len(precision)
    whole = np.eye(size + more)
    whole[:size, :size] = precision
    return whole
