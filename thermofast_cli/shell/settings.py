"""``thermofast.toml``: what a lab says once instead of on every command line."""

import re
import shlex
import tomllib
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import ThermofastError, UsageError, nearest
from ..reading_options import SEVERAL, joined, names

if TYPE_CHECKING:
    from ..reading import Run

FILE = "thermofast.toml"
#: Options by which code is named.
CODE = {"filter_name": "--filter", "extra": "--effect", "effects": "--effects", "add": "--add", "execute": "--exec"}
#: Options that say where to work, which is where code is run, and what is written; this is done in this folder alone.
AFAR = ("--cluster", "--mpi")
TABLES = "--trace", "--predicted", "--denoise"
WRITTEN = ("--output", "--save-plot", "--jsonl", "--write-effect", "--lab", "--key", "--write", *TABLES)
#: The types of a settings file in words.
KINDS = {
    "array": "a list",
    "str": "a text",
    "int": "a whole number",
    "float": "a number",
    "bool": "true or false",
    "object": "a table",
}


def free_for_settings(path: str) -> None:
    """Raises UsageError where a settings file cannot be written: another suffix, no such folder, or one is there already."""
    from ..output.files import check_target

    check_target(path, (".toml",))
    if Path(path).exists():
        raise UsageError(f"{path}: is there already", do="name another file, or move it away")


def write_settings(path: str, run: "Run", reading: dict[str, Any]) -> None:
    """How a run was read, as the [input] table of a settings file that reads it so again; reading holds the options given.

    Raises
    ------
    UsageError: the file is there already, or cannot be written.
    """
    import tomli_w

    from ..output.files import write_text_whole

    free_for_settings(path)
    lines = [f"# How {run.name} was read. Correct what is wrong; every command reads it so from then on.", ""]
    lines += [f"# {note}" for note in (*run.notes, *map(str, run.guesses))]
    whole = "\n".join(lines) + "\n\n" + tomli_w.dumps({"input": _said(reading) | _found(run)})
    write_text_whole(path, whole)


def _said(reading: dict[str, Any]) -> dict[str, Any]:
    """The options of reading that the user gave, as a settings file has them."""
    from .settings_schema import Reading

    keys = zip(Reading.__struct_fields__, Reading.__struct_encode_fields__, strict=True)
    told = {key: reading[k] for k, key in keys if reading.get(k) and reading[k] != "auto"}
    if "start" in told:
        told["start"] = float(told["start"])
    return {k: list(names(v)) if k in SEVERAL else v for k, v in told.items()}


def _found(run: "Run") -> dict[str, Any]:
    """What was found in the file: its layout and which columns are what, by their names in the file."""
    seen = run.seen
    if seen is None:
        return {}
    found: dict[str, Any] = {n: getattr(seen, n) for n in ("encoding", "delimiter", "decimal") if getattr(seen, n)}
    if seen.header_line is not None:
        found["header_line"] = seen.header_line
    if seen.time_column and " and " not in seen.time_column:
        found["time"] = seen.time_column
    if seen.time_unit not in ("stamp", "interval", ""):
        found["time_unit"] = seen.time_unit
    if seen.long:
        found["long"] = f"{'+'.join(seen.long[:-1])},{seen.long[-1]}"
    of = {role: [c.in_file for c in seen.columns if c.role == role] for role in ("sensor", "ambient", "input")}
    if len(of["ambient"]) == 1:  # several are found again by themselves
        found["ambient"] = of["ambient"][0]
    return found | {"channels": of["sensor"]} | ({"inputs": of["input"]} if of["input"] else {})


