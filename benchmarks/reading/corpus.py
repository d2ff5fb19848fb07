"""Files as loggers write them, made by rule: is every one read exactly, or refused in words?

python -m benchmarks.reading.corpus [--files 2000] [--seed 0] [--show 5] makes files of twenty-two forms (BenchLink, Graphtec,
Yokogawa, Hioki, LabVIEW, HOBO, TOA5, Testo, WinCC archives, TwinCAT Scope, UaExpert, Home Assistant and other long tables, Excel,
headers in other languages, a clock for each sensor, and plain ones) times encodings,
decimal marks, delimiters, line ends, clocks and marks of missing readings, and prints by form how many were read exactly,
refused, or read WRONG. A refusal is right where its message says what to do. --show prints the beginnings of files that were
not read exactly.
"""

import argparse
import datetime as dt
import random
import tempfile
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import thermofast as tf

ENCODINGS = ("utf-8", "utf-8-sig", "cp1252", "utf-16", "utf-16-le-bom")
ENDS = ("\n", "\r\n", "\r")
MISSING = ("", "NaN", "----", "9.9E+37", "OVER", "#N/A", "-")
NAMES = ("front", "rear", "Lager vorn", "Motor", "T_housing", "spindle nose", "Öl", "bearing 2")


@dataclass
class Truth:
    """A record: time (n,) [s], readings (S, n) [degC], nan for none; and how a file of it is written."""

    rng: random.Random
    time: np.ndarray
    values: np.ndarray
    names: list[str]
    digits: int
    start: dt.datetime
    delimiter: str
    decimal: str
    missing: str
    lines: list[str] = field(default_factory=list)
    encoding: str = ""

    def number(self, value: float) -> str:
        """A reading as text."""
        if not np.isfinite(value):
            return self.missing.replace(".", self.decimal) if self.missing[:1].isdigit() else self.missing
        return f"{value:.{self.digits}f}".replace(".", self.decimal)

    def clock(self, k: int) -> dt.datetime:
        """Date and time of a row."""
        return self.start + dt.timedelta(seconds=float(self.time[k]))

    def row(self, *cells: str) -> None:
        """A line of the file; a cell that holds the delimiter is quoted."""
        quoted = [f'"{c}"' if self.delimiter in c or '"' in c else c for c in cells]
        self.lines.append(self.delimiter.join(quoted))

    def readings(self, k: int) -> list[str]:
        """The cells of a row."""
        return [self.number(v) for v in self.values[:, k]]


def truth_of(rng: random.Random) -> Truth:
    """A record and a dialect."""
    count, sensors, step = rng.randint(40, 120), rng.randint(1, 4), rng.choice([1, 2, 5, 10, 30, 60])
    digits = rng.choice([1, 2, 3])
    time = step * np.arange(count, dtype=float)
    tau = time[-1] * rng.uniform(0.2, 1.0)
    values = np.array([[rng.uniform(16, 24)] + rng.uniform(-8, 40) * -np.expm1(-time / tau) for _ in range(sensors)])
    values = np.round(values + np.array([[rng.gauss(0.0, 0.05) for _ in time] for _ in range(sensors)]), digits)
    for _ in range(rng.choice([0, 0, 2, 5])):
        values[rng.randrange(sensors), rng.randrange(2, count)] = np.nan
    decimal = rng.choice([".", ","])
    delimiter = rng.choice([";", "\t"] if decimal == "," else [",", ";", "\t"])
    start = dt.datetime(2026, rng.randint(1, 12), rng.randint(13, 28), rng.randint(0, 23), rng.randint(0, 59), rng.randint(0, 59))
    names = rng.sample(NAMES, sensors)
    return Truth(rng, time, values, names, digits, start, delimiter, decimal, rng.choice(MISSING))


def with_unit(t: Truth) -> list[str]:
    """Names that say degC in one of the usual ways."""
    form = t.rng.choice(["{} [°C]", "{} (degC)", "{} °C", "{} / °C", "Temp {} (C)"])
    return [form.format(n) for n in t.names]


def plain(t: Truth) -> None:
    """Elapsed time, its unit in its name."""
    unit, scale = t.rng.choice([("s", 1.0), ("min", 60.0), ("h", 3600.0), ("ms", 0.001)])
    head = t.rng.choice([f"time_{unit}", f"Time [{unit}]", f"Zeit ({unit})"])
    t.row(head, *with_unit(t))
    for k, s in enumerate(t.time):
        t.row(f"{s / scale:.6f}".rstrip("0").rstrip(".").replace(".", t.decimal), *t.readings(k))


