"""What a command found: its records with ways to look at them, save them and draw them. Frozen; nothing is computed here."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar, overload

from .errors import UsageError
from .reading import Run, columns_named, told
from .reading.run import layout
from .records import (
    BenchRecord,
    CalibrateRecord,
    ChangedRecord,
    CompareRecord,
    DiagnoseRecord,
    DisplacementRecord,
    IdentifyRecord,
    ImproveRecord,
    InspectRecord,
    PlanRecord,
    Record,
    Row,
    SensitivityRecord,
    SweepRecord,
    ValidateRecord,
)
from .records.columns import Records, told_more

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    from matplotlib.figure import Figure

    from thermofast.models.imperfection import Imperfection

    from .analysis.changed import Difference
    from .analysis.denoise import Denoised
    from .analysis.validate import Area
    from .analysis.watching import Look
    from .discovery.compare import Panel
    from .discovery.improve import Improved
    from .displacements.report import Panel as DisplacementPanel
    from .estimation.curves import Curves
    from .estimation.sweep import Swept
    from .experiments.planning import Curve
    from .machine.model import Model


R = TypeVar("R", bound=Row, covariant=True)  # what a result holds


@dataclass(frozen=True, eq=False, repr=False)
class Result(Generic[R]):
    """Records in the order of the runs and their sensors.

    interrupted: the user stopped a command, and the rest is missing; a call from Python raises KeyboardInterrupt.
    """

    command: ClassVar[str] = ""
    kind: ClassVar[type[Row]] = Record
    named_by: ClassVar[str] = "channel"
    records: Sequence[R]
    runs: tuple[Run, ...] = ()
    interrupted: bool = False

    def __len__(self) -> int:
        return len(self.records)

    def __iter__(self) -> Iterator[R]:
        return iter(self._with_guesses())

    def __contains__(self, key: object) -> bool:
        """Whether there is a record of a sensor: its name, or (run, name); or a record itself."""
        if isinstance(key, self.kind):
            return key in list(self._with_guesses())
        named = self._whole(key)
        return any(named in self._names(r) for r in self.records)

    def _whole(self, key: object) -> object:
        """The name of the sensor that is meant, with its unit, alone or behind its run; any other key as it is."""
        if isinstance(key, tuple) and len(key) == 2 and isinstance(key[1], str):
            return key[0], self._whole(key[1])
        return columns_named(key, self._sensors(), ())[0] if isinstance(key, str) else key

    def _sensors(self) -> list[str]:
        return list(dict.fromkeys(str(self._names(r)[0]) for r in self.records))

    def _names(self, record: Any) -> tuple[object, object]:
        """What a record is asked for by: its sensor, and (run, sensor)."""
        name = getattr(record, self.named_by)
        return name, (getattr(record, "run", ""), name)

    def __eq__(self, other: object) -> bool:
        """Whether the records are the same; runs and curves behind them are not compared."""
        return type(self) is type(other) and isinstance(other, Result) and list(self.records) == list(other.records)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        """How many records of which status: all that stands in them would flood a prompt."""
        counted = Counter(self.statuses())
        told = ", ".join(f"{number} {status}".strip() for status, number in counted.most_common())
        return f"<{type(self).__name__}: {len(self.records)} records ({told}); .to_frame() shows them>"

    @overload
    def __getitem__(self, key: slice) -> Sequence[R]: ...

    @overload
    def __getitem__(self, key: int | str | tuple[str, str]) -> R: ...

    def __getitem__(self, key: int | slice | str | tuple[str, str]) -> R | Sequence[R]:
        """The record at a place, those of a slice, or the first one of a sensor: its name, of several runs (run, name).

        Raises
        ------
        KeyError: no such sensor, or one of several runs; the message lists those there are. IndexError: no such place.
        """
        held = self._with_guesses()
        if isinstance(key, slice):
            return tuple(held[key])
        if isinstance(key, Integral) and not isinstance(key, bool):  # those of numpy, too
            if not -len(held) <= key < len(held):
                raise IndexError(f"record {key} of {len(held)}")
            return held[int(key)]
        named = self._whole(key)
        found = [r for r in held if named in self._names(r)]
        if len(set(of := [getattr(r, "run", "") for r in found])) > 1:
            raise KeyError(f"{key!r} is a sensor of several runs; say ({of[0]!r}, {key!r})")
        if not found:
            raise KeyError(f"no sensor {key!r}; there are {', '.join(self._sensors()) or 'none'}")
        return found[0]

    def statuses(self) -> list[str]:
        """The status of each record."""
        if isinstance(self.records, Records):
            return self.records.column("status")
        return [str(getattr(record, "status", "")) for record in self.records]

    def rows(self) -> list[dict[str, Any]]:
        """The records as dictionaries; what was guessed of a run stands in the message of each of its records."""
        held = self._with_guesses()
        return held.rows() if isinstance(held, Records) else [record.as_dict() for record in held]

    def _with_guesses(self) -> Sequence[R]:
        """The records; what was guessed of a run stands in the message of each of its own."""
        guessed = {run.name: told(run.guesses) for run in self.runs if run.guesses}
        return told_more(self.records, guessed) if guessed else self.records

    def input(self) -> list[dict[str, Any]]:
        """How each run was read: notes and guesses."""
        return [{"run": r.name, "notes": list(r.notes), "guesses": [g.as_dict() for g in r.guesses]} for r in self.runs]

    def to_frame(self) -> "pd.DataFrame":
        """A row for each record; numbers are float64 whether or not they are told, absent ones nan; lists stay lists."""
        import pandas as pd

        from .output.arrow import types_of

        frame = pd.DataFrame(self.rows(), columns=list(self.kind.columns()))
        return frame.astype({name: float for name, type_ in types_of(self.kind).items() if type_ == "double"})

    def to_arrow(self) -> "pa.Table":
        """As the Parquet file of ``save``."""
        from .output.arrow import columns_to_arrow, to_arrow, types_of

        held = self._with_guesses()
        if isinstance(held, Records):
            return columns_to_arrow(held, types_of(self.kind))
        return to_arrow(self.kind.columns(), self.rows(), types_of(self.kind))

    def to_json(self) -> str:
        """The document that ``--format json`` prints."""
        from .output.text import to_json

        return to_json(self.command, self.rows(), self.input())

    def save(self, path: str | Path, excel_csv: bool = False, made: Mapping[str, str] | None = None) -> None:
        """Write the records, whole or not at all: .csv .json .jsonl .parquet .md .xlsx, or a page: .html.

        A workbook or a page holds a summary beside the records and, where details were asked for, curves with charts. excel_csv: a
        .csv with semicolons and decimal commas. made: headings and texts that a page or a workbook has of how it was made.

        Raises
        ------
        UsageError: an unknown suffix, or a place that cannot be written.
        """
        from .output.files import REPORT_SUFFIXES, TABLE_SUFFIXES, check_target, write_table, write_text_whole
        from .output.whole import write_whole

        check_target(str(path), (*TABLE_SUFFIXES, *REPORT_SUFFIXES))
        if Path(path).suffix.lower() in REPORT_SUFFIXES:
            from .output.report.page import page_of

            write_text_whole(str(path), page_of(self, made or {}))
            return
        if Path(path).suffix.lower() == ".xlsx":
            from .output.report.excel import write_result

            write_whole(str(path), lambda p: write_result(p, self, made or {}))
            return
        if Path(path).suffix.lower() == ".parquet":
            from .output.arrow import write_arrow

            write_whole(str(path), lambda p: write_arrow(p, self.to_arrow()))
            return
        write_table(str(path), self.command, self.kind.columns(), self.rows(), self.input(), excel_csv)

    def _repr_html_(self) -> str:
        """For a notebook: the answer in a few columns, or the table without columns that are empty throughout."""
        from .output.report.glance import notebook_html

        return notebook_html(self)


def _drawn(figure: "Figure | None", path: str | Path | None) -> "Figure | None":
    """The figure, saved where a path is given."""
    if path is not None and figure is None:
        way = "see the status of each record; of many sensors identify, sweep and compare keep curves with details=True"
        raise UsageError(f"{path}: nothing to draw", found="a result without curves", do=way)
    if path is not None and figure is not None:
        from .output.pictures.plots import save_figure

        save_figure(str(path), figure)
    return figure


@dataclass(frozen=True, eq=False, repr=False)
class Inspection(Result[InspectRecord]):
    """What ``inspect`` found: a record for each column of each run."""

    command: ClassVar[str] = "inspect"
    kind: ClassVar[type[Row]] = InspectRecord
    named_by: ClassVar[str] = "column"

    def _with_guesses(self) -> Sequence[InspectRecord]:
        """The records, of which each says what was guessed of its own column."""
        return self.records

    def input(self) -> list[dict[str, Any]]:
        """How each file is laid out, and what was guessed of it."""
        return [layout(run) for run in self.runs]

    def plot(self, path: str | Path | None = None) -> "Figure | None":
        """All columns that were read, over time."""
        from .output.pictures.inspect import draw_columns

        return _drawn(draw_columns(self.runs), path)


@dataclass(frozen=True, eq=False, repr=False)
class Identification(Result[IdentifyRecord]):
    """What ``identify`` found; `curves` and `traces` only where details were asked for."""

    command: ClassVar[str] = "identify"
    kind: ClassVar[type[Row]] = IdentifyRecord
    curves: tuple["Curves", ...] = ()
    traces: tuple[dict[str, Any] | None, ...] = ()

    def trace_rows(self) -> list[dict[str, Any]]:
        """What the filter did, reading by reading: columns of ``--trace``."""
        return [
            {"run": r.run, "channel": r.channel, **{c: float(v[i]) for c, v in trace.items()}}
            for r, trace in zip(self.records, self.traces, strict=False)
            if trace is not None
            for i in range(len(trace["time_min"]))
        ]

    def plot(self, path: str | Path | None = None, trace: bool = False) -> "Figure | None":
        """Measurement, model and band of each sensor, with the filter's convergence beside it; None where there is nothing."""
        from .output.pictures.plots import draw_prediction

        return _drawn(draw_prediction(self.curves, trace), path)


