"""``displacement``: thermal displacement predicted from the temperatures, and which prediction to trust."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.models.displacement import Fitter, Prediction, fit_least_squares, fit_network
from thermofast.models.displacement_score import Score, compare

from ..reading import Run
from ..records import DisplacementRecord

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Told:
    """Records of a run and, for a picture, what each trusted model says of every reading when it was left out."""

    records: list[DisplacementRecord]
    panels: list["Panel"]


@dataclass(frozen=True)
class Panel:
    """One displacement (N,) [um] over time [min] and what two models say of readings left out."""

    run: str
    channel: str
    time: Array
    displacement: Array
    predicted: dict[str, Prediction]
    trusted: str


#: The models by their name in the records.
METHODS: dict[str, Fitter] = {"least squares": fit_least_squares, "network": fit_network}


def displacement_run(run: Run, columns: tuple[str, ...], start_min: float = 0.0) -> Told:
    """Both models on each displacement column of a run from `start_min` on; rows in which any number is missing are left out."""
    channels = list(run.channels)
    temperatures = np.array([run.channels[c] for c in channels]).T
    told = Told([], [])
    if not columns:
        why = "no displacement column: name one with um, or with --displacements"
        return Told([DisplacementRecord(run.name, "", status="no_data", message=why)], [])
    for column in columns:
        values = run.displacements[column] if column in run.displacements else run.channels[column]
        sensors = [i for i, c in enumerate(channels) if c != column and _moves(temperatures[:, i])]
        own = temperatures[:, sensors]
        good = np.isfinite(values) & np.isfinite(own).all(axis=1) & (run.time_s / 60.0 >= start_min - 1e-9)
        names, lost = [channels[i] for i in sensors], int((~good).sum())
        _add(told, run, column, run.time_s[good] / 60.0, own[good], values[good], names, lost)
    return told


def _moves(values: Array) -> bool:
    seen = values[np.isfinite(values)]
    return len(seen) > 0 and float(np.ptp(seen)) > 0.0


def _add(told: Told, run: Run, column: str, time: Array, temperatures: Array, values: Array, names: list[str], lost: int) -> None:
    blank: dict[str, Any] = {"samples": len(values), "sensors": names}
    if not names or not len(values):
        why = "no temperature goes with it" if not names else "no reading in this column"
        told.records.append(DisplacementRecord(run.name, column, status="no_data", message=why))
        return
    if float(np.ptp(values)) == 0.0:
        told.records.append(DisplacementRecord(run.name, column, status="constant", message="every reading is the same", **blank))
        return
    found = compare(temperatures, values)
    gaps = f"; {lost} rows with a gap in some column are left out, see --exclude" if lost else ""
    scores: dict[str, Score | None] = {"least squares": found.least_squares, "network": found.network}
    for method, score in scores.items():
        if score is None:
            told.records.append(
                DisplacementRecord(run.name, column, method, status="too_short", message=found.reason + gaps, **blank)
            )
            continue
        fitted = METHODS[method](temperatures, values).predict(temperatures).mean - values
        trusted = found.choice == method
        verdict = f"trust {found.choice}: {found.reason}" if found.choice != "neither" else f"trust neither: {found.reason}"
        told.records.append(
            DisplacementRecord(
                run.name,
                column,
                method,
                rmse_fit_um=float(np.sqrt(np.mean(fitted**2))),
                rmse_ahead_um=score.rmse,
                baseline_um=score.rival_rmse,
                coverage=score.coverage,
                trusted=trusted,
                status="ok" if trusted else "model_doubtful" if found.choice == "neither" else "ok",
                message=verdict,
                **blank,
            )
        )
    shown = {m: s.prediction for m, s in scores.items() if s is not None}
    if shown:
        told.panels.append(Panel(run.name, column, time, values, shown, found.choice))
