"""Processes of this machine: how many the work pays for, how they start and end."""

import ctypes
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import cache
from importlib import import_module
from multiprocessing import connection
from pkgutil import walk_packages
from threading import Thread
from typing import Any

from .processes import context_of

#: Starting a pool costs about this long; below it one process is faster.
POOL_COST_S = 0.8
#: Rough cost of a sensor and of a reading, for that decision alone.
SENSOR_COST_S = 3e-5
READING_COST_S = 3.5e-7
#: Options of glibc's mallopt (malloc.h); arrays up to so many bytes come from memory that is kept.
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, KEPT_BYTES = -1, -3, 1 << 25
#: Records larger than this surely pay for a pool.
WARM_BYTES = 8_000_000


def cores() -> int:
    """Processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)


def worth(sensors: int, readings: int, weight: float = 1.0) -> int:
    """How many processes the work pays for; weight is its cost relative to ``identify``."""
    seconds = sensors * (SENSOR_COST_S + READING_COST_S * readings) * weight
    if seconds < 2.0 * POOL_COST_S:
        return 1
    return max(1, min(cores(), int(seconds / POOL_COST_S)))


@cache
def keep_freed_memory() -> None:
    """Lets this process keep what it frees: blocks of sensors need the same room again and again, and getting pages anew costs
    time. A process that has read a large file keeps it anyway. Nothing where there is no glibc.
    """
    with suppress(OSError, AttributeError):
        set_option = ctypes.CDLL(None).mallopt
        set_option(M_MMAP_THRESHOLD, KEPT_BYTES)
        set_option(M_TRIM_THRESHOLD, KEPT_BYTES)


def _quiet_worker() -> None:
    """The parent alone answers an interrupt, and no worker outlives it."""
    keep_freed_memory()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    """Ends this process with the one of the sentinel: a parent that is killed cannot say goodbye."""
    connection.wait([sentinel])
    os._exit(1)


def new_pool(jobs: int, search: bool = True) -> ProcessPoolExecutor:
    """Worker processes that are spawned, never forked from this one; search: with what looking for effects needs loaded."""
    searching = ["thermofast.models.search.discover"] if search else []
    context = context_of(["thermofast.workers.starting", "thermofast.pipeline.tasks", *searching])
    return ProcessPoolExecutor(jobs, mp_context=context, initializer=_quiet_worker)


def ended(pool: Executor) -> None:
    """Ends a pool and its processes now, at work or not."""
    # Before Python 3.14 an executor has no word for it.
    for process in list((getattr(pool, "_processes", None) or {}).values()):
        process.kill()
    pool.shutdown(wait=True, cancel_futures=True)


def _nothing() -> None:
    """What a warming pool does."""


def warm_pool(jobs: int | None, size_bytes: int, search: bool = True) -> ProcessPoolExecutor | None:
    """A :func:`new_pool` that starts while a large record is still being read, or None where the work will not pay for one."""
    processes = jobs if jobs is not None else cores()
    if processes < 2 or size_bytes < WARM_BYTES:
        return None
    pool = new_pool(processes, search)
    # In a thread: a process is not there before the server of forks has imported what all of them need.
    Thread(target=_started, args=(pool, processes), daemon=True).start()
    return pool


def _started(pool: Executor, processes: int) -> None:
    """Brings the processes of a pool up; what breaks here shows again where they are needed."""
    with suppress(RuntimeError, OSError):
        for _ in range(processes):
            pool.submit(_nothing)


class Shared:
    """One run's work shared over processes: as the built-in ``map``. What a dying worker leaves is done in this process."""

    def __init__(self, jobs: int) -> None:
        self._pool: ProcessPoolExecutor | None = new_pool(jobs)
        self._last: list[Future[Any]] = []
        for _ in range(jobs):
            self._pool.submit(_nothing)

    def __call__(self, work: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[Any]:
        items = list(items)
        futures = [_submit(self._pool, work, item) for item in items] if self._pool is not None else []
        self._last = futures
        for i, item in enumerate(items):
            try:
                yield futures[i].result() if futures else work(item)
            except BrokenProcessPool:
                self._pool = None
                yield work(item)

    def close(self) -> None:
        """End the processes; waits for none that is still at work, as after an interrupt."""
        if self._pool is not None:
            self._pool.shutdown(wait=all(f.done() for f in self._last), cancel_futures=True)


def _submit(pool: Executor, work: Callable[[Any], Any], task: Any) -> Future[Any]:
    try:
        return pool.submit(work, task)
    except BrokenProcessPool as error:  # broken while tasks were still being handed out
        failed: Future[Any] = Future()
        failed.set_exception(error)
        return failed


def import_all() -> None:
    """Import every module that work may need: of a package that two threads import at once one may see the half of it."""
    for part in ("models", "filters", "estimation", "discovery", "machine", "displacements", "analysis", "pipeline", "archives"):
        package = import_module(f"thermofast.{part}")
        for found in walk_packages(package.__path__, f"{package.__name__}."):
            import_module(found.name)