@dataclass(frozen=True, eq=False, repr=False)
class Sweeping(Result[SweepRecord]):
    """What ``sweep`` found; `curves` only where they were asked for."""

    command: ClassVar[str] = "sweep"
    kind: ClassVar[type[Row]] = SweepRecord
    curves: tuple["Swept", ...] = ()

    def plot(self, path: str | Path | None = None) -> "Figure | None":
        """RMSE against identification time, one curve per window."""
        from .output.pictures.plots import draw_sweep

        return _drawn(draw_sweep(self.curves), path)


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Result[CalibrateRecord]):
    """What ``calibrate`` learnt: how it held, and the prior for ``imperfection=``."""

    command: ClassVar[str] = "calibrate"
    kind: ClassVar[type[Row]] = CalibrateRecord
    prior: "Imperfection" = field(kw_only=True)
    learnt_from: tuple[str, ...] = ()

    def save(self, path: str | Path, excel_csv: bool = False, made: Mapping[str, str] | None = None) -> None:
        """Write the prior: .toml for ``--imperfection``; any other suffix the rows."""
        if str(path).endswith(".toml"):
            from .machine.lab import write_imperfection

            write_imperfection(str(path), self.prior, self.learnt_from)
        else:
            super().save(path, excel_csv, made)


@dataclass(frozen=True, eq=False, repr=False)
class Changes(Result[ChangedRecord]):
    """What ``changed`` found, the likeliest kind first; `difference` is what its picture shows."""

    command: ClassVar[str] = "changed"
    kind: ClassVar[type[Row]] = ChangedRecord
    difference: "Difference | None" = None

    @property
    def verdict(self) -> str:
        """The kind of change that is sure, "A or B", or "cannot tell"."""
        return str(self.records[0].verdict)

    def plot(self, path: str | Path | None = None) -> "Figure | None":
        """Rate and rise of every sensor, new over old."""
        from .output.pictures.change import draw_change

        return _drawn(draw_change(self.difference), path)


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Result[PlanRecord]):
    """How long a test must run; `curves` are half-widths against the time measured."""

    command: ClassVar[str] = "plan"
    kind: ClassVar[type[Row]] = PlanRecord
    curves: tuple["Curve", ...] = ()

    def plot(self, path: str | Path | None = None) -> "Figure | None":
        """Half-width against the time measured, a curve for each alternative."""
        from .output.pictures.plan import draw_plan

        return _drawn(draw_plan(self.curves, sorted({r.tolerance_c for r in self.records if r.tolerance_c is not None})), path)


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Result[CompareRecord]):
    """What ``compare`` found; `panels` only where details were asked for, `denoised` runs where that was."""

    command: ClassVar[str] = "compare"
    kind: ClassVar[type[Row]] = CompareRecord
    panels: tuple["Panel", ...] = ()
    denoised: tuple["Denoised", ...] = ()

    def plot(self, path: str | Path | None = None) -> "Figure | None":
        """Measurement and model, residual with failing stretches, logged inputs."""
        from .output.pictures.loop import draw_comparison

        return _drawn(draw_comparison(self.panels), path)


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Result[DiagnoseRecord]):
    """What ``diagnose`` found."""

    command: ClassVar[str] = "diagnose"
    kind: ClassVar[type[Row]] = DiagnoseRecord

    def plot(self, path: str | Path | None = None) -> "Figure | None":
        """What is left of the misfit with each effect that was tried, named ones in colour, the noise beside."""
        from .output.pictures.ranking import draw_ranking

        return _drawn(draw_ranking(self.records), path)


