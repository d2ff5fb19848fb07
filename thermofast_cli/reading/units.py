"""Units: what the name of a column or its cell in a unit line says, and whether that is a temperature."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..errors import InputError, listed
from .run import Array
from .vocabulary import UNIT_SUFFIXES

ABSOLUTE_ZERO_C = -273.15
#: Units that are no temperature, by the quantity they measure; compared as they stand, then in lower case.
QUANTITIES: dict[str, tuple[str, ...]] = {
    "voltage": ("V", "VDC", "VAC", "mV", "µV", "μV", "uV", "kV", "volt", "volts", "millivolt", "millivolts", "vdc", "vac"),
    "current": ("A", "mA", "µA", "μA", "uA", "amp", "amps", "ampere", "amperes"),
    "resistance": ("Ω", "kΩ", "mΩ", "ohm", "ohms", "kohm", "mohm", "kohms"),
    "power": ("W", "mW", "kW", "watt", "watts", "kilowatt", "W/m2", "W/m²"),
    "energy": ("J", "kJ", "joule", "joules", "Wh", "mWh", "kWh", "watt-hr", "watt-hours"),
    "charge": ("Ah", "mAh"),
    "share": ("%", "%rh", "% rh", "rh%", "rh", "percent", "prozent", "pct", "% sat"),
    "pressure": ("psi", "psia", "psig", "bar", "mbar", "Pa", "hPa", "kPa", "MPa", "atm", "mmhg", "inhg", "torr"),
    "speed": ("rpm", "1/min", "min-1", "min^-1", "U/min", "rev/min", "m/s", "km/h", "mph", "m/min", "mm/s"),
    "frequency": ("Hz", "kHz", "MHz", "GHz"),
    "flow": ("l/min", "l/h", "l/s", "lpm", "slpm", "m3/h", "m³/h", "kg/s", "kg/h", "g/s", "gpm", "ml/min", "l_min"),
    "length": ("m", "mm", "cm", "µm", "μm", "um", "nm", "in", "inch", "ft", "feet", "micron", "microns"),
    "force": ("N", "kN", "Nm", "lbf", "µε", "µm/m", "um/m"),
    "light": ("lux", "lx", "lm"),
    "concentration": ("mg/l", "ppm", "ppb", "g/m3", "g/m³"),
    "mass": ("kg", "g", "mg"),
    "time": ("s", "sec", "secs", "second", "seconds", "ms", "min", "mins", "minutes", "h", "hours", "d", "days", "us", "ns"),
    "number": ("bit", "bits", "count", "counts", "cnt", "dec", "hex", "bool", "dB", "dBm", "RN"),
    "acceleration": ("m/s2", "m/s²"),
}  # fmt: skip
_EXACT = {symbol: kind for kind, symbols in QUANTITIES.items() for symbol in symbols}
_LOWER = {symbol.lower(): kind for symbol, kind in _EXACT.items() if len(symbol) > 1}
_MARK = r"(?:°|º|˚|\*|'|�|Â°|\?|¡|\\circ|\^\\circ|deg(?:rees?|\.)?|grad|grd\.?|degr)"
_MARKED = re.compile(rf"{_MARK}[ _]?(c|k|f|celsius|kelvin|fahrenheit)$", re.IGNORECASE)
_BEHIND = re.compile(r"(?:o|O)?([cfk])(?:°|º)|o([cf])", re.IGNORECASE)
_WORD = re.compile(r"(celsius|kelvin|fahrenheit|cel|degc|degf|degk|℃|℉)$", re.IGNORECASE)
_SCALED = re.compile(r"(?:[x×*]\s*)?(1/10{1,3}|0[.,]0*1|10\^?-[123])\s*[x×*]?\s*(.+)$")
#: Thousandths, and what a controller keeps as whole numbers: degC times ten.
_MILLI = re.compile(r"(?:milli|m) ?((?:°|º|deg).+|celsius|kelvin|℃|(?-i:[CK](?<=m[CK])))$", re.I)
_TIMES = re.compile(r"(.+?) ?[x×*·/] ?(10{1,3})$")
#: A bracket that holds one of these signs holds a unit, though none that is known: °C/min, W/(m²K), Vol%.
_UNIT_SIGNS = re.compile(r"[/%°²³^µμΩ·⁻]")
_ODD = re.compile(r"-|[mkM]?V ?(AC|DC)|g RMS|mK|kvar|VAr?|cos.*")
#: What a bracket may say of a thermocouple instead of its unit: [K-Type], (Typ J).
_PROBE = re.compile(r"(?i)(?:tc[ -]?)?(?:[kjtnsrbe][ -]?typ|[kjtnsrbe][ -]?type|type?[ -]?[kjtnsrbe])")
#: Letters of Russian keyboards that look like those of units.
_CYRILLIC = str.maketrans("СК", "CK")
_BRACKET = re.compile(r"[\[(<{]([^\[\](){}<>]*)[\])>}]")
_ANYWHERE = re.compile(r"[°º˚] ?([CFK])\b(?!\s*/)|(℃)|(℉)|(?i:(?<![a-z])deg[ _]?([CFK])(?![a-z]))|(?i:(celsius|kelvin|fahrenheit))")
_RANKINE = re.compile(r"(?i)(?:°|º|deg(?:rees)?)[ _]?(?:r|rankine)|rankine")
_PLATINUM = re.compile(r"(?i)pt[ -]?(100|500|1000)")
#: Callendar and Van Dusen's coefficients of platinum (IEC 60751): R/R0 = 1 + A t + B t^2 + C (t - 100) t^3, the last below 0 degC.
_CVD = 3.9083e-3, -5.775e-7, -4.183e-12
_LETTER = {"celsius": "C", "cel": "C", "degc": "C", "℃": "C", "kelvin": "K", "degk": "K", "fahrenheit": "F", "degf": "F", "℉": "F"}

_UNIT_ABOVE = re.compile(r"(?i)\W*(?:temperature |temp\.? )?(?:units?|einheit)\W+?([^\s;,\"]+(?: [cfk])?)[\"\s;,]*$")
_SCALE_IN_WORDS = re.compile(
    r"(?i)\b(?:temp\w*|values|readings|units?|data)\b[^\n]*(?<!\w)(fahrenheit|celsius|kelvin|(?:°|deg(?:rees?)?) ?[fck])\b"
)
_SCALES = {"fahrenheit": "F", "celsius": "C", "kelvin": "K"}


@dataclass(frozen=True)
class Unit:
    """symbol is C, K, F, R (rankine) or Pt100 (ohms of such a probe) where kind is ``temperature``.

    sure: said by a bracket, a degree sign or a unit line, not by a letter.
    """

    symbol: str
    kind: str
    sure: bool = True
    #: A reading times this is in the unit: 0.1 for tenths of a degree.
    scale: float = 1.0
    #: Said by a letter alone, F, which may stand for a place or a type as well.
    letter: bool = False

    @property
    def temperature(self) -> bool:
        return self.kind == "temperature"


@lru_cache(maxsize=4096)
def parse_unit(text: str) -> Unit | None:
    """The unit that a text *is*, as ``°C``, ``(*F)``, ``Deg C`` or ``mV``; None where it is none that is known."""
    text = text.replace("$", "").strip().strip("[](){}<>").strip().rstrip(".").translate(_CYRILLIC)
    if not text:
        return None
    if text in ("C", "K", "F"):
        return Unit(text, "temperature", letter=True)
    behind = _BEHIND.fullmatch(text)
    if behind:
        return Unit((behind.group(1) or behind.group(2)).upper(), "temperature")
    marked = _MARKED.fullmatch(text) or _WORD.fullmatch(text)
    if marked:
        letter = marked.group(1).lower()
        return Unit(_LETTER.get(letter, letter.upper()), "temperature")
    if _RANKINE.fullmatch(text):
        return Unit("R", "temperature")
    kind = _EXACT.get(text) or _LOWER.get(text.lower())
    if kind:
        return Unit(text, kind)
    scaled = _SCALED.fullmatch(text)
    inner = parse_unit(scaled.group(2)) if scaled else None
    if scaled and inner is not None and inner.temperature:
        part = scaled.group(1).replace(",", ".")
        size = {"1/10": 0.1, "1/100": 0.01, "1/1000": 0.001}.get(part)
        size = size or (10.0 ** float(part.replace("^", "")[2:]) if part.startswith("10") else float(part))
        return Unit(inner.symbol, "temperature", scale=size)
    milli, times = _MILLI.fullmatch(text), _TIMES.fullmatch(text)
    inner = parse_unit(milli[1]) if milli else parse_unit(times[1]) if times else None
    if inner is not None and inner.temperature:
        return Unit(inner.symbol, "temperature", scale=1e-3 if milli else 1.0 / float(times[2]))  # type: ignore[index]
    return None


@lru_cache(maxsize=4096)
def unit_in_name(name: str) -> Unit | None:
    """The unit that a column's name carries: ``front [°C]``, ``Temp, °C (LGR S/N: 7)``, ``T1 / °C``, ``front_ohm``, ``TempF``.

    A single letter behind a name is a unit of temperature only where the name speaks of one (``Temp_F``): ``Lager_F`` is the
    bearing in front.
    """
    for inside in _BRACKET.findall(name)[::-1]:
        unit = parse_unit(inside) or parse_unit(inside.split(",")[0])
        if unit:
            return unit
    plain = _BRACKET.sub("", name).strip()
    last = plain.split(" ")[-1]
    if last != plain and re.search(r"[/%²³]", last) and parse_unit(last):
        return parse_unit(last)
    for separator in (",", "/", ";"):
        head, found, tail = plain.rpartition(separator)
        unit = parse_unit(tail) if found and head.strip() else None
        if unit and separator == "/" and parse_unit(head):
            return Unit(plain, "unknown")  # W/K, mV/K
        if unit and not (separator == "/" and unit.kind == "time"):
            return unit
    anywhere = _ANYWHERE.search(plain)
    if anywhere:
        letter = next(g for g in anywhere.groups() if g)
        return Unit(_LETTER.get(letter.lower(), letter.upper()), "temperature")
    stem = plain.rstrip("0123456789").rstrip("_ ")
    tail = re.split(r"[ _]", stem)[-1]
    if tail != stem and (tail.lower() in UNIT_SUFFIXES or tail in ("mV", "kV", "mA", "kW")):
        return Unit(tail, _EXACT.get(tail) or _LOWER.get(tail.lower()) or "share")
    letter = re.fullmatch(r"(?i:.*(?:temp|temperatur|temperature))[ _]?([CFK])|[Tt][ _]([CFK])", stem)
    if letter:
        return Unit(letter.group(1) or letter.group(2), "temperature", sure=False)
    return _unknown_unit(name)


def names_probe(name: str) -> bool:
    """Whether a bracket of a column's name says the kind of a thermocouple."""
    return any(_PROBE.fullmatch(inside.strip()) for inside in _BRACKET.findall(name))


