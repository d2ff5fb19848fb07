"""What an effect is: data that describe it, and one function that changes the drive.

A new effect is a class derived from :class:`Effect`, with its parameters declared and ``apply`` written in numpy; see
docs/add-an-effect.md. Effects add up: each changes the drive that the one before it left.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..core.kernel import Array
from ..drive import Drive
from ..observations import Observations

#: Logged columns that an effect is tried along.
MOST_COLUMNS = 6
#: Minutes of a record from which on bounds of rates are as they stand.
HOUR = 60.0
#: Coupling over own rate from which a link explains anything: true links in simulated and real records reach 15.
MOST_COUPLED = 25.0


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    low, high, start: bounds and start value, in `unit`; with ``share`` they are shares of the record's length. `least_steps`
    raises the lower bound to that many sampling intervals, `fastest` lowers the upper
    bound of a rate to that per interval; in a record of less than an hour it is as much higher as that is shorter.
    null is the value at which the effect vanishes (None: this parameter alone cannot make it vanish).
    belongs: 'machine', carried to other runs of it, or 'run'.
    each: 'run', one value for all sensors, or 'sensor', one for each. log: search on a logarithmic scale.
    periodic: a whole number more is the same (a phase). settles: 'rate' or 'time' where something comes to rest with this rate or
    time constant. typical: sizes that occur, from which training records are drawn; the start value where none are told.
    logging_steps: standard deviation, in sampling intervals, that logging adds to a time: what happened between two readings.
    """

    name: str
    unit: str
    low: float
    high: float
    start: float
    meaning: str
    null: float | None = None
    belongs: str = "machine"
    each: str = "run"
    log: bool = False
    share: bool = False
    least_steps: float = 0.0
    fastest: float = 0.0
    periodic: bool = False
    settles: str = ""
    typical: tuple[float, float] | None = None
    logging_steps: float = 0.0

    def bounds(self, run: Observations) -> tuple[float, float]:
        """Lower and upper bound for a run."""
        scale = run.span if self.share else 1.0
        low = max(self.low * scale, self.least_steps * run.step) if self.least_steps else self.low * scale
        high = self.high * scale
        if self.fastest:
            high = min(high * max(1.0, HOUR / max(run.span, 1e-9)), self.fastest / run.step)
        return low, max(high, 2.0 * low if self.log else low)

    def grid(self, run: Observations, points: int) -> Array:
        """Places from which to start a search, `points` of them between the bounds; none after the last reading used."""
        low, high = self.bounds(run)
        if self.share:
            high = max(low, min(high, self.high * float(run.time[run.last] - run.time[0])))
        if self.log:
            return np.geomspace(max(low, 1e-6 * high), high, points + 2)[1:-1]
        return np.linspace(low, high, points + 2)[1:-1]


@dataclass(frozen=True)
class Choice:
    """One way for an effect to act on a run: which logged column it follows, which neighbour, which shape of wave.

    constants are carried in the model file; by_sensor names those that are (S,) indices of sensors, one for each sensor. omitted
    are parameters that this way does not search, coupled those of the run that it makes the machine's. simple is False for a
    way that is tried only where the simple ones do not do; rare is one that is taken where it leaves no pattern, and gives way to
    what does as well.
    """

    label: str = ""
    constants: dict[str, Any] = field(default_factory=dict)
    omitted: tuple[str, ...] = ()
    simple: bool = True
    by_sensor: tuple[str, ...] = ()
    coupled: tuple[str, ...] = ()
    rare: bool = False

    def acts_as(self, other: "Choice") -> bool:
        """Whether it is the same way to act; constants may be arrays."""
        alike = self.constants.keys() == other.constants.keys()
        return (
            alike
            and all(np.array_equal(v, other.constants[k]) for k, v in self.constants.items())
            and replace(self, constants={}) == replace(other, constants={})
        )

    @staticmethod
    def composed(choices: "Sequence[Choice]") -> "Choice":
        """Each sensor's own choice of several: choices (S,)."""
        first = choices[0]
        own = {k: np.array([int(c.constants[k][i]) for i, c in enumerate(choices)]) for k in first.by_sensor}
        return replace(first, label="" if own else first.label, constants={**first.constants, **own})

    def ends(self, sensor: int) -> set[int]:
        """The other sensors that a sensor's own constants name."""
        return {int(self.constants[k][sensor]) for k in self.by_sensor} - {sensor}

    def ways(self, channels: Sequence[str], who: Any) -> list[str]:
        """How it acts on the sensors who (S,) that have it, as ['rpm'] or ['T2 by T1 and T3', 'T3 by T2']; [] where plainly."""
        if not self.by_sensor:
            return [self.label] if self.label else []
        told = []
        for i in map(int, np.flatnonzero(who)):
            others = dict.fromkeys(channels[int(self.constants[k][i])] for k in self.by_sensor)
            told.append(f"{channels[i]} by {' and '.join(c for c in others if c != channels[i])}")
        return told


