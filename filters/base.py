"""The contract of a filter, and the narrow seam through which it sees a model.

A filter is settings only (a frozen dataclass); what it learns of one record is a :class:`Track`. The seam to the physics is
:class:`StateModel`: a start from the first readings, one step, and the convention that the reading is the first state.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Start(Protocol):
    """State after the first readings, from which a filter goes on.

    index: the last reading used; state (n,); covariance (n, n) per unit of the noise variance; noise_variance [K^2] with its
    degrees of freedom; weights (index + 1,), 0 for a reading left out; settled is False where the readings ended
    before the state was known well enough to filter from.
    """

    @property
    def index(self) -> int: ...
    @property
    def state(self) -> Array: ...
    @property
    def covariance(self) -> Array: ...
    @property
    def noise_variance(self) -> float: ...
    @property
    def dof(self) -> float: ...
    @property
    def weights(self) -> Array: ...
    @property
    def settled(self) -> bool: ...


class Starts(Protocol):
    """Starts of S records, each field of :class:`Start` an array (S, ...); index is -1 where nothing could be fitted.

    weights (S, N) are those of the readings up to the index.
    """

    @property
    def index(self) -> NDArray[np.intp]: ...
    @property
    def state(self) -> Array: ...
    @property
    def covariance(self) -> Array: ...
    @property
    def noise_variance(self) -> Array: ...
    @property
    def dof(self) -> Array: ...
    @property
    def weights(self) -> Array: ...


class Compiled(Protocol):
    """Capsules around C functions ``void f(const double *state, double dt, double *out)``.

    steps: of many states at once, ``void f(const double *states, Py_ssize_t count, double dt, double *out)``, each state's values
    together; None where a model has none, and records are filtered one after another.
    """

    @property
    def step(self) -> Any: ...
    @property
    def jacobian(self) -> Any: ...
    @property
    def steps(self) -> Any: ...


class StateModel(Protocol):
    """What a filter may know of the physics. The first state is what the sensor reads."""

    @property
    def state_names(self) -> tuple[str, ...]: ...

    @property
    def compiled(self) -> Compiled | None: ...

    def start(self, time: Array, reading: Array, resolution: float) -> Start:
        """Start from the first readings; depends on no reading after ``Start.index``."""

    def starts(self, time: Array, reading: Array, resolution: Array) -> Starts | None:
        """As :meth:`start` for records (S, N) on one grid; None where a model has no such form."""

    def step(self, state: Array, dt: float) -> Array:
        """States (..., n) one interval on."""

    def jacobian(self, state: Array, dt: float) -> Array:
        """Derivative (n, n) of :meth:`step` at one state (n,)."""


@dataclass(frozen=True)
class Track:
    """What a filter made of one record, reading by reading; rows before ``first`` are nan.

    state (N, n), covariance (N, n, n) per unit of the noise variance; the rest (N,): noise_variance [K^2], innovation [K],
    innovation_variance [K^2], fading (factor, 1 = none), process_noise [K^2] added to the first state, noise_factor on the
    noise variance, weight (0 = reading left out), forgotten (cumulated log of the fading).
    diverged_at is the reading at which the numbers broke, or None.
    """

    first: int
    state: Array
    covariance: Array
    noise_variance: Array
    innovation: Array
    innovation_variance: Array
    fading: Array
    process_noise: Array
    noise_factor: Array
    weight: Array
    forgotten: Array
    diverged_at: int | None

    @property
    def likelihood_weight(self) -> Array:
        """Weight (N,) of each reading in a likelihood: 0 for one left out, less where the noise was found larger."""
        return np.where(self.weight > 0.0, 1.0 / self.noise_factor, 0.0)


@dataclass(frozen=True)
class Tracks:
    """What is known after the last reading of each of S records (S, N) on one grid, where no series is asked for.

    first (S,); weight (S, N) of each reading in a likelihood; state (S, n), covariance (S, n, n), noise_variance (S,) and
    forgotten (S,) as in :class:`Track`; woke (S,), the first reading at which the filter faded, N where it never did;
    diverged_at (S,), -1 where it never did.
    """

    first: NDArray[np.intp]
    weight: Array
    state: Array
    covariance: Array
    noise_variance: Array
    forgotten: Array
    woke: NDArray[np.intp]
    diverged_at: NDArray[np.intp]

    def some(self, rows: Any) -> "Tracks":
        """Those of these rows."""
        return Tracks(**{name: values[rows] for name, values in vars(self).items()})

    @classmethod
    def of(cls, tracks: "Sequence[Track]") -> "Tracks":
        """The last rows of tracks of one length."""
        faded = [np.flatnonzero(t.fading > 1.0) for t in tracks]
        return cls(
            np.array([t.first for t in tracks], dtype=np.intp),
            np.stack([t.likelihood_weight for t in tracks]),
            np.stack([t.state[-1] for t in tracks]),
            np.stack([t.covariance[-1] for t in tracks]),
            np.array([t.noise_variance[-1] for t in tracks]),
            np.array([t.forgotten[-1] for t in tracks]),
            np.array([f[0] if len(f) else len(t.fading) for t, f in zip(tracks, faded, strict=True)], dtype=np.intp),
            np.array([-1 if t.diverged_at is None else t.diverged_at for t in tracks], dtype=np.intp),
        )


Closing = Literal["never", "when consistent", "always"]


@dataclass(frozen=True)
class Filter(ABC):
    """One published method. Subclasses are frozen dataclasses whose fields are the settings."""

    #: command-line name, one line for the catalogue, and where it was published
    name = "abstract"
    summary = ""
    reference = ""

    @property
    @abstractmethod
    def closing(self) -> Closing:
        """Whether a maximum-likelihood step over the same readings ends the estimate."""

    @abstractmethod
    def track(self, model: StateModel, time: Array, reading: Array, resolution: float) -> Track:
        """Filter one record.

        time (N,) in minutes, ascending; reading (N,) in degC, all finite; resolution [K] of the logger, 0 if unknown.
        """

    def tracks(self, model: StateModel, time: Array, reading: Array, resolution: Array) -> Tracks | None:
        """What :meth:`track` comes to at the end of records (S, N) on one grid, in one call; None where each is filtered alone."""
        return None


def setting(default: float, meaning: str, low: float, high: float) -> Any:
    """A numeric field of a filter: its default, meaning and allowed range, shown by ``thermofast filters``."""
    return field(default=default, metadata={"meaning": meaning, "low": low, "high": high})
