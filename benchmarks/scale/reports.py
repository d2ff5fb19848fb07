"""What a page and a workbook cost: ``python -m benchmarks.scale.reports``.

A page of ten sensors of 20,000 readings (size, and time to make it from the result), a workbook of 100,000 rows of nine numbers
written, and one read, each beside what was asked for.
"""

import tempfile
import time
from pathlib import Path

import numpy as np
import xlsxwriter

import thermofast as tf
from thermofast.output.report.excel import write_rows
from thermofast.output.report.page import page_of


def page() -> tuple[float, float]:
    """(size [kB], seconds) of the page."""
    rng, minutes = np.random.default_rng(1), np.arange(20_000) / 60.0
    data = {f"T{i}": 20.0 - (8.0 + i) * np.expm1(-minutes / 40.0) + 0.03 * rng.standard_normal(20_000) for i in range(10)}
    result = tf.identify(tf.read({"time_min": minutes, **data}), until=60.0, details=True)
    began = time.perf_counter()
    size = len(page_of(result).encode("utf-8")) / 1000.0
    return size, time.perf_counter() - began


def workbooks(folder: Path) -> tuple[float, float]:
    """Seconds to write a table of 100,000 x 9 as a workbook, and to read a record of that size from one."""
    values = 20.0 + np.random.default_rng(0).standard_normal((100_000, 9)).cumsum(axis=0) * 1e-3
    rows = [{f"T{i}": float(v) for i, v in enumerate(row)} for row in values]
    began = time.perf_counter()
    write_rows(str(folder / "out.xlsx"), "bench", list(rows[0]), rows)
    written = time.perf_counter() - began
    with xlsxwriter.Workbook(str(folder / "in.xlsx"), {"constant_memory": True}) as book:
        sheet = book.add_worksheet("run")
        sheet.write_row(0, 0, ["time_s", *[f"T{i}" for i in range(8)]])
        for number, row in enumerate(values, 1):
            sheet.write_row(number, 0, [float(number), *row[:8].tolist()])
    began = time.perf_counter()
    assert len(tf.read(folder / "in.xlsx").time_s) == 100_000
    return written, time.perf_counter() - began


def main() -> None:
    """Print the table."""
    size, seconds = page()
    with tempfile.TemporaryDirectory() as folder:
        written, read = workbooks(Path(folder))
    print("| what | reached | to reach |")
    print("| --- | ---: | ---: |")
    print(f"| page, 10 sensors x 20,000 readings | {size:.0f} kB | 300 kB |")
    print(f"| the same, made in | {seconds:.2f} s | 1 s |")
    print(f"| workbook of 100,000 x 9, written | {written:.1f} s | 8 s |")
    print(f"| the same, read | {read:.1f} s | 8 s |")


if __name__ == "__main__":
    main()
