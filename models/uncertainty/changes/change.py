"""A kind of change, and how likely each is before the runs are looked at."""

from dataclasses import dataclass

#: Prior probabilities: three tests in four are repeated without anything having changed.
PRIORS = {"nothing": 0.74, "heat": 0.06, "heat capacity": 0.06, "loss": 0.06, "sensor": 0.035, "contact": 0.035, "exchanged": 0.01}


@dataclass(frozen=True)
class Change:
    """One kind of change: its probability, and the logarithm of its size with its deviation; sensor is that of a `sensor`, with
    other one of two that were `exchanged`.

    size is the factor on heat, heat capacity or loss; of a sensor the factor on its rise; of the contacts that on the rise of the
    sensor that moved most; of the room the difference [K], not a logarithm; None for `nothing`. kelvin: of a sensor as well, whose
    probe tells another temperature throughout; shows: deviation [K] of what parts that from a place that was warm before.
    """

    kind: str
    sensor: int | None
    probability: float
    size: float | None = None
    deviation: float | None = None
    kelvin: bool = False
    shows: float | None = None
    other: int | None = None
