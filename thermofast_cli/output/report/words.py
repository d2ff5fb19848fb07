"""Names and values as a reader of a page or a workbook takes them in."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from html import escape as escaped
from pathlib import Path
from typing import Any

#: Statuses that need a second look; the others but ``ok`` are failures.
DOUBT = ("not_determined", "model_doubtful", "partly_explained")
#: Signs that turn the direction of what follows, also of words that are not the name's.
TURNING = dict.fromkeys([*range(0x202A, 0x202F), *range(0x2066, 0x206A), 0x200E, 0x200F, 0x061C])


def escape(text: str, quote: bool = True) -> str:
    """Text that stays text, and in its own direction."""
    return escaped(text.translate(TURNING), quote)


def run_names(runs: Iterable[str]) -> dict[str, str]:
    """Each run's file by its name; of several of one name with as many folders as tell them apart."""
    parts = {run: Path(run).parts or (run,) for run in dict.fromkeys(runs)}
    found: dict[str, str] = {}
    count = 1
    while len(found) < len(parts):
        ends = Counter(mine[-count:] for mine in parts.values())
        for run, mine in parts.items():
            if run not in found and (ends[mine[-count:]] == 1 or count >= len(mine)):
                found[run] = str(Path(*mine[-count:]))
        count += 1
    return {run: found[run] for run in parts}


def interval_words(row: Mapping[str, Any], ends: tuple[str, str], digits: int) -> str:
    """'26.10 to 27.50'; an open side is told as such."""
    low, high = ("open" if row[end] is None else f"{row[end]:.{digits}f}" for end in ends)
    return f"{low} to {high}"


def sentence(text: str) -> str:
    """Words of a record as a sentence: with a capital, and an end."""
    text = text.strip()
    first = text.split(" ", 1)[0]
    begun = text[:1].upper() + text[1:] if first.isalpha() and first.islower() else text
    return begun if begun.endswith((".", "!", "?")) or not begun else f"{begun}."


def value_words(value: Any) -> str:
    """A list or a dictionary of a record in words: parameters with their errors, rows as names and numbers."""
    if isinstance(value, dict) and value and all(isinstance(v, dict) and "value" in v for v in value.values()):
        return "; ".join(_parameter(name, v) for name, v in value.items())
    if isinstance(value, dict):
        return ", ".join(f"{name} {value_words(v)}" for name, v in value.items() if v not in (None, "", [], {}))
    if isinstance(value, list | tuple):
        return ("; " if any(isinstance(v, dict) for v in value) else ", ").join(value_words(v) for v in value)
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _parameter(name: str, told: dict[str, Any]) -> str:
    """A parameter as a reader takes it in: load_step.change = 0.31 ± 0.02, for one standard error."""
    error, unit = told.get("standard_error"), told.get("unit", "")
    beside = f" ± {error:.2g}" if isinstance(error, float) and math.isfinite(error) else ""
    value = f"{told['value']:.6g}" if isinstance(told["value"], int | float) else str(told["value"])
    return f"{name} = {value}{beside}{f' {unit}' if unit not in ('', '1') else ''}"


def status_cell(status: str) -> str:
    """A cell of a table that shows at a glance how far to trust its row."""
    kind = "ok" if status == "ok" else "doubt" if status in DOUBT else "failed"
    return f'<td class="{kind}">{escape(status)}</td>'
