"""One process reads while others compute: files into blocks, blocks over workers, tables into parts, a few at a time."""

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from ..errors import InputError, ThermofastError, UsageError
from ..reading import Run
from ..workers.flow import NOT_TRIED, Crew, Flow
from ..workers.pool import new_pool
from .blocks import (
    OUT_OF_MEMORY,
    Analysis,
    Block,
    Done,
    Piece,
    Reading,
    WholeFile,
    cut,
    lost_block,
    unreadable,
    with_source,
    work_block,
)
from .parts import Parts
from .sources import SourceFile

#: A block is to take about so long [s]; what it costs is measured on the way.
BLOCK_S = 0.8
#: Cost of a reading [s] to begin with, least and most readings in a block: the way to a worker is to be worth it, and not too wide.
FIRST_COST_S, FEWEST, MOST = 6e-6, 20_000, 1_500_000
#: The same for bytes of files that a worker reads itself: small ones, and up to LARGE where so many times as much is left for each
#: worker that nobody waits for the last. Others are read by one and shared by several.
FIRST_BYTE_S, FEWEST_BYTES, MOST_BYTES, SMALL, LARGE, LEFT = 2e-6, 10_000, 50_000_000, 4_000_000, 64_000_000, 2


@dataclass
class Progress:
    """How far it has got. Bytes are those of files that were not there already."""

    files: int
    total_bytes: int
    began: float = field(default_factory=time.monotonic)
    done: int = 0
    skipped: int = 0
    done_bytes: int = 0
    statuses: Counter[str] = field(default_factory=Counter)
    #: Records without a result, by status, of files that were there already.
    lost: Counter[str] = field(default_factory=Counter)
    _marks: list[tuple[float, int]] = field(default_factory=list)

    def finished(self, size: int, statuses: "Counter[str]") -> None:
        """A file more is on the disk."""
        self.done += 1
        self.done_bytes += size
        self.statuses.update(statuses)
        self._marks.append((time.monotonic() - self.began, self.done_bytes))

    def there(self, size: int, lost: dict[str, int]) -> None:
        """A file more was there already; `lost` of its records have no result, by status."""
        self.skipped += 1
        self.lost.update(lost)
        self.total_bytes -= size

    def remaining_s(self) -> tuple[float, float, float] | None:
        """(seconds, least, most) still to go, from the speed so far and how it varied; None before anything can be said."""
        if len(self._marks) < 8 or self.done_bytes <= 0:
            return None
        step = len(self._marks) // 8
        marks = [(0.0, 0), *self._marks[step - 1 :: step]]
        costs = [(b[0] - a[0]) / (b[1] - a[1]) for a, b in pairwise(marks) if b[1] > a[1]]
        mean = self._marks[-1][0] / self.done_bytes
        spread = (sum((c - mean) ** 2 for c in costs) / max(1, len(costs) - 1)) ** 0.5
        left = max(0, self.total_bytes - self.done_bytes)
        part = left / max(1, self.total_bytes)
        wide = 2.0 * spread * (1.0 / max(1, len(costs))) ** 0.5
        return left * mean, left * max(0.0, mean - wide), left * (mean + wide * (1.0 + part))


@dataclass
class _File:
    """A file of which pieces are under way."""

    content: str
    size: int
    pieces: int
    tables: dict[int, Any] = field(default_factory=dict)


def stream(
    analysis: Analysis,
    sources: Sequence[SourceFile],
    parts: Parts,
    crew: Crew,
    reading: Reading,
    limit_s: float | None,
    near: bool,
    told: Callable[[Progress], None] = lambda _progress: None,
) -> Progress:
    """Every file's part, written as soon as its last piece is done; what is there already stays as it is.

    near: the workers see the same files: small ones they read and write themselves.

    Raises
    ------
    UsageError: a part cannot be written, or one block after another fails.
    """
    return _Stream(analysis, sources, parts, reading, limit_s, near, told).run(crew)


