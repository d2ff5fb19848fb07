"""The tables of docs/real-records.md: ``python -m benchmarks.documents.real [--all]`` writes what the program says of the records.

Without --all only the first, which takes some seconds. The words around the tables are nobody's but the author's: read them again.
"""

import argparse
import contextlib
import io
import sys
from collections.abc import Callable
from pathlib import Path

from benchmarks.discovery import real_loop
from benchmarks.estimation import real_records
from benchmarks.intervals import real_settling

PAGE = Path(__file__).resolve().parents[2] / "docs" / "real-records.md"


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
    page = PAGE.read_text()
    for one in (real_records.main, *((real_settling.main, real_loop.main) if asked.all else ())):
        page = with_table(page, printed(one))
    PAGE.write_text(page)


if __name__ == "__main__":
    main()
