"""The steps from a table to its runs: time, a column for each sensor, what each column is, temperatures in degC."""

import re
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import InputError, UsageError, listed
from ..reading_options import Options
from .columns import Roles, classify, length_unit, resistive
from .headings.called import check_names, column_named, resolved
from .long import Layout, find_long, to_wide, without_switches
from .moments.in_turn import each_in_turn
from .moments.order import in_order, length_told, runs_otherwise
from .moments.stamps import two_decimal_signs, two_signs
from .moments.time_column import is_time_name
from .moments.times import Time, find_time, length_of
from .moments.zones import in_zone
from .run import Array, Guess, Run, Seen, SeenColumn, renamed, told_of_sensors
from .signs import sign_of
from .table import Table
from .tables.clocks import clocks_of_columns, with_one_clock
from .units import parse_unit, unit_changes
from .values.degrees import Temperatures, refuse_another_unit, refuse_words, unit_told, warm_inputs, winding
from .values.faults import unmoved_gap, without_faults, without_impossible
from .values.marks import good_readings
from .values.thousands import with_thousands
from .values.unchanged import as_it_stood
from .vocabulary import UNITS
from .vocabulary import words as words_of

#: Units of temperature that a line above the names may tell of all columns.
OF_ALL = ("C", "K", "F")


@dataclass
class _Said:
    """What is said of the whole record on the way from its table to its runs."""

    notes: list[str] = field(default_factory=list)
    guesses: list[Guess] = field(default_factory=list)
    own_unit: frozenset[str] = frozenset()  # columns that --units, said of all, does not concern

    def of(self, what: str, who: "list[str] | tuple[str, ...]", most: int = 6) -> None:
        """That columns, if there are any, are this."""
        if who:
            self.notes.append(f"{what}: {listed(who, most)}")


def runs_from_table(table: Table, options: Options) -> list[Run]:
    """What each column is, time in order, temperatures in degC: one run, or several where the time begins anew.

    Raises
    ------
    InputError: no time, no sensor, a cell that is no number, or something that cannot be told and must be said.
    UsageError: an option names no column.
    """
    table, time, layout = _with_time(table, options)
    said = _Said([*table.notes, time.note], [*table.guesses, *time.guesses])
    numbers = {n: c for n, c in table.columns.items() if n not in time.used and isinstance(c, np.ndarray)}
    options = resolved(options, table.names, [n for n in numbers if not is_time_name(n)])
    check_names(options.exclude, table.names, "--exclude", table.name)
    windings, options = _windings(table, numbers, options, said)
    spare = _other_clocks(table, time, () if layout is not None else tuple(numbers), options)
    said.of("other columns of time left out", spare)
    named = [n for n in numbers if n not in spare and not (n.startswith("column ") and np.isnan(numbers[n]).all())]
    words = [n for n, c in table.columns.items() if n not in time.used and not isinstance(c, np.ndarray)]
    _refuse_words(table, words, options)
    said.of("columns of words left out", [n for n in words if n not in options.exclude])
    said.of("by --exclude left out", options.exclude)
    _refuse_taken(options)
    _check_channels(table, named, words, options)
    units = _with_unit_column(table, named)
    origin = "long" if layout is not None else "header" if table.header else "none"
    roles = _roles(classify(named, numbers, units, options, table.name, origin), named, windings)
    said.notes += roles.notes
    said.guesses += roles.guesses
    if not roles.sensors:
        raise _no_sensor(table, words, named)
    for n in (*roles.sensors, *roles.ambient, *roles.inputs):
        if n in table.faults:
            raise table.faults[n]
    options = _unit_above(table, roles, units, options, said)
    columns, of_channels = _in_degrees(table, numbers, roles, units, options, said)
    columns |= _in_um({n: numbers[n] for n in roles.displacements}, units, said)
    seen = _seen(table, time, layout, roles, units, spare, options, said.own_unit)
    if layout is not None:
        time, in_turn = each_in_turn(time, columns)
        said.guesses += in_turn
    where = table.lines, time.wall, time.dated, layout is not None, table.headers
    parts = in_order(time.seconds, columns, table.name, *where)
    runs = []
    for k, part in enumerate(parts):
        of, faults = without_faults(part.columns, (*roles.sensors, *roles.ambient))
        about = {n: "; ".join(t for t in (of_channels.get(n, ""), faults.get(n, "")) if t) for n in (*of_channels, *faults)}
        kinds = (roles.sensors, roles.ambient, roles.inputs, roles.displacements)
        channels, ambient, inputs, displacements = ({n: of[n] for n in who} for who in kinds)
        notes = (*said.notes, *part.notes)
        guesses = (*said.guesses, *part.guesses, *unmoved_gap(part.time, list(channels.values())))
        name = table.name if len(parts) == 1 else f"{table.name}#{k + 1}"
        run = as_it_stood(Run(name, part.time, channels, ambient, inputs, notes, about, displacements, guesses, seen))
        runs.append(told_of_sensors(renamed(run, options.rename) if options.rename else run))
    return runs


