"""Binary files with bytes changed: refused in words, or read as they were. And bombs: refused before they are unpacked.

python -m benchmarks.reading.hostile [--kind parquet] [--files 100000] [--seed 0] changes, drops, doubles or inserts bytes of a
whole file and reads it in a process of its own; python -m benchmarks.reading.hostile --bombs makes the bombs and reads them. To
reach: no traceback, no process that dies, none that takes longer than a second, no value changed without a word.
"""

import argparse
import bz2
import gzip
import io
import json
import lzma
import random
import resource
import tempfile
import time
import zipfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as papq
import xlsxwriter

import thermofast as tf
from thermofast.workers.flow import Flow, Local, in_order
from thermofast.workers.pool import cores

BATCH = 500
SLOW_S = 1.0


def columns() -> dict[str, np.ndarray]:
    """A small record."""
    minutes = np.arange(60.0)
    return {
        "time_min": minutes,
        "T1": np.round(20.0 + 8.0 * -np.expm1(-minutes / 40.0), 3),
        "T2": np.round(20.0 + 0.05 * minutes, 3),
    }


def parquet() -> bytes:
    """As Parquet, its pages with checksums."""
    out = io.BytesIO()
    papq.write_table(pa.table(columns()), out, compression="snappy", write_page_checksum=True)
    return out.getvalue()


def xlsx() -> bytes:
    """As a workbook."""
    out = io.BytesIO()
    book = xlsxwriter.Workbook(out, {"in_memory": True})
    sheet = book.add_worksheet()
    for k, (name, values) in enumerate(columns().items()):
        sheet.write_column(0, k, [name, *values.tolist()])
    book.close()
    return out.getvalue()


def gz() -> bytes:
    """As packed text."""
    held = columns()
    lines = [",".join(held), *(",".join(f"{v:g}" for v in row) for row in zip(*held.values(), strict=True))]
    return gzip.compress(("\n".join(lines) + "\n").encode())


KINDS: dict[str, Callable[[], bytes]] = {"parquet": parquet, "xlsx": xlsx, "gz": gz}


