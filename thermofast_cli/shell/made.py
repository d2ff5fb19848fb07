"""How a result came about: the command as it was given, and what the settings file said."""

import shlex

import click
from click.core import ParameterSource

#: Where a command's context keeps the words that it was called with.
ARGUMENTS = "thermofast.arguments"


def how_made() -> dict[str, str]:
    """Headings and texts for a report: the command, and the options that it took from thermofast.toml."""
    context = click.get_current_context(silent=True)
    if context is None or ARGUMENTS not in context.meta:
        return {}
    told = {"Command": shlex.join(["thermofast", *context.meta[ARGUMENTS]])}
    kept = []
    for option in context.command.params:
        name = str(option.name)
        if context.get_parameter_source(name) is ParameterSource.DEFAULT_MAP and name in context.params:
            words = option.opts[-1] if isinstance(option, click.Option) else "RUN"
            value = context.params[name]
            kept.append(f"{words} {' '.join(map(str, value)) if isinstance(value, tuple | list) else value}")
    return told | ({"Settings from thermofast.toml": "; ".join(kept)} if kept else {})
