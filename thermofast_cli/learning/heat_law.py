"""To which power, and how late, the heat follows the column that drives it."""

from dataclasses import dataclass

from thermofast.models.effects.load_step import DriveLaw
from thermofast.models.joint import Fit, Key
from thermofast.models.search.candidates import Candidate, try_add
from thermofast.models.search.dominant import beats_disturbance
from thermofast.models.search.judge import widening
from thermofast.models.search.rules import RULES

from ..errors import rounded


@dataclass(frozen=True)
class HeatLaw:
    """A fit with the power, the 95 % half-width of the power, and the law in words."""

    candidate: Candidate
    power: float
    half_width: float
    words: str

    @property
    def may_be_none(self) -> bool:
        """Whether the heat may not follow its drive at all."""
        return self.power - self.half_width <= 0.0


def heat_law(fit: Fit) -> HeatLaw | None:
    """Of a driven fit, where its readings tell the law surely from a proportion, and from a disturbance; else None."""
    law = try_add(fit, DriveLaw())
    if law is None or not law.identifiable.ok or not beats_disturbance(fit, law, RULES.false_alarm, 1):
        return None
    at, effect = len(law.parts) - 1, law.parts[-1].effect
    amplitude = Key(at, effect.amplitude)
    power, half_width = 1.0 + float(law.fit.values[amplitude]), 1.96 * widening(law.fit) * float(law.fit.deviations[amplitude])
    others = [p for p in effect.active(law.parts[-1].choice) if p.name != effect.amplitude]
    beside = "".join(f", {p.name} {rounded(float(law.fit.values[Key(at, p.name)]))} {p.unit}" for p in others)
    words = f"the heat follows {fit.run.drive} to the power {power:.3g} ± {half_width:.2g}{beside}"
    return HeatLaw(law, power, half_width, words)