def _with_time(table: Table, options: Options) -> tuple[Table, Time, Layout | None]:
    """The table with a column for each sensor, the time of its rows, and how it was laid out where it was long."""
    table = with_thousands(without_switches(with_one_clock(table, options)))
    time = find_time(table, replace(options, time=column_named(options.time, table.names)))
    if options.tz is not None:
        time = in_zone(time, options.tz, table.name)
    layout = find_long(table, time, options)
    return to_wide(table, layout, time) if layout is not None else good_readings(table), time, layout


def _windings(table: Table, numbers: dict[str, Array], options: Options, said: _Said) -> tuple[list[str], Options]:
    """Columns of resistance, put among `numbers` as temperatures of windings, and the options with that unit."""
    found = resistive(numbers, table.units, options, table.name) if options.resistance else []
    numbers |= {n: winding(numbers[n], n, table, options) for n in found}
    said.of("temperatures of windings by their resistance", found)
    return found, replace(options, units=(*options.units, *(f"{n}=C" for n in found)))


def _other_clocks(table: Table, time: Time, among: tuple[str, ...], options: Options) -> list[str]:
    """Columns `among` some that are time beside the one used; of a long table a sensor may be called min, so it has none.

    Raises
    ------
    InputError: one runs otherwise.
    """
    asked = (*options.channels, *options.inputs, options.ambient)
    spare = [n for n in among if is_time_name(n) and n not in asked]
    _refuse_other_clock(table, time, spare, options)
    return spare


def _refuse_words(table: Table, words: list[str], options: Options) -> None:
    """Raises InputError for a column of words that surely is one of readings, where nobody says which columns are."""
    for n in words:
        if n in options.exclude or options.channels:
            continue
        if n in table.faults and sign_of(n, table.units.get(n, "")).kind == "sensor":
            raise table.faults[n]
        refuse_words(table, n)


def _check_channels(table: Table, named: list[str], words: list[str], options: Options) -> None:
    """Raises where a column that is asked for as a sensor is not there, or holds words."""
    if not options.channels:
        return
    check_names(options.channels, [*named, *words], "--channels", table.name)
    if wordy := [c for c in options.channels if c in words]:
        raise InputError(
            f"{table.name}: column {wordy[0]!r} holds words", found=f"as {table.columns[wordy[0]][0]!r}", allowed="numbers"
        )


def _roles(found: Roles, named: list[str], windings: list[str]) -> Roles:
    """What each column is, where a resistance asked for as a winding is a sensor."""
    if not windings:
        return found
    sensors = tuple(n for n in named if n in (*found.sensors, *windings))
    return replace(found, sensors=sensors, inputs=tuple(n for n in found.inputs if n not in windings))


def _unit_above(table: Table, roles: Roles, units: dict[str, str], options: Options, said: _Said) -> Options:
    """The options with the unit that a line above the names tells of all columns, where no column has its own.

    Raises
    ------
    InputError: it is none of temperature.
    """
    own = [u for n in roles.sensors if (u := sign_of(n, units.get(n, "")).unit) is not None and u.temperature]
    if not table.unit_above or options.units or own:
        return options
    if table.unit_above in OF_ALL:
        said.notes.append(f"temperatures in {table.unit_above}, as a line above the names says")
        return replace(options, units=(table.unit_above,))
    if options.channels:
        return options
    raise _no_sensor(table, [], [f"{n} [{table.unit_above}]" for n in roles.sensors])


