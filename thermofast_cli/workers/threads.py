"""One thread for each product of matrices: they are small, and the cores go to whole tasks."""

import os
from contextlib import AbstractContextManager, nullcontext
from typing import Any

#: What the libraries of linear algebra read when they are loaded.
NAMES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def set_before_loading() -> None:
    """For this process and those that it starts, where nothing else was asked for and numpy is not loaded yet."""
    for name in NAMES:
        os.environ.setdefault(name, "1")


def one_thread() -> AbstractContextManager[Any]:
    """The same for as long as it is entered, where numpy is loaded: on a busy machine threads of a small product only wait."""
    if os.environ.get(NAMES[0]) == "1":
        return nullcontext()
    from threadpoolctl import threadpool_limits

    limited: AbstractContextManager[Any] = threadpool_limits(1, user_api="blas")
    return limited
