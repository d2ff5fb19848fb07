"""``displacement``: thermal displacement predicted from the temperatures, and which prediction to trust."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.models.displacement import Method, Sample
from thermofast.models.displacement.fits import NORMAL_95, LinearModel, Prediction, fit_least_squares
from thermofast.models.displacement.scoring import compare

from ..errors import UsageError, nearest, rounded
from ..reading import Run
from ..records import DisplacementRecord
from . import LONE, METHODS, TOGETHER
from .arx import arx

Array = NDArray[np.float64]

#: Share of its range within which a displacement begins at nought.
AT_NOUGHT = 0.03
#: Share of what is left of several runs together that a constant of each must leave at most, to be told of.
APART = 0.5
#: Share of the readings at which an input must be logged; between them it is as it was last.
LOGGED = 0.02


@dataclass(frozen=True)
class Report:
    """Records of a run and, for a picture, what each method says of every reading when it was left out."""

    records: list[DisplacementRecord]
    panels: list["Panel"]


@dataclass(frozen=True)
class Panel:
    """One displacement (N,) [um] over time [min] and what methods say of readings left out."""

    run: str
    channel: str
    time: Array
    displacement: Array
    predicted: dict[str, Prediction]
    trusted: str

    def rows(self) -> list[dict[str, Any]]:
        """Each reading as each method tells it when it was left out: columns of ``--predicted``."""
        return [
            {
                "run": self.run,
                "channel": self.channel,
                "time_min": float(self.time[i]),
                "displacement_um": float(self.displacement[i]),
                "method": method,
                "predicted_um": float(told.mean[i]),
                "predicted_lo_um": float(told.mean[i] - NORMAL_95 * told.deviation[i]),
                "predicted_hi_um": float(told.mean[i] + NORMAL_95 * told.deviation[i]),
            }
            for method, told in self.predicted.items()
            for i in range(len(self.time))
        ]


@dataclass(frozen=True)
class _Rows:
    """One run's whole rows: minutes (N,), temperatures (N, S), displacement (N,), inputs (N, k); how many rows were lost."""

    run: str
    minutes: Array
    temperatures: Array
    displacement: Array
    inputs: Array
    lost: int


def methods_of(methods: Sequence[str], order: tuple[int, int] | None, together: bool) -> dict[str, Method]:
    """The methods named, or those that are tried unasked; arx of the order given.

    Raises
    ------
    UsageError: a method that is not known, an order of a method that is not tried.
    """
    asked = {m.replace("_", " ").replace("-", " "): m for m in methods}
    for name, word in asked.items():
        if name not in METHODS:
            known = ", ".join(w.replace(" ", "_") for w in METHODS)
            raise UsageError(
                f"--methods: {word!r} is no method",
                allowed=known,
                do=nearest(word, [w.replace(" ", "_") for w in METHODS]) or "see thermofast displacement --help",
            )
    names = [n for n in METHODS if n in asked] or list(TOGETHER if together else LONE)
    if order is not None and "arx" not in names:
        raise UsageError("--order is that of arx", found=f"--methods {', '.join(methods)}", do="add arx to --methods")
    return {n: arx(order) if n == "arx" and order is not None else METHODS[n] for n in names}


def displacement_runs(
    started: Sequence[tuple[Run, float]], columns: tuple[str, ...], methods: dict[str, Method], asked: bool = False
) -> Report:
    """Each method on each displacement column of a run, or of several of one machine together, by the sensors that all have.

    Runs count from their starts [min]; rows in which any number is missing are left out. A method that the readings do not bear
    has a record of its own only where the methods were asked for, or where no other has.
    """
    name = started[0][0].name if len(started) == 1 else f"{len(started)} runs"
    report = Report([], [])
    if not columns:
        why = "no displacement column: write um into its name, or say --channels with the temperatures and it, and --displacements"
        return Report([DisplacementRecord(name, "", status="no_data", message=why)], [])
    for column in dict.fromkeys(columns):
        sensors = [
            c
            for c in started[0][0].channels
            if c != column and all(c in run.channels for run, _ in started) and any(_moves(run.channels[c]) for run, _ in started)
        ]
        inputs = [
            c
            for c in started[0][0].inputs
            if c != column
            and all(c in run.inputs and np.isfinite(run.inputs[c]).mean() >= LOGGED for run, _ in started)
            and any(_moves(run.inputs[c]) for run, _ in started)
        ]
        rows = [_rows(run, column, sensors, inputs, start) for run, start in started]
        _add(report, name, column, rows, (sensors, inputs), methods, asked, column in started[0][0].channels)
    return report


def _rows(run: Run, column: str, sensors: list[str], inputs: list[str], start: float) -> _Rows:
    values = run.displacements[column] if column in run.displacements else run.channels[column]
    minutes = run.time_s / 60.0
    own = np.array([run.channels[c] for c in sensors]).T.reshape(len(minutes), len(sensors))
    drives = np.array([_held(run.inputs[c]) for c in inputs]).T.reshape(len(minutes), len(inputs))
    good = np.isfinite(values) & np.isfinite(own).all(axis=1) & (minutes >= start - 1e-9)
    return _Rows(run.name, minutes[good] - start, own[good], values[good], drives[good], int((~good).sum()))


def _from_start(several: list[_Rows]) -> tuple[list[_Rows], bool]:
    """Rows of several runs, and whether temperatures in them are changes from each start, where displacements were set to nought.

    What a probe read then says nothing of how warm the machine was, and runs begin in rooms of different temperature.
    """
    whole = max((float(np.ptp(one.displacement)) for one in several if len(one.minutes)), default=0.0)
    if len(several) < 2 or not all(abs(float(one.displacement[0])) <= AT_NOUGHT * whole for one in several):
        return several, False
    return [replace(one, temperatures=one.temperatures - one.temperatures[0]) for one in several], True