def _in_degrees(
    table: Table, numbers: dict[str, Array], roles: Roles, units: dict[str, str], options: Options, said: _Said
) -> tuple[dict[str, Array], dict[str, str]]:
    """Sensors, surroundings and inputs, temperatures in degC without impossible readings; and what is said of each."""
    degrees, of_channels = Temperatures(table, units, options, (*roles.sensors, *roles.ambient)), dict[str, str]()
    columns = {n: numbers[n] for n in (*roles.sensors, *roles.ambient, *roles.inputs)}
    for n in (*roles.sensors, *roles.ambient, *warm_inputs(roles.inputs, units, options, table)):
        columns[n], impossible = without_impossible(degrees.of(n, numbers[n], n in roles.inputs))
        if impossible:
            of_channels[n] = f"{impossible} overload or impossible reading{'s' if impossible > 1 else ''} left out"
    refuse_another_unit([numbers[n] for n in roles.sensors], table)
    said.notes += degrees.notes()
    said.own_unit = frozenset(degrees.own_unit)
    said.guesses += degrees.guesses()
    said.notes.append(f"{len(roles.sensors)} sensor{'s' if len(roles.sensors) > 1 else ''} ({listed(roles.sensors, 4)})")
    for what, who in (("surroundings", roles.ambient), ("inputs", roles.inputs), ("displacements", roles.displacements)):
        if who:
            said.notes.append(f"{what}: {listed(who)}")
    return columns, of_channels


def _in_um(displacements: dict[str, Array], units: dict[str, str], said: _Said) -> dict[str, Array]:
    """Displacements in um; one without a unit of length is taken for that."""
    columns = dict(displacements)
    for n, column in displacements.items():
        unit = length_unit(n, units.get(n, ""))
        if unit == "mm":
            columns[n] = column * 1000.0
            said.notes.append(f"{n}: mm, turned into um")
        elif not unit:
            text = f"{n}: no unit of length, taken for um"
            said.guesses.append(Guess("unit", text, "write um or mm into its name, or into a line of units"))
    return columns


def _refuse_taken(options: Options) -> None:
    """Raises UsageError for a column that two options name."""
    if options.ambient is not None and options.ambient in options.inputs:
        raise UsageError(f"--ambient and --inputs both name {options.ambient!r}", do="say it in one of them")
    taken = {"--exclude": options.exclude, "--inputs": options.inputs, "--ambient": (options.ambient,)}
    for other, names in taken.items():
        if both := [n for n in options.channels if n in names]:
            raise UsageError(f"--channels and {other} both name {both[0]!r}", do="say it in one of them")


def _seen(
    table: Table,
    time: Time,
    layout: Layout | None,
    roles: Roles,
    units: dict[str, str],
    spare: list[str],
    options: Options,
    own_unit: frozenset[str],
) -> Seen:
    """What each column was taken for, and how the file is laid out."""
    kinds = {"sensors": "sensor", "ambient": "ambient", "inputs": "input", "displacements": "displacement"}
    of = {n: role for kind, role in kinds.items() for n in getattr(roles, kind)} | dict.fromkeys(time.used, "time")
    of |= dict.fromkeys(table.clocks, "time")
    columns = []
    for n in (*table.names, *table.clocks[1:]):
        role = of.get(n, "ignored")
        unit = time.unit if role == "time" else units.get(n, "") or getattr(sign_of(n, "").unit, "symbol", "")
        if role in ("sensor", "ambient", "input"):
            unit = unit_told(n, options, table, by_name=role == "input" or n in own_unit) or unit
        columns.append(SeenColumn(n, role, unit, _why(n, role, table, roles, spare, options)))
    d = table.dialect if table.dialect is None or not table.dialect.joined else replace(table.dialect, delimiter="", decimal="")
    return Seen(
        len(time.seconds),
        tuple(columns),
        " and ".join(table.clocks or [n for n in table.names if n in time.used]),
        time.unit,
        d.encoding if d else "",
        d.delimiter if d else "",
        d.decimal if d else "",
        None if d is None else 0 if d.header_line is None else d.header_line + 1,
        (*layout.labels, layout.value) if layout is not None else (),
    )


