"""Every threshold of the search, with its unit, its meaning and where it comes from; ``docs/thresholds.md`` is made of it."""

from dataclasses import dataclass, field
from typing import Any


def rule(default: Any, unit: str, meaning: str, source: str) -> Any:
    """A field of a settings object that tells what it is and where its value comes from."""
    return field(default=default, metadata={"unit": unit, "meaning": meaning, "source": source})


BY_HAND = "set on the simulator that training records are drawn from; what the whole comes to is docs/proof.md"
COST = "how far the search looks: set by hand so that the times of docs/figures.md hold"


@dataclass(frozen=True)
class SearchRules:
    """What decides in the search for missing effects. Ratios are likelihood ratios: twice the logarithm."""

    false_alarm: float = rule(
        0.01, "1", "chance, over all effects and sensors of a run, of naming what is not there", "docs/false-alarms.md"
    )
    pattern: float = rule(
        1e-3,
        "1",
        "a right model's residuals look this patterned, over all sensors, with this probability",
        "once in a thousand runs",
    )
    pair_pattern: float = rule(1e-2, "1", "the same for the residuals of a pair", BY_HAND)
    sound: float = rule(
        0.05, "1", "a single effect whose residuals look like noise with this probability is not doubted", "the usual 5 %"
    )
    rounding: float = rule(0.1, "logger's steps", "a smaller misfit is not told from rounding", BY_HAND)
    too_large: float = rule(1.35, "noise", "larger residuals are more than noise", BY_HAND)
    equal: float = rule(9.0, "likelihood ratio", "within it two models fit equally well", "three deviations of one parameter")
    nearly: tuple[float, float] = rule(
        (12.0, 30.0), "likelihood ratio", "short of the best by less, a rival stays possible: at least, a quarter, at most", BY_HAND
    )
    worth: float = rule(
        12.0, "likelihood ratio", "what a way of acting with one more parameter must gain over the plain one", "chance of 1 in 2000"
    )
    jump_share: float = rule(0.3, "of its range", "change of a logged column between two readings that is a jump", BY_HAND)
    soon: float = rule(
        0.02, "of the record", "by which an event may come after a column's jump and be it: probes are late", BY_HAND
    )
    worth_another: float = rule(20.0, "likelihood ratio", "a round of refinement that gains less is the last", COST)
    one_way: float = rule(
        16.0,
        "likelihood ratio",
        "what a neighbour may lose of a sensor's fit against one that is not warmed by the sensor in turn",
        "four deviations of one parameter: heat is conducted both ways",
    )
    moved: float = rule(10.0, "noise", "a sensor that moves by less warms no other so that it shows", BY_HAND)
    concerned: float = rule(0.01, "1", "chance at which a sensor's gain makes it one that has the effect", "once in a hundred runs")
    in_part: float = rule(
        0.75,
        "1",
        "share of a sensor's squared residuals that a cause of one part of the machine must explain in each of its sensors",
        BY_HAND,
    )
    needed: float = rule(4.0, "standard errors", "a sensor with less of the effect is tried without it", BY_HAND)
    sure: float = rule(1.5, "standard errors", "an amplitude nearer to nothing is not determined", BY_HAND)
    alike: float = rule(0.99995, "1", "correlation from which the record does not tell two parameters apart", BY_HAND)
    vague: float = rule(1.2, "1", "standard error of a logarithm from which a scale is not known", "a factor of three either way")
    beyond_disturbance: float = rule(
        5.0,
        "times what chance gives",
        "evidence over an unknown disturbance from which an effect is named although a pattern remains",
        "benchmarks.discovery.dominant: wrong names against missed ones on one simulator, tried on two others",
    )
    least_evidence: float = rule(
        100.0,
        "likelihood ratio",
        "evidence over an unknown disturbance below which an effect is not named while a pattern remains",
        "benchmarks.discovery.dominant: a thermometer's drift named on backgrounds of one simulator in 4 of 160 without it",
    )
    likeliest: float = rule(
        0.4,
        "of what names",
        "evidence from which identify --auto counts an effect that is not named, and calls no row sure",
        "benchmarks.discovery.auto --acted",
    )
    beyond_alone: float = rule(
        1.5,
        "times what chance gives",
        "the same for a single effect that leaves no pattern",
        "faint effects of ../shared/cases/clean",
    )
    beyond_once_more: float = rule(
        8.0,
        "times what chance gives",
        "the same for an effect beside those named: what remains is a machine's usual background",
        BY_HAND,
    )
    roundabout: tuple[float, float] = rule(
        (0.001, 0.95),
        "1",
        "share of the misfit that one effect may leave at most, and share of a pair's gain that it has at least, to be named "
        "before a pair without it",
        "a load that fell to 0.63: a changed loss and a friction that ran in drew it with what the room did",
    )
    pair_leaves: float = rule(
        0.1,
        "of what the best single effect leaves",
        "that two together leave at most, to be named for that",
        "benchmarks.discovery.acts_twice, and quieter machines: backgrounds leave 0.17 and more, pairs that are there 0.01 to 0.1",
    )
    pair_rival: float = rule(3.0, "times", "what such two leave, up to which other two may be as good", BY_HAND)
    beyond_pair: float = rule(4.0, "times what chance gives", "evidence asked of each of such two beside the other", BY_HAND)
    least_share: float = rule(0.25, "1", "share of the misfit that an effect must explain to be named so", BY_HAND)
    takes: float = rule(
        0.5,
        "1",
        "share of what a named effect leaves that one more must take away, not sure enough to be named, for its "
        "size to be told as uncertain as this has it",
        "benchmarks.analysis.linked_events: links are seldom surer than a disturbance, and draw half of a change of the loss",
    )
    mostly: float = rule(
        0.9,
        "1",
        "share of the misfit below which twice the evidence is asked for",
        "benchmarks.discovery.dominant: disturbances outside the catalogue",
    )
    both: float = rule(
        1.5,
        "times the likelihood ratio",
        "of what is named one after the other, that two effects together must have to take its place",
        "by an independent simulator: machines with a second mass and a load that changed",
    )
    known_size: float = rule(
        1.25,
        "times",
        "an effect of what is logged may be larger or smaller than physics has it, and needs no more evidence than chance gives",
        "a logged room acts as it is: by an independent simulator, records with a room that rises by 5 K",
    )
    room_share: float = rule(
        0.4, "rise so far", "a logged room that moves by more, and in the machine's shape, is warmed by it: not used", BY_HAND
    )
    room_unlike: float = rule(0.2, "1", "share of its variance that the machine's shape leaves of such a room at most", BY_HAND)
    room_least: float = rule(1.0, "K", "by which it must have moved at least", BY_HAND)
    overruled: float = rule(
        2.5, "1", "times that evidence overrules an amplitude that is near nothing by the curvature there", "records without a room"
    )
    white_share: float = rule(0.1, "misfit", "structure below this share of the misfit counts as white", "trial of six rules")
    rival: float = rule(
        0.75, "1", "share of the best one's evidence from which another one may be as good", "benchmarks.discovery.dominant"
    )
    leaves: float = rule(
        1.25, "1", "of the misfit that the best one leaves, which another one that may be as good leaves at most", BY_HAND
    )
    as_good: float = rule(
        0.85,
        "1",
        "the same of its likelihood ratio under white noise, and of the evidence where the best is not sound",
        "benchmarks.discovery.dominant",
    )
    most_effects: int = rule(4, "effects", "that are named beside each other", "what a reader takes in")
    pairs: int = rule(24, "pairs", "looked at", COST)
    partners: int = rule(4, "effects", "that each single brings", COST)
    far: float = rule(2.0, "noise", "a quick pair that leaves more is not looked at with care: it will not come down to it", COST)
    refined: int = rule(3, "pairs", "in which each effect is looked for anew beside the other", COST)
    exchanged: int = rule(5, "effects", "tried in the place of each one of the best pair", COST)
    grown: int = rule(3, "sets", "that are grown by one effect more", COST)
    quick_sets: int = rule(24, "sets", "of three, then of four, that get a quick look", COST)
    most_left_quick: float = rule(
        0.6,
        "share of the misfit",
        "that one effect more may leave of it at a quick look; more ends the search",
        "48 machines with three and four effects: the same sets are found with 0.75, in less time",
    )
    most_left: float = rule(0.6, "share of the misfit", "the same with each effect looked for anew", COST)
    most_left_of_little: float = rule(
        0.45, "share of the misfit", "the same where less is left than `little`", "the same machines: 0.43 where the set was right"
    )
    little: float = rule(0.03, "share of the misfit of the base model", "a machine's usual background beside what dominates", COST)
    replaced: int = rule(3, "effects", "tried in the place of each one of the best larger set", COST)
    close: float = rule(
        200.0, "likelihood ratio", "short of the best by more at a quick look, a set is no rival to look at with care", COST
    )
    rivals: int = rule(4, "sets", "that are looked at with care for whether they explain as much as the best", COST)
    most_also: int = rule(6, "sets", "of rivals that are named", "what a reader takes in")
    followed: int = rule(3, "starts", "of a shared effect that are followed to their end", COST)
    quick: int = rule(14, "iterations", "of a quick look", COST)
    careful: int = rule(25, "iterations", "of a careful one", COST)
    parameter_costs: float = rule(
        6.0, "likelihood ratio", "what each parameter of a way of acting must gain, where ways are compared", BY_HAND
    )
    partner: float = rule(25.0, "likelihood ratio", "that a partner of a good effect must promise", BY_HAND)
    glance: int = rule(8, "iterations", "of the first look at every start that each sensor has for itself", COST)
    glance_at_links: int = rule(18, "iterations", "of the first look at neighbours, whose order is told by small differences", COST)
    carried_on: int = rule(3, "starts", "of these that are carried on", COST)


RULES = SearchRules()
