"""Which column is what: sensors, surroundings, logged inputs, counters; by unit first, by the words of the name then."""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import UsageError, listed
from ..reading_options import Options
from .headings.called import check_names
from .run import Array, Guess
from .signs import Sign, names_all_sensors, sign_of
from .units import parse_unit, platinum
from .vocabulary import (
    AMBIENT,
    COUNTERS,
    EXTREMES,
    LABELS,
    MARKS,
    MEANS,
    MEDIA,
    REFERENCE,
    SPREADS,
    VALUES,
    WANTED,
    words,
)

#: Where other columns say that they are temperatures, one that does not say so is none if its readings are above this [degC].
HOTTEST = 1000.0
#: Signs of speed, power, current, voltage, torque, force, flow, humidity and place beside temperatures that are called T1, T2.
_ANY_EXTREME = re.compile("|".join(sorted(EXTREMES | SPREADS, key=len, reverse=True)), re.I)
_QUANTITY = re.compile(r"(?:[nPIUMFQHXYZ]|d[XYZ])\d*|[nPIUM]_[^\W\d]\w*")
#: A machine and what flows past it begin within this much of each other [K].
BEGIN_ALIKE = 10.0
#: Readings that are asked for to say that two columns move alike, and how far apart they begin then at most [K].
LEAST_ALIKE, STARTS_ALIKE = 20, 3.0
#: By less than half of this [K] a room may drift in a test.
ROOM_DRIFTS = 6.0
#: Ends of a name that tell something of the reading which is called so without them: how many, whose, how sure; of air how moist.
COUNTED = frozenset(["n", "count", "id"])
TELLS_OF, OF_AIR = frozenset(["rssi", "unc", "uncertainty", "battery", "batt"]), frozenset(["h", "rh", "hum", "p"])
#: Different numbers that a column of marks or counts holds at most.
FEW_MARKS = 5
#: Surroundings that are not the machine's where others are, and by how much two rooms differ that are hardly one [K].
OUTSIDE, ROOMS_APART = ("outdoor", "outside", "oat", "aussen", "außen", "室外", "extér"), 3.0
#: What an instrument says of its state; constant, it says nothing.
SIGNALS = frozenset(["alarm", "alarms", "flag", "status", "error", "event", "alert"])


@dataclass(frozen=True)
class Roles:
    """Column names by what they are; `notes` and `guesses` say what was left out and why."""

    ambient: tuple[str, ...]
    inputs: tuple[str, ...]
    sensors: tuple[str, ...]
    displacements: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    guesses: tuple[Guess, ...] = ()


def resistive(names: Collection[str], units: Mapping[str, str], options: Options, run: str) -> list[str]:
    """Columns that are resistances of windings: in ohms by unit or name, else those named by --channels.

    Raises
    ------
    UsageError: there are none.
    """
    found = []
    for n in names:
        unit = sign_of(n, units.get(n, "")).unit
        if (unit is not None and unit.kind == "resistance") or set(words(n)) & {"resistance", "widerstand"}:
            found.append(n)
    found = [n for n in found if n not in options.exclude and (not options.channels or n in options.channels)]
    found = found or [n for n in options.channels if n in names]
    if not found:
        raise UsageError(f"{run}: --resistance: no column is in ohms", found=listed(list(names), 6), do="name it with --channels")
    return found


