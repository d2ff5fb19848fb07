"""What the program knows by itself, as tables: the effects and the filters, a user's own plug-ins among them."""

import warnings
from collections.abc import Iterable
from dataclasses import fields
from typing import TYPE_CHECKING

from .errors import UsageError

if TYPE_CHECKING:
    import pandas as pd

    from .plugins.entrypoints import Broken


def effects(*own: str) -> "pd.DataFrame":
    """The catalogue of effects, a row for each: equation, tell-tale, parameters; `own` are effects of files, ``my.py[:CLASS]``.

    Raises
    ------
    UsageError: a file that holds no effect.
    """
    import pandas as pd

    from .plugins.effects import broken_effects, known_effects

    if not all(isinstance(one, str) for one in own):
        raise UsageError("effects: not a file", found=repr(own)[:60], allowed="FILE.py or FILE.py:CLASS, one after the other")
    told = ("id", "summary", "equation", "tell_tale", "scope", "needs", "mistaken_for", "separate", "reference")
    rows = []
    _warn_of(broken_effects())
    for effect in known_effects(own).values():
        row = {name: getattr(effect, name) for name in told}
        row["parameters"] = {p.name: f"{p.meaning} [{p.unit}], {p.low:g} to {p.high:g}" for p in effect.parameters}
        rows.append(row)
    return pd.DataFrame(rows)


def _warn_of(broken: "Iterable[Broken]") -> None:
    """A UserWarning for each installed plug-in that cannot be used, which the table would leave out without a word."""
    for plugin in broken:
        warnings.warn(f"{plugin.name} cannot be used: {plugin.why}", stacklevel=3)


def filter_catalogue() -> "pd.DataFrame":
    """The filters, a row for each: summary, reference, and the settings with their default values."""
    import pandas as pd

    from .plugins.filters import broken_filters, known_filters

    rows = []
    _warn_of(broken_filters())
    for name, kind in known_filters().items():
        chosen = kind()
        settings = {f.name: getattr(chosen, f.name) for f in fields(chosen) if f.metadata}
        rows.append({"name": name, "summary": chosen.summary, "reference": chosen.reference, "settings": settings})
    return pd.DataFrame(rows)
