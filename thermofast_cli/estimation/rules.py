"""Every threshold of an estimate of one sensor, with its unit, its meaning and where it comes from; see ``docs/thresholds.md``."""

from dataclasses import dataclass

from thermofast.models.search.rules import BY_HAND, rule

ODD_HEATS = "set on an independent simulator's networks; what it takes away would mostly have missed: benchmarks.machines.odd_heats"


@dataclass(frozen=True)
class EstimationRules:
    """What decides in ``identify`` and ``sweep``."""

    fewest_readings: int = rule(6, "readings", "fewer are not identified", "three parameters and as many to judge them by")
    doubt: float = rule(
        1e-3, "1", "residuals of a right model look this patterned with this probability", "once in a thousand records"
    )
    widen: float = rule(
        0.05, "1", "residuals this patterned are no doubt yet, but intervals make room for their colour", "the usual 5 %"
    )
    unfit: float = rule(
        0.01, "1", "a machine of the prior's kind leaves the law this far with this probability", "once in a hundred records"
    )
    strong: float = rule(
        0.9,
        "1",
        "probability of an effect beside the law from which a row is doubtful, and past runs are not believed",
        BY_HAND,
    )
    kinked: float = rule(
        20.0,
        "1",
        "twice the log-likelihood ratio of a sensor, of a kink at one time in all, from which heat or cooling changed within",
        "benchmarks.unlike_parts.events_within: 5 of 120 runs without a change pass, 264 of 360 with one",
    )
    kinked_share: float = rule(
        0.05, "of what was moved", "that a kink has done until the last reading: less is a load that flutters", "as kinked"
    )
    kink_over: float = rule(
        2.0, "time constants", "after a kink, or times what came before it, from which on it is behind", BY_HAND
    )
    done: float = rule(
        0.1,
        "of the rise",
        "an effect beside the law is no doubt where no side of the interval is farther from the readings",
        BY_HAND,
    )
    outlying: float = rule(
        0.1, "of the readings", "left out as outliers at which a row is doubtful: a load that swings looks so, no probe", BY_HAND
    )
    contradicted: float = rule(
        3.0, "1", "log likelihood that readings gain without past runs, at which those are let go", "Markov: once in 20 at most"
    )
    heard_min: float = rule(
        25.0,
        "min",
        "read from which on a slow part behind a quick one shows, of machines that warm for hours: below it no row is `ok`",
        "benchmarks.intervals.two_masses --fast 3 8; by an independent simulator 46, 35, 9, 2 % missed at 15, 20, 30, 40 min",
    )
    heard_warm_min: float = rule(
        60.0,
        "min",
        "the same of a machine that is warm from before: its sensors begin apart",
        "benchmarks.unlike_parts.warm_starts; by an independent simulator 39, 13, 8, 2 % of rows missed at 30, 40, 50, 60 min",
    )
    heard_turns: float = rule(
        60.0,
        "time constants",
        "read that do as well: of what is small, and quick",
        "benchmarks.unlike_parts.chips: 5 to 20 s on heat sinks of 2 to 10 min; at six nearly every `ok` row missed",
    )
    past_until: float = rule(
        0.5,
        "time constants of past runs, a slow mass counted (a third of their time to 95 %)",
        "read, up to which intervals reach to what past runs say, where the readings let these go",
        "by an independent simulator: of repeats with a tank or windings 21 of 22 rows were let go at 0.2 to 0.4, none at 0.8; "
        "at 1 benchmarks.intervals.past_runs is twice as wide",
    )
    tried_until: float = rule(
        0.8, "of the window", "up to which identification times must be tried where the last has the least error", BY_HAND
    )
    fewest_times: int = rule(3, "times", "tried within a window, of which the one with the least error says anything", BY_HAND)
    other_rates: float = rule(
        2.0,
        "deviations from run to run",
        "that a run's rates are off past ones, by the median, beyond which intervals are those of its readings alone at least",
        "by an independent simulator: repeats are off by 0.5 at most, a heat capacity of 0.8 or 1.25 times by 2 and more",
    )
    searched: float = rule(
        3.0,
        "1",
        "log likelihood that all readings of a run must gain by effects that a search chose, over a machine's usual disturbance",
        "the choice of one of 14 effects costs its logarithm, 2.6",
    )
    searched_each: float = rule(
        1.0, "1", "the same of a sensor that may have an effect while others have none, once the run has gained so much", BY_HAND
    )
    hides: float = rule(0.1, "1", "probability that a slow second mass moves the limit out of the interval", BY_HAND)
    lawless: float = rule(
        0.15,
        "range of the readings",
        "residuals of the law, in a pattern, from which one exponential is no word about the record",
        "benchmarks.intervals.imperfect: what rows that are `ok` leave at most, with a dominant effect too",
    )
    silent_readings: float = rule(5.0, "of its readings", "that a sensor misses at the end, at which its row says so", BY_HAND)
    silent_share: float = rule(0.05, "of what it read", "the same, at least", BY_HAND)
    begins: float = rule(
        0.02, "of the rise", "from the law, at which the first reading tells where a rise begins", "2 % move t95 by 0.7 %"
    )
    back: float = rule(
        0.03, "1", "share of the way seen: a limit nearer than that to the beginning is a return, with no rise", BY_HAND
    )
    at_rest: float = rule(
        5.0,
        "noise",
        "that no reading went farther than where a sensor is said not to move",
        "of 10,000 normal ones the largest is 4",
    )
    kept_share: float = rule(
        0.5, "1", "of the earlier readings' weight: below it the filter's own state stands, not a likelihood", BY_HAND
    )
    widest: float = rule(5.0, "rise so far", "a wider interval of the steady state determines nothing", BY_HAND)
    farthest: float = rule(
        50.0, "what was seen of it", "a limit, or a side of one, farther from the last readings is no number", BY_HAND
    )
    backwards: float = rule(
        1.0, "rise so far", "an interval that reaches farther back behind where the sensor began determines nothing", BY_HAND
    )
    band_factor: float = rule(
        3.29 / 1.96, "1", "times the 95 % band that readings ahead may leave it by", "the normal quantile of one in a thousand"
    )
    claimed_factor: float = rule(1.0, "1", "as band_factor, for a band that counts the machine", "an interval holds or it does not")
    last_alone: int = rule(
        3, "readings", "at the end, left out in a row, that are a change and no outliers", "one outlier is no evidence"
    )
    fastest_step: float = rule(
        5.0, "largest other step", "from one reading to the next, beyond which no machine goes", "a heat switched off does one"
    )
    changed_share: float = rule(
        0.25, "of the sensors", "and two at least, whose last reading is left out: a change", "outliers of probes come one by one"
    )
    fresh: float = rule(
        0.5,
        "time constants",
        "since the load changed, before which a row is doubtful",
        "benchmarks.unlike_parts.stages; by an independent simulator 76 % of 261 rows sooner after a step held",
    )
    fresh_learnt: float = rule(
        0.25,
        "time constants",
        "the same by a model learnt from driven runs, of which it leaves a pattern",
        "by an independent simulator 67 of 80 rows sooner after a step held",
    )
    behind: float = rule(
        0.1,
        "largest movement of a sensor of the run",
        "below which another one is not determined at first, and tells its own rate",
        "a quarter of the ok rows of short records along a bar was wrong without it (benchmarks.machines.bodies --kinds far)",
    )
    behind_until: float = rule(
        1.0, "time constants of the sensors that move", "until then", "after one all ok rows along a bar hold (the same)"
    )
    still_until: float = rule(
        3.0, "time constants of the sensors that move", "until then, for one that does not move at all", BY_HAND
    )
    turned_until: float = rule(
        5.0,
        "times",
        "as long as a sensor went the other way before it turned, until which heat is on its way to it",
        "the same machines: of such rows that were `ok` 8 of 17 missed at 60 min, 5 of 24 at 90",
    )
    slow_share: float = rule(
        0.4,
        "of what a slow part of the machine that has a sensor may still go",
        "by which the intervals of the others reach on",
        "benchmarks.machines.bodies --kinds bed; by an independent simulator 177 of 220 `ok` rows held without, 214 with it",
    )
    slow_open: float = rule(
        0.7, "of the others' rise", "up to which such a part may come as long as its limit is not known", "the same machines"
    )
    slow_follows: float = rule(
        1.0,
        "times the share of its pace that a sensor itself has, at most that of what the slow part may still go",
        "by which its interval reaches on",
        "what follows it moves with it by then; the same machines",
    )
    still_others: float = rule(20.0, "noise", "that the others have moved by, at least", "four times what is no movement")
    jump: float = rule(
        10.0, "noise", "of a single step beyond fastest_step that is a probe's", "twice what no reading at rest reaches"
    )
    faster: float = rule(
        4.0,
        "1",
        "times as fast as the median of a run's other sensors, before these have settled, at which a row is doubtful",
        ODD_HEATS,
    )
    faster_slowest: float = rule(8.0, "1", "the same, as the slowest of them, of one that is said to have settled", ODD_HEATS)
    faster_until: float = rule(2.0, "time constants of the others", "after which they have settled", ODD_HEATS)
    far_beyond: float = rule(
        2.0, "half-widths", "beyond the limit claimed, at which readings ahead contradict it", "four deviations; a room may wander"
    )
    noise_factor: float = rule(3.29, "noise", "beside that", "the normal quantile of one in a thousand")
    share_outside: float = rule(0.05, "1", "of the readings ahead that must lie outside", "one outlier is no evidence")
    fewest_outside: int = rule(3, "readings", "that must lie outside", "one outlier is no evidence")
    fewest_complete: int = rule(30, "readings", "of a record that may be complete", "a last tenth of three readings")
    last_share: float = rule(0.1, "1", "of a complete record whose mean is the measured steady state", BY_HAND)
    drift_share: float = rule(0.2, "1", "of a record at its end that must not drift", BY_HAND)
    complete: float = rule(0.006, "rise", "of drift over that end at most", BY_HAND)
    agreed_min: float = rule(5.0, "min", "between the identification times of the windows that agree", BY_HAND)
    saturated_readings: int = rule(8, "readings", "at the extreme in a row that may be the end of the instrument's range", BY_HAND)
    frozen_readings: int = rule(
        20, "readings", "alike in a row, of a noise of a step or more, that a frozen probe gives", "once in 1e10 by chance"
    )
    frozen_finer: float = rule(
        0.3, "of a step", "noise from which on readings that repeat tell a frozen probe too, if more of them", "rounding's is 0.08"
    )
    frozen_before: int = rule(60, "readings", "before them, whose noise is looked at", BY_HAND)
    frozen_share: float = rule(0.1, "1", "of the readings before, at least: a machine that stands is quiet for a while", BY_HAND)
    fewest_of_room: int = rule(4, "readings", "of a logged room, within the time used", BY_HAND)
    room_gap: float = rule(0.25, "1", "share of the time used for which a room is not logged at most", BY_HAND)
    flat_readings: int = rule(5, "readings", "of a still beginning", BY_HAND)


RULES = EstimationRules()
