"""What test standards ask of a temperature record: when a test may stop, and what is reckoned from it then."""

from .criteria import LONGEST_GAP, PRESETS, Criterion, criterion_from
from .switch_off import SwitchOff, temperature_at_switch_off
from .three_point import three_point

__all__ = ["LONGEST_GAP", "PRESETS", "Criterion", "SwitchOff", "criterion_from", "temperature_at_switch_off", "three_point"]
