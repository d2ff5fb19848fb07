"""A record followed while it is written."""

import math
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
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

    from ..observing.task import ready
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
    return _Following(follower, "stdin" if source == "-" else source, options, watch, begin, leave, tell).followed(
        poll_s, give_up_min
    )


@dataclass
class _Following:
    """A file or pipe that is followed: what was read of it last, what is wrong with it, and what was told of it.

    last: the last look and the run it was at; seen: bytes that it was at; trouble: why it cannot be read now; unread: how often
    something came of which nothing could be read; told: notes that were told.
    """

    follower: Piped | Follower
    name: str
    options: Options
    watch: Watch
    begin: float | None
    leave: bool
    tell: Tell
    last: tuple[Look, Run] | None = None
    seen: int = 0
    trouble: str = ""
    unread: int = 0
    told: set[str] = field(default_factory=set)
    clock: _Clock = field(default_factory=lambda: _Clock(time.monotonic()))

    def followed(self, poll_s: float, give_up_min: float | None) -> tuple[Look, Run]:
        """The last look, when the input has ended, the test can be stopped, nothing came for give_up_min, or by an interrupt.

        Raises
        ------
        InputError: nothing could be read.
        """
        given_up = False
        try:
            while not given_up:
                ended = self._ended  # asked before what there is, so that no last line is lost
                data = self.follower.poll()
                if data is not None:
                    self.clock.seen, self.clock.said = time.monotonic(), False
                    self.unread += self.last is None
                    if self._looked(data, self._ended) and self.last is not None:
                        return self.last
                elif ended:
                    break
                silent = self._waited(poll_s)
                given_up = give_up_min is not None and silent > 60.0 * give_up_min
                if not given_up:
                    time.sleep(poll_s)
        except KeyboardInterrupt:
            pass
        # What came since the last look is not lost: an hour's readings are a hundred times what a look waits for.
        with suppress(KeyboardInterrupt):
            data = self.follower.rest() if given_up and isinstance(self.follower, Follower) else self.follower.text
            if data and len(data) != self.seen:
                self._looked(data, True)
        if self.last is None:
            raise self._nothing_read()
        return self.last

    @property
    def _ended(self) -> bool:
        return isinstance(self.follower, Piped) and self.follower.ended

    @property
    def _gone(self) -> bool:
        return isinstance(self.follower, Follower) and not self.follower.path.exists()

    def _looked(self, data: bytes, at_end: bool) -> bool:
        """Reads what there is, and looks where that is worth it; whether the watch may be left."""
        try:
            run, self.trouble = read_growing(data, self.options, self.name), ""
        except ThermofastError as error:
            before, self.trouble = self.trouble, str(error)  # a heading alone is no record yet
            if self.last is not None and self.trouble != before:
                since = rounded(self.last[1].time_s[-1] / 60.0)
                self.tell(None, (f"cannot be read since {since} min: {self.trouble}",))
            return False
        if not _begun(run, self.begin) or not _worth(self.watch, run, at_end):
            return False
        self.clock.interval = float(np.median(np.diff(run.time_s)))
        notes = self.follower.notes
        notes += [n for n in run.notes if (CUT_ROW in n or BAD_ROW in n) and n not in self.told]
        self.told.update(run.notes)
        self.last, self.seen = (self.watch.look(run), run), len(data)
        self.tell(self.last[0], tuple(notes))
        notes.clear()
        return self.leave and self.last[0].stop

    def _waited(self, poll_s: float) -> float:
        """For how long nothing has come [s]; it is said once, as is that nothing can be read of what comes."""
        if self.unread == UNREAD and self.last is None and self.trouble:
            self.unread += 1
            self.tell(None, (f"it grows, and nothing can be read of it yet: {self.trouble}",))
        silent = time.monotonic() - self.clock.seen
        if not self.clock.said and silent > SILENT * max(self.clock.interval, poll_s):
            self.clock.said = True
            there = ": the file is no longer there" if self.last is not None and self._gone else ""
            self.tell(None, (self.trouble or f"no reading since {rounded(silent / 60.0)} min{there}",))
        return silent

    def _nothing_read(self) -> InputError:
        path, do = self.name.rpartition("#")[0], ""
        if self._gone and Path(path).is_file():
            do = f"--replay 600 plays one run of a file; {path} itself is followed in its last run"
        found = "the file never appeared" if self._gone else self.trouble
        what = f"{self.name}: nothing to foretell from was read"
        return InputError(what, found=found, allowed=f"{FEWEST} readings or more", do=do)


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
