"""``load_step``: the load changes during the run."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..drive import Drive
from ..observations import Observations
from .base import Choice, Effect, Parameter, driven, heated, tried_columns

#: Levels of a drive of which more say to which power the heat follows it: of on and off all powers are one.
FEWEST_LEVELS = 2
#: How a change without an event is called, and what it does not search.
STEADILY, NO_EVENT = "steadily, until the last reading", ("event", "power", "delay")


class LoadStep(Effect):
    """The heat steps at an unknown time, changes steadily until the last reading, follows a logged column, or follows the drive in
    another way than in proportion.
    """

    id = "load_step"
    summary = "the load changes during the run"
    equation = (
        "heat(t) = 1 + change after event; or 1 + change t/t_last (steadily); "
        "or 1 + change ((u(t - delay)/u0)^power - 1), u a logged column; "
        "or (u(t - delay)/u0)^(1 + change), u the drive"
    )
    tell_tale = "kink in slope at the event, then a new exponential with the same b"
    mistaken_for = ("cooling_switch", "reading_jump")
    separate = "log the speed or the power"
    reference = "step response of a lump, e.g. Incropera, Fundamentals of Heat and Mass Transfer, ch. 5"
    event = "event"
    uses_sink = True
    changes_heat = True
    again = True
    in_parts = True
    places = (30.0, 0.0)
    amplitude = "change"
    parameters = (
        Parameter(
            "change",
            "1",
            -1.5,
            8.0,
            0.2,
            "change of the heat, relative to the heat at the start",
            null=0.0,
            belongs="run",
            typical=(0.15, 0.4),
        ),
        Parameter("event", "min", 0.0, 1.0, 0.5, "time of the change", belongs="run", share=True, typical=(0.3, 0.6)),
        Parameter("power", "1", 0.25, 4.0, 1.0, "exponent of the logged column", log=True),
        Parameter(
            "delay",
            "min",
            0.0,
            0.3,
            0.02,
            "time by which the heat follows the column later",
            share=True,
            logging_steps=0.289,  # a jump lies evenly between two readings: 1 / sqrt(12)
        ),
    )

    def choices(self, run: Observations) -> Sequence[Choice]:
        free = Choice("", {"column": "", "power": 1.0, "ending": 0.5, **driven(run)}, ("power", "delay"))
        steadily = {**free.constants, "event": 0.0, "steady": 1.0}
        found = [free, replace(free, label=STEADILY, constants=steadily, omitted=NO_EVENT, simple=False, rare=True)]
        if run.heat is not None and len(np.unique(run.heat)) > FEWEST_LEVELS and float(run.heat.min()) >= 0.0:
            own = {"column": "", "own": str(run.drive)}
            way = f"{run.drive} to the power 1 + change"
            found.append(Choice(way, own, ("event", "power", "delay"), coupled=("change",)))
            found.append(Choice(f"{way}, later", own, ("event", "power"), simple=False, coupled=("change",)))
        for name, column in tried_columns(run, but=run.cools).items():
            constants = {"column": name, "scale": float(np.abs(column).max()), "event": 0.0}
            ways = [{**constants, "ending": ending} for ending in endings(column)]
            plain = [{**way, "power": 1.0} for way in ways]
            later = {**plain[0], "ending": 0.5}  # a delay that is searched says how a column is held, too
            found += [Choice(name, way, ("event", "power", "delay"), coupled=("change",)) for way in plain]
            found += [Choice(f"{name}, later", later, ("event", "power"), simple=False, coupled=("change",))]
            if len(np.unique(column)) > 2 and float(column.min()) >= 0.0:
                raised, both = f"{name}, to a power", {**constants, "ending": 0.5}
                found += [Choice(raised, way, ("event", "delay"), simple=False, coupled=("change",)) for way in ways]
                found += [Choice(f"{raised}, later", both, ("event",), simple=False, coupled=("change",))]
        return found

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        if getattr(p, "own", ""):
            drive.heat = later(run, drive.heat * raised(run.heat, p.change), getattr(p, "delay", 0.0))
            return
        if not p.column:
            drive.heat = heated(drive, p.change * (so_far(run) if getattr(p, "steady", 0.0) else run.after(p.event)), p)
            return
        level = held(run, p.column, p.scale, p.power, p.ending)
        drive.heat = heated(drive, p.change * (later(run, level, getattr(p, "delay", 0.0)) - 1.0), p)


def so_far(run: Observations) -> Any:
    """The share of the way to the last reading used, from 0 to 1 (N,), mean over the interval that ends at each reading."""
    first, last = run.time[0], run.time[run.last]
    return np.clip((run.middle - first) / max(float(last - first), 1e-9), 0.0, 1.0)


def raised(level: Any, power: Any) -> Any:
    """A level (N,), a share from 0 to 1, to a power (B, 1): (B, N); what is off stays off."""
    on = level > 0.0
    return np.where(on, np.where(on, level, 1.0) ** power, 0.0)


def later(run: Observations, level: Any, delay: Any) -> Any:
    """Means over the interval that ends at each reading, (1 or B, N), `delay` [min] later; before the record it is as at first."""
    if not np.any(np.asarray(delay) > 0.0):
        return level
    delay = np.atleast_2d(delay)
    level = np.broadcast_to(level, (max(len(delay), len(np.atleast_2d(level))), len(run.time)))
    edges = np.concatenate([run.time[:1] - run.step, run.time])
    moved = edges - delay
    through = np.zeros((len(level), len(edges)))
    np.cumsum(level * np.diff(edges), axis=1, out=through[:, 1:])
    passed = np.stack([np.interp(m, edges, row) for m, row in zip(np.broadcast_to(moved, through.shape), through, strict=True)])
    passed += np.minimum(moved - edges[0], 0.0) * level[:, :1]
    return np.diff(passed, axis=1) / np.diff(edges)


def endings(column: Any) -> tuple[float, ...]:
    """Shares that a reading may have in the interval it ends: of a column in steps, how it is held is not known."""
    return (0.5, 0.0, 1.0) if float(np.mean(np.diff(column) == 0.0)) > 0.8 else (0.5,)


def held(run: Observations, name: str, scale: float, power: Any, ending: float = 0.5) -> Any:
    """A logged column over `scale`, to a power, as mean over the interval that ends at each reading; (1 or B, N)."""
    level = np.maximum(run.inputs[name] / scale, 0.0) if np.any(np.asarray(power) != 1.0) else run.inputs[name] / scale
    return run.over_intervals(level**power, ending)


class DriveLaw(LoadStep):
    """The drive followed to a power, or late: what is asked of a run whose drive is given before anything else is."""

    in_parts = False

    def choices(self, run: Observations) -> Sequence[Choice]:
        return [c for c in super().choices(run) if "own" in c.constants]
