"""What a worker does: a block is some runs, or parts of large ones, that take about as long as a task should."""

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

from ..errors import ThermofastError, TooShortError, shown_name
from ..output.arrow import to_arrow, types_of
from ..reading import Options, Run, read_runs
from ..records import JOINT_FIT, CompareRecord, DiagnoseRecord, IdentifyRecord, Record, SweepRecord
from ..results import Result
from ..workers.engine import Work, with_start
from ..workers.pool import ended
from .parts import Parts
from .sources import SourceFile

#: Why a file that this process cannot hold has no records.
OUT_OF_MEMORY = "out of memory while it was read"


KINDS: dict[str, type[Record]] = {
    "identify": IdentifyRecord,
    "sweep": SweepRecord,
    "compare": CompareRecord,
    "diagnose": DiagnoseRecord,
}
#: What is asked of all sensors of a run together, where they are worked on each by itself otherwise.
OF_WHOLE_RUNS = {"identify": ("criterion", "joint", "model", "drive", "auto"), "sweep": ("model", "drive")}


@dataclass(frozen=True)
class Analysis:
    """What is done with each run: ``call(started, how=...)`` gives a result with records of `kind`.

    together: neighbouring sensors that are worked on as one, 0 where all of a run are. more: fields of a record of a file that
    could not be read. settings: as they were told, for the manifest. from_rise as in :func:`~..workers.engine.with_start`.
    """

    command: str
    kind: type[Record]
    call: Callable[..., Result[Any]]
    together: int = 0
    more: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, str] = field(default_factory=dict)
    from_rise: bool = False

    @classmethod
    def of_sensors(
        cls,
        command: str,
        call: Callable[..., Result[Any]],
        filter_name: str,
        asked: Mapping[str, Any],
        settings: Mapping[str, str] | None = None,
        from_rise: bool = False,
    ) -> "Analysis":
        """One of sensors each by itself, ``identify`` or ``sweep``, but for what is `asked` of all of a run together."""
        from ..estimation.imperfect import GROUP

        whole = any(asked.get(name) for name in OF_WHOLE_RUNS[command])
        name = JOINT_FIT if whole and command == "sweep" else filter_name
        return cls(command, KINDS[command], call, 0 if whole else GROUP, {"filter": name}, settings or {}, from_rise)

    def failed(self, name: str, channel: str, status: str, why: str) -> Any:
        """A record of what could not be worked on."""
        return self.kind(run=name, channel=channel, status=status, message=why, **self.more)  # type: ignore[call-arg]

    def table(self, result: Result[Any]) -> Any:
        """Its records as an Arrow table."""
        return result.to_arrow()


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
class Reading:
    """How the files of an archive are read: options, and when the rise begins [min], None where that is looked for."""

    options: Options
    start_min: float | None
    from_rise: bool

    def started(self, path: str, data: bytes) -> list[tuple[Run, float]]:
        """The runs of a file's bytes with their starts.

        Raises
        ------
        ThermofastError: as :func:`read_runs` and :func:`with_start`.
        """
        runs = read_runs(path, self.options, data=data)
        return [with_start(replace(run, seen=None), self.start_min, self.from_rise) for run in runs]


@dataclass(frozen=True)
class WholeFile:
    """The file of that number, which the worker reads, and of which it writes the part."""

    source: int
    file: SourceFile
    reading: Reading
    parts: Parts

    @property
    def units(self) -> int:
        """A measure of the work: bytes."""
        return max(1, self.file.size())


@dataclass(frozen=True)
class Done:
    """The table of a piece, or the statuses in the part of a whole file; the seconds that it took."""

    source: int
    place: int
    table: Any
    seconds: float
    units: int
    statuses: "Counter[str] | None" = None


@dataclass(frozen=True)
class Block:
    """Pieces and what is done with them."""

    analysis: Analysis
    pieces: tuple[Piece | WholeFile, ...]

    def singles(self) -> "list[Block]":
        """A block for each piece."""
        return [replace(self, pieces=(piece,)) for piece in self.pieces]


