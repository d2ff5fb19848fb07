"""A record followed while it is written."""

import math
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..analysis.watching import FEWEST, Look, Watch, first_readings
from ..errors import InputError, ThermofastError, UsageError, rounded
from ..estimation.request import Method
from ..reading import Run, read_runs
from ..reading.follow import Follower, Piped, is_stream
from ..reading.source import BAD_ROW, CUT_ROW, read_growing
from ..reading_options import Options
from ..records import IdentifyRecord
from ..workers.engine import Started, Work, with_start
from .request import Request
from .sensors import from_rise, identify_runs

if TYPE_CHECKING:
    from ..machine.model import Model

#: Hears of each look, with what happened to the file since the last one; of None, that no reading came.
Tell = Callable[[Look | None, tuple[str, ...]], None]
#: Minutes without a reading, in usual intervals, after which it is said.
SILENT = 20.0
#: Looks at what has come by which something must have been read, or it is said why not.
UNREAD = 8


def speed_of(replay: str | None) -> float | None:
    """``600x`` as 600; ``max`` as infinity; None for none.

    Raises
    ------
    UsageError: not such a number.
    """
    if replay is None:
        return None
    if replay == "max":
        return math.inf
    try:
        found = float(replay.removesuffix("x"))
    except ValueError:
        found = math.nan
    if not 0.0 < found < math.inf:
        raise UsageError("--replay: not a speed", found=repr(replay), allowed="600x for six hundred times as fast, or max")
    return found


def events_before(started: Started, minute: float) -> bool:
    """Whether a search of a run finds that all it has beside the law are changes of its load or cooling before a minute of it.

    Where several sets of effects leave no pattern and none is named (one sensor's load or cooling), all of them must be such.
    """
    from thermofast.models.joint import Key  # the search takes longer to load than a look takes
    from thermofast.models.search.discover import discover

    from ..discovery.loop import ready
    from ..plugins.effects import chosen_effects
    from .loop import loop_tasks

    start = started[1]
    prepared = ready(loop_tasks([started])[0])[1]
    if prepared is None:
        return False
    found = discover(prepared.seen, chosen_effects((), ()))
    sets = [found.named] if found.named is not None else [c for c in found.also if c.at_floor]
    # Minutes of a fit are from the start on.
    return bool(sets) and all(
        part.effect.scope == "run" and start + float(one.fit.values.get(Key(k, part.effect.event or ""), np.inf)) < minute
        for one in sets
        for k, part in enumerate(one.parts)
    )


@dataclass
class _Clock:
    """When the last reading came [s], and how far they usually are apart."""

    seen: float
    interval: float = 1.0
    said: bool = False