def classify(names: list[str], values: dict[str, Array], units: dict[str, str], options: Options, run: str, origin: str) -> Roles:
    """Roles of the numeric columns, by the user's word first, then by unit and name.

    names are all columns that hold numbers, values those numbers (N,). origin is where the names come from: ``header``, ``long``
    for the cells of a long table, which name sensors whatever they are, or ``none``: then what is a sensor is guessed.

    Raises
    ------
    UsageError: an option names no column.
    """
    check_names(options.channels, names, "--channels", run)
    check_names(options.inputs, names, "--inputs", run)
    if options.ambient:
        check_names([options.ambient], names, "--ambient", run)
    told = {option.rpartition("=")[0] for option in options.units if "=" in option}
    signs = {n: sign_of(own, units.get(n, "")) for n, own in _beyond_place(names).items()}
    ohms = {n for n, s in signs.items() if s.unit is not None and s.unit.kind == "resistance"}
    of_platinum = {u.rpartition("=")[0] for u in options.units if platinum(u.rpartition("=")[2])}
    ohms = ohms if "" in of_platinum else ohms & of_platinum
    signs |= {n: replace(signs[n], kind="sensor", temperature=True) for n in ohms}
    signs |= {n: replace(signs[n], kind="input") for n in (*_differences(names), *_extremes(names), *_bands(names, values))}
    signs |= {n: replace(signs[n], kind="ambient") for n in _rooms(names)}
    signs |= {n: replace(signs[n], kind="other", unit=None, temperature=False) for n in _companions(names, values)}
    signs |= {n: replace(signs[n], kind="sensor", temperature=True) for n in names if _spindles(n, signs[n], values[n])}
    signs |= {n: replace(signs[n], kind="input") for n in names if _small(signs[n], values[n])}
    overall = [n for n in names if signs[n].temperature and names_all_sensors(n)]
    if any(s.kind == "sensor" and n not in overall for n, s in signs.items()):
        signs |= {n: replace(signs[n], kind="input") for n in overall}
    signs |= {n: replace(signs[n], kind="input") for n in _outdoors([n for n in names if signs[n].kind == "ambient"])}
    saying = [n for n, s in signs.items() if s.kind == "sensor" and s.temperature and not _bare(n, s)]
    said_somewhere = origin != "long" and bool(saying) and not _of_media_alone(saying, signs, values)
    # A room with its unit says nothing of places without one.
    by_unit = origin != "long" and any(s.unit is not None and s.unit.temperature and s.kind != "ambient" for s in signs.values())
    quantities = {n for n in names if signs[n].unit is None and _QUANTITY.fullmatch(n)}
    quantities = quantities if origin != "long" and any(_bare(n, s) for n, s in signs.items()) else set()
    roles: dict[str, list[str]] = {
        k: [] for k in ("ambient", "input", "sensor", "displacement", "counter", "empty", "constant", "other", "silent")
    }
    for n in names:
        if n in options.exclude:
            continue
        role = _role(n, signs[n], values[n], options, said_somewhere, by_unit, n in told)
        roles["silent" if role == "sensor" and n in quantities and n not in (*options.channels, *told) else role].append(n)
    if said_somewhere:
        unsaid = [n for n in roles["sensor"] if signs[n].kind == "named" and n not in (*options.channels, *told)]
        for n in _settings(unsaid, saying, values):
            roles["sensor"].remove(n)
            roles["constant"].append(n)
    found = _with_words(roles, signs, values, options, origin)
    return replace(found, guesses=(*found.guesses, *_other_quantities(options, signs, told)))


#: Quantities of which no reading is one in degrees.
NO_DEGREES = frozenset(["voltage", "current", "resistance", "power", "pressure", "speed", "flow", "frequency"])


def _other_quantities(options: Options, signs: Mapping[str, Sign], told: Collection[str]) -> tuple[Guess, ...]:
    """What to say of columns that are named as sensors though their unit is one of something else, where none was told."""
    units = {n: signs[n].unit for n in options.channels if n in signs and n not in told}
    odd = [f"{n!r} is a {u.kind}, in {u.symbol}" for n, u in units.items() if u is not None and u.kind in NO_DEGREES]
    if not odd or options.units or options.resistance:
        return ()
    way = "export degC (--resistance R0,T0 reads a winding), or say --units COLUMN=C if the name is wrong"
    return (Guess("unit", f"taken for degC, as asked: {'; '.join(odd[:3])}", way),)