def _constants_apart(sample: Sample, runs: int) -> float:
    """By how much [um] runs differ in a constant each, where these explain most of what one plane for all leaves; else nought."""
    each = (sample.run[:, None] == np.arange(runs)).astype(float)
    if runs < 2 or len(sample.displacement) <= sample.temperatures.shape[1] + runs:
        return 0.0
    beside = np.column_stack([each, sample.temperatures - sample.temperatures.mean(axis=0)])
    one = np.column_stack([np.ones(len(each)), beside[:, runs:]])
    of_each, of_one = (np.linalg.lstsq(x, sample.displacement, rcond=None)[0] for x in (beside, one))
    left, all_left = (float(np.std(sample.displacement - x @ b)) for x, b in ((beside, of_each), (one, of_one)))
    return float(np.ptp(of_each[:runs])) if left < APART * all_left else 0.0


def _formula(model: LinearModel, sensors: Sequence[str]) -> str:
    """'-34.21 + 1.834 [T1] - 0.4121 [T2]', displacement [um] of temperatures [degC]."""
    constant = model.offset - float(model.centre @ model.slope)
    terms = [f"{'-' if by < 0.0 else '+'} {abs(by):.6g} [{name}]" for by, name in zip(model.slope, sensors, strict=True)]
    return " ".join([f"{constant:.6g}", *terms])


def _held(values: Array) -> Array:
    """A logged input (N,), where it is missing as it was last; before its first reading, as it was then."""
    known = np.flatnonzero(np.isfinite(values))
    last = np.maximum(np.searchsorted(known, np.arange(len(values)), side="right") - 1, 0)
    return np.asarray(values[known[last]])


def _moves(values: Array) -> bool:
    seen = values[np.isfinite(values)]
    return len(seen) > 0 and float(np.ptp(seen)) > 0.0


def _add(
    report: Report,
    name: str,
    column: str,
    several: list[_Rows],
    names: tuple[list[str], list[str]],
    methods: dict[str, Method],
    asked: bool,
    temperature: bool,
) -> None:
    sensors, inputs = names
    empty = [one.run for one in several if not len(one.minutes)]
    lost = sum(one.lost for one in several)
    several, changes = _from_start([one for one in several if len(one.minutes)] or several[:1])
    values, temperatures, minutes, drives = (
        np.concatenate([getattr(one, part) for one in several]) for part in ("displacement", "temperatures", "minutes", "inputs")
    )
    runs = len(several)
    used = [*sensors, *(inputs if "arx" in methods else [])]
    blank: dict[str, Any] = {"samples": len(values), "sensors": used, "runs": runs, "left_out": "runs" if runs > 1 else "blocks"}
    if not sensors or not len(values):
        why = "no temperature goes with it" if not sensors else "no reading in this column"
        report.records.append(DisplacementRecord(name, column, status="no_data", message=why))
        return
    if float(np.ptp(values)) == 0.0:
        report.records.append(DisplacementRecord(name, column, status="constant", message="every reading is the same", **blank))
        return
    number = np.repeat(np.arange(runs), [len(one.minutes) for one in several])
    sample = Sample(temperatures, values, minutes, number, drives if inputs else None)
    found = compare(sample, methods)
    linear = _formula(fit_least_squares(temperatures, values), sensors) if "least squares" in found.scores else ""
    gaps = f"; {lost} rows with a gap in some column are left out, see --exclude" if lost else ""
    gaps += f"; no row of {', '.join(empty)} is whole" if empty else ""
    notes = [f"{column} = {linear}"] if found.choice == "least squares" else []
    notes += [f"{m} of {s.prediction.note}" for m, s in found.scores.items() if s.prediction.note]
    notes += [f"{m} not told: {why}" for m, why in found.refused.items() if not asked and found.scores]
    notes += [f"{column} is a temperature: errors are in K"] if temperature else []
    notes += [f"{column} begins at nought in each run, so temperatures count from each run's start"] if changes else []
    apart = 0.0 if changes else _constants_apart(sample, runs)
    again = "a gauge set anew in each? subtract its first reading from each run, and temperatures count from there"
    notes += [f"the runs differ by constants of up to {rounded(apart)} um: {again}"] if apart else []
    verdict = "; ".join([f"trust {found.choice}: {found.reason}", *notes]) + (gaps if empty else "")
    for method in methods:
        score = found.scores.get(method)
        if score is None and not asked and found.scores:
            continue  # nobody asked for it
        if score is None:
            why = found.refused[method] + gaps
            status = "too_short" if not found.scores else "not_determined"
            report.records.append(DisplacementRecord(name, column, method, status=status, message=why, **blank))
            continue
        trusted = found.choice == method
        report.records.append(
            DisplacementRecord(
                name,
                column,
                method,
                rmse_fit_um=score.fitted,
                rmse_ahead_um=score.rmse,
                baseline_um=score.rival_rmse,
                coverage=score.coverage,
                trusted=trusted,
                formula=linear if method == "least squares" else "",
                status="model_doubtful" if found.choice == "neither" or found.doubts.get(method) else "ok",
                message=verdict,
                **blank,
            )
        )
    for r, one in enumerate(several if found.scores else ()):
        mine = number == r
        shown = {m: Prediction(s.prediction.mean[mine], s.prediction.deviation[mine]) for m, s in found.scores.items()}
        report.panels.append(Panel(one.run, column, one.minutes, one.displacement, shown, found.choice))
