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
    "lab labor shop ambiance ambiant ambiante ambiente werkstatt outdoor outside klima surr tsurr otoczenie oat tumg tamb tu "
    "ambient amb room air surroundings surrounding environment env umgebung umg raum raumluft luft hall halle hallen troom "
    "tair 环境 室温 okoli okolí otoczenia omgeving omgivning omgivningen omgivelser ympäristö ortam környezet prostredi prostředí "
    "окружающая окружающей среда среды воздух воздуха помещение помещении окр raumtemp umgebungstemp umgebungsluft hallenluft "
    "messraum rumtemperatur huonelämpötila officina atelier werkhalle místnosti airtemp "
    "prüfraum klimaraum omgivelsestemperatur kamertemperatuur romtemperatur stuetemperatur huone huoneen ympäristön oda "
    "szobahőmérséklet szoba pokojowa pokojová pokoj комнатная комнаты ambiental ambientală camerei "
    "omgevingstemperatuur omgivningstemperatur rumstemperatur környezeti mediului workshop indoor laboratory "
    "περιβάλλον περιβάλλοντος δωμάτιο δωματίου χώρος χώρου αέρας αέρα "
    "laborraum inf цех umgeb laborluft okol cabin kabine aussen außen extérieur exterieur"
)
#: A German word for a temperature in front of which these stand is the surroundings': Hallentemperatur.
AMBIENT_STEMS = ("umgebung", "raum", "hallen", "luft", "aussen", "außen")
INPUTS = _set(
    "dehnung weg mass kwh vibration feedrate override drehmoment torque betriebsstunden auslastung zyklus vbat soc level "
    "accel acceleration strain "
    "summe sum pos axis tool uptime heap relais relay relays pumpe heizung feedback angle winkel conductivity leitwert gas "
    "gps altitude rotation spindel_drehzahl turns travel position stroke debit vitesse couple enthalpy conc concentration "
    "dust noise pm ph orp turbidity irradiance radiation speed rpm load power duty heater voltage current curr coolant fan "
    "flow humidity rh pressure pump door valve feed drehzahl last leistung spannung strom druck feuchte luftfeuchte "
    "durchfluss vorschub volt volts battery batt batterie resistance widerstand ohm force kraft energy energie capacity watt "
    "frequency freq utilization light lux lamp lamps co "
    "ток напряжение мощность скорость обороты давление corrente tensione potenza velocità coppia pressione courant "
    "tension puissance pression corriente tensión potencia velocidad presión prąd napięcie moc prędkość ciśnienie "
    "stellgrad stellgröße stellgrösse stellwert "
    "proud napětí výkon otáčky tlak akım gerilim güç devir basınç weight gewicht "
    "velocity barometer pwm distance cosphi intensité potência velocidade нагрузка yük obciążenie carga carico charge zatížení "
    "schalter betriebsart restzeit switch adc growth expansion elongation bending tilt vib preload vorspannung unbalance unwucht "
    "влажность вибрация расход частота сила крутящий насос вентилятор nem hız debi titreşim frekans pompa kapı "
    "υγρασία ρεύμα τάση ισχύς πίεση ταχύτητα στροφές ροή αντλία wilgotność vlhkost umidità umedad humedad humidité umidade "
    "imbalance flux wärmestrom runout körperschall schlupf slip druckluft clearance spiel backlash deflection displ"
)
#: Names of inputs that are none beside another word: Press ram is a place.
INPUT_NAMES = _set("vin vout vcc vdd vbus vbatt ubat ibat ibatt iin iout press pres hum amp amps")
#: Inputs that bring heat, and those that take it away.
HEATING = _set(
    "power leistung load last duty current strom heater heizung torque drehmoment couple moment watt puissance potenza potencia "
    "moc výkon güç potência мощность нагрузка yük obciążenie carga charge zatížení stellgrad"
)
COOLING = _set(
    "fan lüfter luefter coolant kühlmittel kuehlmittel kühlung kuehlung cooling chiller pump pumpe flow durchfluss door tür "
    "valve ventil"
)
#: Inputs that have a temperature: T_flow_out and Coolant temp are sensors.
WARM_INPUTS = _set("axis flow load coolant last fan heater heizung pump pumpe valve ventil door tür battery batt batterie")
#: What flows past the machine: its temperature says nothing of the columns beside it.
MEDIA = _set(
    "coolant oil öl oel water wasser kühlmittel kuehlmittel kühlwasser kuehlwasser emulsion chiller fluid eau acqua agua huile "
    "olio aceite supply return inlet outlet vorlauf rücklauf ruecklauf"
)
#: Those of them that are a quantity where they end a name that speaks of no temperature: Motor load.
QUANTITIES = _set("flow load last")
#: A temperature that is asked for, or that the instrument needs for itself, is logged but no sensor of the machine.
WANTED = _set(
    "consigne consigna setpunkt börvärde уставка tset tsoll tsp preset grenzwert limit limits threshold schwelle "
    "führungsgröße offset tolerance uncertainty alarm set "
    "setpoint setpt sp sv soll sollwert solltemperatur target command cmd ziel zielwert zieltemperatur vorgabe vorgabewert demand "
    "desired gewenste gewenst célhőmérséklet zul tref setată warning ajuste commanded wsp rsp "
    "trip nominal hedef ayar alapjel objetivo deseada deseado alvo desejada ønsket önskad tavoite setare setata "
    "cílová docelowa задание "
    "limite grenze obergrenze untergrenze fem simulation "
    "goal req request requested calc calculated sim simulated predicted prediction berechnet simuliert correction korrektur "
    "allowed zulässig permissible shutdown programmed programmiert forecast extrapolated extrapoliert führungsgrösse cutout"
)
#: Beginnings and parts of words for it: Sollvorgabe, Abschalttemperatur, Nastavená, 設定温度.
WANTED_STEMS = (
    *("soll", "setpun", "abschalt", "warnschwelle", "warngrenze", "alarmgrenze", "alarmschwelle", "grenztemp", "nastav", "nastaw"),
    *("žádan", "zadan", "żądan", "заданн", "asetus", "impostat", "ingesteld", "beállít", "ayarla", "indstil", "innstil", "inställ"),
    *("börvärd", "željen", "tavoite"),
)
WANTED_PARTS = ("設定", "目標", "设定", "目标", "给定", "給定", "설정", "목표")
#: Of the weather, and of what instruments are compared with: no place on a machine.
WEATHER = _set("wetbulb humidex windchill icebath kalibrator calibrator")
REFERENCE = _set(
    "cjt tcj coldjunction internal logger panel board klemmentemperatur vergleichsstellentemperatur cjc cj ref reference "
    "referenz vergleichsstelle ptemp kaltstelle"
)
#: Columns of one whole number that say whose record it is.
LABELS = _set("machine run test trial series lot order job station operator serial experiment sample count row project customer")
COUNTERS = _set("sweep frame place part no nr index idx sample scan record count counter row number id rec anz point")
#: Words of what is logged beside temperatures and means nothing for them.
OTHER = _set(
    "flags heartbeat relay program segment loop frame sweep place part free ok valid sign bit bits sum checksum battery_low "
    "output index idx alm dio totalizer "
    "id serial status state code alarm flag error crc counter cycle cyc step rssi signal lat lon latitude longitude altitude "
    "depth seq sequence quality validity marker mode result table millisecond millitm msec position cell rack shelf test lot "
    "batch tvoc voc tds type pid kp ki kd dwell ramp gain gateway firmware version confidence subsec "
    "emissivity emissivität emissionsgrad transmissivity transmissivität transmission"
)
TEMPERATURE = _set(
    "temp temps temperature temperatures temperatur temperaturen tmp tc thermocouple thermo pt rtd ntc thermistor therm dewpt "
    "dewpoint probe fühler 温度 temperatura temperaturas teplota lämpötila hőmérséklet sıcaklık температура "
    "θερμοκρασία θερμοκρασίες θερμ"
)
#: Words that a name may have beside the one that decides, and is still that.
#: What a channel is called before its number.
CHANNELS = _set("channel chan kanal canal sensor probe fühler fuehler sonde capteur input eingang")
BESIDE = _set("t tc ch c f k degc temp temps temperature temperatur avg ave average mean last max min inside indoor")
#: Places on a machine, which have a temperature whatever stands beside them.
PLACES = _set(
    "bearing lager motor housing gehäuse winding wicklung casing stator rotor coil spule nut flange block body outlet inlet "
    "spindle spindel compressor gearbox headstock "
    "pipe rohr rodamiento cuscinetto rolamento palier roulement łożysko łożyska ložisko ložiska подшипник подшипника"
)
#: Parts of a machine tool whose words mean other things in tables; behind the number of a probe they are places: T5_column.
PARTS = _set("column table bed base frame ram saddle quill chuck carriage slide beam rail ständer tisch bett schlitten")
#: A temperature made from others: their difference, scatter or rate.
DERIVED = _set(
    "rise overtemperature übertemperatur uebertemperatur anstieg erwärmung erwaermung delta std stdev stddev sigma "
    "diff difference differenz deviation abweichung messabweichung noise resolution accuracy genauigkeit auflösung "
    "rauschen погрешность error gradient rate slope deltat dt spread uncertainty temperaturdifferenz temperaturgradient "
    "drift temperaturanstieg überhitzung messfehler unsicherheit "
    "regelabweichung regeldifferenz sollabweichung überhöhung temperaturerhöhung temperaturüberhöhung "
    "разность разница διαφορά fark farkı "
    "temperaturspreizung spreizung tdiff overtemp excess trel rel relative residual residuum hysteresis abw"
)
#: The same that count wherever in a name they stand, behind its unit too: front [°C] rate.
QUALITIES = _set("rate noise resolution accuracy error")
#: Of the readings of an interval: their mean, and what else is told of them.
MEANS = _set("avg ave average mean mittel mittelwert mw moyenne moy media promedio 平均 平均值")
EXTREMES = _set("rms min max mini maxi minimum maximum lowest highest mín máx 最小 最大 最小值 最大值")
SPREADS = _set("raw adc counts range std stdev stddev dev sd spread span")
#: Marks of a reading, one for each row, whatever else the name says.
FLAGS = _set("ok valid validity status state error fault quality flag")
#: Words of a name that tell how its marks are meant: a quality, 1 for good, 1 for bad, or a state.
MARK_QUALITIES = _set("quality qualität statuscode opc q qual")
MARK_VALIDITIES = _set("valid validity gültig ok good")
MARK_FAULTS = _set("fault error err fehler fail failure bad invalid ungültig")
MARK_STATES = _set("status state flag code")
MARKS = MARK_QUALITIES | MARK_VALIDITIES | MARK_FAULTS | MARK_STATES
#: What a sensor's readings are called behind its name.
VALUES = _set("value val wert messwert reading")
#: Endings of German compounds that are inputs: Spindeldrehzahl, Vorlaufdruck.
INPUT_ENDINGS = (
    "drehzahl",
    "druck",
    "spannung",
    "strom",
    "leistung",
    "moment",
    "kraft",
    "feuchte",
    "feuchtigkeit",
    "frequenz",
    "durchfluss",
    "menge",
    "aufnahme",
    "schwingung",
    "abweichung",
    "wachstum",
    "ventil",
    "pumpe",
    "stunden",
)
#: Parts of words of languages that are written without blanks.
AMBIENT_PARTS = (
    "気温",
    "雰囲気",
    "T∞",
    "环境",
    "環境",
    "室温",
    "室溫",
    "室内",
    "室內",
    "周囲",
    "周围",
    "车间",
    "주변",
    "실내",
    "실온",
    "기온",
    "주위",
)
INPUT_PARTS = (
    *("转速", "回転", "轉速", "电流", "電流", "电压", "電圧", "功率", "電力", "湿度", "濕度", "压力", "圧力", "速度", "进给"),
    *("전류", "전압", "회전", "속도", "압력", "부하", "负载", "負荷", "負載", "습도", "전력", "유량", "진동", "토크", "주파수"),
    *(
        "壓力",
        "油压",
        "油壓",
        "油圧",
        "气压",
        "氣壓",
        "气圧",
        "電壓",
        "电力",
        "流量",
        "振动",
        "振動",
        "扭矩",
        "转矩",
        "轉矩",
        "トルク",
    ),
    *("频率", "頻率", "周波数", "温差", "溫差", "温度差", "溫度差", "온도차"),
)
#: Names that begin so are no temperature though "temp" stands in them.
NOT_TEMPERATURE = _set("attempts attempt template templates tempo tempus contempt temporary temporal")
#: Names that name nothing: a column called so beside columns that say they are temperatures is none.
NAMELESS = _set(
    "value values val wert data channel chan kanal reading measurement column analog input output dev untitled var series "
    "signal field messwert unnamed"
)
#: Words of a thermal displacement; the unit alone says it too, as in ``Z (um)``.
DISPLACEMENTS = _set("mm um µm μm micron microns disp displacement displacements verlagerung verschiebung 热位移 位移")

