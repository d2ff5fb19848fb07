"""Readings of one run or of several, from which a displacement is learned, and which of them are left out in turn."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .fits import Array, Fitter, Mask, Prediction, blocks_of, checked

#: Most folds over runs: with more runs several are left out together.
MOST_FOLDS = 10


@dataclass(frozen=True)
class Sample:
    """temperatures (N, S) [degC], displacement (N,) [um], minutes (N,) on each run's own clock, run (N,) its number, ascending.

    inputs (N, k) are logged drives, each in its own unit; None where there are none.
    """

    temperatures: Array
    displacement: Array
    minutes: Array
    run: NDArray[np.int64]
    inputs: Array | None = None

    @staticmethod
    def of(temperatures: Array, displacement: Array, minutes: Array | None = None) -> "Sample":
        """One run; without minutes its readings are a minute apart. ValueError where nothing can be learned from it."""
        temperatures, displacement = checked(temperatures, displacement)
        n = len(displacement)
        return Sample(temperatures, displacement, np.arange(float(n)) if minutes is None else minutes, np.zeros(n, dtype=np.int64))

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(np.unique(self.run))

    def stretches(self) -> list[NDArray[np.int64]]:
        """Rows of each run."""
        return [np.flatnonzero(self.run == r) for r in np.unique(self.run)]

    def folds(self) -> list[tuple[Mask, Mask]]:
        """(left in, left out) (N,), (N,): contiguous blocks of one run, or whole runs of several."""
        if self.runs == 1:
            return blocks_of(len(self.displacement))
        groups = np.array_split(np.unique(self.run), min(self.runs, MOST_FOLDS))
        outs = [np.isin(self.run, group) for group in groups]
        return [(~out, out) for out in outs]


#: What a method to tell a displacement says of every reading (N,) when it may use those marked (N,); ValueError where it cannot.
Method = Callable[[Sample, Mask], Prediction]


def static(fit: Fitter) -> Method:
    """The method of a fit that looks at the temperatures of the moment alone."""

    def told(sample: Sample, used: Mask) -> Prediction:
        return fit(sample.temperatures[used], sample.displacement[used]).predict(sample.temperatures)

    return told
