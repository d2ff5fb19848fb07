"""One thread for each product of matrices: they are small, and the cores go to whole tasks."""

import os
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from types import TracebackType
from typing import Any

#: What the libraries of linear algebra read when they are loaded.
NAMES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def set_before_loading() -> None:
    """For this process and those that it starts, where nothing else was asked for and numpy is not loaded yet."""
    for name in NAMES:
        os.environ.setdefault(name, "1")


class _OneThread(AbstractContextManager[None]):
    """The limit of a process, for as long as any of its threads has entered: the first sets it, the last gives back what was.

    threadpoolctl lets no other thread change what one has set for as long as that one lives. Each change is made in a thread that
    ends with it, so that whoever is last may give back.
    """

    def __init__(self) -> None:
        self.lock, self.inside = threading.Lock(), 0
        self.limits: Any = None

    def __enter__(self) -> None:
        from threadpoolctl import threadpool_limits

        with self.lock:
            if self.inside == 0:

                def limit() -> None:
                    self.limits = threadpool_limits(1, user_api="blas")

                _in_a_thread(limit)
            self.inside += 1

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        with self.lock:
            self.inside -= 1
            if self.inside == 0:
                _in_a_thread(self.limits.restore_original_limits)


def _in_a_thread(work: Callable[[], None]) -> None:
    thread = threading.Thread(target=work, name="thermofast-threads")
    thread.start()
    thread.join()


_of_process = _OneThread()


def one_thread() -> AbstractContextManager[Any]:
    """The same for as long as it is entered, where numpy is loaded: on a busy machine threads of a small product only wait."""
    return nullcontext() if os.environ.get(NAMES[0]) == "1" else _of_process
