"""What a worker does: a block is some runs, or parts of large ones, that take about as long as a task should."""

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

from ..errors import ThermofastError
from ..output.arrow import to_arrow, types_of
from ..reading import Run
from ..records import Record
from ..results import Result
from ..workers.engine import Work


@dataclass(frozen=True)
class Analysis:
    """What is done with each run: ``call(started, how=...)`` gives a result with records of `kind`.

    together: neighbouring sensors that are worked on as one, 0 where all of a run are. more: fields of a record of a file that
    could not be read. settings: as they were told, for the manifest. from_rise as in :func:`~..workers.engine.with_start`.
    """

    command: str
    kind: type[Record]
    call: Callable[..., Result]
    together: int = 0
    more: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, str] = field(default_factory=dict)
    from_rise: bool = False

    def failed(self, name: str, channel: str, status: str, why: str) -> Any:
        """A record of what could not be worked on."""
        return self.kind(run=name, channel=channel, status=status, message=why, **self.more)  # type: ignore[call-arg]

    def table(self, result: Result) -> Any:
        """Its records as an Arrow table."""
        return to_arrow(self.kind.columns(), result.rows(), types_of(self.kind))


@dataclass(frozen=True)
class Piece:
    """A run of the file of that number, or some of its sensors; `place` among the pieces of the file."""

    source: int
    place: int
    run: Run
    start_min: float

    @property
    def units(self) -> int:
        """A measure of the work: readings."""
        return len(self.run.channels) * max(1, len(self.run.time_s))


@dataclass(frozen=True)
class Done:
    """The table of a piece, and the seconds that it took."""

    source: int
    place: int
    table: Any
    seconds: float
    units: int


@dataclass(frozen=True)
class Block:
    """Pieces and what is done with them."""

    analysis: Analysis
    pieces: tuple[Piece, ...]

    def singles(self) -> "list[Block]":
        """A block for each piece."""
        return [replace(self, pieces=(piece,)) for piece in self.pieces]


def work_block(block: Block) -> list[Done]:
    """The table of each piece; what is wrong with a run is its record."""
    return [_work(block.analysis, piece, Work()) for piece in block.pieces]


def _work(analysis: Analysis, piece: Piece, how: Work) -> Done:
    began = time.perf_counter()
    try:
        table = analysis.table(analysis.call([(piece.run, piece.start_min)], how=how))
    except ThermofastError as error:
        table = _told(analysis, analysis.failed(piece.run.name, "", "unreadable", str(error)))
    return Done(piece.source, piece.place, table, time.perf_counter() - began, piece.units)


def _told(analysis: Analysis, *records: Any) -> Any:
    return to_arrow(analysis.kind.columns(), [r.as_dict() for r in records], types_of(analysis.kind))


def unreadable(analysis: Analysis, name: str, why: str) -> Any:
    """The table of a file that cannot be read."""
    return _told(analysis, analysis.failed(name, "", "unreadable", why))


def lost_block(block: Block, why: str, pool: Callable[[], ProcessPoolExecutor], limit_s: float | None) -> list[Done]:
    """A piece on which its worker died: shared out sensor by sensor where that can be, so that the culprit is named."""
    (piece,) = block.pieces
    if block.analysis.together:
        workers = pool()
        try:
            return [_work(block.analysis, piece, Work(executor=workers, limit_s=limit_s))]
        finally:
            workers.shutdown(wait=False, cancel_futures=True)
    record = block.analysis.failed(piece.run.name, "", "failed", why)
    return [Done(piece.source, piece.place, _told(block.analysis, record), 0.0, 0)]


def cut(source: int, started: Sequence[tuple[Run, float]], together: int, most: int) -> list[Piece]:
    """Pieces of a file's runs: whole ones, or such of `most` readings where their sensors can be parted."""
    found: list[Piece] = []
    for run, start in started:
        channels = list(run.channels)
        size = len(channels)
        if together:
            per = max(1, most // max(1, len(run.time_s)))
            size = max(together, per // together * together)
        for i in range(0, len(channels), max(1, size)):
            part = {c: run.channels[c] for c in channels[i : i + size]}
            found.append(Piece(source, len(found), replace(run, channels=part) if len(part) < len(channels) else run, start))
    return found