STAMPS = (
    "%Y-%m-%d %H:%M:%S",
    "%d.%m.%Y %H:%M:%S",
    "%Y/%m/%d %H:%M:%S",
    "%Y-%m-%dT%H:%M:%S",
    "%m/%d/%Y %I:%M:%S %p",
    "%d-%b-%Y %H:%M:%S",
)


def stamped(t: Truth) -> None:
    """Stamps in one column."""
    form = t.rng.choice(STAMPS)
    t.row(t.rng.choice(["Timestamp", "Date/Time", "Datum", "Zeitstempel"]), *with_unit(t))
    for k in range(len(t.time)):
        t.row(t.clock(k).strftime(form), *t.readings(k))


def two_columns(t: Truth) -> None:
    """Date and time side by side, under a preamble."""
    for line in ("Logger XY 200", "Serial number: 12345", f"Sensors: {len(t.names)}", ""):
        t.lines.append(line)
    form = t.rng.choice(["%d.%m.%Y", "%Y-%m-%d", "%m/%d/%Y"])
    t.row("Date", "Time", *with_unit(t))
    for k in range(len(t.time)):
        t.row(t.clock(k).strftime(form), t.clock(k).strftime("%H:%M:%S"), *t.readings(k))


def unit_line(t: Truth) -> None:
    """A line of units under the names."""
    t.row("Time", *t.names)
    t.row("s", *["°C"] * len(t.names))
    for k, s in enumerate(t.time):
        t.row(f"{s:.0f}", *t.readings(k))


def benchlink(t: Truth) -> None:
    """BenchLink Data Logger: each channel beside its alarm."""
    t.lines += [
        "Name: run",
        "Owner: lab",
        "Acquisition Date: " + t.start.strftime("%d.%m.%Y %H:%M:%S"),
        "",
        "Instrument: 34972A",
        "",
    ]
    cells = [c for i, n in enumerate(t.names) for c in (f"{101 + i} <{n}> (C)", f"Alarm {101 + i}")]
    t.row("Scan", "Time", *cells)
    for k in range(len(t.time)):
        t.row(str(k + 1), t.clock(k).strftime("%d.%m.%Y %H:%M:%S:000"), *[c for v in t.readings(k) for c in (v, "0")])


def graphtec(t: Truth) -> None:
    """GL series: sign, blanks, a line of units, alarms."""
    t.lines += ["Vendor,GRAPHTEC Corporation".replace(",", t.delimiter), "Model,GL240".replace(",", t.delimiter)]
    t.lines += ["Sampling interval,1s".replace(",", t.delimiter), "", "Data"]
    t.row("Number", "Date&Time", "ms", *[f"CH{i + 1}" for i in range(len(t.names))], "Alarm1-10", "AlarmOut")
    t.row("NO.", "Time", "ms", *["degC"] * len(t.names), "A1234567890", "A1234")
    for k in range(len(t.time)):
        cells = [f"{'-' if v < 0 else '+'}{t.number(abs(v)):>7}" if np.isfinite(v) else "+++++++" for v in t.values[:, k]]
        t.row(str(k + 1), t.clock(k).strftime("%Y/%m/%d %H:%M:%S"), "0", *cells, "LLLLLLLLLL", "LLLL")


def yokogawa(t: Truth) -> None:
    """Rows of tags and units above the dates: degC, degF or K, with or without milliseconds."""
    unit, scale, zero = t.rng.choice([("°C", 1.0, 0.0), ("C", 1.0, 0.0), ("°F", 1.8, 32.0), ("K", 1.0, 273.15)])
    written = np.round(scale * t.values + zero, t.digits)
    t.values = (written - zero) / scale
    between = t.rng.choice([[], ["msec"]])
    t.row("Device", "DX1000", *[""] * (len(t.names) + len(between)))
    t.row("Tag", "", *[""] * len(between), *t.names)
    t.row("Unit", "", *[""] * len(between), *[unit] * len(t.names))
    t.row("Date", "Time", *between, *[f"CH{i + 1:03d}" for i in range(len(t.names))])
    for k in range(len(t.time)):
        cells = [t.number(v) for v in written[:, k]]
        t.row(t.clock(k).strftime("%Y/%m/%d"), t.clock(k).strftime("%H:%M:%S"), *["000"] * len(between), *cells)