class Values:
    """Parameter values of an effect by name, each (B, 1), and the constants of its choice."""

    def __init__(self, values: dict[str, Any], constants: dict[str, Any]) -> None:
        self.__dict__.update(constants)
        self.__dict__.update(values)
        for value in values.values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    def __getattr__(self, name: str) -> Any:
        known = ", ".join(sorted(self.__dict__))
        raise AttributeError(f"no parameter {name!r}; declared are: {known}")


class Effect:
    """A missing piece of physics. Class attributes describe it; ``apply`` changes the drive.

    uses_sink: the effect needs to know the surroundings; changes_heat: it changes the heat, so that two of its kind may multiply.
    moves_room names the parameter [K] by which the surroundings change by themselves. logged: it follows a logged column, so it
    is tried beside every other effect. follows_ambient: that column is the surroundings'. reads_sensors: it uses other sensors'
    readings; most_sensors: of more at once it is not tried (None: of any number). again: a run may have two of it, with constants
    of their own. masses: how many hidden masses it appends. advice: what a user to whom it is named should know beside. places
    (constant, per reading): the effective number of independent places at which it is looked for (docs/false-alarms.md);
    choice_costs: what choosing a way of acting costs each sensor, in parameters. in_parts: with scope 'run', it may be a cause
    that only some of the sensors share, as the motor or the coolant of one part of the machine. amplitude names the parameter
    whose null makes the effect vanish. scope: 'run', all sensors share one cause; 'sensor', some sensors have it, each with its
    own values; 'one', it concerns a single sensor.
    """

    id: ClassVar[str] = "abstract"
    summary: ClassVar[str] = ""
    equation: ClassVar[str] = ""
    tell_tale: ClassVar[str] = ""
    mistaken_for: ClassVar[tuple[str, ...]] = ()
    needs: ClassVar[str] = ""
    separate: ClassVar[str] = ""
    reference: ClassVar[str] = ""
    scope: ClassVar[str] = "run"
    event: ClassVar[str | None] = None
    uses_sink: ClassVar[bool] = False
    changes_heat: ClassVar[bool] = False
    moves_room: ClassVar[str] = ""
    logged: ClassVar[bool] = False
    follows_ambient: ClassVar[bool] = False
    reads_sensors: ClassVar[bool] = False
    most_sensors: ClassVar[int | None] = None
    again: ClassVar[bool] = False
    in_parts: ClassVar[bool] = False
    #: Which of its kind it is in a model.
    number: ClassVar[int] = 1
    masses: ClassVar[int] = 0
    advice: ClassVar[str] = ""
    places: ClassVar[tuple[float, float]] = (30.0, 0.0)
    choice_costs: ClassVar[float] = 0.0
    amplitude: ClassVar[str] = ""
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    #: The user's own file that it was loaded from; empty for the catalogue's and those of installed packages.
    file: ClassVar[str] = ""

    def numbered(self, number: int) -> "Effect":
        """The same effect standing once more in a model, as ``second_mode.2``."""
        twin = object.__new__(type(self))  # not a copy: what a plug-in is pickled as is one and the same wherever it is asked for
        twin.__dict__.update(self.__dict__)
        # Of this one alone: the class stays as it is.
        twin.__dict__.update(id=f"{self.id.partition('.')[0]}.{number}", number=number)
        return twin

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        """Change the drive. p.<name> are arrays (B, 1), one row per lump; run.time, run.middle are (N,) [min]."""
        raise NotImplementedError

    def choices(self, run: Observations) -> Sequence[Choice]:
        """The ways in which this effect could act on a run; none where it lacks an input."""
        return (Choice(),)

    def parameter(self, name: str) -> Parameter:
        return next(p for p in self.parameters if p.name == name)

    def active(self, choice: Choice) -> tuple[Parameter, ...]:
        """Parameters that are searched under a choice."""
        return tuple(p for p in self.parameters if p.name not in choice.omitted)

    def acting(self, parameter: Parameter, choice: Choice, sensors: int) -> NDArray[np.bool_]:
        """Sensors (S,) in which a parameter of their own does anything under a choice."""
        return np.ones(sensors, dtype=bool)

    def grid(self, run: Observations, choice: Choice) -> list[dict[str, float]]:
        """Values of the parameters other than the amplitude from which to start a search."""
        others = [p for p in self.active(choice) if p.name != self.amplitude]
        if not others:
            return [{}]
        points = max(3, round(48 ** (1.0 / len(others)))) if self.event else max(3, round(16 ** (1.0 / len(others))))
        meshes = np.meshgrid(*[p.grid(run, points) for p in others], indexing="ij")
        columns = [m.ravel() for m in meshes]
        return [{p.name: float(c[i]) for p, c in zip(others, columns, strict=True)} for i in range(len(columns[0]))]

    def starts(
        self, points: list[dict[str, float]], amplitude: Array, gain: Array, most: int
    ) -> list[tuple[float, dict[str, float]]]:
        """The best distinct of grid points (G) with first-order amplitude and gain (G,): (gain, values by name)."""
        found: list[tuple[float, dict[str, float]]] = []
        left = gain.copy()
        apart = max(1, len(left) // 16)
        for _ in range(most):
            best = int(np.argmax(left))
            if left[best] <= 0.0 and found:
                break
            found.append((float(gain[best]), {**points[best], self.amplitude: float(amplitude[best])}))
            left[max(0, best - apart) : best + apart + 1] = -1.0
        return found

    def response(self, points: list[dict[str, float]], run: Observations, rate: Array, rise: Array) -> Array | None:
        """Change (S or 1, G, N) of the curves of lumps (S,) by an amplitude of 1 at each grid point, where a formula gives it."""
        return None

    def borrowed_noise(self, run: Observations, choice: Choice, sensor: int, rate: float, own: dict[str, float]) -> float:
        """Standard deviation [K] of the slow noise that a logged input puts into a sensor's curve."""
        return 0.0

    def physical(self, choice: Choice, who: Any, rate: Array, own: dict[str, Array]) -> bool:
        """Whether the sensors concerned, who (S,), could really have these values; what statistics does not see."""
        return True

    def mirrored(self, rate: Array, own: dict[str, Array]) -> tuple[Array, dict[str, Array]] | None:
        """Other values (S,) of rate and own parameters with the same curve, where they are the physical ones; else None."""
        return None

    def equivalent(self, amplitude: float, rate: Array, level: Array, sink: float) -> tuple[Array, Array]:
        """Rate and level (S,) with which the base model's curve about stays when the effect has this amplitude."""
        return rate, level

    def large_starts(self) -> tuple[float, ...]:
        """Amplitudes, beside the one a straight line suggests, from which a search is worth starting."""
        return ()


def varying(columns: dict[str, Array]) -> dict[str, Array]:
    """Those logged columns that change during the run."""
    return {n: c for n, c in columns.items() if float(np.ptp(c)) > 1e-6 * max(1.0, float(np.abs(c).max()))}


def tried_columns(run: Observations, warm: bool = False, but: Sequence[str] = ()) -> dict[str, Array]:
    """Logged inputs that an effect is tried along: those that are temperatures, or all others but some.

    What is warm neither heats nor cools by what it is, but by how warm it is.
    """
    mine = {n: c for n, c in run.inputs.items() if (n in run.temperatures) is warm and n not in but}
    return dict(list(varying(mine).items())[:MOST_COLUMNS])


def columns_not_tried(run: Observations) -> list[str]:
    """Logged inputs that change and along which no effect is tried, because there are too many: those logged last."""
    tried = {*tried_columns(run), *tried_columns(run, warm=True)}
    return [n for n in varying(run.inputs) if n not in tried]


def heated(drive: Drive, change: Any, p: Any) -> Any:
    """The heat with a relative change more: another source beside the others or, with p.product, all of them scaled."""
    return drive.heat * (1.0 + change) if getattr(p, "product", False) else drive.heat + change


def driven(run: Observations) -> dict[str, Any]:
    """Constants of a choice: a change of a heat that is logged scales it, and is off when the heat is off."""
    return {"product": True} if run.heat is not None else {}
