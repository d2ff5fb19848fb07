"""Archives: time and memory as they grow, against bare pyarrow, over processes, over Dask.

python -m benchmarks.scale.archives grow|speed|jobs|dask [--files 100] [--sensors 10000]. Records of 401 readings, a file for each
test, wide Parquet; a few files are made and linked as many times as there are to be.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as papq

from benchmarks.scale.killed import children_of, same

DIFFERENT = 5
PLAIN = ("--imperfection", "none", "--rates", "own")


def make(folder: Path, files: int, sensors: int) -> Path:
    """An archive of so many files of so many sensors."""
    folder.mkdir(parents=True)
    minutes = np.arange(401.0)
    for i in range(files):
        path = folder / f"run {i:04d}.parquet"
        if i >= DIFFERENT:
            os.link(folder / f"run {i % DIFFERENT:04d}.parquet", path)
            continue
        rng = np.random.default_rng(i)
        tau, rise = rng.uniform(40.0, 120.0, sensors), rng.uniform(3.0, 12.0, sensors)
        heat = 20.0 + rise * -np.expm1(-minutes[:, None] / tau) + 0.02 * rng.standard_normal((401, sensors))
        papq.write_table(pa.table({"time_min": minutes} | {f"S{k}": heat[:, k] for k in range(sensors)}), path)
    return folder


def resident(pid: int) -> int:
    """Bytes that a process and its children hold, pages that they share counted once."""
    total = 0
    for one in (pid, *children_of(pid)):
        try:
            text = Path(f"/proc/{one}/smaps_rollup").read_text()
        except OSError:
            continue
        total += next((int(line.split()[1]) * 1024 for line in text.splitlines() if line.startswith("Pss:")), 0)
    return total


def run(folder: Path, into: Path, *more: str) -> tuple[float, float, list[float]]:
    """(seconds, peak bytes, bytes over time) of identify."""
    call = [sys.executable, "-m", "thermofast", "identify", str(folder), "-o", f"{into}/", "-q", *more]
    environment = {**os.environ, "PYTHONPATH": str(Path.cwd()), "OMP_NUM_THREADS": "1"}
    began, held = time.perf_counter(), [0.0]
    process = subprocess.Popen(call, env=environment, stderr=subprocess.PIPE)

    def watch() -> None:
        while process.poll() is None:
            held.append(resident(process.pid))
            time.sleep(0.25)

    watcher = threading.Thread(target=watch)
    watcher.start()
    err = process.communicate()[1]
    took = time.perf_counter() - began
    watcher.join()
    if process.returncode:
        sys.exit(err.decode())
    return took, max(held), held


def grow(place: Path, files: int, sensors: int) -> None:
    """A tenth of the files, then all."""
    few = run(make(place / "few", files // 10, sensors), place / "r few", *PLAIN)
    many = run(make(place / "many", files, sensors), place / "r many", *PLAIN)
    half = len(many[2]) // 2
    first, second = (np.mean(part) / 1e9 for part in (many[2][half // 2 : half], many[2][half:-4]))
    ratio = many[0] / few[0]
    print(f"{files // 10 * sensors} sensors {few[0]:.1f} s, {files * sensors} sensors {many[0]:.1f} s: {ratio:.2f} x (10 +- 1)")
    print(f"peak {few[1] / 1e9:.2f} and {many[1] / 1e9:.2f} GB (1.5); second quarter {first:.2f}, second half {second:.2f} GB")


def speed(place: Path, files: int, sensors: int) -> None:
    """Against reading alone."""
    folder = make(place / "in", files, sensors)
    reading = "import sys, glob, pyarrow.parquet as p\nfor f in sorted(glob.glob(sys.argv[1] + '/*')): p.read_table(f)"
    times = []
    for _ in range(2):
        began = time.perf_counter()
        subprocess.run([sys.executable, "-c", reading, str(folder)], check=True)
        times.append(time.perf_counter() - began)
    plain = run(folder, place / "plain", *PLAIN)[0]
    whole = run(make(place / "fewer", max(1, files // 5), sensors), place / "whole")[0] * files / max(1, files // 5)
    print(f"pyarrow {min(times):.1f} s; --imperfection none --rates own {plain:.1f} s: {plain / min(times):.2f} x (2.5)")
    print(f"as it is by default {whole:.1f} s: {whole / min(times):.1f} x (told)")


def jobs(place: Path, files: int, sensors: int) -> None:
    """Two processes over one."""
    folder = make(place / "in", files, sensors)
    for more in (PLAIN, ()):
        some = folder if more else make(place / "fewer", max(2, files // 10), sensors)
        took = [run(some, place / f"{n}{len(more)}", "--jobs", str(n), *more)[0] for n in (1, 2)]
        assert same(place / f"1{len(more)}", place / f"2{len(more)}")
        one, two = took
        print(f"{' '.join(more) or 'default'}: 1 process {one:.1f} s, 2 processes {two:.1f} s: {one / two:.2f} x (1.8)")


def dask(place: Path, files: int, sensors: int) -> None:
    """One worker, two workers, and the local pool of two."""
    folder, told = make(place / "in", files, sensors), place / "scheduler.json"
    start = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(told)]
    work = [sys.executable, "-m", "distributed.cli.dask_worker", "--nthreads", "1", "--no-dashboard", "--scheduler-file", str(told)]
    environment = {**os.environ, "PYTHONPATH": str(Path.cwd()), "OMP_NUM_THREADS": "1"}
    quiet = {"env": environment, "cwd": place, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    processes = [subprocess.Popen(start, **quiet)]  # type: ignore[call-overload]
    took = []
    try:
        from distributed import Client

        while not told.exists():
            time.sleep(0.1)
        for n in (1, 2):
            processes.append(subprocess.Popen(work, **quiet))  # type: ignore[call-overload]
            with Client(scheduler_file=str(told), set_as_default=False) as client:
                client.wait_for_workers(n, timeout=60)
                address = client.scheduler.address
            took.append(run(folder, place / f"dask {n}", "--cluster", address)[0])
    finally:
        for process in processes:
            process.terminate()
    local = run(folder, place / "local", "--jobs", "2")[0]
    assert same(place / "dask 2", place / "local")
    one, two = took
    print(f"1 worker {one:.1f} s, 2 workers {two:.1f} s: {one / two:.2f} x (1.8)")
    print(f"local, 2 processes {local:.1f} s: Dask takes {two / local:.2f} x (1.1)")


def main() -> None:
    """Print what is asked for."""
    options = argparse.ArgumentParser()
    options.add_argument("what", choices=["grow", "speed", "jobs", "dask"])
    options.add_argument("--files", type=int, default=100)
    options.add_argument("--sensors", type=int, default=10_000)
    given = options.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        {"grow": grow, "speed": speed, "jobs": jobs, "dask": dask}[given.what](Path(folder), given.files, given.sensors)


if __name__ == "__main__":
    main()
