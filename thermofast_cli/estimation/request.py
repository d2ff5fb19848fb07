"""What is asked of the sensors of a run, and with what it is answered."""

from dataclasses import dataclass

import numpy as np

from thermofast.filters import Filter
from thermofast.models import PrintedLump
from thermofast.models.imperfection import TYPICAL, Imperfection, Past, Rates
from thermofast.models.uncertainty.first_passage import Pace

from ..standards.stopping import Rule
from .estimate import Model


@dataclass(frozen=True)
class Method:
    """What every sensor of a run is treated with.

    paces: how the rate will change after the last reading used; imperfection: how far the machine may leave the law; rates: what
    sensors tell each other; past: what complete runs say; changed_min, jumps_min: when what is logged jumped before, and after.
    """

    model: Model
    filter: Filter
    paces: tuple[Pace, ...] = ()
    imperfection: Imperfection = TYPICAL
    rates: Rates = "auto"
    past: Past | None = None
    changed_min: float | None = None
    jumps_min: float = np.inf

    @property
    def widens(self) -> bool:
        """Whether the closing estimate counts the machine: not with the bare law, and not for a filter whose own state stands."""
        exact = self.imperfection.none and self.rates == "own" and self.past is None
        return not exact and self.filter.closing != "never" and not isinstance(self.model, PrintedLump)

    @property
    def steadies(self) -> bool:
        """Whether a swing that goes on all the time is taken out: not where a model of the machine foretells its rise."""
        return self.widens and not self.imperfection.none and not (self.past is not None and self.past.rises)


@dataclass(frozen=True)
class Question:
    """What is asked of each sensor of a run.

    until_min: from which first minutes, None for all; at_min [min after the start]: for the temperature then; room_c [degC]: for
    the steady state in such a room; rule: when it holds; together: by one adaptive fading filter over all sensors; details: with
    trace and curves.
    """

    until_min: float | None = None
    at_min: float | None = None
    room_c: float | None = None
    rule: Rule | None = None
    together: bool = False
    details: bool = False


#: Steady state and settling time from all that was read.
EVERYTHING = Question()