def load_settings(path: str | None) -> dict[str, Any]:
    """Defaults per command, {command: {option: value}}, from the file named or from the one in this folder; empty without.

    Raises
    ------
    UsageError: no such file, not TOML, an unknown key or a wrong type; the message lists the known keys.
    """
    target = Path(path or FILE)
    if not target.is_file():
        if path:
            raise UsageError(f"{path}: no such file", do="check --config")
        return {}
    import msgspec

    try:
        raw = tomllib.loads(target.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{target}: not valid TOML", found=str(error), do="mend the line") from None
    from ..main import COMMANDS
    from .settings_schema import Settings, known_keys

    own = {name: raw.pop(name) for name in list(raw) if name in COMMANDS}
    try:
        settings = msgspec.convert(raw, Settings)
    except msgspec.ValidationError as error:
        raise UsageError(f"{target}: {_in_words(str(error), raw)}", allowed=known_keys(), do=_way(str(error), raw)) from None
    defaults = settings.defaults(str(target))
    for name, table in own.items():
        defaults[name] = defaults.get(name, {}) | _of_command(name, table, str(target))
    for table in defaults.values():
        _refuse_code(table, str(target))
    return defaults


def _refuse_code(table: dict[str, Any], target: str) -> None:
    """Raises UsageError where settings name code: they are read wherever a command is called, in a folder of anybody's too."""
    from ..plugins.files import is_file

    for key, option in CODE.items():
        told = table.get(key, ())
        for value in [told] if isinstance(told, str) else told:
            if key == "execute" or any(is_file(part.strip()) for part in value.split(",")):
                raise UsageError(
                    f"{target}: {option} names code",
                    found=repr(value)[:60],
                    allowed="code that you name: no file that settings speak of is run by itself",
                    do=f"say {option} {shlex.quote(value)} on the command line",
                )


def _of_command(name: str, table: Any, target: str) -> dict[str, Any]:
    """The defaults of one command from its table: its options, with underlines, and values as Click takes them.

    Raises
    ------
    UsageError: no option of that command, or a value that it does not take.
    """
    command = import_module(f"..commands.{name}", __package__).command
    options = {o.opts[-1].lstrip("-").replace("-", "_"): o for o in command.params if isinstance(o, click.Option)}
    known = sorted(set(options) - {"help"})
    if not isinstance(table, dict):
        raise UsageError(f"{target}: [{name}] is no table", found=repr(table)[:60], do=f"write [{name}] above its keys")
    told = {}
    context = click.Context(command, resilient_parsing=True)
    for key, value in table.items():
        option = options.get(key)
        if option is None or key == "help":
            hint = nearest(key, known) or "use an option of the command, with underlines"
            raise UsageError(f"{target}: [{name}] has no key {key!r}", allowed=" ".join(known), do=hint)
        _check_kind(option, value, f"{target}: [{name}] {key}")
        _refuse_afar(option, value, str(target))
        if isinstance(value, list) and not option.multiple:
            value = joined(f"{v:g}" if isinstance(v, float | int) else str(v) for v in value)
        if isinstance(value, str) and option.multiple:
            value = [value]
        try:
            option.type_cast_value(context, value)
        except (click.ClickException, ThermofastError, TypeError) as error:
            why = error.message if isinstance(error, click.ClickException) else str(error)
            raise UsageError(f"{target}: [{name}] {key}: {why}", found=repr(value)[:60], do="mend the value") from None
        told[str(option.name)] = value
    return told


def _check_kind(option: click.Option, value: Any, where: str) -> None:
    """Raises UsageError for a value of another kind than the option takes, which Click would make one of."""
    number = isinstance(option.type, click.types.IntParamType | click.types.FloatParamType)
    kind = "true or false" if option.is_flag else "a whole number" if isinstance(option.type, click.types.IntParamType) else ""
    kind = kind or ("a number" if number else "a list of texts" if option.multiple else "a text")
    if option.is_flag or isinstance(value, bool):
        good = option.is_flag and isinstance(value, bool)
    elif number:
        good = isinstance(value, int) or (isinstance(value, float) and kind == "a number")
    else:
        good = isinstance(value, str | int | float) if not option.multiple else isinstance(value, str | list)
        good = good or isinstance(value, list)
    if not good:
        raise UsageError(f"{where}: not {kind}", found=repr(value)[:60], allowed=kind, do="mend the value")


def _refuse_afar(option: click.Option, value: Any, target: str) -> None:
    """Raises UsageError where settings, which may be anybody's, let work be done elsewhere, or files be written outside this
    folder.
    """
    said = next((o for o in option.opts if o in (*AFAR, *WRITTEN)), "")
    if not said:
        return
    paths = [Path(str(v)) for v in (value if isinstance(value, list) else [value])] if said in WRITTEN else []
    outside = [p for p in paths if p.is_absolute() or ".." in p.parts or (said == "--jsonl" and p.suffix != ".jsonl")]
    if said in WRITTEN and not outside:
        return
    what = "works elsewhere" if said in AFAR else "writes outside this folder, or to what is no table"
    allowed = "what you name: settings may come from somebody else" if said in AFAR else "a file of results below this folder"
    do = f"say {said} on the command line"
    raise UsageError(f"{target}: {said} {what}", found=repr(str(outside[0]) if outside else value)[:60], allowed=allowed, do=do)


def _in_words(error: str, raw: dict[str, Any]) -> str:
    """What is wrong with a key: the checker's own words, with its types and its path as a file has them."""
    found = re.match(r"Expected `([\w |]+)`, got `(\w+)` - at `\$\.([\w.]+)", error)
    if found is None:
        unknown = _unknown(error)
        return f"{f'[{unknown}]' if isinstance(raw.get(unknown), dict) else repr(unknown)} is not known" if unknown else error
    allowed = " or ".join(KINDS.get(kind.strip(), kind.strip()) for kind in found[1].split("|") if kind.strip() != "null")
    table, _, key = found[3].rpartition(".")
    return f"{f'[{table}] ' if table else ''}{key}: {allowed}, not {KINDS.get(found[2], found[2])} ({error})"


def _way(error: str, raw: dict[str, Any]) -> str:
    """What to do about it."""
    from ..main import COMMANDS
    from .settings_schema import Reading, Settings

    unknown = _unknown(error)
    if unknown and isinstance(raw.get(unknown), dict):
        return nearest(unknown, list(COMMANDS)) or "name a command, or input"
    if unknown and "$" not in error:
        from ..commands.identify import command

        options = [p.name or "" for p in command.params]
        of_command = "write it below a line with the command that takes it in brackets, as [identify]"
        near = "" if unknown in options else nearest(unknown, Settings.__struct_fields__) or nearest(unknown, options)
        return near if near and nearest(unknown, options) != near else f"{near} {of_command}".strip()
    if unknown:
        return nearest(unknown, Reading.__struct_encode_fields__) or "leave it out"
    return 'write a list as ["T1", "T2"]' if "Expected `array`" in error else "mend the key or its value"


def _unknown(error: str) -> str:
    found = re.search(r"unknown field `([^`]+)`", error)
    return found[1] if found else ""
