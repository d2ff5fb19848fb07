"""Agreeing digits with NIST certified values, from both starts: ``python -m benchmarks.estimation.certified``.

Needs the NIST files in ../shared/data.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

import nist


def main() -> None:
    if not nist.FOLDER.is_dir():
        print(f"skipped: no folder {nist.FOLDER}")
        return
    print("| problem | start | digits of parameters (to reach: 8) | of standard errors (6; Lanczos1: 3) |")
    print("| --- | ---: | ---: | ---: |")
    for name in nist.PROBLEMS:
        certified = nist.read(name)
        for i, start in enumerate(certified.starts):
            values, errors = nist.solved(name, certified, start)
            print(
                f"| {name} | {i + 1} | {nist.digits(values, certified.values):.1f} | {nist.digits(errors, certified.errors):.1f} |"
            )


if __name__ == "__main__":
    main()
