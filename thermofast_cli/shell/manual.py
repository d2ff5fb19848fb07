"""The manual page of the program, in the language of man(7), from the same texts as ``--help``."""

import re
from collections.abc import Iterator
from datetime import date

import click

from .. import __version__


def manual_page(program: click.Group) -> str:
    """The page of a program and its commands."""
    context = click.Context(program, info_name="thermofast")
    lines = [
        f'.TH THERMOFAST 1 "{date.today():%Y-%m-%d}" "thermofast {__version__}" "User Commands"',
        ".SH NAME",
        f"thermofast \\- {_text(program.get_short_help_str(200)).rstrip('.')}",
        ".SH SYNOPSIS",
        ".B thermofast",
        "[\\-\\-config FILE] COMMAND [OPTIONS] [RUN]...",
        ".SH DESCRIPTION",
        *_paragraphs(program.help or ""),
        ".SH COMMANDS",
    ]
    for name in program.list_commands(context):
        command = program.get_command(context, name)
        assert command is not None
        own = click.Context(command, info_name=name, parent=context)
        usage = " ".join(command.collect_usage_pieces(own))
        lines += [f".SS {name} {_text(usage)}", *_paragraphs(command.help or "")]
        for heads, told in _options(command, own):
            lines += [".TP", f".B {_text(heads)}", _text(told)]
        if command.epilog:
            lines += [".PP", _text(command.epilog)]
    lines += [".SH EXIT STATUS", "0 done; 1 some sensor failed; 2 bad usage or input; 130 interrupted."]
    lines += [".SH FILES", ".TP", ".B thermofast.toml", "settings of the folder in which a command is called."]
    return "\n".join(lines) + "\n"


def _options(command: click.Command, context: click.Context) -> Iterator[tuple[str, str]]:
    """Options and their help, those of reading too, which --help names in a line."""
    for option in command.get_params(context):
        if not isinstance(option, click.Option):
            continue
        hidden, option.hidden = option.hidden, False
        record = option.get_help_record(context)
        option.hidden = hidden
        if record is not None:
            yield record


def _paragraphs(text: str) -> list[str]:
    """Paragraphs of a help text; those behind a backspace keep their lines."""
    lines: list[str] = []
    for paragraph in re.split(r"\n\s*\n", text.strip()):
        if "\b" in paragraph:
            kept = [line.strip() for line in paragraph.replace("\b", "").strip().splitlines()]
            lines += [".nf", *map(_text, kept), ".fi"]
        else:
            lines += [".PP", _text(" ".join(paragraph.split()))]
    return lines


def _text(text: str) -> str:
    """Text in which nothing is a request or an escape."""
    plain = text.replace("\\", "\\e").replace("-", "\\-")
    return "\\&" + plain if plain.startswith((".", "'")) else plain
