"""``identify --auto``: intervals that count that the effect found may not be the one at work."""

import math
from dataclasses import replace

from scipy.optimize import brentq
from scipy.special import ndtr

from ..estimation.estimate import NOT_LIKELIER
from ..records import IdentifyRecord

#: Probability that what was added is not what is at work: what benchmarks.discovery.dominant finds wrong, and look-alikes in a
#: short record; of sets of three and more, of which benchmarks.discovery.several_effects finds one in four another one.
UNTRUE, SET_UNTRUE = 0.15, 0.25
#: Effects from which on a set is no ground for ``ok``.
MANY = 3
#: How what a search added begins in a message.
FOUND = "--auto: "
#: An interval that grows by more than this factor is told.
WIDER = 1.5
#: Estimate and both sides.
TRIPLES = (
    ("steady_state_c", "steady_state_lo_c", "steady_state_hi_c"),
    ("t95_min", "t95_lo_min", "t95_hi_min"),
    ("time_to_go_min", "time_to_go_lo_min", "time_to_go_hi_min"),
    ("at_c", "at_lo_c", "at_hi_c"),
    ("room_steady_c", "room_steady_lo_c", "room_steady_hi_c"),
    ("trip_min", "trip_lo_min", "trip_hi_min"),
    ("missing_k", "missing_lo_k", "missing_hi_k"),
)


def averaged(added: IdentifyRecord, plain: IdentifyRecord, effects: int) -> IdentifyRecord:
    """The record with so many effects added, its 95 % intervals those of a mixture with the record without them.

    A side that one of the two leaves open is that of the first. What was found and is not counted has no part in it: the record is
    that without it, whatever other sensors share with this one. Where the readings do not determine what it adds, and settle by
    themselves as a machine with usual disturbances may, it is not counted.
    """
    found = [part.replace(" added, ", " found, ") for part in added.message.split("; ") if part.startswith(FOUND)]
    if NOT_LIKELIER in added.message:
        return replace(plain, message="; ".join(part for part in (NOT_LIKELIER, plain.message, *found) if part))
    sides = added.steady_state_lo_c, added.steady_state_hi_c
    if added.status == "not_determined" and None in sides and plain.status == "ok":
        told = "with it these readings would not bound the steady state, and it is not counted"
        return replace(plain, message="; ".join(part for part in (plain.message, *found, told) if part))
    changed: dict[str, float | str] = {}
    untrue = UNTRUE if effects < MANY else SET_UNTRUE
    for middle, low, high in TRIPLES:
        one, other = ([getattr(r, name) for name in (middle, low, high)] for r in (added, plain))
        if None in one or None in other:
            continue
        changed[low], changed[high] = _quantile(one, other, 0.025, untrue), _quantile(one, other, 0.975, untrue)
    below, above = changed.get("steady_state_lo_c"), changed.get("steady_state_hi_c")
    if isinstance(below, float) and isinstance(above, float):
        own = (added.steady_state_hi_c or 0.0) - (added.steady_state_lo_c or 0.0)
        if above - below > WIDER * own:
            changed["message"] = (
                f"{added.message}; without what was added {plain.steady_state_c:.2f} degC would come: the interval counts it"
            )
    if effects >= MANY and added.status == "ok":
        changed["status"] = "model_doubtful"
        changed["message"] = (
            f"{effects} effects had to be added, which others may explain as well; {changed.get('message', added.message)}"
        )
    return replace(added, **changed)  # type: ignore[arg-type]


def _quantile(one: list[float], other: list[float], probability: float, untrue: float) -> float:
    """Of two normals joined at their estimates, the second with the weight `untrue`."""

    def below(x: float, three: list[float]) -> float:
        middle, low, high = three
        spread = (middle - low if x < middle else high - middle) / 1.96
        return float(ndtr((x - middle) / spread)) if spread > 0.0 else float(x >= middle)

    def missing(x: float) -> float:
        return (1.0 - untrue) * below(x, one) + untrue * below(x, other) - probability

    reach = max(one[2], other[2]) - min(one[1], other[1]) + 1e-9
    first, last = min(one[1], other[1]) - reach, max(one[2], other[2]) + reach
    if not (math.isfinite(first) and math.isfinite(last) and missing(first) < 0.0 < missing(last)):
        return one[1] if probability < 0.5 else one[2]
    return float(brentq(missing, first, last, xtol=1e-6))
