"""``thermofast effects``."""

import click


@click.command("effects", epilog="Example: thermofast effects second_mode")
@click.argument("name", metavar="[ID]", required=False)
@click.option("--effect", "extra", multiple=True, metavar="FILE.py[:CLASS]", help="An effect of your own, checked and shown too.")
def command(name: str | None, extra: tuple[str, ...]) -> int:
    """List the effects, or show one: equation, parameters, what its absence looks like, and what it is mistaken for."""
    from ..errors import ThermofastError, UsageError, in_one_line, nearest
    from ..output.screen import show_text
    from ..plugins.effects import broken_effects, known_effects, load_effect
    from ..plugins.files import is_file

    if name is not None and is_file(name):
        extra = (*extra, name)
        name = load_effect(name).id
    if name is None:
        known, good = known_effects(), list[str]()
        wrong: dict[str, ThermofastError] = {}
        for spec in extra:  # one that cannot be used keeps nobody else's out of the list
            try:
                known = known_effects([*good, spec])
                good.append(spec)
            except ThermofastError as error:
                wrong[spec] = error
        if wrong and not good:
            raise next(iter(wrong.values()))
        width = max(map(len, known))
        show_text("".join(f"{i:<{width}}  {e.summary}\n" for i, e in known.items()))
        show_text("".join(f"{b.name:<{width}}  cannot be used: {b.why}\n" for b in broken_effects()))
        show_text("".join(f"{spec:<{width}}  cannot be used: {in_one_line(e)}\n" for spec, e in wrong.items()))
        if wrong:
            raise next(iter(wrong.values()))
        return 0
    known = known_effects(extra)
    if name not in known:
        for broken in broken_effects():
            if broken.name == name:
                raise UsageError(f"the effect {name!r} cannot be used", found=broken.why)
        raise UsageError(f"unknown effect {name!r}", allowed=", ".join(known), do=nearest(name, known) or "see thermofast effects")
    effect = known[name]
    scope = {"run": "all sensors share it", "sensor": "each sensor has its own, or none", "one": "it concerns one sensor"}
    lines = [f"{effect.id}: {effect.summary}", f"  equation      {effect.equation}", f"  tell-tale     {effect.tell_tale}"]
    lines.append(f"  concerns      {scope[effect.scope]}{', or those of one part of the machine do' if effect.in_parts else ''}")
    lines += [f"  needs         {effect.needs}"] if effect.needs else []
    lines += [f"  mistaken for  {', '.join(effect.mistaken_for)}"] if effect.mistaken_for else []
    lines += [f"  to tell       {effect.separate}"] if effect.separate else []
    lines += [f"  reference     {effect.reference}"] if effect.reference else []
    lines.append("  parameters")
    for p in effect.parameters:
        reach = "of the record's length" if p.share else p.unit if p.unit != "1" else ""
        carried = "the machine's, carried to other runs" if p.belongs == "machine" else "the run's own"
        nothing = f"; {p.null:g} is no effect" if p.null is not None else ""
        lines.append(f"    {p.name} [{p.unit}]  {p.meaning}; {p.low:g} to {p.high:g} {reach}".rstrip() + f"{nothing}; {carried}")
    show_text("\n".join(lines) + "\n")
    return 0
