"""What a record is once it is read, and what the user may say about how to read it."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Options:
    """The user's word against the rules; None leaves a thing to its rule."""

    time: str | None = None
    time_unit: str | None = None
    time_format: str | None = None
    interval_s: float | None = None
    ambient: str | None = None
    inputs: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    delimiter: str | None = None
    decimal: str | None = None
    encoding: str | None = None
    header_line: int | None = None


@dataclass(frozen=True)
class Run:
    """One record: time_s (N,) ascending seconds from the first reading, channels name -> (N,) degC with nan for no reading.

    `notes` say what was taken for what, and what was mended; `channel_notes` what was mended in one sensor.
    `displacements` are columns in um.
    """

    name: str
    time_s: Array
    channels: dict[str, Array]
    ambient: dict[str, Array] = field(default_factory=dict)
    inputs: dict[str, Array] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    channel_notes: dict[str, str] = field(default_factory=dict)
    displacements: dict[str, Array] = field(default_factory=dict)
