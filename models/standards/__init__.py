"""What test standards ask of a temperature record: when a test may stop, and what is reckoned from it then."""

from .criteria import PRESETS, Criterion, criterion_from
from .three_point import three_point

__all__ = ["PRESETS", "Criterion", "criterion_from", "three_point"]
