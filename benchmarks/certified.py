"""Agreeing digits with NIST certified values, from both starts: ``python -m benchmarks.certified``.

Needs the NIST files in ../shared/data.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import nist

from thermofast.models.separable import fit_separable


def main() -> None:
    if not nist.FOLDER.is_dir():
        print(f"skipped: no folder {nist.FOLDER}")
        return
    print("| problem | start | digits of parameters (to reach: 8) | of standard errors (6; Lanczos1: 3) |")
    print("| --- | ---: | ---: | ---: |")
    for name, (basis, amplitudes, rates) in nist.PROBLEMS.items():
        certified = nist.read(name)
        for i, start in enumerate(certified.starts):
            fit = fit_separable(basis, certified.x, certified.y, start[rates])
            values, errors = nist.in_certified_order(fit, certified, basis, amplitudes, rates)
            print(
                f"| {name} | {i + 1} | {nist.digits(values, certified.values):.1f} | {nist.digits(errors, certified.errors):.1f} |"
            )


if __name__ == "__main__":
    main()