def _of_media_alone(saying: Sequence[str], signs: Mapping[str, Sign], values: Mapping[str, Array]) -> bool:
    """Whether the columns that say that they are temperatures are a coolant's or an oil's, beside a numbered series of codes (S1,
    S2, S3) that begins where they do: that is the machine.
    """
    if not all(MEDIA.intersection(words(n)) for n in saying):
        return False
    codes = [n for n, s in signs.items() if s.kind == "nameless" and re.fullmatch(r"[^\W\d_]{1,3}_?\d{1,2}", n)]
    stems = {re.sub(r"\d", "", n) for n in codes}
    if len(stems) != 1 or len(codes) < 2 or any(_whole(values[n]) for n in codes):
        return False
    began = [float(_finite(values[n])[0]) for n in (*codes, *saying) if len(_finite(values[n]))]
    return len(began) > len(codes) and max(began) - min(began) <= BEGIN_ALIKE


def _beyond_place(names: list[str]) -> dict[str, str]:
    """Names without the place that stands in front of all, or in front of several as in a path: lab/T1 is not the lab's air."""
    found = {n: n for n in names}
    if not any(AMBIENT.intersection(words(n)) for n in names):
        return found
    for sign in (r"[/\\.:]", r"[\s_]"):
        groups: dict[str, list[str]] = {}
        for n in names:
            bare = re.sub(r"\s*[\[(].*$", "", n)
            last = [m.end() for m in re.finditer(sign, bare)]
            if last:
                groups.setdefault(n[: last[-1] if sign.startswith("[/") else last[0]], []).append(n)
        for place, some in groups.items():
            many = len(some) > 1 and (sign.startswith("[/") or len(some) == len(names))
            many = many and not all(set(words(n[len(place) :])) <= MARKS | VALUES for n in some)  # Room.Value and Room.Quality
            if many and AMBIENT.intersection(words(place)) and all(re.search(r"[^\W\d_]", n[len(place) :]) for n in some):
                found |= {n: n[len(place) :] for n in some}
    return found


def _differences(names: list[str]) -> list[str]:
    """Columns whose names are made of those of two others, as T1-T2."""
    made = {n: re.split(r"\s*-\s*", _core(n)) for n in names if "-" in n}
    cores = {_core(n) for n in names} if made else set()
    return [n for n, apart in made.items() if len(apart) == 2 and set(apart) <= cores]


def _extremes(names: list[str]) -> list[str]:
    """Columns that are the least, greatest or spread of what another one is the mean of, as ``T1 min`` beside ``T1 avg``; spreads
    beside the readings themselves, too.
    """
    if not _ANY_EXTREME.search("\n".join(names)):
        return []
    parts = {n: tuple(w for w in re.split(r"[\W_]+", _without_unit(n).casefold()) if w) for n in names}
    told = {n: some for n, some in parts.items() if (EXTREMES | SPREADS).intersection(some)}
    means = {tuple(w for w in some if w not in MEANS) for some in parts.values() if MEANS.intersection(some)}
    bare = {some for some in parts.values() if not (MEANS | EXTREMES | SPREADS).intersection(some)}

    def of_one(some: tuple[str, ...], words_of: Collection[str], others: set[tuple[str, ...]]) -> bool:
        rest = tuple(w for w in some if w not in words_of)
        return len(rest) < len(some) and rest in others

    # Of a least and a greatest without a mean both are readings; of one of them beside the reading itself, that is.
    alone = {
        n
        for n, some in told.items()
        if sum(of_one(s, EXTREMES, {tuple(w for w in some if w not in EXTREMES)}) for s in told.values()) < 2
    }
    return [
        n
        for n, some in told.items()
        if of_one(some, EXTREMES | SPREADS, means) or of_one(some, SPREADS, bare) or (n in alone and of_one(some, EXTREMES, bare))
    ]


