"""Where runs begin, and what that says: another room, a machine that was warm, a probe that is off."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from .change import PRIORS, Change
from .numbers import Late
from .repeats import OWN

Array = NDArray[np.float64]

#: A room is another one from this difference [K] on, or from so many deviations of the old runs' rooms: labs hold them to 1 or 2 K.
ROOM, ROOM_DEVIATIONS = 3.0, 3.0
#: Deviation [K] between the rooms of two runs where nobody logged them: so far a warm start is not known.
ROOM_BETWEEN = 0.7
#: Prior probability that a run which begins elsewhere began warm, and not in another room; where the room is logged, the other way.
WARM = 0.2
#: Prior probability that a run of which one sensor began elsewhere is one that was logged late.
LATE = 0.2
#: Prior probability that runs which begin warmer were logged late, and the share of what that does which is not known.
LOGGED_LATE, UNSURE_LATE = 0.1, 0.3
#: Prior deviation [K] of what a probe that is off tells beside the truth.
PROBE = 2.0
#: Deviation [K] of where sensors begin beside each other from run to run; of a machine that is warm, as share of how warm it is.
BESIDE, UNEVEN = 0.3, 0.5


Way = tuple[float, Array, Array]


@dataclass(frozen=True)
class Begun:
    """By how much the new runs began warmer (S,) [K] than the old ones by the fits, and how much they rise (S,) [K].

    warm: how likely that is the machine's; room: deviation [K] between rooms. seen (S,) [K]: `warmer` by the first readings, which
    no law bends; late: what the old runs would be, were they logged late; new (2, S) [degC]: where the new runs began, by the fits
    and by the first readings.
    """

    warmer: Array
    rise: Array
    warm: float = WARM
    room: float = ROOM_BETWEEN
    seen: Array | None = None
    late: Late | None = None
    new: Array | None = None

    def ways(self) -> list[Way]:
        """Of another room, which moves no rise, of a warm machine, and of a logger that began late: log-likelihood, shift (2 S,) of
        a difference, deviation.
        """
        n = len(self.warmer)
        seen = self.warmer if self.seen is None else self.seen
        uneven = float(np.hypot(BESIDE, UNEVEN * seen.mean()))
        logs = [_log(share, seen, deviation) for share, deviation in ((1.0 - self.warm, BESIDE), (self.warm, uneven))]
        # Had it begun as cold as before, it would have risen by so much more.
        more = np.log(np.maximum(1.0 + self.warmer / self.rise, 0.05))
        still = np.zeros(n)
        by_kelvin = np.concatenate([still, np.exp(-more) / self.rise])
        found = [(logs[0], np.zeros(2 * n), BESIDE * by_kelvin), (logs[1], np.concatenate([still, -more]), self.room * by_kelvin)]
        if self.late is not None:
            moved = self.late.moved
            found.append((_log(LOGGED_LATE, seen - self.late.warmer, BESIDE), moved, UNSURE_LATE * moved))
        return found

    def exchanged(self, i: int, j: int) -> "Begun":
        """The same, with two sensors of the new runs in each other's place."""
        if self.new is None:
            return self
        order = np.arange(len(self.rise))
        order[[i, j]] = j, i
        moved = self.new[:, order] - self.new
        seen = None if self.seen is None else self.seen + moved[1]
        return replace(self, warmer=self.warmer + moved[0], rise=self.rise[order], seen=seen, late=None)


def _log(share: float, warmer: Array, deviation: float) -> float:
    """Log-likelihood of how much warmer (S,) [K] sensors began beside each other, by a deviation [K], with a prior probability."""
    apart = float(((warmer - warmer.mean()) ** 2).sum())
    return float(np.log(share)) - (len(warmer) - 1) * float(np.log(deviation)) - 0.5 * apart / deviation**2


def with_room(found: Sequence[Change], probability: float, difference: float, deviation: float) -> list[Change]:
    """Kinds of change with another room, by so many K, where the machine is as it was; the likeliest first."""
    as_it_was = next(c for c in found if c.kind == "nothing")
    parted = [
        replace(as_it_was, probability=as_it_was.probability * (1.0 - probability)),
        Change("room", None, as_it_was.probability * probability, difference, deviation),
    ]
    return sorted([*parted, *(c for c in found if c is not as_it_was)], key=lambda c: -c.probability)