def hioki(t: Truth) -> None:
    """A preamble of names and values, quoted heads with units."""
    t.row("File name", "AUTO0001.MEM")
    t.row("Title comment", "warm-up")
    t.row("Trigger Time", t.start.strftime("%Y-%m-%d %H:%M:%S"))
    t.row("Date Time", *[f"CH{i + 1}-1[°C]" for i in range(len(t.names))])
    for k in range(len(t.time)):
        t.row(t.clock(k).strftime("%Y-%m-%d %H:%M:%S"), *t.readings(k))


def labview(t: Truth) -> None:
    """A LabVIEW measurement file."""
    t.delimiter = "\t"
    t.lines += [
        "LabVIEW Measurement",
        "Writer_Version\t2",
        "Reader_Version\t2",
        "Separator\tTab",
        f"Decimal_Separator\t{t.decimal}",
    ]
    t.lines += ["Multi_Headings\tNo", "X_Columns\tOne", "Time_Pref\tRelative", "***End_of_Header***", ""]
    t.lines += [
        f"Channels\t{len(t.names)}",
        f"Samples\t{len(t.time)}",
        "Y_Unit_Label\t" + "\t".join(["°C"] * len(t.names)),
        "***End_of_Header***",
    ]
    t.row("X_Value", *with_unit(t), "Comment")
    for k, s in enumerate(t.time):
        t.row(f"{s:.6f}".replace(".", t.decimal), *t.readings(k), "")


def hobo(t: Truth) -> None:
    """A title, numbered rows, names with serials, events at the end."""
    t.delimiter = "," if t.decimal == "." else ";"
    t.lines.append('"Plot Title: run 7"')
    heads = [f"Temp, °C (LGR S/N: 1042, SEN S/N: {10420 + i}, LBL: {n})" for i, n in enumerate(t.names)]
    t.lines.append(t.delimiter.join(f'"{h}"' for h in ("#", "Date Time, GMT+01:00", *heads, "Host Connected", "End Of File")))
    for k in range(len(t.time)):
        t.row(str(k + 1), t.clock(k).strftime("%m/%d/%y %I:%M:%S %p"), *t.readings(k), "", "")
    last = len(t.time)
    t.row(str(last + 1), t.clock(last - 1).strftime("%m/%d/%y %I:%M:%S %p"), *[""] * len(t.names), "Logged", "Logged")


def toa5(t: Truth) -> None:
    """Campbell's table: environment, names, units, processing."""
    t.delimiter, t.decimal = ",", "."
    t.lines.append('"TOA5","lab","CR1000X","1234","CR1000X.Std.04","CPU:run.CR1X","5","Table1"')
    t.lines.append(",".join(f'"{c}"' for c in ("TIMESTAMP", "RECORD", *t.names)))
    t.lines.append(",".join(f'"{c}"' for c in ("TS", "RN", *["Deg C"] * len(t.names))))
    t.lines.append(",".join(f'"{c}"' for c in ("", "", *["Smp"] * len(t.names))))
    t.missing = '"NAN"'
    for k in range(len(t.time)):
        t.lines.append(",".join([f'"{t.clock(k):%Y-%m-%d %H:%M:%S}"', str(k), *t.readings(k)]))


def testo(t: Truth) -> None:
    """Channels with units, and a footer of statistics."""
    t.row("Datum", "Zeit", *[f"{i + 1}:°C {n}" for i, n in enumerate(t.names)])
    for k in range(len(t.time)):
        t.row(t.clock(k).strftime("%d.%m.%Y"), t.clock(k).strftime("%H:%M:%S"), *t.readings(k))
    t.lines.append("")
    t.row("Minimum", "", *[t.number(v) for v in np.nanmin(t.values, axis=1)])
    t.row("Maximum", "", *[t.number(v) for v in np.nanmax(t.values, axis=1)])


def wincc(t: Truth) -> None:
    """An archive: a row for each variable, with validity and milliseconds of days."""
    t.lines.append(t.delimiter.join(f'"{c}"' for c in ("VarName", "TimeString", "VarValue", "Validity", "Time_ms")))
    for k in range(len(t.time)):
        for n, v in zip(t.names, t.values[:, k], strict=True):
            if np.isfinite(v):
                days = (t.clock(k) - dt.datetime(1899, 12, 30)).total_seconds() / 86400.0
                ms = f"{1e6 * days:.6f}".replace(".", t.decimal)
                cells = (f'"{n} Temp"', f'"{t.clock(k):%d.%m.%Y %H:%M:%S}"', t.number(v), "1", ms)
                t.lines.append(t.delimiter.join(cells))


