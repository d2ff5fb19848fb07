"""Crews on other machines: Dask and MPI, each an optional extra. A worker must be of the client's version and kernels."""

import hashlib
import logging
import math
import os
import re
import shutil
import socket
import sys
import time
from collections.abc import Callable, Collection
from concurrent.futures import Executor, Future
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import thermofast.filters as filters
import thermofast.models as models

from ..errors import UsageError
from .flow import LOOK_S, Crew, Given, Here, Local
from .pool import cores, import_all, keep_freed_memory

#: How long a scheduler may take to answer [s].
PATIENCE_S = 20.0


@cache
def build() -> str:
    """What must be alike everywhere: version, kernels, and the code itself."""
    from .. import __version__

    digest = hashlib.sha256()
    for package in (Path(__file__).parents[1], *(Path(p) for m in (models, filters) for p in m.__path__)):
        for path in sorted(package.rglob("*.py")):
            digest.update(Path(path).name.encode())
            digest.update(_text(path))
    return f"{__version__} {kernels()} {digest.hexdigest()[:12]}"


def kernels() -> str:
    """``compiled`` or ``numpy``."""
    return "compiled" if models.COMPILED else "numpy"


def _text(path: Path) -> bytes:
    return path.read_text(encoding="utf-8").encode()


def checked(told: str, work: Callable[[Any], Any], task: Any) -> Any:
    """``work(task)`` on a worker that is built as the client is.

    Raises
    ------
    UsageError: it is not.
    """
    if told != build():
        raise UsageError(
            f"the worker on {socket.gethostname()} runs another thermofast",
            found=build(),
            allowed=told,
            do="install the same version there, with the same compiler or none",
        )
    keep_freed_memory()
    return work(task)