def _companions(names: list[str], values: Mapping[str, Array]) -> list[str]:
    """Columns that tell something of the reading beside them, as ``Front_Q``, ``T1 [°C] ok``, ``Room_n`` and ``Room_H``.

    A mark, a count, an error, and of the surroundings a humidity. Marks and counts are few whole numbers; whole degrees are more.
    """
    parts = {n: [w for w in re.split(r"[\W_]+", re.sub(r"[\[(][^\])]*[\])]", " ", n).casefold()) if w] for n in names}
    there = {tuple(some) for some in parts.values()}
    beside = {n: some for n, some in parts.items() if len(some) > 1 and tuple(some[:-1]) in there}
    told = [n for n, some in beside.items() if some[-1] in TELLS_OF or (some[-1] in OF_AIR and AMBIENT & set(some))]
    marks = [n for n, some in beside.items() if some[-1] in MARKS | COUNTED and _whole(values[n])]
    return told + [n for n in marks if len(np.unique(_finite(values[n]))) <= FEW_MARKS]


def _spindles(name: str, sign: Sign, column: Array) -> bool:
    """Whether an SP is a spindle and no set point: SP_TEMP that hardly ever stands still."""
    if sign.kind != "input" or WANTED & set(words(name)) != {"sp"} or not sign.temperature:
        return False
    seen = _finite(column)
    return len(seen) > 20 and float(np.mean(np.diff(seen) == 0.0)) < 0.5 and len(np.unique(seen)) > 0.3 * len(seen)


def _outdoors(rooms: Sequence[str]) -> list[str]:
    """Those of the surroundings that are outside the house, where others are inside."""
    outside = [n for n in rooms if any(w.startswith(OUTSIDE) for w in words(n))]
    return outside if len(outside) < len(rooms) else []


def _bands(names: list[str], values: Mapping[str, Array]) -> list[str]:
    """Columns that are the two sides of another one's interval: T1_lo and T1_hi beside T1, and as far from it in every row.

    Sensors at the bottom and at the top of a thing may be called so too.
    """
    there = set(names)
    both = [(n, f"{n}_lo", f"{n}_hi") for n in names if there.issuperset({f"{n}_lo", f"{n}_hi"})]
    even = [
        three for three in both if np.allclose(values[three[1]] + values[three[2]], 2.0 * values[three[0]], 1e-9, equal_nan=True)
    ]
    return [side for three in even for side in three[1:]]


def _without_unit(name: str) -> str:
    """A name without the brackets that say its unit of temperature."""
    return re.sub(r"[\[(]([^\[\]()]*)[\])]", lambda m: "" if (unit := parse_unit(m[1])) and unit.temperature else m[0], name)


def _rooms(names: list[str]) -> list[str]:
    """Columns named by channel and place, as T3-room beside T1-front: no difference to the room, but its temperature."""
    apart = {
        n: m for n in names if ("-" in n or "–" in n) and (m := re.fullmatch(r"([A-Za-z]{1,4}\d+)\s*[-–]\s*([^\W\d_]+)", _core(n)))
    }
    places = [n for n, m in apart.items() if not set(words(m[2])) & AMBIENT]
    return [n for n, m in apart.items() if places and set(words(m[2])) & AMBIENT]


def _core(name: str) -> str:
    return re.sub(r"\s*[\[(].*$", "", name).strip().casefold()


def _bare(name: str, sign: Sign) -> bool:
    """Whether only a T and a number say that it is a temperature."""
    return sign.unit is None and re.fullmatch(r"[Tt]_?\d*( \(\d+\))?", name) is not None


def _role(name: str, sign: Sign, column: Array, options: Options, said_somewhere: bool, by_unit: bool, unit_told: bool) -> str:
    if name == options.ambient:
        return "ambient"
    if name in options.inputs:
        return "input"
    if name in options.channels:
        return "sensor"
    if sign.kind == "displacement":
        return "displacement"
    if sign.kind == "ambient" and not options.ambient:
        return "ambient"
    if sign.kind == "input":
        return "constant" if not sign.temperature and set(words(name)) & SIGNALS and _constant(column) else "input"
    if options.channels:
        return "other"
    if unit_told:
        return "sensor"
    count = np.count_nonzero(np.isfinite(column))
    if sign.kind in ("named", "nameless", "other") and not count:
        return "empty"
    if sign.kind == "nameless" and count >= 10 and _constant(column):
        return "constant"
    if sign.kind == "named" and set(words(name)) & LABELS and _constant(column) and _whole(column):
        return "constant"  # of which machine, which run
    if _counts(name, sign, column):
        return "counter"
    if (
        sign.kind == "other"
        or (sign.kind == "nameless" and (said_somewhere or _code(column)))
        or (
            sign.kind == "named"
            and (_switch(column) or by_unit or (said_somewhere and float(np.median(np.abs(_finite(column)))) > HOTTEST))
        )
    ):
        return "silent"
    if said_somewhere and count and not _finite(column).any():
        return "constant"
    return "sensor"


