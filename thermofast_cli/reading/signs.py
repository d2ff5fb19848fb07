"""What the name and the unit of a column say that it is: a sensor, the room, a set point, a load, a counter."""

import re
from dataclasses import dataclass
from functools import lru_cache

from .units import Unit, names_probe, parse_unit, unit_in_name
from .vocabulary import (
    AMBIENT,
    AMBIENT_PARTS,
    AMBIENT_STEMS,
    BESIDE,
    CALENDAR,
    CHANNELS,
    DERIVED,
    DISPLACEMENTS,
    EXTREMES,
    FLAGS,
    INPUT_ENDINGS,
    INPUT_NAMES,
    INPUT_PARTS,
    INPUTS,
    MEANS,
    NAMELESS,
    NOT_TEMPERATURE,
    OTHER,
    PARTS,
    PLACES,
    QUALITIES,
    QUANTITIES,
    REFERENCE,
    TEMPERATURE,
    TEMPERATURE_PARTS,
    WANTED,
    WANTED_PARTS,
    WANTED_STEMS,
    WARM_INPUTS,
    WEATHER,
    words,
)

#: Units of one letter in brackets that may also be the name of a place (phase A, side N).
_LETTERS = frozenset(["A", "N", "W", "J", "m", "g", "h", "d"])
#: Channels of a data acquisition board that nobody named: they are volts until a unit says otherwise.
_BOARD = re.compile(r"(?i)(dev|mod|cdaq\w*)?\d*[/_ ]?ai[/_ ]?\d*$")
#: Names of differences: dT, Rear ΔT, T1-T2, T front - T rear, ±T1; and of an uncertainty: u(T1).
_DIFFERENCE = re.compile(
    r"[dDΔ]_?T(?![a-z])|.*\bΔ_?T\b|u\(|±|([A-Za-z]{1,3})\d+ ?[-−–] ?\1\d*\b|([A-Za-z]{1,3})[ _]\S.* [-−–] \2[ _]\S"
)


@dataclass(frozen=True)
class Sign:
    """What a column's name and unit line say of it. kind: sensor, ambient, input, displacement, other, named, nameless."""

    kind: str
    unit: Unit | None
    #: Whether it is said to be a temperature: by its unit, or by a word.
    temperature: bool


#: What a controller's tags begin with: [PLC]T_Front.
_CONTROLLER = re.compile(r"^\[[^\[\]]+\](?=[^\W\d])")
#: How the second column of a name is called.
_WHICH = re.compile(r" \(\d\)$")


def sign_of(name: str, unit_cell: str) -> Sign:
    """What name and unit line say of a column; digits at the end of a name say nothing, nor which of its name it is."""
    return _sign(_WHICH.sub("", name).rstrip("0123456789"), unit_cell)


@lru_cache(maxsize=4096)
def _sign(name: str, unit_cell: str) -> Sign:
    name = _CONTROLLER.sub("", name)
    core = re.sub(r"[\[(].*", "", name).split(", ")[0]
    said = set(words(name)) | ({name} if not name.isascii() else set())
    first = set(words(core)) or said
    first |= _said_in_brackets(name)
    unit = parse_unit(unit_cell) or unit_in_name(name)
    spoken = _speaks_of_temperature(core or name, said) or names_probe(name)
    if unit is not None and unit.symbol in _LETTERS and spoken:
        unit = None
    degrees = unit is not None and unit.temperature
    temperature = degrees or (spoken and unit is None)
    if (said & FLAGS and unit is None) or name.lower() in CALENDAR:
        kind = "other"
    elif (
        _wanted(name, first)
        or (first | (said & QUALITIES)) & DERIVED
        or _over_the_room(core)
        or re.match(_DIFFERENCE, name)
        or _is_reference(first)
        or (said & WEATHER and not said & PLACES)
    ):
        kind = "input"
    elif (said | set(words(unit_cell))) & DISPLACEMENTS and (unit.kind == "length" if unit is not None else not spoken):
        kind = "displacement"
    elif _is_ambient(name, first, spoken or degrees) and (unit is None or degrees):
        kind = "ambient"
    elif temperature:
        kind = "sensor"
    elif unit is not None and unit.kind in ("number", "time"):
        kind = "other"
    elif unit is not None or _BOARD.fullmatch(name.strip()) or _is_input(name, said):
        kind = "input"
    elif said & OTHER:
        kind = "other"
    else:
        kind = "named" if _means_something(said, name) else "nameless"
    return Sign(kind, unit, temperature)


def _said_in_brackets(name: str) -> set[str]:
    """Words of a bracket that says nothing but room or set point: T3 (ambient) [°C]."""
    told = [set(words(inside)) for inside in re.findall(r"\(([^()]+)\)", name)]
    return set().union(*(w for w in told if w and w <= AMBIENT | WANTED | BESIDE and w & (AMBIENT | WANTED)))


