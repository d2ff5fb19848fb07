"""Worker processes that neither run the user's script again nor change how the user's own processes start."""

import multiprocessing
import sys
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from multiprocessing import context, spawn
from types import FunctionType, SimpleNamespace
from typing import Any

#: Never forked from a process that may hold threads and locks; from a server, where there is one, which has loaded all.
METHOD = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
#: Of how each method starts a process: the module of multiprocessing, and what of its Popen asks what the child prepares.
STARTED = {
    "forkserver": ("popen_forkserver", "_launch"),
    "spawn": ("popen_spawn_win32", "__init__") if sys.platform == "win32" else ("popen_spawn_posix", "_launch"),
}


def context_of(preload: Sequence[str], method: str = METHOD) -> context.BaseContext:
    """A context of multiprocessing with modules that its server loads, of processes that begin without the user's script.

    Python's own would import that script, as a task might be defined there. None of ours is; and a script without ``if __name__ ==
    "__main__"`` would do its work, and write its files, once more in each worker. The server is another than multiprocessing's:
    processes that the user starts from that one would load what ours do, and would not answer an interrupt.
    """
    found: Any = type(multiprocessing.get_context(method))()
    found.Process = WORKERS[method]
    if method == "forkserver":
        _server().set_forkserver_preload(list(preload))
    own: context.BaseContext = found
    return own


@cache
def _server() -> Any:
    return import_module("multiprocessing.forkserver").ForkServer()


def _without_script(name: str) -> dict[str, Any]:
    """What a process of that name prepares, but for the import of the script."""
    return {key: value for key, value in spawn.get_preparation_data(name).items() if not key.startswith("init_main")}


@cache
def _popen(method: str) -> Any:
    """Python's own way to start a process, with other things under two of the names that it uses."""
    where, starts = STARTED[method]
    usual = import_module(f"multiprocessing.{where}")
    names = {"spawn": SimpleNamespace(**{**vars(spawn), "get_preparation_data": _without_script})}
    if method == "forkserver":
        its = {"connect_to_new_process": _server().connect_to_new_process}
        names["forkserver"] = SimpleNamespace(**{**vars(usual.forkserver), **its})
    how = getattr(usual.Popen, starts)
    own = FunctionType(how.__code__, {**how.__globals__, **names}, how.__name__, how.__defaults__, how.__closure__)
    return type("Popen", (usual.Popen,), {starts: own})


_usual: Any = multiprocessing.get_context(METHOD)
_spawned: Any = multiprocessing.get_context("spawn")


class Worker(_usual.Process):  # type: ignore[misc]
    """A process of the usual method."""

    @staticmethod
    def _Popen(process: Any) -> Any:  # noqa: N802 - the name is multiprocessing's
        return _popen(METHOD)(process)


class Spawned(_spawned.Process):  # type: ignore[misc]
    """One where there is no server, as on Windows."""

    @staticmethod
    def _Popen(process: Any) -> Any:  # noqa: N802
        return _popen("spawn")(process)


WORKERS = {"spawn": Spawned, METHOD: Worker}
