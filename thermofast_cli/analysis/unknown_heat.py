"""The heat that a model would need to follow its record, sensor by sensor, and the logged columns that this heat follows."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from thermofast.models import Observations
from thermofast.models.core.kernel import Array
from thermofast.models.greybox import RATE
from thermofast.models.joint import Fit
from thermofast.models.uncertainty.heat_in_watts import HeatInWatts, heat_in_watts
from thermofast.models.uncertainty.lump_heat import Lump, UnknownHeat, following_rate, simplest_rate, smooth_heat
from thermofast.models.uncertainty.unknown_heat import NEARLY, RULES, Follows, claims, moments, with_lag

from ..errors import rounded
from ..learning.rise import free_runs
from .power import Constants, unit_watts

if TYPE_CHECKING:
    from ..observing.task import LoopTask

#: The logarithm of a rate is known no better than this, and a worse one is told as this.
LEAST_DEVIATION, MOST_DEVIATION = 0.03, 0.7
#: Nor is that of a rate at which heat follows a column: a load that flutters by a per cent, a probe's lag that stands beside an
#: unknown instant of a step.
LEAST_FOLLOWING = 0.02
FEWEST_READINGS = 24
#: Rates that a column may come with where no other run tells them, times the length of the record.
POSSIBLE = np.geomspace(0.5, 40.0, 19)


@dataclass(frozen=True)
class NeededHeat:
    """heats has None for a sensor with too few readings; follows are claims, strongest first.

    own_rate: a rate comes from the same record. in_watts has None for each sensor where no power was logged as the drive, or it
    moves too little to tell how much heat the sensor's part holds.
    """

    heats: tuple[UnknownHeat | None, ...]
    follows: tuple[Follows, ...]
    own_rate: bool
    in_watts: tuple[HeatInWatts | None, ...]

    def constants(self, sensor: int) -> Constants | None:
        """Heat capacity and resistance with the intervals that any other heat leaves them."""
        told = self.in_watts[sensor]
        return Constants(told.capacity, told.resistance, to_all=True) if told is not None else None


def needed_of(task: "LoopTask", fit: Fit, whole: Observations) -> NeededHeat:
    """The unknown heat of a run beside the model that its task names."""
    learnt = set(task.model.file.channels) if task.model is not None else set()
    drive = {whole.drive: whole.heat} if whole.drive and whole.heat is not None else {}
    most = unit_watts(whole)
    power = whole.heat * most if most is not None and whole.heat is not None else None
    return needed_heat(fit, whole, learnt, {**whole.ambient, **whole.inputs, **drive}, power)


def needed_heat(fit: Fit, whole: Observations, learnt: Collection[str], columns: dict[str, Any], power: Any = None) -> NeededHeat:
    """Heat that each sensor of a run needs at the rates of a fit, of `learnt` sensors at those that other runs told.

    It is what its lump needs, dT/dt + b (T - sink): what flows to a hidden mass or from a neighbour is in it. A model's effects are
    taken off where they do not depend on the heat themselves: a room that moves, a probe that drifts.

    columns are logged columns (N,) of the run that the heat might follow, by name; power (N,) [W] is the logged part
    of the heat.
    """
    moved = any(part.effect.follows_ambient for part in fit.model.parts)
    sink: Any = fit.model.sink_guess if moved or not whole.ambient else next(iter(whole.ambient.values()))
    fit, errors = _as_learnt(fit, [c in learnt for c in whole.channels])
    rates, sensors = fit.values[RATE], np.arange(whole.sensors)
    shared = np.tile(fit.shared, (whole.sensors, 1))
    with_, without = (free_runs(fit, whole, fit.local, shared, sensors, keep) for keep in (heat_apart(fit), []))
    effects = with_ - without
    lumps: list[Lump | None] = []
    for i in range(whole.sensors):
        good = whole.used[i]
        noise = whole.least_noise[i] / np.sqrt(whole.weight[i][good])
        surroundings = np.full(int(good.sum()), sink) if np.ndim(sink) == 0 else sink[good]
        reading = (whole.known[i] - effects[i])[good]
        lumps.append(Lump(whole.clock[good], reading, noise, surroundings) if len(reading) >= FEWEST_READINGS else None)
    known = {i: lump for i, lump in enumerate(lumps) if lump is not None}
    own = [c not in learnt for c in whole.channels]
    # A rate that the same readings gave is bent by the heat that the fit did not know of: a column may come with another.
    may = {i: possible_rates(lump) if own[i] else [float(rates[i])] for i, lump in known.items()}
    # Between the times of the file a column is drawn in straight lines, which is for the claim to judge.
    told = whole.logged if whole.logged is not None else np.ones(len(whole.clock), dtype=bool)
    logged = {n: c[told] for n, c in columns.items()}
    late, follows = probed(list(known.values()), list(may.values()), logged, whole.clock[told])
    known = dict(zip(known, late, strict=True))
    heats: list[UnknownHeat | None] = [None] * whole.sensors
    watts: list[HeatInWatts | None] = [None] * whole.sensors
    for place, (i, lump) in enumerate(known.items()):
        # Of surroundings that nobody logged the fit has a guess, and the first reading is another.
        sink_unknown = abs(float(sink) - float(lump.reading[0])) if np.ndim(sink) == 0 and own[i] else 0.0
        unsure = min(max(float(np.nan_to_num(errors[i])), LEAST_DEVIATION), MOST_DEVIATION)
        if own[i]:
            heats[i] = told_heat(lump, place, follows, whole.clock[told], sink_unknown)
        else:
            heats[i] = smooth_heat(lump, float(rates[i]), unsure)
        if power is not None:
            watts[i] = heat_in_watts(lump, power[told], may[i], None if own[i] else unsure, whole.clock[told])
    return NeededHeat(tuple(heats), tuple(follows), any(own), tuple(watts))


def heat_apart(fit: Fit) -> list[int]:
    """Places of a model's parts that do the same under any heat: surroundings, and what a probe shows that is not its object's."""
    effects = [part.effect for part in fit.model.parts]
    return [k for k, effect in enumerate(effects) if effect.follows_ambient or effect.scope == "one"]


def _as_learnt(fit: Fit, learnt: Sequence[bool]) -> tuple[Fit, Array]:
    """A fit with what it was told beforehand as it was told, and deviations (S,) of the logarithms of its rates.

    The run's own fit bends the constants of a machine by the very heat that is looked for.
    """
    local, shared, errors = fit.local.copy(), fit.shared.copy(), fit.deviations[RATE].copy()
    if fit.prior is None or not any(learnt):
        return fit, errors
    at = fit.model.column(RATE)
    for i in np.flatnonzero(learnt).tolist():
        told = np.flatnonzero(np.diagonal(fit.prior.local_precision[i])[: local.shape[1]] > 0.0)
        local[i, told] = fit.prior.local[i, told]
        if at in told:
            covariance = np.linalg.inv(fit.prior.local_precision[i][np.ix_(told, told)])
            errors[i] = np.sqrt(covariance[told == at, told == at][0])
    together = np.flatnonzero(np.diagonal(fit.prior.shared_precision)[: len(shared)] > 0.0)
    shared[together] = fit.prior.shared[together]
    return replace(fit, local=local, shared=shared), errors


def probed(lumps: list[Lump], rates: list[list[float]], columns: dict[str, Any], time: Array) -> tuple[list[Lump], list[Follows]]:
    """Lumps with the lags of their probes, and the columns (N,) logged at `time` that their heats follow at some of `rates`."""
    follows = claims(lumps, rates, columns, time)
    late = [with_lag(lump, may, follows, k, time) for k, (lump, may) in enumerate(zip(lumps, rates, strict=True))]
    return late, claims(late, rates, columns, time) if any(lump.lag > 0.0 for lump in late) else follows


def possible_rates(lump: Lump) -> list[float]:
    """Rates [1/min] that a record of this length may show."""
    return (POSSIBLE / float(lump.time[-1] - lump.time[0])).tolist()  # type: ignore[no-any-return]


def told_heat(lump: Lump, place: int, follows: Sequence[Follows], time: Array, sink_deviation: float = 0.0) -> UnknownHeat:
    """The heat that a record alone tells: at the rate at which it follows columns, logged at `time`, or at which it is simplest."""
    if not follows or follows[-1].correlation < RULES.sharp:
        rate, unsure = simplest_rate(lump, possible_rates(lump))
        return smooth_heat(lump, rate, min(max(unsure, LEAST_DEVIATION), MOST_DEVIATION), sink_deviation)
    shapes, grid = np.array([f.shape for f in follows]), moments(time)
    rate, unsure = following_rate(lump, follows[-1].rates[place], NEARLY, shapes, grid)
    unsure = float(np.hypot(unsure, follows[-1].open[place]))
    return smooth_heat(lump, rate, max(unsure, LEAST_FOLLOWING), sink_deviation, shapes, grid)


#: What a reader of a heat must know where the rate comes from the same record.
OWN_RATE = (
    "the unknown heat is told at the rate at which it follows a column or moves least, which the same readings gave: with --model, "
    "learnt on another run of the machine, it is surer"
)


def of_effects(fit: Fit) -> str:
    """What to say of effects that a model has and the heat counts."""
    apart = heat_apart(fit)
    counted = [part.id for k, part in enumerate(fit.model.parts) if k not in apart]
    return f"the heat is what the part itself needs: what {' and '.join(counted)} brings or takes is in it" if counted else ""


def in_words(follows: tuple[Follows, ...]) -> str:
    """'the unknown heat follows flow^2 (powers 1.5 to 2.5 do as well), 3 min late: correlation 0.93 on blocks left out'."""
    told = []
    for f in follows:
        low, high = f.powers
        power = "" if f.power == 1.0 else f"^{f.power:g}"
        near = f" (powers {low:g} to {high:g} do as well)" if low < high else ""
        late = f", {rounded(f.delay_min)} min late" if f.delay_min > 0.0 else ""
        chance = "chance below 1e-6" if f.p < 1e-6 else f"chance {f.p:.1g}"
        told.append(f"{f.column}{power}{near}{late}: correlation {f.correlation:.2f} on blocks left out, {chance}")
    return "the unknown heat follows " + ", and with it ".join(told) if told else ""


NO_COLUMN = "the unknown heat follows no logged column more than chance would have it"


NO_WATTS = "the power moves too little to tell how many watts the unknown heat is: log a run in which it is changed"


def heat_rows(heat: UnknownHeat | None, watts: HeatInWatts | None) -> list[dict[str, float]]:
    """Rows of a record: time, heat and its 95 % band, in K/min and, where that is known, in W."""
    if heat is None:
        return []
    low, high = heat.heat - 1.96 * heat.deviation, heat.heat + 1.96 * heat.deviation
    columns = {"time_min": heat.time, "heat_k_per_min": heat.heat, "lo_k_per_min": low, "hi_k_per_min": high}
    if watts is not None:
        columns |= {"heat_w": watts.heat, "lo_w": watts.low, "hi_w": watts.high}
    return [{n: float(f"{v:.6g}") for n, v in zip(columns, row, strict=True)} for row in zip(*columns.values(), strict=True)]