@dataclass(frozen=True, eq=False, repr=False)
class Watching(Identification):
    """What ``watch`` knew at its last look, `looked`, which says whether the test can be stopped."""

    command: ClassVar[str] = "watch"
    looked: "Look | None" = None

    @property
    def stop(self) -> bool:
        """Whether every sensor is known well enough, and has been for a while."""
        return self.looked is not None and self.looked.stop


@dataclass(frozen=True, eq=False, repr=False)
class Improvement(Result[ImproveRecord]):
    """What ``improve`` found: a record for each step and sensor, and the model learnt of each run."""

    command: ClassVar[str] = "improve"
    kind: ClassVar[type[Row]] = ImproveRecord
    steps: tuple["Improved", ...] = ()
    models: tuple["Model | None", ...] = ()

    @property
    def model(self) -> "Model":
        """The model learnt, where there is one run.

        Raises
        ------
        UsageError: several runs, or none was learnt from.
        """
        if len(self.models) != 1 or self.models[0] is None:
            many = f"{len([m for m in self.models if m])} models of {len(self.models)} runs"
            raise UsageError(f"{many}: there is no one model", allowed="one of .models")
        return self.models[0]

    def plot(self, path: str | Path | None = None) -> "Figure | None":
        """The error of each step, fitted and on readings not fitted."""
        from .output.pictures.loop import draw_staircase

        return _drawn(draw_staircase(self.steps), path)


