"""``thermofast completion``."""

import click


@click.command("completion", epilog="Example: thermofast completion bash")
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def command(shell: str) -> int:
    """Print what SHELL needs to complete commands, options and, behind --channels and the like, the columns of the RUN named.

    \b
    bash  thermofast completion bash > ~/.local/share/bash-completion/completions/thermofast
    zsh   thermofast completion zsh > "${fpath[1]}/_thermofast"
    fish  thermofast completion fish > ~/.config/fish/completions/thermofast.fish
    """  # noqa: D301 - a backspace keeps lines as they are
    from click.shell_completion import get_completion_class

    from ..main import cli
    from ..output.screen import show_text

    kind = get_completion_class(shell)
    assert kind is not None
    # Not by source(), which asks the machine's own bash for its version: the script may be meant for another machine.
    complete = kind(cli, {}, "thermofast", "_THERMOFAST_COMPLETE")
    show_text(complete.source_template % complete.source_vars() + "\n")
    return 0
