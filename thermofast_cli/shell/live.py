"""What a watch shows: a table that is drawn again, or lines where there is no terminal; a file of looks; a command to run."""

import json
import os
import signal
import subprocess  # nosec B404 - for --exec alone
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from ..analysis.watching import Look
from ..output.files import append_line
from ..output.screen import live_table, say
from ..pipeline.watching import Tell

#: Without a terminal a line is said when the record has grown by this share, or the verdict changes.
SAID_AGAIN = 0.1
#: How long [s] a watch that has ended waits for what --exec began, how long that has to end once it is told to, and how often it is
#: looked at.
WAITED_S, ENDING_S, HEARD_S = 60.0, 2.0, 0.02


class Commands:
    """What --exec begins, beside the watch: it reads nothing of the record, and what it prints is none of the results."""

    def __init__(self, command: str | None) -> None:
        self.command = command
        self._running: list[subprocess.Popen[bytes]] = []

    def begin(self) -> None:
        """Begins the command, if there is one."""
        if not self.command:
            return
        # A session of its own, so that what a shell begins ends with it.
        alone = subprocess.Popen(  # nosec B602 - the user's own command
            self.command, shell=True, stdin=subprocess.DEVNULL, stdout=2, start_new_session=True
        )
        self._running.append(alone)

    def heard(self) -> None:
        """Says of those that have ended with an error what it is."""
        for one in [p for p in self._running if p.poll() is not None]:
            self._running.remove(one)
            if one.returncode:
                say(f"--exec ended with code {one.returncode}: {self.command}")

    def end(self, wait_s: float) -> None:
        """Waits so long for those that run, or until an interrupt, and ends the others."""
        until = time.monotonic() + wait_s
        with suppress(KeyboardInterrupt):
            while self._running and time.monotonic() < until:
                self.heard()
                time.sleep(HEARD_S)
        for one in self._running:
            say(f"--exec was still running and has been ended: {self.command}")
            for number in (signal.SIGTERM, getattr(signal, "SIGKILL", signal.SIGTERM)):
                with suppress(OSError):
                    getattr(os, "killpg", os.kill)(one.pid, number)
                with suppress(subprocess.TimeoutExpired):
                    one.wait(ENDING_S)
        self._running.clear()


@contextmanager
def commanded(command: str | None) -> Iterator[Commands]:
    """What --exec begins; at the end it is waited for, but not after an interrupt or an error."""
    commands = Commands(command)
    try:
        yield commands
    except BaseException:
        commands.end(0.0)
        raise
    commands.end(WAITED_S)


class Looks:
    """The file of --jsonl, and whether it was ever said that the test can be stopped.

    Where the file can no longer be written, the watch goes on without it, and that is said.
    """

    def __init__(self, path: str | None) -> None:
        self.path, self.failed, self.stopped = path, False, False

    def keep(self, line: str) -> None:
        """Appends a line, while that can be done."""
        if self.path is None or self.failed:
            return
        try:
            append_line(self.path, line)
        except OSError as error:
            self.failed = True
            say(f"Error: {self.path}: looks are kept no longer: {error.strerror or error}; the watch goes on without")


@contextmanager
def shown(tolerance_c: float, quiet: bool, looks: Looks, commands: Commands) -> Iterator[Tell]:
    """Yields what hears of looks."""
    state: dict[str, Any] = {"said": 0.0, "within": -1, "stopped": False, "withdrawn": False, "last": 0.0}
    terminal = not quiet and sys.stderr.isatty()
    with live_table(terminal) as draw:

        def tell(look: Look | None, notes: tuple[str, ...]) -> None:
            commands.heard()
            for note in notes if not quiet else ():
                say(note)
            if look is None:
                return
            if look.minutes < state["last"]:  # another run: all is said anew
                state.update(said=0.0, within=-1, stopped=False, withdrawn=False)
            state["last"] = look.minutes
            looks.stopped |= look.stop
            head = {"minutes": round(look.minutes, 4), "stop": look.stop, "tolerance_c": tolerance_c}
            looks.keep(json.dumps(head | {"records": [r.as_dict() for r in look.records]}))
            if terminal:
                draw(look.words, look.records, look.within)
            elif not quiet and (
                look.minutes >= state["said"] * (1.0 + SAID_AGAIN) or sum(look.within) != state["within"] or look.stop
            ):
                if look.stop == (state["stopped"] and not state["withdrawn"]) and state["stopped"]:
                    pass  # said already, and still so
                elif state["stopped"] and not look.stop:
                    say(f"{look.words}; what was said before is no longer sure")
                else:
                    say(look.words)
                state["withdrawn"] = state["stopped"] and not look.stop
                state["said"], state["within"] = look.minutes, sum(look.within)
            if look.stop and not state["stopped"]:
                state["stopped"] = True
                commands.begin()

        yield tell