def _settings(names: Sequence[str], saying: Sequence[str], values: Mapping[str, Array]) -> list[str]:
    """Those of the columns `names`, of which no word says a temperature, that never change and are none that others came to."""
    still = [n for n in names if np.count_nonzero(np.isfinite(values[n])) >= 10 and _constant(values[n])]
    read = [c for n in saying if len(c := _finite(values[n]))] if still else []
    if not read:
        return []
    low, high = min(float(c.min()) for c in read), max(float(c.max()) for c in read)
    return [n for n in still if not low <= float(_finite(values[n])[0]) <= high]


def _moving_alike(
    roles: Mapping[str, Sequence[str]], signs: Mapping[str, Sign], values: Mapping[str, Array], options: Options
) -> list[str]:
    """Temperatures that a word made an input or the surroundings, and that begin and rise as the sensors do.

    A set point stands still, a difference begins at nothing, a room moves less: a ``Housing diff gear`` is a place on a machine.
    """
    said = (*options.channels, *options.inputs, options.ambient)
    suspects = [n for n in (*roles["input"], *roles["ambient"]) if signs[n].temperature and n not in said]
    sensors = [c for n in roles["sensor"] if len(c := _finite(values[n])) > LEAST_ALIKE] if suspects else []
    if options.channels or not sensors:
        return []
    begin, moved = [float(np.median(c[:5])) for c in sensors], [_movement(c) for c in sensors]
    found = []
    for n in suspects:
        # A room drifts, too, by more than a sensor far from the heat: one that is called so must move as most sensors do.
        least = 0.5 * (max(float(np.median(moved)), ROOM_DRIFTS) if n in roles["ambient"] else min(moved))
        c = _finite(values[n])
        still = len(c) <= LEAST_ALIKE or np.mean(np.diff(c) == 0.0) > 0.5 or len(np.unique(c)) < 0.1 * len(c)
        near = not still and min(begin) - STARTS_ALIKE <= np.median(c[:5]) <= max(begin) + STARTS_ALIKE
        if near and least <= _movement(c) <= 2.0 * max(moved) and _movement(c) > 0.0:
            found.append(n)
    return found


def _small(sign: Sign, column: Array) -> bool:
    """Whether a column in mK is a difference or a noise: no machine is colder than 100 K."""
    unit = sign.unit
    thousandths = unit is not None and unit.symbol == "K" and unit.scale == 1e-3
    return thousandths and bool(len(seen := _finite(column))) and float(np.median(seen)) < 1e5


def _movement(column: Array) -> float:
    """By how much a column rose in all: a mean of its first readings against one of its last."""
    return float(np.mean(column[-5:]) - np.mean(column[:5]))


def _finite(column: Array) -> Array:
    return column[np.isfinite(column)]


def _constant(column: Array) -> bool:
    low, high = np.fmin.reduce(column, initial=np.inf), np.fmax.reduce(column, initial=-np.inf)
    if math.isfinite(low) and math.isfinite(high):
        return bool(low == high)
    readings = _finite(column)
    return bool(len(readings)) and float(np.ptp(readings)) == 0.0


