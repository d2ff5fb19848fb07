"""What a run is once it is read, and what was guessed on the way."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Guess:
    """What the file does not say and the reader had to take for granted.

    about is one of time, unit, date order, role, layout, runs, encoding; text says what was taken and why; option overrules it.
    """

    about: str
    text: str
    option: str

    def __str__(self) -> str:
        return f"guessed: {self.text} ({self.option})"

    def as_dict(self) -> dict[str, str]:
        return {"about": self.about, "text": self.text, "option": self.option}


def told(guesses: Iterable[Guess]) -> str:
    """All guesses in one line; empty without any."""
    return "; ".join(map(str, guesses))


@dataclass(frozen=True)
class Run:
    """One run: time_s (N,) ascending seconds from the first reading, channels name -> (N,) degC with nan for no reading.

    `notes` say what was taken for what, and what was mended; `guesses` what the file did not say; `channel_notes` what was mended
    in one sensor. `displacements` are columns in um.
    """

    name: str
    time_s: Array
    channels: dict[str, Array]
    ambient: dict[str, Array] = field(default_factory=dict)
    inputs: dict[str, Array] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    channel_notes: dict[str, str] = field(default_factory=dict)
    displacements: dict[str, Array] = field(default_factory=dict)
    guesses: tuple[Guess, ...] = ()