def watch_run(
    source: str,
    options: Options,
    start: str,
    method: Method,
    tolerance_c: float,
    model: "Model | None" = None,
    leave: bool = False,
    speed: float | None = None,
    poll_s: float = 1.0,
    give_up_min: float | None = None,
    tell: Tell = lambda _look, _notes: None,
    drive: str | None = None,
) -> tuple[Look, Run]:
    """The last look at a growing file (``-``: standard input), and the run it was at; `tell` hears of every look.

    drive: a logged column that the heat follows: what the load did is then known, and a step of it is no reason to wait.

    It ends with the input, when `leave` and the test can be stopped, when no reading came for give_up_min, or by an interrupt.

    Raises
    ------
    UsageError: a start that is none. InputError: it ended before anything could be read.
    """
    begin = None if start == "auto" else float(start)

    def identify(run: Run, start_min: float | None) -> tuple[IdentifyRecord, ...]:
        started = [with_start(run, start_min, from_rise(model, drive))]
        return tuple(identify_runs(started, method, Request(model=model, drive=drive), Work(1)).records)

    def happened(run: Run, minute: float) -> bool:
        return events_before(with_start(run, begin, from_rise(model, drive)), minute)

    watch = Watch(identify, tolerance_c, model is not None or method.imperfection.rarely_strong, happened, begin)
    if speed is not None:
        return _replayed(source, options, watch, speed, leave, tell, begin)
    if source == "-" or is_stream(source):
        follower: Piped | Follower = Piped(sys.stdin.buffer if source == "-" else Path(source))
    else:
        follower = Follower(source)
        if not follower.path.exists():
            _awaited(follower.path, tell)
    name = "stdin" if source == "-" else source
    last: tuple[Look, Run] | None = None
    clock, trouble, told, seen = _Clock(time.monotonic()), "", set[str](), 0

    def looked(data: bytes, at_end: bool) -> bool:
        """Reads what there is, and looks where that is worth it; whether the watch may be left."""
        nonlocal last, trouble, seen
        try:
            run, trouble = read_growing(data, options, name), ""
        except ThermofastError as error:
            before, trouble = trouble, str(error)  # a heading alone is no record yet
            if last is not None and trouble != before:
                tell(None, (f"cannot be read since {rounded(last[1].time_s[-1] / 60.0)} min: {trouble}",))
            return False
        if not _begun(run, begin) or not _worth(watch, run, at_end):
            return False
        clock.interval = float(np.median(np.diff(run.time_s)))
        follower.notes += [n for n in run.notes if (CUT_ROW in n or BAD_ROW in n) and n not in told]
        told.update(run.notes)
        last, seen = (watch.look(run), run), len(data)
        tell(last[0], tuple(follower.notes))
        follower.notes.clear()
        return leave and last[0].stop

    given_up, unread = False, 0
    try:
        while not given_up:
            ended = isinstance(follower, Piped) and follower.ended  # asked before what there is, so that no last line is lost
            data = follower.poll()
            if data is not None:
                clock.seen, clock.said = time.monotonic(), False
                unread += last is None
                if looked(data, isinstance(follower, Piped) and follower.ended) and last is not None:
                    return last
            elif ended:
                break
            if unread == UNREAD and last is None and trouble:
                unread += 1
                tell(None, (f"it grows, and nothing can be read of it yet: {trouble}",))
            silent = time.monotonic() - clock.seen
            if not clock.said and silent > SILENT * max(clock.interval, poll_s):
                clock.said = True
                gone = isinstance(follower, Follower) and last is not None and not follower.path.exists()
                there = ": the file is no longer there" if gone else ""
                tell(None, (trouble or f"no reading since {rounded(silent / 60.0)} min{there}",))
            given_up = give_up_min is not None and silent > 60.0 * give_up_min
            if not given_up:
                time.sleep(poll_s)
    except KeyboardInterrupt:
        pass
    # What came since the last look is not lost: an hour's readings are a hundred times what a look waits for.
    with suppress(KeyboardInterrupt):
        data = follower.rest() if given_up and isinstance(follower, Follower) else follower.text
        if data and len(data) != seen:
            looked(data, True)
    if last is None:
        never = isinstance(follower, Follower) and not follower.path.exists()
        found, do = "the file never appeared" if never else trouble, ""
        if never and Path(name.rpartition("#")[0]).is_file():
            do = f"--replay 600 plays one run of a file; {name.rpartition('#')[0]} itself is followed in its last run"
        raise InputError(f"{name}: nothing to foretell from was read", found=found, allowed=f"{FEWEST} readings or more", do=do)
    return last


def _awaited(path: Path, tell: Tell) -> None:
    """Tells that a file is waited for; refuses one that cannot come, as its folder is not there."""
    folder = path.parent
    if not folder.is_dir():
        raise InputError(f"{path}: cannot be followed", found=f"no folder {folder}", do="name the file that the logger writes")
    beside: list[str] = []
    with suppress(OSError):
        beside = sorted(p.name for p in folder.iterdir() if p.is_file())
    near = get_close_matches(path.name, beside, 3)
    alike = f"; alike there: {', '.join(near)}" if near else ""
    tell(None, (f"waiting for {path.name}: it is not there yet{alike}",))


def _begun(run: Run, start_min: float | None) -> bool:
    """Whether enough was read after the start to look at."""
    return int((run.time_s / 60.0 >= (start_min or 0.0)).sum()) >= FEWEST


def _worth(watch: Watch, run: Run, at_end: bool) -> bool:
    """Whether to look: the record has grown, another has begun, or the input has ended and something has come since."""
    minutes = float(run.time_s[-1]) / 60.0
    return watch.due(minutes) or minutes < watch.last_min or (at_end and minutes != watch.last_min)


def _replayed(
    source: str, options: Options, watch: Watch, speed: float, leave: bool, tell: Tell, begin: float | None
) -> tuple[Look, Run]:
    runs = read_runs(source, options)
    if len(runs) > 1:
        raise InputError(f"{source}: {len(runs)} runs", allowed="one to replay", do=f"name one, as {source}#2")
    whole = runs[0]
    last: tuple[Look, Run] | None = None
    began = time.monotonic()
    try:
        for count in range(FEWEST, len(whole.time_s) + 1):
            now = float(whole.time_s[count - 1])
            run = first_readings(whole, count)
            if not _begun(run, begin) or (not watch.due(now / 60.0) and count < len(whole.time_s)):
                continue
            wait = began + now / speed - time.monotonic()
            if wait > 0.0:
                time.sleep(wait)
            last = watch.look(run), run
            tell(last[0], ())
            if leave and last[0].stop:
                return last
    except KeyboardInterrupt:
        pass
    if last is None:
        raise InputError(f"{source}: nothing to foretell from", found=f"{len(whole.time_s)} readings", allowed=f"{FEWEST} or more")
    return last