#: Columns of a long table: what names the sensor, what holds the reading, and what only remarks on it.
SENSOR_NAMES = _set(
    "ch chan itemid tagid tag_id slot node address addr varname sensor channel series name probe location tag field metric "
    "kanal messstelle entity device variable parameter signal topic label measurement host fühler sensorname messpunkt ort "
    "point"
)
READINGS = _set("value val wert messwert reading state temperature temp temperatur mean")
REMARKS = _set(
    "unit einheit status remark comment note event alarm message operator quality validity flag bemerkung kommentar mode phase type"
)
UNITS = _set("unit units einheit uom eu")

TIME = _set(
    "time times timestamp timestamps datetime date elapsed clock zeit uhrzeit datum zeitstempel stamp zeitpunkt temps heure "
    "laufzeit messdauer duración durata zaman fecha hora ora orario saat tarih tid tijd čas idő aika время дата tiempo czas "
    "时间 日期 経過時間 時刻 시간 millis uptime süre χρόνος ώρα ημερομηνία"
)
#: The same in languages that are written without blanks; and a temperature.
TIME_PARTS = ("时间", "時間", "时刻", "時刻", "日期", "日時", "日付", "시간", "날짜")
TEMPERATURE_PARTS = ("温度", "溫度", "온도", "lämpötila", "hőmérséklet", "sıcaklı", "θερμοκρασ")
#: Names that mean time only when they are the whole name: T_min may be the least of a temperature.
TIME_NAMES = _set("t s sec seconds min minutes h hours x_value _time ts ms Seconds Minutes Hours Sec X_Value Tempo")

