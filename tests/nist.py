"""Reader of NIST StRD files, and the exponential laws among them as models for the solver that the tool's joint fit uses."""

import re
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Observations
from thermofast.models.joint import Fit, search

FOLDER = Path(__file__).resolve().parents[2] / "shared" / "data" / "nist_strd"
Array = NDArray[np.float64]

#: problem -> (whether Y = b1 (1 - exp(-b2 x)), else places of a constant, of amplitudes and of their rates among b1..)
PROBLEMS: dict[str, tuple[bool, list[int], list[int], list[int]]] = {
    "Misra1a": (True, [], [0], [1]),
    "BoxBOD": (True, [], [0], [1]),
    "MGH17": (False, [0], [1, 2], [3, 4]),
    "Lanczos1": (False, [], [0, 2, 4], [1, 3, 5]),
    "Lanczos2": (False, [], [0, 2, 4], [1, 3, 5]),
    "Lanczos3": (False, [], [0, 2, 4], [1, 3, 5]),
}
#: Readings are fitted in units this small: the tool's floor of a noise, 1e-9 K, is no floor then.
UNIT = 1e-9


@dataclass(frozen=True)
class Certified:
    starts: tuple[Array, Array]
    values: Array
    errors: Array
    x: Array
    y: Array


def read(name: str) -> Certified:
    text = (FOLDER / f"{name}.dat").read_text()
    rows = [[float(v) for v in m.groups()] for m in re.finditer(r"^\s*b\d+ =\s+(\S+)\s+(\S+)\s+(\S+)\s+(\S+)", text, re.M)]
    table = np.array(rows)
    data = np.array([[float(v) for v in line.split()] for line in text.splitlines()[60:] if line.strip()])
    return Certified((table[:, 0], table[:, 1]), table[:, 2], table[:, 3], data[:, 1], data[:, 0])


class Law:
    """A sum of exponentials with the attributes of a grey-box model that the solver looks at; derivatives are exact."""

    def __init__(self, name: str, certified: Certified) -> None:
        self.rises, self.constant, self.amplitudes, self.rates = PROBLEMS[name]
        x, y, k = certified.x, certified.y, len(certified.values)
        one = np.ones((1, len(x)))
        self.run = Observations(name, ("y",), x, y[None] / UNIT, one, np.ones(1), np.zeros(1))
        self.parts, self.local, self.shared = (), [None] * k, []
        self.low_local, self.high_local = np.full(k, -np.inf), np.full(k, np.inf)
        self.low_shared = self.high_shared = np.zeros(0)
        self.active = np.ones((1, k), dtype=bool)

    def forward(self, local: Array, shared: Array, sensor: Array) -> Array:
        return self.with_jacobian(local, shared, sensor)[0]

    def with_jacobian(
        self, local: Array, shared: Array, sensor: Array, _: Array | None = None, by_shared: bool = True
    ) -> tuple[Array, Array, Array]:
        x, rows = self.run.time, len(local)
        curve, by = np.zeros((rows, len(x))), np.zeros((len(self.local), rows, len(x)))
        for place in self.constant:
            curve += local[:, place, None]
            by[place] = 1.0
        for a, b in zip(self.amplitudes, self.rates, strict=True):
            rate = np.exp(local[:, b, None])  # searched by its logarithm, as the tool's are
            decay = np.exp(-rate * x)
            sign = -1.0 if self.rises else 1.0
            curve += local[:, a, None] * ((1.0 - decay) if self.rises else decay)
            by[a] = (1.0 - decay) if self.rises else decay
            by[b] = -sign * local[:, a, None] * rate * x * decay
        return curve / UNIT, by / UNIT, np.zeros((0, rows, len(x)))


def solved(name: str, certified: Certified, start: Array) -> tuple[Array, Array]:
    """(values, standard errors) of b1.. from a start, modes in the certified order.

    As in the tool's own search several starts are so many rows: NIST's, and rates over all that the record can show; what is linear
    is solved for at each. The best row is polished.
    """
    law = Law(name, certified)
    span, count = float(np.ptp(certified.x)), len(law.rates)
    grid = np.geomspace(0.2 / span, 0.5 * len(certified.x) / span, 9)
    rates = np.log(np.array([np.abs(start[law.rates]), *combinations(grid, count)]))
    first = np.ones((len(rates), len(start)))
    first[:, law.rates] = rates
    linear = [*law.constant, *law.amplitudes]
    one = np.zeros(len(rates), dtype=int)
    _, by, _ = law.with_jacobian(first, np.zeros(0), one)
    for row in range(len(first)):
        first[row, linear] = np.linalg.lstsq(by[linear, row].T, law.run.reading[0], rcond=None)[0]
    many = search(law, first, np.zeros(0), most=300, sensor=one)
    best = many.local[[int(np.argmin(many.rss))]]
    fit: Fit = search(law, best, np.zeros(0), most=2000, ends_at=(0.0, 0.0), polish=3)
    # Not fit.covariance: its ridge of 1e-13 shows in the sixth digit where three modes nearly coincide.
    inverse = np.linalg.inv(np.linalg.qr(fit.by_local[:, 0].T, mode="r"))
    values, errors = fit.local[0], np.sqrt((inverse**2).sum(axis=1)) * float(np.sqrt(fit.rss / fit.dof)[0])
    _, _, amplitudes, rates = PROBLEMS[name]
    values[rates] = np.exp(values[rates])
    errors[rates] *= values[rates]
    own, wanted = np.argsort(values[rates]), np.argsort(np.argsort(certified.values[rates]))
    places = np.arange(len(values))
    for group in (amplitudes, rates):
        places[group] = np.array(group)[own][wanted]
    return values[places], errors[places]


def digits(found: Array, certified: Array) -> float:
    """Agreeing digits of the worst number: log relative error, capped at the 11 that are certified."""
    error = np.abs(found - certified) / np.abs(certified)
    return float(min(11.0, -np.log10(max(error.max(), 1e-12))))
