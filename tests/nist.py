"""Reader of NIST StRD files and the problems of this law: certified values that nobody here computed."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thermofast.models.separable import Basis, SeparableFit, modes, rise_from_zero, settling_modes

FOLDER = Path(__file__).resolve().parents[2] / "shared" / "data" / "nist_strd"

#: problem -> (basis, places of the amplitudes among b1.. , places of the rates)
PROBLEMS: dict[str, tuple[Basis, list[int], list[int]]] = {
    "Misra1a": (rise_from_zero, [0], [1]),
    "BoxBOD": (rise_from_zero, [0], [1]),
    "MGH17": (settling_modes, [0, 1, 2], [3, 4]),
    "Lanczos1": (modes, [0, 2, 4], [1, 3, 5]),
    "Lanczos2": (modes, [0, 2, 4], [1, 3, 5]),
    "Lanczos3": (modes, [0, 2, 4], [1, 3, 5]),
}


@dataclass(frozen=True)
class Certified:
    starts: tuple[NDArray[np.float64], NDArray[np.float64]]
    values: NDArray[np.float64]
    errors: NDArray[np.float64]
    x: NDArray[np.float64]
    y: NDArray[np.float64]


def read(name: str) -> Certified:
    text = (FOLDER / f"{name}.dat").read_text()
    rows = [[float(v) for v in m.groups()] for m in re.finditer(r"^\s*b\d+ =\s+(\S+)\s+(\S+)\s+(\S+)\s+(\S+)", text, re.M)]
    table = np.array(rows)
    data = np.array([[float(v) for v in line.split()] for line in text.splitlines()[60:] if line.strip()])
    return Certified((table[:, 0], table[:, 1]), table[:, 2], table[:, 3], data[:, 1], data[:, 0])


def digits(found: NDArray[np.float64], certified: NDArray[np.float64]) -> float:
    """Agreeing digits of the worst number: log relative error, capped at the 11 that are certified."""
    error = np.abs(found - certified) / np.abs(certified)
    return float(min(11.0, -np.log10(max(error.max(), 1e-12))))


def in_certified_order(
    fit: SeparableFit, certified: Certified, basis: Basis, amplitude_places: list[int], rate_places: list[int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Parameters and standard errors in the order of NIST's b1, b2, ...: modes are matched by the size of their rates."""
    fixed = len(amplitude_places) - len(rate_places)
    order = np.argsort(np.argsort(certified.values[rate_places]))
    modes_first = np.argsort(fit.rates)[order]
    values, errors = np.empty(len(certified.values)), np.empty(len(certified.values))
    for target, amplitudes, rates in (
        (values, fit.amplitudes, fit.rates),
        (errors, fit.amplitude_errors, fit.rate_errors),
    ):
        target[amplitude_places] = [*amplitudes[:fixed], *amplitudes[fixed:][modes_first]]
        target[rate_places] = rates[modes_first]
    return values, errors