#: Units that may follow a name after a blank or underline: single letters may be the front (V, vorn) or the rear of a machine.
UNIT_SUFFIXES = _set(
    "mv uv kv volts ohm ohms kohm ma kw watt watts kwh wh mah ah percent pct psi mbar bar hpa kpa rpm hz khz mhz lpm lux ppm kn "
    "dbm %"
)

#: Words for the units of time.
TIME_UNITS: dict[str, tuple[str, ...]] = {
    "ns": ("ns", "nanoseconds"),
    "us": ("us", "µs", "μs", "microseconds"),
    "ms": ("ms", "msec", "millis", "msecs", "millis", "milliseconds"),
    "s": (
        "s",
        "sec",
        "secs",
        "second",
        "seconds",
        "sek",
        "sekunden",
        "秒",
        "초",
        "с",
        "сек",
        "sn",
        "saniye",
        "δευτ",
        "δευτερόλεπτα",
    ),
    "min": ("min", "mins", "minute", "minutes", "minuten", "分钟", "分", "분", "мин", "dk", "dakika", "λεπτά", "λεπ"),
    "h": ("h", "hr", "hrs", "hour", "hours", "std", "stunden", "小时", "ч", "час", "saat", "ώρες"),
    "d": ("d", "day", "days", "tage"),
}