class Dask(Crew):
    """Workers of a Dask scheduler."""

    near = False

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise UsageError("--cluster runs on Dask, which is not installed", do="pip install 'thermofast[dask]'") from None
        if not re.search(r":\d+/?$", address):
            allowed = "HOST:PORT, as tcp://scheduler:8786"
            raise UsageError(f"--cluster {address}: no Dask scheduler answers", found="no port", allowed=allowed, do="say its port")
        logging.getLogger("distributed").setLevel(logging.ERROR)  # that a worker died is told by what becomes of its tasks
        try:
            self._client = Client(address, timeout=PATIENCE_S, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise UsageError(
                f"--cluster {address}: no Dask scheduler answers", found=str(error)[:120], do="start one: dask scheduler"
            ) from None
        workers = self._client.scheduler_info(n_workers=-1)["workers"]
        if not workers:
            self._client.close()
            raise UsageError(f"--cluster {address}: a scheduler without workers", do=f"start some: dask worker {address}")
        self.slots = sum(w["nthreads"] for w in workers.values())
        # A worker unpickles tasks in several threads, and of a package that two threads import at once one sees the half of it.
        try:
            self._client.register_plugin(_importing(), name="thermofast")
        except Exception as error:
            self._client.close()
            raise UsageError(
                f"--cluster {address}: a worker cannot import this thermofast",
                found=f"{type(error).__name__}: {error}"[:160],
                do="install the same version there",
            ) from None
        self._executor = self._client.get_executor(pure=False)
        self._own: Local | None = None
        #: Since when nobody is there, and when it was looked last: long looks apart, results came in between.
        self._alone_since: float | None = None
        self._looked = -math.inf

    def submit(self, work: Callable[[Any], Any], task: Any) -> "Future[Any]":
        """Hand a task over."""
        if self._own is not None:
            return self._own.submit(work, task)
        future: Future[Any] = self._executor.submit(checked, build(), work, task)
        return future

    def renew(self, overdue: Collection["Future[Any]"]) -> bool:
        """Restarts the workers that are at work, as Dask does not say on what; their other tasks it gives out again by itself.

        Where nobody is there any more, processes of this machine take over.
        """
        if self._own is not None:
            return self._own.renew(overdue)
        for future in overdue:
            future.cancel()
        if not overdue:
            self._own = Local(cores())
            return True
        with suppress(Exception):
            busy = [worker for worker, keys in self._client.processing().items() if keys]
            self._client.restart_workers(busy, raise_for_error=False)
        return False

    def gone(self) -> bool:
        """Whether for some time there has been no worker, or no scheduler."""
        if self._own is not None:
            return self._own.gone()
        try:
            there = self._client.status == "running" and bool(self._client.nthreads())
        except (OSError, TimeoutError, RuntimeError):
            there = False
        now = time.monotonic()
        if there or now - self._looked > 3.0 * LOOK_S:
            self._alone_since = None
        if not there and self._alone_since is None:
            self._alone_since = now
        self._looked = now
        return self._alone_since is not None and now - self._alone_since > PATIENCE_S

    def close(self) -> None:
        """Leaves the cluster as it is."""
        if self._own is not None:
            self._own.close()
        # A scheduler that is gone cannot be told to stop anything; what was found stands.
        with suppress(Exception):
            self._executor.shutdown(wait=False)
        with suppress(Exception):
            self._client.close()


def _importing() -> Any:
    """A plug-in by which each worker imports this package once, alone, before it is given tasks."""
    from distributed import WorkerPlugin

    class Importing(WorkerPlugin):
        """Imports what tasks need."""

        def setup(self, worker: Any) -> None:
            """A worker begins."""
            import_all()

    return Importing()


#: What launchers of MPI tell the processes that they start, and what they are called.
STARTED_BY_MPI = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMI_RANK", "PMIX_RANK", "MPI_LOCALNRANKS", "SLURM_STEP_NUM_TASKS")
LAUNCHERS = ("mpiexec", "mpirun", "hydra_pmi_proxy", "orted", "prted")


SIZES = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS", "SLURM_STEP_NUM_TASKS")


class Mpi(Given):
    """Workers that ``mpiexec`` started.

    handed_out: ``python -m mpi4py.futures`` runs us, in one process, and the others wait for work.
    """

    def __init__(self, handed_out: bool = False) -> None:
        several = max((int(os.environ.get(n) or 1) for n in SIZES if (os.environ.get(n) or "1").isdigit()), default=1)
        if several > 1 and not handed_out:
            raise UsageError(
                f"--mpi: mpiexec started {several} of us, and each would do all of the work",
                do="start with mpiexec -n 8 python -m mpi4py.futures -m thermofast ..., of which one hands the work out",
            )
        try:
            from mpi4py.futures import MPIPoolExecutor
        except (ImportError, RuntimeError) as error:
            raise UsageError("--mpi runs on mpi4py", found=str(error)[:120], do="pip install 'thermofast[mpi]'") from None
        if not any(name in os.environ for name in STARTED_BY_MPI) and not any(map(shutil.which, LAUNCHERS)):
            raise UsageError(
                "--mpi: no processes of MPI, and no launcher that could start some",
                found=f"none of {', '.join(LAUNCHERS)} on the path",
                do="install MPI, and start with mpiexec -n 8 python -m mpi4py.futures -m thermofast ...",
            )
        self._pool: Any = MPIPoolExecutor()
        self._pool.bootup(wait=True)
        super().__init__(self._pool, max(1, int(getattr(self._pool, "num_workers", 1))))

    def submit(self, work: Callable[[Any], Any], task: Any) -> "Future[Any]":
        """Hand a task over."""
        if self._own is not None:
            return self._own.submit(work, task)
        future: Future[Any] = self._pool.submit(checked, build(), work, task)
        return future

    def close(self) -> None:
        """Ends the workers, and those that took their place."""
        super().close()
        self._pool.shutdown(wait=False, cancel_futures=True)


def started_by_mpi() -> bool:
    """Whether ``python -m mpi4py.futures`` started us, which hands out what we ask for."""
    return "mpi4py.futures" in sys.modules and any(name in os.environ for name in STARTED_BY_MPI)


def crew_of(
    jobs: int | None, cluster: str | None = None, mpi: bool = False, executor: Executor | None = None, guarded: bool = False
) -> Crew:
    """Who works: a cluster, MPI (also where ``python -m mpi4py.futures`` started us), an executor, or processes here.

    One process is this one where `jobs` says so, in which nothing that dies or hangs is survived, unless it is to be guarded.

    Raises
    ------
    UsageError: two of them, one that is not installed, or one that does not answer.
    """
    asked = [n for n, given in (("--cluster", cluster), ("--mpi", mpi), ("--jobs", jobs), ("executor", executor)) if given]
    if len(asked) > 1:
        raise UsageError(f"{' and '.join(asked)}: each says who works", do="leave all but one out")
    if cluster is not None:
        return Dask(cluster)
    # Loaded by somebody's program it hands nothing out: one process of MPI has no other.
    by_futures = started_by_mpi()
    if mpi or (by_futures and jobs is None and executor is None):
        return Mpi(by_futures)
    if executor is not None:
        return Given(executor, int(getattr(executor, "_max_workers", 0)) or cores())
    wanted = jobs if jobs is not None else cores()
    return Here() if jobs == 1 and not guarded else Local(wanted)