def _is_input(name: str, said: set[str]) -> bool:
    """Whether a name without unit is that of a load, a supply, ...; the bearing of a pump is a place on the machine."""
    if said <= INPUT_NAMES:
        return bool(said)
    told = said & INPUTS
    if told and told <= WARM_INPUTS and said & PLACES and words(name)[-1] not in QUANTITIES:
        return False
    return bool(told or any(w.endswith(INPUT_ENDINGS) for w in said) or any(part in name for part in INPUT_PARTS))


def _wanted(name: str, said: set[str]) -> bool:
    if any(w.startswith(WANTED_STEMS) for w in said) or any(part in name for part in WANTED_PARTS):
        return True
    if re.search(r"(?:\.(?:OP|MV|CO)|_OP)$", name):
        return True  # what a controller puts out
    asked = said & WANTED
    if asked <= {"sp", "sv"} and re.search(r"(?i)\bs[pv]\d", name):
        return bool(asked) and not said & PLACES and "sp" not in asked  # the servo motors of a machine, and its spindles
    return bool(asked)


def names_the_room_alone(name: str) -> bool:
    """Whether a label has no other word than that of the room."""
    said = set(words(name))
    return bool(said & AMBIENT) and said <= AMBIENT | BESIDE | TEMPERATURE


def names_all_sensors(name: str) -> bool:
    """Whether a name is that of the mean, the least or the greatest of all: Max [°C], Mittelwert."""
    said = set(words(re.sub(r"[\[(].*", "", name)))
    return bool(said) and said <= MEANS | EXTREMES


def names_a_set_point(name: str) -> bool:
    """Whether a label says what is asked for."""
    return _wanted(name, set(words(name)))


def _is_reference(said: set[str]) -> bool:
    """Whether a name is that of the instrument's own temperature: CJC, T_ref, Cold junction; not the machine's Reference block."""
    if {"cold", "junction"} <= said:
        return True
    loose = {"ref", "reference", "referenz", "internal", "panel", "board", "logger", "device", "instrument", "gerät"}
    if said & (REFERENCE - loose) or any(w.startswith(("vergleichsstell", "klemmentemp", "kaltstell")) for w in said):
        return True
    return bool(said & loose) and said - loose <= BESIDE


def _is_ambient(name: str, said: set[str], spoken: bool) -> bool:
    """Whether a name is that of the surroundings; air and hall only where no part of the machine is named beside them."""
    if said & PLACES:
        return False  # the room side of a bearing
    if _names_the_room(said) or any(part in name for part in AMBIENT_PARTS):
        return True
    loose = {"air", "luft", "hall", "tu", "outside", "klima", "aussen", "außen", "extérieur", "exterieur"}
    if said & (AMBIENT - loose):
        return spoken or not said & INPUTS
    return bool(said & loose) and said - AMBIENT <= BESIDE


def _speaks_of_temperature(name: str, said: set[str]) -> bool:
    bare = name.strip(" _")
    return bool(
        said & TEMPERATURE
        or (not name.isascii() and any(part in name for part in TEMPERATURE_PARTS))
        or any("temperat" in w or ((w.startswith("temp") or w.endswith("temp")) and w not in NOT_TEMPERATURE) for w in said)
        or any("温度" in w for w in said)
        or (
            re.fullmatch(r"[Tt]|[Tt][ _].*|T[A-Z][a-z]*|T[a-z]{1,3}", bare) is not None
            and not said & (INPUTS | OTHER) - WARM_INPUTS
        )
        or (re.match(r"[Tt]\d+[ _-]", bare) is not None and said & (PLACES | PARTS) and not said & INPUTS)
    )


def _over_the_room(core: str) -> bool:
    """Whether a name is that of a difference to the surroundings: front - room, rise over ambient."""
    apart = re.split(r"\s*[-\u2013]\s*|\s+(?:over|above|minus)\s+", core.strip())
    before = {w for w in words(apart[0]) if not w.isdigit()}
    alone = before <= TEMPERATURE | BESIDE | CHANNELS  # T-Halle, as T hall; Channel 2 - Ambient
    return len(apart) == 2 and all(apart) and bool(set(words(apart[1])) & AMBIENT) and not alone


def _names_the_room(said: set[str]) -> bool:
    return any(w.startswith(AMBIENT_STEMS) and "temp" in w for w in said)


def _means_something(said: set[str], name: str) -> bool:
    """Whether a name has a word that could be a place on a machine, not a code such as R1 or vbl3."""
    if not name.isascii():
        return True
    meant = [w for w in said - NAMELESS if len(w) >= 3 and re.search("[aeiouy]", w)]
    return bool(meant)
