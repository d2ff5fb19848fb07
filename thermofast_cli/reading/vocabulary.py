"""Words that loggers use: of sensors, surroundings, inputs, time; and how a column's name falls into words."""

import re
from functools import lru_cache


def words(name: str) -> list[str]:
    """Lower-case words of a column name; digits at the end of a word are not part of it."""
    return _words(name.rstrip("0123456789"))


@lru_cache(maxsize=4096)
def _words(name: str) -> list[str]:
    spaced = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    return [w for w in (re.sub(r"\d+$", "", part) for part in re.split(r"[\W_]+", spaced.lower())) if w]


def _set(text: str) -> frozenset[str]:
    return frozenset(text.split())


AMBIENT = _set(
    "ambient amb room air surroundings surrounding environment env umgebung umg raum raumluft luft hall halle hallen tamb "
    "troom tair 环境 室温"
)
#: A German word for a temperature in front of which these stand is the surroundings': Hallentemperatur.
AMBIENT_STEMS = ("umgebung", "raum", "hallen", "luft", "aussen", "außen")
INPUTS = _set(
    "speed rpm load power duty heater voltage current curr coolant fan flow torque humidity rh pressure pump door valve feed "
    "drehzahl last leistung spannung strom druck feuchte luftfeuchte durchfluss vorschub volt volts battery batt batterie "
    "resistance widerstand ohm force kraft energy energie capacity watt frequency freq utilization light lux lamp lamps co"
)
#: Inputs that have a temperature: T_flow_out and Coolant temp are sensors.
WARM_INPUTS = _set("flow load coolant last fan heater pump battery batt batterie")
#: A temperature that is asked for, or that the instrument needs for itself, is logged but no sensor of the machine.
WANTED = _set("set setpoint setpt sp sv soll sollwert solltemperatur target command cmd")
REFERENCE = _set("cjc cj ref reference referenz vergleichsstelle ptemp coldjunction kaltstelle")
COUNTERS = _set("no nr index idx sample scan record count counter row number id rec anz point")
#: Words of what is logged beside temperatures and means nothing for them.
OTHER = _set(
    "index idx id serial status state code alarm flag error checksum crc counter cycle cyc step rssi signal lat lon latitude "
    "longitude altitude depth seq sequence quality valid validity marker mode result table millisecond millitm msec position "
    "cell rack shelf test lot batch tvoc tds type"
)
TEMPERATURE = _set(
    "temp temps temperature temperatures temperatur temperaturen tmp tc thermocouple thermo pt rtd ntc thermistor therm dewpt "
    "dewpoint probe fühler 温度"
)
#: Names that name nothing: a column called so beside columns that say they are temperatures is none.
NAMELESS = _set(
    "value values val wert data channel chan kanal reading measurement column analog input output dev untitled var series "
    "signal field messwert unnamed"
)
#: Words of a thermal displacement; the unit alone says it too, as in ``Z (um)``.
DISPLACEMENTS = _set("mm um µm μm micron microns disp displacement displacements verlagerung verschiebung 热位移 位移")

#: Columns of a long table: what names the sensor, what holds the reading, and what only remarks on it.
SENSOR_NAMES = _set(
    "sensor channel series name probe location tag field metric kanal messstelle entity device variable parameter signal "
    "topic label measurement host fühler sensorname messpunkt ort point"
)
READINGS = _set("value val wert messwert reading state temperature temp temperatur mean")
REMARKS = _set(
    "unit einheit status remark comment note event alarm message operator quality validity flag bemerkung kommentar mode phase type"
)
UNITS = _set("unit units einheit")

TIME = _set(
    "time times timestamp timestamps datetime date elapsed clock zeit uhrzeit datum zeitstempel stamp zeitpunkt temps heure "
    "fecha hora 时间 日期"
)
#: Names that mean time only when they are the whole name: T_min may be the least of a temperature.
TIME_NAMES = _set("t s sec seconds min minutes h hours x_value _time")

#: Units that may follow a name after a blank or underline: single letters may be the front (V, vorn) or the rear of a machine.
UNIT_SUFFIXES = _set(
    "mv uv kv volts ohm ohms kohm ma kw watt watts kwh wh mah ah percent pct psi mbar bar hpa kpa rpm hz khz mhz lpm lux ppm kn %"
)
