"""What drives a lump: the picture that an effect changes, and its run forward.

dT/dt = b [ R heat - loss g (T - sink) ] - sum kappa (T - Z) - sum kappa_k (T - T_k),   reading = probe(T) + offset
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .core import kernel
from .core.kernel import Array
from .observations import Observations, read_only

#: Hidden masses of one row, as the compiled core has room for (``core/_forward.pyx``).
MOST_HIDDEN = 16


@dataclass(slots=True)
class Drive:
    """Drive of B rows (one lump each) over N readings; an effect replaces what it changes.

    heat, loss: dimensionless, mean over the interval that ends at each reading, broadcastable to (B, N); times to take are
    ``run.middle``, and ``run.after(t)`` for a step. sink [degC], offset [K]: value at each reading, times ``run.time``.
    exponent, lag [min]: (B, 1). delay [min]: (B, 1), or (B, N) where it is another one at each reading.
    hidden: of each hidden mass (coupling (B, 1) [1/min], its rate (B, 1) [1/min]); a coupling of 0 is none.
    links: of each neighbour (coupling (B, 1) [1/min], neighbour's temperature (B or 1, N) [degC]).
    sensor (B,): the index of each row's sensor. sink_c: the surroundings' reference [degC].
    """

    sensor: Any
    sink_c: Array
    heat: Array
    loss: Array
    sink: Array
    offset: Array
    exponent: Array
    lag: Array
    delay: Array
    hidden: list[tuple[Array, Array]] = field(default_factory=list)
    links: list[tuple[Array, Array]] = field(default_factory=list)

    @classmethod
    def plain(cls, run: Observations, sensor: Any, sink_c: Array) -> "Drive":
        """The base model: heat = loss = g = 1, constant surroundings, no links, a perfect probe."""
        zero = np.zeros((len(sensor), 1))
        one = read_only(np.ones((1, len(run.time))))
        heat = one if run.heat is None else run.heat[None, :]
        return cls(sensor, sink_c, heat, one, sink_c + 0.0 * one, 0.0 * one, zero, zero.copy(), zero.copy())

    def forward(self, run: Observations, rate: Array, rise: Array, start: Array) -> Array:
        """Readings (B, N) [degC] of lumps with rate [1/min], rise [K] and start [degC], each (B,)."""
        n, rows = len(run.time), len(rate)
        couplings = np.zeros((rows, 1))
        linked: Array = np.zeros((1, n))
        for coupling, neighbour in self.links:
            couplings = couplings + coupling
            linked = linked + coupling * neighbour
        masses = np.zeros((2, rows, len(self.hidden)))
        for i, mass in enumerate(self.hidden):
            for values, told in zip(masses, mass, strict=True):
                values[:, i] = _row(told, rows)
        out = np.empty((rows, n))
        moves = np.ndim(self.delay) == 2 and self.delay.shape[1] > 1
        kernel.forward(
            run.time,
            _row(rate, rows),
            _row(rise, rows),
            _row(start, rows),
            _grid(self.heat, rows, n),
            _grid(self.loss, rows, n),
            _grid(self.sink, rows, n),
            _row(self.exponent, rows),
            masses[0],
            masses[1],
            _row(couplings, rows),
            _grid(linked, rows, n),
            _row(self.lag, rows),
            np.zeros(rows) if moves else _row(self.delay, rows),
            out,
        )
        if moves:
            for row, delay in zip(out, _grid(self.delay, rows, n), strict=True):
                row[:] = np.interp(run.time - delay, run.time, row)
        out += self.offset
        return out


def _row(values: Array, rows: int) -> Array:
    flat = np.ascontiguousarray(values, dtype=float).reshape(-1)
    return flat if len(flat) == rows else np.ascontiguousarray(np.broadcast_to(flat, rows))


def _grid(values: Array, rows: int, n: int) -> Array:
    wide = np.atleast_2d(np.asarray(values, dtype=float))
    if wide.shape not in ((rows, n), (1, n)):
        wide = np.broadcast_to(wide, (rows, n))
    return np.ascontiguousarray(wide)
