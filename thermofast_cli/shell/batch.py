"""What the commands over runs are told alike, and what they all do with it: read, work, tell; or an archive into a folder."""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..records import failed
from ..results import Result
from ..workers.engine import Work
from .archive import names_folder, run_archive
from .session import Readings, check_outputs, deliver, read_all, wants_details, working

if TYPE_CHECKING:
    from ..archives.blocks import Analysis


@dataclass(frozen=True)
class Batch:
    """Runs to read, with the options of reading as they were told; where the records and the picture go."""

    runs: tuple[str, ...]
    reading: dict[str, Any]
    form: str | None = None
    output: str | None = None
    jobs: int | None = 1
    quiet: bool = False
    save_plot: str | None = None

    @property
    def is_archive(self) -> bool:
        """Whether ``-o`` names a folder."""
        return names_folder(self.output)

    @property
    def wants_details(self) -> bool:
        """Whether more than the records is to be shown."""
        return wants_details(self.output, self.save_plot)

    def archive(self, analysis: "Analysis") -> int:
        """The results of all files into the folder; the exit code."""
        return run_archive(analysis, self.runs, self.output or "", self.reading, self.jobs, self.quiet)

    def read(self, *also: str | None, from_rise: bool = False, table: bool = True, search: bool = True) -> Readings:
        """Every run, once it is known that what shall be written can be; also: other tables to be written.

        table is False where the output is none. from_rise as in :func:`~..workers.engine.with_start`, search as in
        :func:`~.session.read_all`.

        Raises
        ------
        ThermofastError: as :func:`~.session.check_outputs` and :func:`~.session.read_all`.
        """
        check_outputs([self.output if table else None, *also], self.save_plot)
        targets = [self.output, self.save_plot, *also]
        return read_all(self.runs, self.reading, self.quiet, targets, self.jobs, from_rise=from_rise, search=search)

    def working(self, readings: Readings, total: int, what: str) -> AbstractContextManager[Work]:
        """How the library is to work: see :func:`~.session.working`."""
        return working(readings, total, what, self.quiet, self.jobs)

    def tell(
        self, result: Result[Any], readings: Readings, drawn: Sequence[Any], *beneath: str, table: bool = True, **of_unread: Any
    ) -> int:
        """The records, those of what could not be read with the fields `of_unread` too; the exit code.

        drawn are the columns of a drawn table, beneath the texts under it; table is False where the output is none.
        """
        unread = failed(result.kind, readings.unreadable, **of_unread)
        output = self.output if table else None
        return deliver(result, unread, output, self.form, self.quiet, drawn, beneath or ("message",))
