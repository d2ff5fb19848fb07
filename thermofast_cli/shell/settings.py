"""``thermofast.toml``: what a lab says once instead of on every command line."""

import tomllib
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import ThermofastError, UsageError, nearest
from ..reading_options import joined

if TYPE_CHECKING:
    from ..reading import Run

FILE = "thermofast.toml"


def write_settings(path: str, run: "Run") -> None:
    """How a run was read, as the [input] table of a settings file that reads it so again.

    Raises
    ------
    UsageError: the file is there already, or cannot be written.
    """
    import tomli_w

    from ..output.files import check_target, write_text_whole

    check_target(path, (".toml",))
    if Path(path).exists():
        raise UsageError(f"{path}: is there already", do="name another file, or move it away")
    seen, given = run.seen, dict[str, Any]()
    if seen is not None:
        text = {n: getattr(seen, n) for n in ("encoding", "delimiter", "decimal") if getattr(seen, n)}
        header = {"header_line": seen.header_line} if seen.header_line is not None else {}
        stamped = seen.time_unit in ("stamp", "interval", "")
        time = {} if " and " in seen.time_column or not seen.time_column else {"time": seen.time_column}
        given = text | header | time | ({} if stamped else {"time_unit": seen.time_unit})
        given |= {"long": f"{'+'.join(seen.long[:-1])},{seen.long[-1]}"} if seen.long else {}
    room = next(iter(run.ambient), None)
    given |= {"ambient": room} if room is not None else {}
    given |= {"channels": list(run.channels)} | ({"inputs": list(run.inputs)} if run.inputs else {})
    lines = [f"# How {run.name} was read. Correct what is wrong; every command reads it so from then on.", ""]
    lines += [f"# {note}" for note in (*run.notes, *map(str, run.guesses))]
    whole = "\n".join(lines) + "\n\n" + tomli_w.dumps({"input": given})
    write_text_whole(path, whole)


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
        raise UsageError(f"{target}: {error}", allowed=known_keys(), do="mend the key or its value") from None
    defaults = settings.defaults(str(target))
    for name, table in own.items():
        defaults[name] = defaults.get(name, {}) | _of_command(name, table, str(target))
    return defaults


def _of_command(name: str, table: Any, target: str) -> dict[str, Any]:
    """The defaults of one command from its table: its options, with underlines, and values as Click takes them.

    Raises
    ------
    UsageError: no option of that command, or a value that it does not take.
    """
    command = import_module(f"..commands.{name}", __package__).command
    options = {o.opts[-1].lstrip("-").replace("-", "_"): o for o in command.params if isinstance(o, click.Option)}
    options |= {o.opts[0].lstrip("-").replace("-", "_"): o for o in options.values() if o.opts[0].startswith("--")}
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