class _Stream:
    """The state of a stream: files of which pieces are under way, costs, how far it has got."""

    def __init__(
        self,
        analysis: Analysis,
        sources: Sequence[SourceFile],
        parts: Parts,
        reading: Reading,
        limit_s: float | None,
        near: bool,
        told: Callable[[Progress], None],
    ) -> None:
        self.analysis, self.sources, self.parts, self.reading = analysis, sources, parts, reading
        self.limit_s, self.near, self.told = limit_s, near, told
        self.flow: Flow[Block, Done] = Flow(work_block, lambda block: block.singles(), self._lost, None, limit_s, sound=self._sound)
        sizes = [s.size() for s in sources]
        self.progress = Progress(len(sources), sum(sizes))
        self.left = np.cumsum(sizes[::-1])[::-1].tolist()
        self.slots = 1
        self.open_files: dict[int, _File] = {}
        self.cost, self.file_cost = _Cost(FIRST_COST_S, FEWEST, MOST), _Cost(FIRST_BYTE_S, FEWEST_BYTES, MOST_BYTES)

    def run(self, crew: Crew) -> Progress:
        """Until the last part is there."""
        self.slots = crew.slots
        with closing(crew):
            for _, results in self.flow.results(self._blocks(), crew):
                for one in results:
                    self._done(one)
        self.told(self.progress)
        return self.progress

    def _done(self, one: Done) -> None:
        if one.statuses is not None:
            self.file_cost.learn(one.seconds, one.units)
            self.progress.finished(self.sources[one.source].size(), one.statuses)
            self.told(self.progress)
            return
        self.cost.learn(one.seconds, one.units)
        file = self.open_files[one.source]
        file.tables[one.place] = one.table
        if len(file.tables) == file.pieces:
            self._finish(one.source)

    def _finish(self, number: int) -> None:
        import pyarrow as pa

        one, source = self.open_files.pop(number), self.sources[number]
        table = pa.concat_tables([one.tables[i] for i in sorted(one.tables)])
        self.parts.write(source, one.content, with_source(table, source, one.content))
        self.progress.finished(one.size, Counter(table.column("status").to_pylist()))
        self.told(self.progress)

    def _blocks(self) -> Iterator[Block]:
        """Blocks as they are asked for; files are read no earlier."""
        waiting: list[Piece | WholeFile] = []
        for piece in self._pieces():
            cost = self.file_cost if isinstance(piece, WholeFile) else self.cost
            held = sum(p.units for p in waiting)
            if waiting and (type(piece) is not type(waiting[0]) or held + piece.units > 1.2 * cost.aim()):
                yield Block(self.analysis, tuple(waiting))
                waiting = []
            waiting.append(piece)
        if waiting:
            yield Block(self.analysis, tuple(waiting))

    def _pieces(self) -> Iterator[Piece | WholeFile]:
        for number, source in enumerate(self.sources):
            size = source.size()
            several = size < LARGE and self.left[number] > LEFT * self.slots * size
            whole = self.near and (size < SMALL or several or not self.analysis.together)
            if whole and not self.parts.resumed:
                yield WholeFile(number, source, self.reading, self.parts)
                continue
            content = ""
            try:
                content, data = source.content(self.reading.options)
                if (lost := self.parts.there(source, content)) is not None:
                    self.progress.there(size, lost)
                    continue
                if whole:
                    yield WholeFile(number, source, self.reading, self.parts)
                    continue
                started = self.reading.started(source.path, data)
                del data
            except (ThermofastError, MemoryError) as error:
                why = str(error) if isinstance(error, ThermofastError) else OUT_OF_MEMORY
                self.open_files[number] = _File(content, size, 1, {0: unreadable(self.analysis, source.path, why)})
                self._finish(number)
                continue
            mine = cut(number, started, self.analysis.together, self.cost.aim())
            self.open_files[number] = _File(content, size, len(mine))
            yield from mine

    def _sound(self) -> bool:
        """Whether a worker can do the analysis of a record without fault: then files that fail one after another are at fault."""
        minutes = np.arange(60.0)
        plain = Run("sound", 60.0 * minutes, {"T1": 20.0 - 8.0 * np.expm1(-minutes / 30.0) + 0.01 * np.sin(37.0 * minutes)})
        return self.flow.alone(Block(self.analysis, (Piece(0, 0, plain, 0.0),)))[0] is not None

    def _lost(self, block: Block, why: str) -> list[Done]:
        if why == NOT_TRIED:
            raise UsageError(
                "one file after another fails, and so does a record without fault: it is not the files",
                found=self.sources[block.pieces[0].source].path,
                do="see what ends the workers (memory, a plug-in); --resume goes on from here",
            )
        return lost_block(block, why, partial(new_pool, 1), self.limit_s)


class _Cost:
    """What a unit of work (a reading, a byte of a file) costs, measured; from it how many of them a block holds."""

    def __init__(self, first: float, fewest: int, most: int) -> None:
        self._cost, self._fewest, self._most = first, fewest, most

    def learn(self, seconds: float, units: int) -> None:
        """A piece took so long."""
        if units and seconds > 0.0:
            self._cost += 0.2 * (seconds / units - self._cost)

    def aim(self) -> int:
        """Units with which a block is full."""
        return int(min(max(BLOCK_S / self._cost, self._fewest), self._most))


def check_sources(sources: Sequence[SourceFile]) -> None:
    """Raises InputError where two files would have one name in the folder of results."""
    names: dict[str, str] = {}
    for source in sources:
        if source.name in names:
            raise InputError(
                f"two files are called {source.name!r} below the folders named",
                found=f"{names[source.name]}, {source.path}",
                do="name the folder above both",
            )
        names[source.name] = source.path
