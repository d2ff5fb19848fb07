"""Workers that are killed, crash, run out of memory, hang or cannot send: is a sensor lost, is the culprit named?

python -m benchmarks.scale.faults [--faults 300] [--dask] puts one bad sensor into each of so many small runs, of a kind drawn at
random, and has two processes (or two Dask workers) work on all of them.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from thermofast.workers.cluster import Dask
from thermofast.workers.flow import Crew, Flow, Local, in_order

KINDS = ("kill", "segfault", "memory", "hang", "unpicklable", "error")
LIMIT_S = 3.0


@dataclass(frozen=True)
class Sensors:
    """A task: sensors by number, and what the bad ones among them do."""

    numbers: tuple[int, ...]
    bad: tuple[tuple[int, str], ...]


def work(task: Sensors) -> list[object]:
    """Twice its number of each sensor; the bad ones do what they do."""
    found: list[object] = []
    for number in task.numbers:
        kind = dict(task.bad).get(number)
        if kind == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        elif kind == "segfault":
            os.kill(os.getpid(), signal.SIGSEGV)
        elif kind == "memory":
            raise MemoryError("no room")
        elif kind == "hang":
            time.sleep(3600.0)
        elif kind == "unpicklable":
            found.append(threading.Lock())
            continue
        elif kind == "error":
            raise ZeroDivisionError("a plug-in's own")
        found.append(2 * number)
    time.sleep(0.01)
    return found


def split(task: Sensors) -> list[Sensors]:
    """A task for each sensor."""
    return [Sensors((n,), task.bad) for n in task.numbers]


def together(parts: "list[Sensors]") -> Sensors:
    """One task of several."""
    return Sensors(tuple(n for p in parts for n in p.numbers), parts[0].bad)


def lost(task: Sensors, why: str) -> list[object]:
    """What stands for a sensor that failed."""
    return [f"{task.numbers[0]}: {why}"]


def trial(crew: Crew, faults: int, seed: int) -> Counter[str]:
    """Counts of what came of the sensors."""
    rng = random.Random(seed)
    bad = {5 * i + rng.randrange(5): rng.choice(KINDS) for i in range(faults)}
    tasks: list[Sensors] = []
    for i in range(faults):
        numbers = tuple(range(5 * i, 5 * i + 5))
        tasks += [Sensors(numbers, tuple((n, k) for n, k in bad.items() if n in numbers)), Sensors((10**6 + i,), ())]
    counts: Counter[str] = Counter()
    flow: Flow[Sensors, object] = Flow(work, split, lost, together, LIMIT_S)
    with closing(crew):
        for task, results in zip(tasks, in_order(flow, tasks, crew), strict=True):
            for number, result in zip(task.numbers, results, strict=True):
                if number not in bad:
                    counts["sound sensors right" if result == 2 * number else "SOUND SENSORS LOST"] += 1
                elif isinstance(result, str) and result.startswith(f"{number}: "):
                    counts["culprits named"] += 1
                else:
                    counts["CULPRITS NOT NAMED"] += 1
    return counts


def main() -> None:
    """Print the counts."""
    options = argparse.ArgumentParser()
    options.add_argument("--faults", type=int, default=300)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--dask", action="store_true")
    given = options.parse_args()
    if not given.dask:
        print(dict(trial(Local(2), given.faults, given.seed)))
        return
    with tempfile.TemporaryDirectory() as place:
        told = Path(place) / "scheduler.json"
        module = [sys.executable, "-m"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": {**os.environ, "PYTHONPATH": str(Path.cwd())}}
        port = ["--port", "0", "--no-dashboard", "--scheduler-file", str(told)]
        processes = [subprocess.Popen([*module, "distributed.cli.dask_scheduler", *port], **quiet)]  # type: ignore[call-overload]
        worker = [
            "distributed.cli.dask_worker",
            "--nthreads",
            "1",
            "--nworkers",
            "2",
            "--no-dashboard",
            "--scheduler-file",
            str(told),
        ]
        processes.append(subprocess.Popen([*module, *worker], **quiet))  # type: ignore[call-overload]
        try:
            from distributed import Client

            while not told.exists():
                time.sleep(0.1)
            with Client(scheduler_file=str(told), set_as_default=False) as client:
                client.wait_for_workers(2, timeout=60)
                address = client.scheduler.address
            print(dict(trial(Dask(address), given.faults, given.seed)))
        finally:
            for process in processes:
                process.terminate()


if __name__ == "__main__":
    main()