@dataclass(frozen=True, eq=False, repr=False)
class Bench(Result[BenchRecord]):
    """What ``filters bench`` found."""

    command: ClassVar[str] = "filters bench"
    kind: ClassVar[type[Row]] = BenchRecord
    named_by: ClassVar[str] = "filter"

    def plot(self, path: str | Path | None = None) -> "Figure | None":
        """The error of each filter, the one chosen in colour."""
        from .output.pictures.ranking import draw_bench

        return _drawn(draw_bench(self.records), path)


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity(Result[SensitivityRecord]):
    """What ``sensitivity`` found."""

    command: ClassVar[str] = "sensitivity"
    kind: ClassVar[type[Row]] = SensitivityRecord

    def plot(self, path: str | Path | None = None) -> "Figure | None":
        """The shares as bars."""
        from .output.pictures.share import draw_shares

        return _drawn(draw_shares(self.records), path)


@dataclass(frozen=True, eq=False, repr=False)
class Validation(Result[ValidateRecord]):
    """What ``validate`` found."""

    command: ClassVar[str] = "validate"
    kind: ClassVar[type[Row]] = ValidateRecord
    areas: tuple["Area", ...] = ()

    def plot(self, path: str | Path | None = None) -> "Figure | None":
        """Distributions of measured and foretold bounds, the area between them shaded."""
        from .output.pictures.areas import draw_areas

        return _drawn(draw_areas(self.areas), path)


@dataclass(frozen=True, eq=False, repr=False)
class Displacement(Result[DisplacementRecord]):
    """What ``displacement`` found."""

    command: ClassVar[str] = "displacement"
    kind: ClassVar[type[Row]] = DisplacementRecord
    panels: tuple["DisplacementPanel", ...] = ()

    def predicted_rows(self) -> list[dict[str, Any]]:
        """Measured and predicted displacement [um] with its 95 % interval, readings left out: columns of ``--predicted``."""
        return [row for panel in self.panels for row in panel.rows()]

    def plot(self, path: str | Path | None = None) -> "Figure | None":
        """Measured and predicted displacement of readings left out."""
        from .output.pictures.displacement import draw_displacement

        return _drawn(draw_displacement(self.panels), path)