def with_offset(
    found: Sequence[Change], starts: Array, rises: Array, old: int, errors: Array, stands_for: int = 1, misfit: Array | float = 0.0
) -> list[Change]:
    """Kinds of change with a probe among them that tells another temperature throughout; the likeliest first.

    starts, rises (K, S) [K]: of each run, the first of which are `old`, each the mean of as many as it `stands_for`; errors (S,):
    of the new rises over the old ones, in logarithms; misfit (S,) [K]: by how much more the fits miss the first readings of the new
    runs. A probe that is off moves where its sensor begins and not how far it rises; a
    place that is warm from before does both, and a run is as uneven as the old ones were. Of two sensors nobody knows which is off,
    after one run how uneven they are.
    """
    count = starts.shape[1]
    if count < 3 or old * stands_for < 2:
        return list(found)
    begun, alone = begun_beside(starts, old)
    before = begun[:old].mean(axis=0)
    own = ((begun[:old] - before) ** 2).sum(axis=0)
    # Of one sensor as of all together, as one run more whose sensors begin as they usually do.
    variance = (BESIDE**2 * count + own.sum()) / (count * old) * (1.0 / (old * stands_for) + 1.0 / (len(starts) - old))
    variance = variance + np.broadcast_to(misfit, count) ** 2
    moved = begun[old:].mean(axis=0) - before
    rose, after = rises[:old].mean(axis=0), rises[old:].mean(axis=0)
    unsure = (np.hypot(errors, OWN[1]) * np.abs(after)) ** 2 + BESIDE**2
    chance = norm.logpdf(moved, 0.0, np.sqrt(variance))
    fell = after - weighted_median(after / rose, np.hypot(errors, OWN[1])) * rose
    as_probe = norm.logpdf(moved, 0.0, np.sqrt(variance + PROBE**2)) + norm.logpdf(fell, 0.0, np.sqrt(unsure))
    as_warm = np.logaddexp(chance + norm.logpdf(fell, 0.0, np.sqrt(unsure)), _as_warm_spot(moved, fell, variance, unsure))
    # Where a test is logged late all rise less, each by as much as it had warmed, and no factor is all rises'.
    as_warm = np.logaddexp(as_warm, np.log(LATE) + _as_warm_spot(moved, after - rose, variance, unsure))
    odds = PRIORS["sensor"] / count * np.exp(np.minimum(as_probe - as_warm, 50.0))
    i = int(np.argmax(odds))
    share = float(odds[i] / (1.0 + odds[i]))
    others = [replace(c, probability=c.probability * (1.0 - share)) for c in found]
    size = float((alone[old:, i].mean() - alone[:old, i].mean()) * PROBE**2 / (PROBE**2 + variance[i]))
    deviation, shows = float(np.sqrt(PROBE**2 * variance[i] / (PROBE**2 + variance[i]))), float(np.sqrt(variance[i] + unsure[i]))
    probe = Change("sensor", i, share, size, deviation, kelvin=True, shows=shows)
    return sorted([probe, *others], key=lambda c: -c.probability)


def weighted_median(values: Array, errors: Array) -> float:
    """Median of values (S,), each weighed by what is known of it: a sensor far from the heat tells nothing of its rise."""
    order = np.argsort(values)
    weight = np.cumsum(1.0 / errors[order] ** 2)
    return float(values[order][np.searchsorted(weight, 0.5 * weight[-1])])


def begun_beside(starts: Array, old: int) -> tuple[Array, Array]:
    """Where sensors began (K, S) [K] beside where they began in the `old` runs, less the middle of all in their run; and less that
    of the others alone, which is what one is off by if it is the only one.
    """
    beside = starts - starts[:old].mean(axis=0)  # one that moves past another then leaves the middle where it was
    others = np.stack([np.median(np.delete(beside, i, axis=1), axis=1) for i in range(beside.shape[1])], axis=1)
    return beside - np.median(beside, axis=1, keepdims=True), beside - others


def _as_warm_spot(moved: Array, fell: Array, variance: Array, unsure: Array) -> Array:
    """Log likelihood (S,) that a sensor's place was warm from before: it began higher, and rose by so much less."""
    likely: Array = np.log(WARM) + norm.logpdf(moved, 0.0, np.sqrt(variance + PROBE**2))
    likely += norm.logpdf(fell, -moved, np.sqrt(unsure))
    return likely


def other_room(old: Array, new: Array, error: float) -> float:
    """Probability that the new runs had another room, of the rooms (K,) [degC] of old and new runs, each known to `error` [K]."""
    usual = max(ROOM, ROOM_DEVIATIONS * float(old.std(ddof=1)) if len(old) > 2 else 0.0)
    deviation = error * np.sqrt(1.0 / len(old) + 1.0 / len(new))
    return float(norm.cdf((abs(float(new.mean() - old.mean())) - usual) / deviation))
