"""What the program says of measured records: ``python -m benchmarks.documents.real [--all]`` writes the tables of
docs/real-records.md and docs/filters.md.

Without --all those that take seconds. The words around the tables are nobody's but the author's: read them again.
"""

import argparse
import contextlib
import io
import sys
from collections.abc import Callable
from pathlib import Path

from benchmarks.discovery import real_loop
from benchmarks.estimation import filter_table, real_records
from benchmarks.intervals import real_settling

DOCS = Path(__file__).resolve().parents[2] / "docs"
#: Of each page the benchmarks of its tables: those of seconds, and of minutes.
QUICK = {"real-records.md": [real_records.main], "filters.md": [filter_table.main]}
SLOW = {"real-records.md": [real_settling.main, real_loop.main]}


def printed(main: Callable[[], None]) -> str:
    """The table that a benchmark prints."""
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        main()
    return "\n".join(line for line in text.getvalue().splitlines() if line.startswith("|"))


def with_table(page: str, table: str) -> str:
    """A page with a table in place of the one of the same head."""
    lines, head = page.split("\n"), table.split("\n", 1)[0]
    begin = lines.index(head)
    end = next(i for i in range(begin, len(lines)) if not lines[i].startswith("|"))
    return "\n".join([*lines[:begin], table, *lines[end:]])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--all", action="store_true")
    asked = parser.parse_args()
    if not real_records.FOLDER.is_dir():
        sys.exit(f"no folder {real_records.FOLDER}: the measured records are not part of this repository")
    for pages in (QUICK, SLOW) if asked.all else (QUICK,):
        for name, mains in pages.items():
            for one in mains:
                (DOCS / name).write_text(with_table((DOCS / name).read_text(), printed(one)))


if __name__ == "__main__":
    main()
