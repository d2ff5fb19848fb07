"""What foreign code prints goes to standard error, for a pipe reads the table; what other threads print goes where it did."""

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class _ByThread:
    """Standard output as it was `before`, but for the threads in which foreign code runs."""

    def __init__(self, before: Any) -> None:
        self.before = before

    def __getattr__(self, name: str) -> Any:
        return getattr(sys.stderr if getattr(_state.thread, "inside", 0) else self.before, name)


class _State:
    """How many threads are in foreign code; a process that is forked begins with none of them."""

    def __init__(self) -> None:
        self.lock, self.thread, self.users = threading.Lock(), threading.local(), 0


_state = _State()
if hasattr(os, "register_at_fork"):  # a lock that another thread held would stay locked for ever in the child
    os.register_at_fork(after_in_child=_state.__init__)  # type: ignore[misc]


@contextmanager
def printing_aside() -> Iterator[None]:
    """Sends what this thread prints to standard error; in several threads at once as in one within another."""
    with _state.lock:
        _state.users += 1
        if sys.stdout is not None and not isinstance(sys.stdout, _ByThread):
            sys.stdout = _ByThread(sys.stdout)
    _state.thread.inside = getattr(_state.thread, "inside", 0) + 1
    try:
        yield
    finally:
        _state.thread.inside = getattr(_state.thread, "inside", 1) - 1
        with _state.lock:
            _state.users -= 1
            if _state.users <= 0 and isinstance(sys.stdout, _ByThread):
                sys.stdout = sys.stdout.before
