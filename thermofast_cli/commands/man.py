"""``thermofast man``."""

import click


@click.command("man", epilog="Example: thermofast man")
def command() -> int:
    """Print the manual page: every command with its options.

    \b
    mkdir -p ~/.local/share/man/man1 && thermofast man > ~/.local/share/man/man1/thermofast.1
    """  # noqa: D301 - a backspace keeps lines as they are
    from ..main import cli
    from ..output.screen import show_text
    from ..shell.manual import manual_page

    show_text(manual_page(cli))
    return 0
