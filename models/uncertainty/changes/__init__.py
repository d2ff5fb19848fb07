"""What is different in a machine since other runs of it: heat, heat capacity, loss, one sensor, two exchanged, the contacts, the
room, or nothing.

Of every run the base law gives each sensor a rate b (loss over heat capacity) and a rise R (heat over loss), in logarithms. A
change of the heat moves all rises, of the heat capacity all rates, of the loss rates up and rises down, of one sensor its own
numbers, of the contacts between parts anything; of two that were exchanged each has the other's numbers; another room moves
neither, but where the runs begin. Each is a line, a plane or a place
through no change; how likely each is follows from the marginal likelihood of the difference, run-to-run scatter and the errors of
the fits counted, sizes unknown.
"""

from .begun import ROOM_BETWEEN, WARM, Begun, begun_beside, other_room, with_offset, with_room
from .change import Change
from .kinds import WHOLE, Compared, changes
from .numbers import LOCAL, LOGGED_DRIFT, RunNumbers, beside_others, by_length, logged_late, rates_and_rises, without_room

__all__ = [
    "LOCAL",
    "LOGGED_DRIFT",
    "ROOM_BETWEEN",
    "WARM",
    "WHOLE",
    "Begun",
    "Change",
    "Compared",
    "RunNumbers",
    "begun_beside",
    "beside_others",
    "by_length",
    "changes",
    "logged_late",
    "other_room",
    "rates_and_rises",
    "with_offset",
    "with_room",
    "without_room",
]
