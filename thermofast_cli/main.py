"""The command group. Commands are imported when they are called, so that ``--help`` is quick."""

import errno
import signal
import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import click

from . import __version__
from .errors import ThermofastError, nearest, visible
from .output.pipe import Kept, whole, with_streams, without_lines
from .output.whole import written_together
from .shell.made import ARGUMENTS
from .workers.threads import set_before_loading

set_before_loading()

#: Commands by task, each with one line.
TASKS = {
    "Foretell where a machine will settle": {
        "identify": "Steady state and settling time from the first part of a record.",
        "watch": "Follow a test while it runs: when it can be stopped.",
        "plan": "How long a test must run for an accuracy.",
        "calibrate": "How imperfect a lab's machines are, learnt from complete runs.",
        "sweep": "The shortest identification time that serves.",
    },
    "Find what the model lacks": {
        "compare": "Model beside measurement: how well it fits, and where it fails.",
        "diagnose": "Which physical effect is missing.",
        "improve": "Add effects and watch the error fall; write the model learnt.",
        "validate": "A learnt model against a set of runs: the area between distributions.",
        "changed": "What is different in a machine since other runs of it.",
    },
    "Judge the result": {
        "sensitivity": "Which uncertain thing makes the result spread.",
        "displacement": "Thermal displacement from temperatures, and which method to trust.",
    },
    "Look things up, make records": {
        "inspect": "What is read of a file: columns, units, times, guesses.",
        "effects": "The catalogue of effects: equations, parameters, tell-tales.",
        "filters": "The catalogue of filters and their settings; bench tries all on a record.",
        "simulate": "A record with known truth.",
        "completion": "Completion of commands, options and sensor names, for bash, zsh or fish.",
        "man": "The manual page.",
        "help": "Help on a command, or on how files are read: thermofast help reading.",
    },
}
COMMANDS = {name: line for commands in TASKS.values() for name, line in commands.items()}


class LazyGroup(click.Group):
    """Knows its commands by name and one line; imports the file of one only to run it."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command = import_module(f".commands.{cmd_name}", __package__).command
        assert isinstance(command, click.Command)
        return command

    def resolve_command(self, ctx: click.Context, args: list[str]) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            hint = nearest(args[0], COMMANDS) or "'thermofast --help' lists them."
            raise click.UsageError(f"No such command {args[0]!r}: {hint}", ctx)
        config = ["--config", ctx.params["config"]] if ctx.params.get("config") else []
        ctx.meta[ARGUMENTS] = [*config, *args]
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        widest = max(map(len, COMMANDS))
        for task, commands in TASKS.items():
            with formatter.section(task):
                formatter.write_dl([(name.ljust(widest), line) for name, line in commands.items()])


@click.group(
    cls=LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    epilog="Try: thermofast simulate --sensors 3 -o run.csv, then thermofast identify run.csv --until 60",
)
@click.version_option(__version__, prog_name="thermofast")
@click.option("--config", metavar="FILE", help="Settings file; ./thermofast.toml by default.")
@click.pass_context
def cli(ctx: click.Context, config: str | None) -> None:
    """Read the first part of a machine's temperature record and say where each sensor will settle, when, and how sure that is."""
    from .shell.settings import load_settings

    ctx.default_map = load_settings(config)


def _homeless() -> bool:
    """Whether the working folder was taken away."""
    try:
        Path.cwd()
    except OSError:
        return True
    return False


def run(arguments: list[str] | None = None) -> None:
    """Entry point of the script. Exit code 0 done; 1 some sensor failed; 2 bad usage or input; 130 interrupted, 143 terminated."""
    code: Any = 0
    ended: list[int] = []

    def end(number: int, _frame: Any) -> None:
        ended.append(number)
        raise KeyboardInterrupt

    with_streams()
    with suppress(ValueError):  # not in a thread of somebody else's program
        signal.signal(signal.SIGTERM, end)
        # A terminal that is closed ends the work as a word would, unless nohup said to go on.
        if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) == signal.SIG_DFL:
            signal.signal(signal.SIGHUP, end)
    without_lines()
    screen = Kept.of(whole(sys.stdout))
    sys.stdout, sys.stderr = screen, Kept.of(sys.stderr)
    try:
        with written_together():
            code = cli.main(args=arguments, prog_name="thermofast", standalone_mode=False)
        screen.end()
    except ThermofastError as error:
        click.echo(f"Error: {visible(str(error))}", err=True)
        code = 2
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        code = 2
    except click.ClickException as error:
        error.show()
        code = 2
    except (click.Abort, KeyboardInterrupt):
        click.echo("interrupted", err=True)
        code = 130
    except UnicodeError as error:
        click.echo(f"Error: a name cannot be written here: {error}", err=True)
        code = 2
    except MemoryError as error:
        told = str(error).splitlines()[0][:120] if str(error) else ""
        click.echo(f"Error: out of memory{f': {told}' if told else ''}", err=True)
        click.echo("  do: give it more, cut the record (--from, --to, --channels), or name fewer files", err=True)
        code = 2
    except OSError as error:
        with suppress(OSError):
            screen.end()
        place = f": {error.filename}" if error.filename else ": the working folder is gone" if _homeless() else ""
        click.echo(visible(f"Error: {error.strerror or error}{place}"), err=True)
        if error.errno == errno.ENOSPC:
            click.echo("  do: make room there, or write to another disk with -o", err=True)
        code = 2
    if ended:
        code = 128 + ended[0]
    sys.exit(code if isinstance(code, int) else 0)