def _counts(name: str, sign: Sign, column: Array) -> bool:
    """Whether a column counts the rows: whole numbers one apart, under a name that says so or none."""
    unit = sign.unit is not None and sign.unit.kind != "number"
    if unit or len(column) < 2 or not _whole(column) or not np.isfinite(column).all():
        return False
    column = column[::-1] if column[0] > column[-1] else column  # newest first
    step = np.diff(column)
    if sign.temperature:  # by its name alone, as that of a logger with a thermocouple
        return len(column) > 20 and bool((step == 1.0).all()) and column[0] in (0.0, 1.0)
    if len(column) > 5 and (step == 1.0).all() and column[0] in (0.0, 1.0):
        return True  # whatever it is called
    counting = set(words(name)) & COUNTERS or "#" in name or name.strip().lower() == "n" or name == "column 1"
    return bool(counting and (step > 0).all() and np.median(step) == 1.0)


def _code(column: Array) -> bool:
    """Whether a long column holds a few whole numbers only: a step, a mode, not a temperature."""
    if not _whole(column):
        return False
    good = column[np.isfinite(column)]
    return len(good) > 50 and len(np.unique(good)) <= 3


def _switch(column: Array) -> bool:
    """Whether a column is 0 or 1 and both."""
    return set(np.unique(column[np.isfinite(column)]).tolist()) == {0.0, 1.0}


def _whole(column: Array) -> bool:
    """Whether all numbers of a column are whole; most that are not show it at once."""
    if any(not v.is_integer() for v in column[:8].tolist() if math.isfinite(v)):
        return False
    good = _finite(column)
    return not (np.floor(good) != good).any()


def _with_words(
    roles: dict[str, list[str]], signs: dict[str, Sign], values: dict[str, Array], options: Options, origin: str
) -> Roles:
    notes, guesses = [], []
    if roles["counter"]:
        notes.append(f"row counters left out: {listed(roles['counter'])}")
    if roles["empty"]:
        notes.append(f"columns without readings left out: {listed(roles['empty'], 6)}")
    if roles["constant"]:
        held = [f"{n} is {values[n][np.isfinite(values[n])][0]:g}" for n in roles["constant"]]
        notes.append(f"columns that never change left out: {listed(held, 6)}")
    if roles["other"] and not options.channels:
        notes.append(f"not temperatures: {listed(roles['other'], 6)}")
    if roles["silent"]:
        # Codes beside columns that say they are temperatures: a careful reader would leave them out, and say so.
        guesses.append(
            Guess(
                "role", f"no temperatures, as neither name nor unit says so: {listed(roles['silent'], 6)}", "--channels uses them"
            )
        )
    unsure = [n for n in roles["sensor"] if n not in options.channels and not options.units and signs[n].kind == "nameless"]
    if unsure and origin != "long":
        what = "no header" if origin == "none" else "neither name nor unit says so"
        guesses.append(
            Guess("role", f"taken for temperatures, though {what}: {listed(unsure, 6)}", "--channels and --units confirm it")
        )
    levels = {n: float(np.median(seen)) for n in roles["ambient"] if len(seen := _finite(values[n]))}
    if levels and max(levels.values()) - min(levels.values()) > ROOMS_APART:
        told = listed([f"{n} at {level:.3g}" for n, level in levels.items()], 4)
        guesses.append(Guess("role", f"the surroundings are the mean of columns that differ: {told}", "--ambient says which it is"))
    alike = _moving_alike(roles, signs, values, options)
    if alike:
        what = f"taken for no sensor by a word in its name, though it moves as the sensors do: {listed(alike)}"
        guesses.append(Guess("role", what, "--channels reads it"))
    references = [n for n in roles["input"] if n not in options.inputs and set(words(n)) & REFERENCE]
    if references:
        guesses.append(Guess("role", f"a reference of the instrument, not a sensor: {listed(references)}", "--channels uses it"))
    return Roles(
        tuple(roles["ambient"]),
        tuple(roles["input"]),
        tuple(roles["sensor"]),
        tuple(roles["displacement"]),
        tuple(notes),
        tuple(guesses),
    )


def length_unit(name: str, unit_cell: str) -> str:
    """Mm or um, as the name of a displacement or the line of units tells; nothing where neither does."""
    said = {*words(name), *words(unit_cell)}
    return "mm" if "mm" in said else "um" if said & {"um", "µm", "μm", "micron", "microns"} else ""