def work_block(block: Block) -> list[Done]:
    """The table of each piece; what is wrong with a run is its record."""
    # In this process alone: its neighbours have the other cores.
    return [_of_file(block.analysis, p) if isinstance(p, WholeFile) else _work(block.analysis, p, Work(1)) for p in block.pieces]


def _of_file(analysis: Analysis, piece: WholeFile) -> Done:
    import pyarrow as pa

    began, content = time.perf_counter(), ""
    try:
        content, data = piece.file.content(piece.reading.options)
        started = piece.reading.started(piece.file.path, data)
        del data
        table = pa.concat_tables([_work(analysis, one, Work(1)).table for one in cut(piece.source, started, 0, 0)])
    except ThermofastError as error:
        table = unreadable(analysis, piece.file.path, str(error))
    return _written(piece, content, table, time.perf_counter() - began)


def _written(piece: WholeFile, content: str, table: Any, seconds: float) -> Done:
    piece.parts.write(piece.file, content, with_source(table, piece.file, content))
    return Done(piece.source, 0, None, seconds, piece.units, Counter(table.column("status").to_pylist()))


def with_source(table: Any, source: SourceFile, content: str) -> Any:
    """A part's table with the columns that say which file it is of; the hash is empty where it could not be read."""
    import pyarrow as pa

    rows = table.num_rows
    table = table.append_column("source", pa.array([shown_name(source.name)] * rows, pa.string()))
    return table.append_column("source_sha256", pa.array([content] * rows, pa.string()))


def read_pieces(piece: WholeFile) -> tuple[str, list[Piece]]:
    """(content, pieces) of a file, none where it is no record: what its worker began with."""
    content, data = piece.file.content(piece.reading.options)
    return content, cut(piece.source, piece.reading.started(piece.file.path, data), 0, 0)


def _work(analysis: Analysis, piece: Piece, how: Work) -> Done:
    began = time.perf_counter()
    try:
        table = analysis.table(analysis.call([(piece.run, piece.start_min)], how=how))
    except ThermofastError as error:
        status = "too_short" if isinstance(error, TooShortError) else "unreadable"
        table = _told(analysis, analysis.failed(piece.run.name, "", status, str(error)))
    return Done(piece.source, piece.place, table, time.perf_counter() - began, piece.units)


def _told(analysis: Analysis, *records: Any) -> Any:
    return to_arrow(analysis.kind.columns(), [r.as_dict() for r in records], types_of(analysis.kind))


def unreadable(analysis: Analysis, name: str, why: str) -> Any:
    """The table of a file that cannot be read."""
    return _told(analysis, analysis.failed(name, "", "unreadable", why))


def lost_block(block: Block, why: str, pool: Callable[[], ProcessPoolExecutor], limit_s: float | None) -> list[Done]:
    """A piece on which its worker died: shared out sensor by sensor where that can be, so that the culprit is named."""
    (piece,) = block.pieces
    if isinstance(piece, WholeFile):
        return [_lost_file(block.analysis, piece, why, pool, limit_s)]
    if block.analysis.together:
        workers = pool()
        try:
            return [_work(block.analysis, piece, Work(executor=workers, limit_s=limit_s))]
        finally:
            workers.shutdown(wait=False, cancel_futures=True)
    record = block.analysis.failed(piece.run.name, "", "failed", why)
    return [Done(piece.source, piece.place, _told(block.analysis, record), 0.0, 0)]


def _lost_file(
    analysis: Analysis, piece: WholeFile, why: str, pool: Callable[[], ProcessPoolExecutor], limit_s: float | None
) -> Done:
    import pyarrow as pa

    content = ""
    reader = pool()
    try:
        content, pieces = reader.submit(read_pieces, piece).result(limit_s)
        tables = [lost_block(Block(analysis, (p,)), why, pool, limit_s)[0].table for p in pieces]
        table = pa.concat_tables(tables)
    except ThermofastError as error:
        table = unreadable(analysis, piece.file.path, str(error))
    except (BrokenExecutor, TimeoutError, MemoryError):  # it cannot even be read
        with suppress(ThermofastError):
            content = piece.file.content(piece.reading.options)[0]
        table = _told(analysis, analysis.failed(piece.file.path, "", "failed", why))
    finally:
        ended(reader)
    return _written(piece, content, table, 0.0)


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
