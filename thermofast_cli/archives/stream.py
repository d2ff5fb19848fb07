"""One process reads while others compute: files into blocks, blocks over workers, tables into parts, a few at a time."""

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import Any

from ..errors import InputError, ThermofastError, UsageError
from ..reading.source import content_of, read_runs
from ..reading_options import Options
from ..workers.engine import with_start
from ..workers.flow import NOT_TRIED, Crew, Flow
from ..workers.pool import new_pool
from .blocks import Analysis, Block, Done, Piece, cut, lost_block, unreadable, work_block
from .parts import Parts
from .sources import SourceFile

#: A block is to take about so long [s]; what it costs is measured on the way.
BLOCK_S = 0.8
#: Cost of a reading [s] to begin with, least and most readings in a block: the way to a worker is to be worth it, and not too wide.
FIRST_COST_S, FEWEST, MOST = 6e-6, 20_000, 1_500_000


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
    _marks: list[tuple[float, int]] = field(default_factory=list)

    def finished(self, size: int, table: Any) -> None:
        """A file more is on the disk."""
        self.done += 1
        self.done_bytes += size
        self.statuses.update(table.column("status").to_pylist())
        self._marks.append((time.monotonic() - self.began, self.done_bytes))

    def there(self, size: int) -> None:
        """A file more was there already."""
        self.skipped += 1
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
    options: Options,
    start_min: float | None,
    limit_s: float | None,
    told: Callable[[Progress], None] = lambda _progress: None,
) -> Progress:
    """Every file's part, written as soon as its last piece is done; what is there already stays as it is.

    Raises
    ------
    UsageError: a part cannot be written, or one block after another fails.
    """
    progress = Progress(len(sources), sum(s.size() for s in sources))
    open_files: dict[int, _File] = {}
    cost = _Cost()

    def finish(number: int) -> None:
        import pyarrow as pa

        one = open_files.pop(number)
        table = pa.concat_tables([one.tables[i] for i in sorted(one.tables)])
        source = sources[number]
        table = table.append_column("source", pa.array([source.name] * table.num_rows, pa.string()))
        table = table.append_column("source_sha256", pa.array([one.content] * table.num_rows, pa.string()))
        if one.content:
            parts.write(source, one.content, table)
        progress.finished(one.size, table)
        told(progress)

    def blocks() -> Iterator[Block]:
        pieces: list[Piece] = []
        for number, source in enumerate(sources):
            content, size = "", source.size()
            try:
                content, data = content_of(source.path, options)
                if parts.is_there(source, content):
                    progress.there(size)
                    continue
                runs = read_runs(source.path, options, data=data)
                del data
                started = [with_start(replace(run, seen=None), start_min, analysis.from_rise) for run in runs]
            except ThermofastError as error:
                open_files[number] = _File(content, size, 1, {0: unreadable(analysis, source.path, str(error))})
                finish(number)
                continue
            mine = cut(number, started, analysis.together, cost.most())
            open_files[number] = _File(content, size, len(mine))
            for piece in mine:
                held = sum(p.units for p in pieces)
                if pieces and held + piece.units > 1.2 * cost.aim():
                    yield Block(analysis, tuple(pieces))
                    pieces = []
                pieces.append(piece)
        if pieces:
            yield Block(analysis, tuple(pieces))

    def lost(block: Block, why: str) -> list[Done]:
        if why == NOT_TRIED:
            raise UsageError(
                "one block of work after another fails: it is not the files",
                found=block.pieces[0].run.name,
                do="see what ends the workers (memory, a plug-in); --resume goes on from here",
            )
        return lost_block(block, why, partial(new_pool, 1), limit_s)

    flow: Flow[Block, Done] = Flow(work_block, lambda block: block.singles(), lost, None, limit_s)
    with closing(crew):
        for _, results in flow.results(blocks(), crew):
            for one in results:
                cost.learn(one.seconds, one.units)
                file = open_files[one.source]
                file.tables[one.place] = one.table
                if len(file.tables) == file.pieces:
                    finish(one.source)
    told(progress)
    return progress


class _Cost:
    """What a reading costs, measured; from it how many readings a block holds."""

    def __init__(self) -> None:
        self._cost = FIRST_COST_S

    def learn(self, seconds: float, units: int) -> None:
        """A piece took so long."""
        if units and seconds > 0.0:
            self._cost += 0.2 * (seconds / units - self._cost)

    def aim(self) -> int:
        """Readings from which a block is full."""
        return int(min(max(BLOCK_S / self._cost, FEWEST), MOST))

    def most(self) -> int:
        """Readings of a piece of a run that is cut."""
        return self.aim()


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
