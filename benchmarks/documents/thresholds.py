"""The table of thresholds in docs/thresholds.md: ``python -m benchmarks.documents.thresholds``."""

from dataclasses import fields
from pathlib import Path
from typing import Any

from thermofast.estimation.rules import EstimationRules
from thermofast.models.search.rules import SearchRules
from thermofast.models.uncertainty.unknown_heat import HeatRules

PAGE = Path(__file__).resolve().parents[2] / "docs" / "thresholds.md"
HEAD = """# Thresholds

What decides in `identify` and in the search, with its value, its unit and where it comes from. Made by
`python -m benchmarks.documents.thresholds` of the settings objects in
`thermofast_cli/estimation/rules.py`, `models/search/rules.py` and `models/uncertainty/unknown_heat.py`.
Settings of the filters are shown by `thermofast filters`, bounds of an effect's parameters by `thermofast effects`.
"""


def table(rules: type[Any]) -> str:
    """A Markdown table of a settings object's fields."""
    rows = ["| name | value | unit | meaning | from |", "| --- | ---: | --- | --- | --- |"]
    for f in fields(rules):
        value = " to ".join(f"{v:g}" for v in f.default) if isinstance(f.default, tuple) else f"{f.default:.5g}"
        rows.append(f"| `{f.name}` | {value} | {f.metadata['unit']} | {f.metadata['meaning']} | {f.metadata['source']} |")
    return "\n".join(rows)


def page() -> str:
    """The whole page."""
    parts = [
        HEAD,
        "## Estimates of one sensor\n",
        table(EstimationRules),
        "\n## The search for missing effects\n",
        table(SearchRules),
        "\n## The unknown heat\n",
        table(HeatRules),
        "",
    ]
    return "\n".join(parts)


def main() -> None:
    """Write the page."""
    PAGE.write_text(page())


if __name__ == "__main__":
    main()
