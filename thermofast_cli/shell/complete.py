"""What a shell may offer while a command is typed: the columns of the file that is named."""

import re
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

#: A larger file is not read while somebody waits for a key [bytes].
LARGEST = 30_000_000


def columns(ctx: click.Context, option: click.Parameter, typed: str) -> list[CompletionItem]:
    """Names of columns that continue the last of the names typed; none where no file is named that can be read."""
    from ..reading.moments.time_column import is_time_name

    before, comma, last = typed.rpartition(",")
    names = [n for n in _names(ctx) if (option.name == "time") == is_time_name(n)]
    found = [
        n for n in dict.fromkeys(map(_short, names)) if n.casefold().startswith(last.casefold()) and n not in before.split(",")
    ]
    return [CompletionItem(f"{before}{comma}{name}") for name in found]


def presets(_ctx: click.Context, _option: click.Parameter, typed: str) -> list[CompletionItem]:
    """Names of stopping rules."""
    from thermofast.models.standards import PRESETS

    return [CompletionItem(name, help=rule) for name, (rule, _) in PRESETS.items() if name.startswith(typed.casefold())]


def filters(_ctx: click.Context, _option: click.Parameter, typed: str) -> list[CompletionItem]:
    """Names of filters, and files where none begins so."""
    from ..plugins.filters import known_filters

    found = [CompletionItem(name) for name in known_filters() if name.startswith(typed)]
    return found or [CompletionItem(typed, type="file")]


def _short(name: str) -> str:
    """A name without the unit behind it, as options take it too, where the name itself would need quotes."""
    return re.sub(r"\s*[\[(].*$", "", name).strip(" ,") if re.search(r"[\s,]", name) else name


def _names(ctx: click.Context) -> list[str]:
    from ..errors import ThermofastError
    from ..reading.source import read_table
    from ..reading_options import Options

    # Click leaves the words in args while an option still waits for its value.
    given: list[Any] = [*(ctx.params.get("runs") or ()), *ctx.args]
    path = next((Path(run) for run in given if Path(run).is_file()), None)
    if path is None or path.stat().st_size > LARGEST:
        return []
    try:
        return list(read_table(str(path), Options()).names)
    except ThermofastError:
        return []
