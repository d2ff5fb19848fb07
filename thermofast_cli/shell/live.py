"""What a watch shows: a table that is drawn again, or lines where there is no terminal; a file of looks; a command to run."""

import json
import subprocess  # nosec B404 - for --exec alone
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ..analysis.watching import Look
from ..output.files import append_line
from ..output.screen import live_table, say
from ..pipeline.watching import Tell

#: Without a terminal a line is said when the record has grown by this share, or the verdict changes.
SAID_AGAIN = 0.1


@contextmanager
def shown(tolerance_c: float, quiet: bool, jsonl: str | None, execute: str | None) -> Iterator[Tell]:
    """Yields what hears of looks."""
    state: dict[str, Any] = {"said": 0.0, "within": -1, "stopped": False, "withdrawn": False, "last": 0.0}
    terminal = not quiet and sys.stderr.isatty()
    with live_table(terminal) as draw:

        def tell(look: Look | None, notes: tuple[str, ...]) -> None:
            for note in notes if not quiet else ():
                say(note)
            if look is None:
                return
            if look.minutes < state["last"]:  # another run: all is said anew
                state.update(said=0.0, within=-1, stopped=False, withdrawn=False)
            state["last"] = look.minutes
            if jsonl:
                head = {"minutes": round(look.minutes, 4), "stop": look.stop, "tolerance_c": tolerance_c}
                append_line(jsonl, json.dumps(head | {"records": [r.as_dict() for r in look.records]}))
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
                if execute:
                    code = subprocess.run(execute, shell=True, check=False).returncode  # nosec B602 - the user's own command
                    if code and not quiet:
                        say(f"--exec ended with code {code}: {execute}")

        yield tell
