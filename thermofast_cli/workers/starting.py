"""Loaded by the server of worker processes alone: a worker that is started after its parent has gone has nothing to say, and an
interrupt is the parent's to answer, also while workers are still being made.
"""

import signal
import sys
from types import TracebackType

from .threads import set_before_loading

set_before_loading()
_usual = sys.excepthook


def _unless_orphaned(kind: type[BaseException], error: BaseException, trace: "TracebackType | None") -> None:
    """An interrupt takes away what a worker on its way should have shared with its parent; all else is told as usual."""
    frame = trace
    while frame is not None and frame.tb_next is not None:
        frame = frame.tb_next
    orphaned = isinstance(error, FileNotFoundError) and frame is not None
    if not (orphaned and frame is not None and frame.tb_frame.f_code.co_filename.endswith("synchronize.py")):
        _usual(kind, error, trace)


sys.excepthook = _unless_orphaned
signal.signal(signal.SIGINT, signal.SIG_IGN)