def long_table(t: Truth) -> None:
    """Time, sensor, value."""
    t.row(
        *t.rng.choice(
            [("time", "sensor", "value"), ("last_changed", "entity_id", "state"), ("timestamp", "channel", "temperature")]
        )
    )
    for k in range(len(t.time)):
        for n, v in zip(t.names, t.values[:, k], strict=True):
            if np.isfinite(v):
                t.row(f"{t.clock(k):%Y-%m-%dT%H:%M:%S}", "sensor." + n.lower().replace(" ", "_"), t.number(v))


def omega(t: Truth) -> None:
    """Each reading with its unit in a cell beside it."""
    t.row("Date", "Time", *[c for n in t.names for c in (n, f"{n} unit")])
    for k in range(len(t.time)):
        t.row(t.clock(k).strftime("%Y-%m-%d"), t.clock(k).strftime("%H:%M:%S"), *[c for v in t.readings(k) for c in (v, "C")])


def excel_sep(t: Truth) -> None:
    """Excel's line that names the delimiter."""
    t.lines.append(f"sep={t.delimiter}")
    stamped(t)


def repeated(t: Truth) -> None:
    """The head again every so often, and lines of events between."""
    plain(t)
    head = t.lines[0]
    for at in sorted(t.rng.sample(range(10, len(t.lines)), 2), reverse=True):
        t.lines.insert(at, head)


def twincat(t: Truth) -> None:
    """An export of TwinCAT Scope: one clock in front of all channels, or of each; a line for each thing that is known of them."""
    each = t.rng.random() < 0.5
    t.lines += [f"Name{t.delimiter}scope", f"Starttime of export{t.delimiter}132959733843760000", ""]
    titles = ("Name", "SampleTime[ms]", "Unit")
    told = (t.names, [f"{1000 * t.time[1]:g}"] * len(t.names), ["°C (Temperature)"] * len(t.names))
    for title, cells in zip(titles, told, strict=True):
        t.row(*([c for cell in cells for c in (title, cell)] if each else [title, *cells]))
    t.lines.append("")
    for k, s in enumerate(t.time):
        cells, clock = t.readings(k), f"{1000 * s:.0f}"
        t.row(*([c for cell in cells for c in (clock, cell)] if each else [clock, *cells]))
    t.lines += t.rng.choice([[], ["EOF"]])


def uaexpert(t: Truth) -> None:
    """A log of an OPC UA client: a row for each value, numbered, with the clocks of server and source."""
    t.row("#", "Server", "DisplayName", "Value", "Datatype", "SourceTimestamp", "ServerTimestamp", "Statuscode")
    number = 0
    for k in range(len(t.time)):
        for name, v in zip(t.names, t.values[:, k], strict=True):
            if np.isfinite(v):
                at = t.clock(k).strftime("%d.%m.%Y %H:%M:%S")
                t.row(str(number := number + 1), "PLC", f"{name} Temp", t.number(v), "Double", f"{at}.000", f"{at}.010", "Good")


EASTERN = {
    "gb18030": ("采集时间", "主轴轴承{}(℃)", "%Y年%m月%d日 %H时%M分%S秒"),
    "cp932": ("日時", "軸受{}[℃]", "%Y/%m/%d %H:%M:%S"),
    "big5": ("時間", "主軸軸承{}(℃)", "%Y/%m/%d %H:%M:%S"),
    "euc_kr": ("시간", "온도{}(℃)", "%Y-%m-%d %H:%M:%S"),
}


def eastern(t: Truth) -> None:
    """Headers in Chinese, Japanese and Korean, in their own encodings."""
    t.encoding = t.rng.choice([*EASTERN])
    head, name, form = EASTERN[t.encoding]
    t.missing = t.missing if t.missing.isascii() else ""
    t.row(head, *(name.format(i + 1) for i in range(len(t.names))))
    for k in range(len(t.time)):
        t.row(t.clock(k).strftime(form), *t.readings(k))


LANGUAGES = {
    "cp1250": ("Datum", "Čas", "Ložisko {}"),
    "cp1251": ("Дата", "Время", "Подшипник {}"),
    "cp1252": ("Data", "Ora", "Cuscinetto {}"),
    "cp1254": ("Tarih", "Saat", "Sıcaklık {}"),
    "latin-1": ("Fecha", "Hora", "Rodamiento {}"),
    "utf-8": ("Datum", "Tijd", "Temperatuur {}"),
}