def changed(data: bytes, seed: int) -> bytes:
    """One to four changes at random places."""
    rng = random.Random(seed)
    found = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        at, wide = rng.randrange(len(found)), rng.choice((1, 1, 1, 2, 4, 8, 64))
        kind = rng.randrange(5)
        if kind == 0:
            found[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            found[at : at + wide] = rng.randbytes(wide)
        elif kind == 2:
            del found[at : at + wide]
        elif kind == 3:
            found[at:at] = found[at : at + wide] or rng.randbytes(wide)
        else:
            found[at : at + wide] = rng.choice((b"\x00", b"\xff", b"\x7f")) * wide
    return bytes(found)


def read(task: tuple[str, list[int]]) -> list[tuple[int, str]]:
    """(seed, outcome) of each: refused, same, named (other names or less of it), slow, or what is wrong."""
    kind, seeds = task
    whole, truth = KINDS[kind](), columns()
    found = []
    for seed in seeds:
        data, began = changed(whole, seed), time.perf_counter()
        try:
            with tempfile.NamedTemporaryFile(suffix=f".{'csv.gz' if kind == 'gz' else kind}") as file:
                file.write(data)
                file.flush()
                runs = tf.read_all(file.name)
            outcome = _compared(runs, truth)
        except tf.ThermofastError:
            outcome = "refused"
        except Exception as error:
            outcome = f"TRACEBACK {type(error).__name__}: {str(error)[:80]}"
        found.append((seed, "SLOW" if time.perf_counter() - began > SLOW_S else outcome))
    return found


def _compared(runs: list[tf.Run], truth: dict[str, np.ndarray]) -> str:
    """Whether what was read is what was written; names are in no checksum."""
    (run, *more) = runs
    held = {**run.channels, **run.ambient, **run.inputs}
    known = [v for n, v in truth.items() if n != "time_min"]
    right = [any(len(v) == len(k) and np.array_equal(v, k) for k in known) for v in held.values()]
    if more or len(run.time_s) != 60 or not np.allclose(run.time_s, truth["time_min"] * 60.0):
        return "guessed, and told" if run.guesses else "TIME CHANGED"
    if not all(right):
        return "VALUES CHANGED"
    return "same" if list(held) == ["T1", "T2"] else "named otherwise"


def lost(task: tuple[str, list[int]], why: str) -> list[tuple[int, str]]:
    """Seeds on which the process died or hung."""
    return [(seed, f"DIED: {why}") for seed in task[1]]


def outcomes(kind: str, files: int, seed: int, jobs: int) -> Counter[str]:
    """How often which outcome; those that are wrong with their seeds."""
    tasks = [(kind, list(range(i, min(i + BATCH, seed + files)))) for i in range(seed, seed + files, BATCH)]
    flow = Flow(read, lambda task: [(task[0], [s]) for s in task[1]], lost, limit_s=120.0)
    found: Counter[str] = Counter()
    crew = Local(jobs)
    for results in in_order(flow, tasks, crew):
        for number, outcome in results:
            found[outcome] += 1
            if outcome.isupper() or outcome[:4].isupper():
                print(f"{kind} seed {number}: {outcome}", flush=True)
    crew.close()
    return found


def bombs(folder: Path, times: int = 1024) -> list[Path]:
    """Small files that are large inside: so many MiB."""
    zeros = b"0" * (1 << 20)
    rows = folder / "rows.parquet"
    with papq.ParquetWriter(rows, pa.schema([("time_min", pa.float64()), ("T1", pa.float64())]), compression="zstd") as out:
        chunk = pa.table({"time_min": np.zeros(10_000_000), "T1": np.full(10_000_000, 20.0)})
        for _ in range(times // 10):
            out.write_table(chunk)
    words = pa.DictionaryArray.from_arrays(pa.array(np.zeros(200_000, np.int32)), pa.array(["x" * 1_000_000]))
    papq.write_table(pa.table({"time_min": np.arange(2e5), "T1": np.full(200_000, 20.0), "note": words}), folder / "words.parquet")
    for name, pack in {"zeros.csv.gz": gzip.open, "zeros.csv.bz2": bz2.open, "zeros.csv.xz": lzma.open}.items():
        with pack(folder / name, "wb") as stream:
            for _ in range(times):
                stream.write(zeros)
    with pa.CompressedOutputStream(str(folder / "zeros.csv.zst"), "zstd") as stream:
        for _ in range(times):
            stream.write(zeros)
    with zipfile.ZipFile(folder / "zeros.zip", "w", zipfile.ZIP_DEFLATED) as archive, archive.open("zeros.csv", "w") as stream:
        for _ in range(times):
            stream.write(zeros)
    with zipfile.ZipFile(folder / "zip in zip.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(folder / "zeros.zip", "inner.zip")
    book = xlsxwriter.Workbook(folder / "far.xlsx")
    sheet = book.add_worksheet()
    sheet.write_column(0, 0, range(20))
    sheet.write(1_048_575, 16_383, 1.0)
    book.close()
    with zipfile.ZipFile(io.BytesIO(xlsx())) as source, zipfile.ZipFile(folder / "wide.xlsx", "w", zipfile.ZIP_DEFLATED) as archive:
        for member in source.infolist():
            data = source.read(member)
            if not member.filename.endswith("sheet1.xml"):
                archive.writestr(member, data)
                continue
            with archive.open(member.filename, "w") as stream:
                stream.write(data.replace(b"<sheetData>", b"<sheetData>" + zeros.replace(b"0", b" ")))
                for _ in range(times):
                    stream.write(zeros.replace(b"0", b" "))
    return sorted(p for p in folder.iterdir() if p.is_file())


def refused(paths: list[str]) -> list[tuple[str, str, float, float]]:
    """(name, first line of the refusal, seconds, MB more than before) of each."""
    found = []
    tf.read({"time_min": np.arange(9.0), "T1": np.arange(9.0)})  # what is loaded at the first call is not the bomb's
    for path in paths:
        before, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.perf_counter()
        try:
            tf.read_all(path)
            told = "READ"
        except tf.ThermofastError as error:
            told = str(error).splitlines()[0].replace(path, Path(path).name)
        more = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        found.append((Path(path).name, told, time.perf_counter() - began, more / 1024.0))
    return found


def main() -> None:
    """Print the table that is asked for."""
    options = argparse.ArgumentParser()
    options.add_argument("--kind", choices=list(KINDS), default="parquet")
    options.add_argument("--files", type=int, default=20_000)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--bombs", action="store_true")
    given = options.parse_args()
    if given.bombs:
        with tempfile.TemporaryDirectory() as folder:
            flow = Flow(refused, lambda task: [[p] for p in task], lambda task, why: [(task[0], why, np.nan, np.nan)])
            crew = Local(1)
            for results in in_order(flow, [[str(p)] for p in bombs(Path(folder))], crew):
                for name, told, seconds, more in results:
                    print(f"| {name} | {told} | {seconds:.2f} s | {more:.0f} MB |")
            crew.close()
        return
    print(json.dumps(outcomes(given.kind, given.files, given.seed, cores()), indent=1))


if __name__ == "__main__":
    main()
