"""Which column is what: surroundings, logged inputs, sensors; and their unit."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..errors import UsageError, listed
from .run import Array, Options
from .times import words

AMBIENT = frozenset(
    [
        "ambient",
        "room",
        "air",
        "surroundings",
        "surrounding",
        "environment",
        "env",
        "umgebung",
        "raum",
        "raumluft",
        "luft",
        "hall",
        "环境",
        "室温",
    ]
)
INPUTS = frozenset(
    [
        "speed",
        "rpm",
        "load",
        "power",
        "duty",
        "heater",
        "voltage",
        "current",
        "coolant",
        "fan",
        "flow",
        "torque",
        "humidity",
        "pressure",
        "pump",
        "door",
        "valve",
        "drehzahl",
        "last",
        "leistung",
        "spannung",
        "strom",
    ]
)
COUNTERS = frozenset(["no", "nr", "index", "idx", "sample", "scan", "record", "count", "row", "number", "id"])
#: Words of a thermal displacement; the unit alone says it too, as in ``Z (um)``.
DISPLACEMENTS = frozenset(
    [
        "mm",
        "um",
        "µm",
        "μm",
        "micron",
        "microns",
        "disp",
        "displacement",
        "displacements",
        "verlagerung",
        "verschiebung",
        "热位移",
        "位移",
    ]
)
ABSOLUTE_ZERO_C = -273.15
HOTTEST_C = 5000.0


@dataclass(frozen=True)
class Roles:
    """Column names by what they are."""

    ambient: tuple[str, ...]
    inputs: tuple[str, ...]
    sensors: tuple[str, ...]
    counters: tuple[str, ...]
    displacements: tuple[str, ...] = ()


def check_names(wanted: Iterable[str], known: Iterable[str], option: str, run: str) -> None:
    """Raises UsageError for a name that is no column."""
    known = list(known)
    for name in wanted:
        if name not in known:
            raise UsageError(
                f"{run}: {option} {name!r} is no column of this record",
                allowed=listed(known),
                do="use a name as it stands in the header",
            )


def classify(names: list[str], values: dict[str, Array], units: dict[str, str], options: Options, run: str) -> Roles:
    """Roles of the numeric columns, by the user's word first and by their names else."""
    check_names(options.channels, names, "--channels", run)
    check_names(options.inputs, names, "--inputs", run)
    if options.ambient:
        check_names([options.ambient], names, "--ambient", run)
    ambient, inputs, sensors, counters, displacements = [], [], [], [], []
    for name in names:
        told = set(words(name)) | ({name} if not name.isascii() else set())
        if name in options.exclude:
            continue
        if name == options.ambient:
            ambient.append(name)
        elif name in options.inputs:
            inputs.append(name)
        elif name not in options.channels and (told | set(words(units.get(name, "")))) & DISPLACEMENTS:
            displacements.append(name)
        elif options.channels:
            if name in options.channels:
                sensors.append(name)
            elif told & AMBIENT and not options.ambient:
                ambient.append(name)
            elif told & INPUTS:
                inputs.append(name)
        elif told & AMBIENT and not options.ambient:
            ambient.append(name)
        elif told & INPUTS:
            inputs.append(name)
        elif (told & COUNTERS or name == "column 1") and _counts(values[name]):
            counters.append(name)
        else:
            sensors.append(name)
    return Roles(tuple(ambient), tuple(inputs), tuple(sensors), tuple(counters), tuple(displacements))


def _counts(values: Array) -> bool:
    return len(values) > 1 and bool(np.all(np.diff(values) == 1.0))


def to_celsius(name: str, unit_cell: str, values: Array) -> tuple[Array, str | None]:
    """Temperatures in degC and a note where they were in another unit, told by the name (``T_kelvin``, ``T [K]``) or unit line."""
    unit = _temperature_unit(name.rstrip("0123456789"), unit_cell.strip("[]() ").lower())
    # (K) may be the type of a thermocouple: nothing in a test lab is colder than 170 K.
    if unit == "K" and np.isfinite(values).any() and float(np.nanmedian(values)) > 170.0:
        return values + ABSOLUTE_ZERO_C, f"{name}: kelvin, turned into degC"
    if unit == "F":
        return (values - 32.0) / 1.8, f"{name}: degF, turned into degC"
    return values, None


@lru_cache(maxsize=4096)
def _temperature_unit(name: str, unit: str) -> str | None:
    if unit in ("k", "kelvin", "°k", "degk", "deg k") or re.search(r"(?i:kelvin)|[\[(]K[\])]|[_ /]K$|(?i:deg) ?K\b|°K", name):
        return "K"
    if unit in ("f", "°f", "degf", "deg f", "fahrenheit") or re.search(
        r"(?i:fahrenheit)|[\[(]°?F[\])]|[_ /]F$|(?i:deg) ?F\b|°F", name
    ):
        return "F"
    return None


def to_micrometres(name: str, unit_cell: str, values: Array) -> tuple[Array, str | None]:
    """Displacements in um and a note where they were in mm, told by the name or the unit line."""
    if "mm" in {*words(name), *words(unit_cell)}:
        return values * 1000.0, f"{name}: mm, turned into um"
    return values, None


def without_impossible(values: Array) -> tuple[Array, int]:
    """Overload values (9.9E+37) and temperatures below absolute zero become nan; and how many there were."""
    with np.errstate(invalid="ignore"):
        bad = (values <= ABSOLUTE_ZERO_C) | (values > HOTTEST_C)
    if not bad.any():
        return values, 0
    return np.where(bad, np.nan, values), int(bad.sum())