def _unknown_unit(name: str) -> Unit | None:
    """A bracket that holds a unit, though none that is known here: what it measures is no temperature."""
    for whole in _BRACKET.finditer(name):
        inside = whole.group(1).strip()
        if whole.group(0)[0] not in "[(" or _PROBE.fullmatch(inside):
            continue
        square = whole.group(0).startswith("[") and re.search(r"[^\W\d]", inside) and len(inside) <= 8 and " " not in inside
        signs = len(inside) <= 14 and ":" not in inside and _UNIT_SIGNS.search(inside)
        if signs or (square and not inside.islower()) or _ODD.fullmatch(inside):
            return Unit(inside, "unknown")
    return None


def unit_changes(place: str, told: Iterable[str]) -> InputError:
    """The error of a column whose readings change their unit, of those told in it."""
    return InputError(
        f"{place}: the unit changes within the record",
        found=listed(told, 4),
        allowed="readings of one unit in a column",
        do="export the record in one unit, or cut it where the unit changes",
    )


def unit_above(lines: list[str]) -> str:
    """The unit of temperature, C, K or F, that a line above the names or a comment says of all of them, or a voltage's; empty where
    none or several do.
    """
    told = [unit for m in map(_UNIT_ABOVE.match, lines) if m and (unit := parse_unit(m[1])) is not None]
    units = {unit.symbol for unit in told if unit.temperature}
    if not units:  # # all temperatures in Fahrenheit
        units = {_SCALES.get(m[1].lower()) or m[1][-1].upper() for line in lines for m in _SCALE_IN_WORDS.finditer(line)}
    if not units and told and all(unit.kind == "voltage" for unit in told):
        return told[0].symbol
    return units.pop() if len(units) == 1 else ""


