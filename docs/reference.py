"""The reference that the program writes: commands, columns, effects, filters and functions, from what it itself knows."""

import re
from dataclasses import fields
from pathlib import Path

import click

from thermofast import records
from thermofast.main import TASKS, cli
from thermofast.output.meanings import meaning_of, unit_of
from thermofast.plugins.effects import known_effects
from thermofast.plugins.filters import known_filters

#: Functions and classes of the library, in the order of their page.
LIBRARY = (
    "read read_all inspect identify sweep watch plan calibrate compare diagnose improve validate changed sensitivity displacement "
    "bench "
    "simulate effects filter_catalogue write_effect Model Run ThermofastError InputError UsageError"
)

#: Characters of a line of help.
WIDTH = 86


def write_reference(folder: Path) -> None:
    """Pages of the reference, in Markdown, into the folder."""
    folder.mkdir(exist_ok=True)
    pages = {"commands": _commands(), "columns": _columns(), "effects": _effects(), "filters": _filters(), "library": _library()}
    for name, text in pages.items():
        target = folder / f"{name}.md"
        if not target.exists() or target.read_text(encoding="utf-8") != text:
            target.write_text(text, encoding="utf-8")


def _commands() -> str:
    context = click.Context(cli, info_name="thermofast", max_content_width=WIDTH, terminal_width=WIDTH)
    parts = ["# Commands\n"]
    for task, commands in TASKS.items():
        parts.append(f"## {task}\n")
        for name, line in commands.items():
            command = cli.get_command(context, name)
            assert command is not None
            own = click.Context(command, info_name=name, parent=context, max_content_width=WIDTH, terminal_width=WIDTH)
            parts.append(f"### thermofast {name}\n\n{line}\n\n```text\n{command.get_help(own)}\n```\n")
            hidden = [p for p in command.params if isinstance(p, click.Option) and p.hidden]
            if name == "identify":
                parts.append("The options of reading, which every command that reads runs has:\n")
                parts += [f"- `{' '.join(p.opts)} {p.metavar or ''}`: {p.help}" for p in hidden]
                parts.append("")
    return "\n".join(parts)


def _columns() -> str:
    kinds = [k for k in vars(records).values() if isinstance(k, type) and k.__name__.endswith("Record") and k is not records.Record]
    parts = [
        "# Columns of the records\n",
        "The columns of CSV, JSON and data frames, by command, in their order. Absent numbers are empty.\n",
    ]
    for kind in kinds:
        name = kind.__name__.removesuffix("Record").lower()
        told = "\n\n".join(" ".join(p.split()) for p in re.split(r"\n\s*\n", kind.__doc__ or ""))
        parts.append(f"## {name}\n\n{told}\n\n| column | unit | what it is |\n| --- | --- | --- |")
        parts += [f"| `{f.name}` | {unit_of(f.name)} | {meaning_of(f.name)} |" for f in fields(kind)]
        parts.append("")
    return "\n".join(parts)


def _effects() -> str:
    parts = ["# Effects\n"]
    for effect in known_effects(()).values():
        parts.append(f"## {effect.id}\n\n{effect.summary}\n\n    {effect.equation}\n\nTell-tale: {effect.tell_tale}\n")
        if effect.mistaken_for:
            parts.append(f"Mistaken for {', '.join(effect.mistaken_for)}. {effect.separate or ''}\n")
        parts.append("| parameter | unit | meaning | from | to |\n| --- | --- | --- | ---: | ---: |")
        parts += [f"| `{p.name}` | {p.unit} | {p.meaning} | {p.low:g} | {p.high:g} |" for p in effect.parameters]
        parts.append(f"\n{effect.reference or ''}\n")
    return "\n".join(parts)


def _filters() -> str:
    parts = ["# Settings of the filters\n"]
    for name, kind in known_filters().items():
        chosen = kind()
        parts.append(f"## {name}\n\n{chosen.summary} {chosen.reference}\n")
        told = [f for f in fields(chosen) if f.metadata]
        if told:
            parts.append("| setting | default | meaning | from | to |\n| --- | ---: | --- | ---: | ---: |")
            parts += [
                f"| `{name}.{f.name}` | {f.default:g} | {f.metadata['meaning']} | {f.metadata['low']:g} | {f.metadata['high']:g} |"
                for f in told
            ]
            parts.append("")
    return "\n".join(parts)


def _library() -> str:
    parts = ["# Functions of the library\n", "```{eval-rst}"]
    for name in LIBRARY.split():
        kind = "autoexception" if name.endswith("Error") else "autoclass" if name[0].isupper() else "autofunction"
        parts.append(f".. {kind}:: thermofast.{name}\n")
    return "\n".join(parts) + "```\n"
