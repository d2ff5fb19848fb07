"""``thermofast filters``."""

import click


@click.command("filters", epilog="Example: thermofast filters afukf")
@click.argument("name", required=False)
def command(name: str | None) -> int:
    """List the filters, or show the settings of the one called NAME."""
    from dataclasses import fields

    from ..errors import UsageError
    from ..methods import known_filters
    from ..output.screen import show_text

    known = known_filters()
    if name is None:
        width = max(map(len, known))
        show_text("".join(f"{n:<{width}}  {f.summary}\n" for n, f in known.items()))
        return 0
    if name not in known:
        raise UsageError(f"unknown filter {name!r}", allowed=", ".join(known))
    chosen = known[name]()
    show_text(f"{name}: {chosen.summary}\nreference: {chosen.reference}\n")
    show_text(f"closing likelihood step: {chosen.closing}\n")
    for f in fields(chosen):
        if f.metadata:
            meaning, low, high = f.metadata["meaning"], f.metadata["low"], f.metadata["high"]
            show_text(f"  {name}.{f.name} = {f.default:g}   {meaning}; {low:g} to {high:g}\n")
        else:
            show_text(f"  {name}.{f.name} = {str(f.default).lower()}   close with a maximum-likelihood step\n")
    return 0