#: Whole names of columns that tell a part of a moment.
TIME_WORDS: dict[str, frozenset[str]] = {
    "year": _set("year yyyy yy jahr année ano anno år rok yıl 年"),
    "month": _set("month mon monat mois mes mese maand måned ay 月"),
    "day": _set("day dd tag jour día dia giorno dag den gün 日"),
    "hour": frozenset(TIME_UNITS["h"]) | _set("hh stunde heure hora ora uur saat 时 時"),
    "minute": frozenset(TIME_UNITS["min"]) | _set("mm mi minuto minuti minuut dakika"),
    "second": frozenset(TIME_UNITS["s"]) | _set("ss sekunde segundo secondo seconde saniye"),
}
#: Whole names of columns that tell a part of a date beside the time.
CALENDAR = frozenset().union(*(known for part, known in TIME_WORDS.items())) - _set("s m h min mm ss mon") | _set(
    "weekday wochentag dow week woche kw doy quarter"
)
#: Months by the first three letters of their names, of four where these are not enough.
MONTHS = dict(zip(["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"], range(1, 13), strict=True))
MONTHS |= {
    "мар": 3,
    "апр": 4,
    "май": 5,
    "мая": 5,
    "июн": 6,
    "июл": 7,
    "авг": 8,
    "сен": 9,
    "окт": 10,
    "ноя": 11,
    "дек": 12,
    "янв": 1,
    "фев": 2,
}
MONTHS |= {
    "mrt": 3,
    "mei": 5,
    "ago": 8,
    "ene": 1,
    "abr": 4,
    "dic": 12,
    "gen": 1,
    "mag": 5,
    "giu": 6,
    "lug": 7,
    "set": 9,
    "ott": 10,
}
MONTHS |= dict(
    zip(["sty", "lut", "kwi", "maj", "cze", "lip", "sie", "wrz", "paź", "lis", "gru"], (1, 2, 4, *range(5, 13)), strict=True)
)
MONTHS |= {"led": 1, "úno": 2, "bře": 3, "dub": 4, "kvě": 5, "zář": 9, "říj": 10, "pro": 12, "fev": 2, "out": 10}
MONTHS |= {"oca": 1, "şub": 2, "nis": 4, "haz": 6, "tem": 7, "ağu": 8, "eyl": 9, "eki": 10, "kas": 11, "ara": 12}
MONTHS |= {"mär": 3, "mrz": 3, "mai": 5, "okt": 10, "dez": 12, "fév": 2, "avr": 4, "juin": 6, "juil": 7, "aoû": 8, "déc": 12}
MONTHS |= dict(
    zip(["ιαν", "φεβ", "μαρ", "μάρ", "απρ", "μαι", "μάι", "ιουν", "ιουλ", "αυγ"], (1, 2, 3, 3, 4, 5, 5, 6, 7, 8), strict=True)
)
MONTHS |= {"σεπ": 9, "οκτ": 10, "νοε": 11, "δεκ": 12}