def _why(name: str, role: str, table: Table, roles: Roles, spare: list[str], options: Options) -> str:
    """Why a column is left out."""
    if role != "ignored":
        return ""
    if name in options.exclude:
        return "left out by --exclude"
    if name in spare:
        return "another column of time"
    column = table.columns.get(name)
    if isinstance(column, np.ndarray) and not np.isfinite(column).any():
        return "empty"
    if column is not None and not isinstance(column, np.ndarray):
        return "words" if any(c.strip() for c in column) else "empty"
    if options.channels and name not in options.channels:
        return "not among --channels"
    said = (n.partition(":")[0] for n in roles.notes if name in n)
    return next(said, "neither name nor unit says a temperature")


def _no_sensor(table: Table, words: list[str], named: list[str]) -> InputError:
    for n in words:
        if two := two_signs(table.columns[n]):  # type: ignore[arg-type]
            return two_decimal_signs(f"{table.name}, column {n!r}", two)
    found = [f"{n} ({u})" if (u := table.units.get(n, "")) else n for n in (named or words)]
    ohms = any((unit := sign_of(n, table.units.get(n, "")).unit) is not None and unit.kind == "resistance" for n in named)
    platinum = "; say --units Pt100 (or Pt1000) if columns are a platinum resistor's ohms" if ohms else ""
    return InputError(
        f"{table.name}: no sensor column",
        found=listed(found, 8) or "only a time column",
        allowed="at least one column of temperatures",
        do=f"name the sensors with --channels, if these are temperatures{platinum}",
    )


def _with_unit_column(table: Table, named: list[str]) -> dict[str, str]:
    """Units of the columns; a column of words that tells one unit in every row is that of the number beside it."""
    units = dict(table.units)
    for at, (n, cells) in enumerate(table.columns.items()):
        if not (set(words_of(n)) & UNITS) or isinstance(cells, np.ndarray):
            continue
        told = {c.strip() for c in cells if c.strip()}
        order = list(table.columns)
        beside = [order[k] for k in (at - 1, at + 1) if 0 <= k < len(order) and order[k] in named]
        kinds = {unit.symbol for t in told if (unit := parse_unit(t)) is not None and unit.temperature}
        if len(kinds) > 1 and beside:
            raise unit_changes(f"{table.name}, column {n!r}", sorted(told))
        if len(told) == 1 and beside:
            units[beside[0]] = units.get(beside[0]) or told.pop()
    return units


def _refuse_other_clock(table: Table, time: Time, spare: list[str], options: Options) -> None:
    """Raises InputError for a second clock, of the same name or among the readings, that runs otherwise or is of another length."""
    used = next(iter(time.used), "")
    if options.channels and options.time:
        return
    words = [n for n, c in table.columns.items() if n not in time.used and not isinstance(c, np.ndarray) and is_time_name(n)]
    named = of if used in (of := clocks_of_columns(table)) else []
    for n in (*spare, *words, *named):
        if n in options.exclude or n == used:
            continue
        alike = words_of(re.sub(r" \(\d+\)$", "", n)) == words_of(re.sub(r" \(\d+\)$", "", used))
        own, main = table.columns[n], table.columns.get(used, [])
        if isinstance(own, np.ndarray) and isinstance(main, np.ndarray) and np.array_equal(own, main, equal_nan=True):
            continue
        numbers = isinstance(own, np.ndarray) and isinstance(main, np.ndarray)
        if (numbers and (alike or n in named)) or runs_otherwise(table, time, used, n, alike):
            raise InputError(
                f"{table.name}: two clocks, {used!r} and {n!r}, that do not run alike",
                allowed="one time for all columns read together",
                do=f"read the columns of each clock by themselves: --time {n!r} --channels with its columns; or --exclude {n!r} "
                "if it is none of theirs",
            )
        if not options.time and (length := length_told(table, time, n)) is not None:
            told = f"{length_of(float(np.ptp(time.seconds)))} by {used!r}, {length_of(length)} by {n!r}"
            do = f"say which is right: --time {n!r}, or --exclude {n!r}"
            raise InputError(f"{table.name}: two times that disagree about how long the record is", found=told, do=do)