def languages(t: Truth) -> None:
    """Headers in languages of Europe, dates and clocks in columns of their own, clocks with dots among them."""
    t.encoding = t.rng.choice([*LANGUAGES])
    date, clock, name = LANGUAGES[t.encoding]
    t.missing = t.missing if t.missing.isascii() else ""
    t.row(date, clock, *(name.format(i + 1) for i in range(len(t.names))))
    form = t.rng.choice(["%H:%M:%S", "%H.%M.%S"])
    for k in range(len(t.time)):
        t.row(t.clock(k).strftime("%d.%m.%Y"), t.clock(k).strftime(form), *t.readings(k))


def own_clocks(t: Truth) -> None:
    """A clock for each sensor, all alike or each some way behind the one before."""
    behind = t.rng.choice([0.0, 0.0002]) * t.time[-1]
    t.row(*(c for name in with_unit(t) for c in ("Time [s]", name)))
    for k, s in enumerate(t.time):
        cells = ((f"{s + i * behind:.3f}".replace(".", t.decimal), v) for i, v in enumerate(t.readings(k)))
        t.row(*(c for pair in cells for c in pair))


FORMS: dict[str, Callable[[Truth], None]] = {
    f.__name__: f
    for f in (
        plain,
        stamped,
        two_columns,
        unit_line,
        benchlink,
        graphtec,
        yokogawa,
        hioki,
        labview,
        hobo,
        toa5,
        testo,
        wincc,
        long_table,
        omega,
        excel_sep,
        repeated,
        twincat,
        uaexpert,
        eastern,
        languages,
        own_clocks,
    )
}


def file_of(number: int) -> tuple[str, bytes, Truth]:
    """(form, bytes, truth) of the file of that number."""
    rng = random.Random(number)
    form = list(FORMS)[number % len(FORMS)]
    truth = truth_of(rng)
    FORMS[form](truth)
    encoding = truth.encoding or rng.choice(ENCODINGS)
    text = rng.choice(ENDS).join(truth.lines) + rng.choice(["", "\n"])
    if encoding == "utf-16-le-bom":
        return form, b"\xff\xfe" + text.encode("utf-16-le"), truth
    return form, text.encode(encoding, errors="replace"), truth


def judged(number: int) -> tuple[str, str, str]:
    """(form, exact, refused or WRONG, why)."""
    form, data, truth = file_of(number)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.csv"
        path.write_bytes(data)
        try:
            run = tf.read(str(path))
        except tf.InputError as error:
            return form, "refused", str(error).replace(folder, "")
    wrong = _wrong(run, truth)
    return form, "WRONG" if wrong else "exact", wrong


def _wrong(run: tf.Run, truth: Truth) -> str:
    """What differs from the truth; nothing where all is as it is."""
    kept = np.isfinite(truth.values).any(axis=0)
    time, values = truth.time[kept] - truth.time[kept][0], truth.values[:, kept]
    if len(run.channels) != len(values):
        return f"{len(run.channels)} sensors of {len(values)}: {list(run.channels)}, surroundings {list(run.ambient)}"
    rows = np.array(list(run.channels.values()))
    some = np.isfinite(rows).any(axis=0)
    got, at = rows[:, some], run.time_s[some] - run.time_s[some][0]
    if len(at) != len(time):
        return f"{len(at)} rows of {len(time)}"
    if np.abs(at - time).max() > 0.01 * time[1] + 1e-3:
        return f"times off by {np.abs(at - time).max():.3g} s"
    # A long table gives its sensors in their own order.
    for line in values:
        if not any(np.array_equal(np.isfinite(o), np.isfinite(line)) and np.nanmax(np.abs(o - line)) < 1e-6 for o in got):
            return "readings differ"
    return ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--show", type=int, default=0)
    asked = parser.parse_args()
    numbers = range(asked.seed, asked.seed + asked.files)
    with ProcessPoolExecutor() as pool:
        found = list(pool.map(judged, numbers, chunksize=20))
    print("| form | files | exact | refused | WRONG |\n| --- | ---: | ---: | ---: | ---: |")
    for form in FORMS:
        count = Counter(how for f, how, _ in found if f == form)
        print(f"| {form} | {sum(count.values())} | {count['exact']} | {count['refused']} | {count['WRONG']} |")
    whole = Counter(how for _, how, _ in found)
    print(f"| all | {len(found)} | {whole['exact']} | {whole['refused']} | {whole['WRONG']} |")
    for number, (form, how, why) in zip(numbers, found, strict=True):
        if how != "exact" and asked.show > 0:
            asked.show -= 1
            lines = file_of(number)[2].lines
            print(f"\n{number} {form} {how}: {why}\n" + "\n".join(lines[:8]))


if __name__ == "__main__":
    main()