def platinum(text: str) -> Unit | None:
    """The unit of a column of ohms, told as ``Pt100``; in the name of a column it is but the probe's kind."""
    found = _PLATINUM.fullmatch(text.strip())
    return Unit(f"Pt{found[1]}", "temperature") if found else None


def to_celsius(values: Array, symbol: str, scale: float = 1.0) -> Array:
    """Temperatures (n,) in the unit C, K, F or R, or `scale` parts of it, or resistances [ohm] of a Pt100, as degC."""
    if scale != 1.0:
        values = values * scale
    if symbol.startswith("Pt"):
        return _of_platinum(values / float(symbol[2:]))
    if symbol in ("K", "R"):
        return values / (1.8 if symbol == "R" else 1.0) + ABSOLUTE_ZERO_C
    return (values - 32.0) / 1.8 if symbol == "F" else values


def _of_platinum(ratio: Array) -> Array:
    """Temperatures (n,) [degC] at which platinum has `ratio` times its resistance at 0 degC (IEC 60751, -200 to 850 degC)."""
    a, b, c = _CVD
    with np.errstate(invalid="ignore"):  # what no temperature makes is no reading
        found: Array = (np.sqrt(a * a - 4.0 * b * (1.0 - ratio)) - a) / (2.0 * b)
        for _ in range(4):  # Newton: below 0 degC the fourth power counts
            cold = np.where(found < 0.0, c, 0.0)
            curve = 1.0 + found * (a + found * (b + cold * found * (found - 100.0)))
            found = found - (curve - ratio) / (a + found * (2.0 * b + cold * found * (4.0 * found - 300.0)))
    return np.where((found > -201.0) & (found < 851.0), found, np.nan)
