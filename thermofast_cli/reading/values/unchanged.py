"""Columns that a logger writes only where they have changed by so much: what is not written stands as it was."""

from dataclasses import replace

import numpy as np

from ...errors import listed, rounded
from ..run import Array, Guess, Run

#: Readings below which a column tells nothing of how it is logged.
FEWEST = 12
#: A silence is this many times as long as the shortest of a column's intervals; it has so many of them, and they cover this share.
SILENT, SILENCES, COVERED = 3.0, 6, 0.5
#: Over a silence a column changes by its band and hardly more, and nowhere by less: shares of readings, and times the band.
WITHIN, BELOW, MORE, LESS = 0.8, 0.02, 2.0, 0.75
#: Rows that are added in silences of a run: so many, were it all one, and no more than these.
FEWEST_ADDED, MOST_ADDED = 300, 2000


def band_of(time_s: Array, values: Array) -> float:
    """By how much [K] a column (N,), nan where nothing is written, changes until it is written again; 0 where it is not so."""
    there = np.isfinite(values)
    if there.sum() < FEWEST:
        return 0.0
    gap, change = np.diff(time_s[there]), np.abs(np.diff(values[there]))
    silent = gap > SILENT * float(np.quantile(gap, 0.05))
    if silent.sum() < SILENCES or float(gap[silent].sum()) < COVERED * float(gap.sum()):
        return 0.0
    band = float(np.median(change[silent]))
    told = float(np.mean(change[silent] <= MORE * band)) >= WITHIN and float(np.mean(change < LESS * band)) <= BELOW
    # What is missing here and there of a steady rise changes by more, the longer the silence.
    longer = gap[silent] > np.median(gap[silent])
    grows = bool(longer.any()) and float(np.median(change[silent][longer])) > 1.5 * float(np.median(change[silent][~longer]))
    return band if told and band > 0.0 and not grows else 0.0


def as_it_stood(run: Run) -> Run:
    """The run with readings where its loggers were silent, because nothing had changed: as the last one before.

    Without them the readings of a rise are those at which a step was passed, and of its end there are none.
    """
    gap = np.diff(run.time_s)
    even = len(gap) > 0 and float(gap.max()) <= SILENT * float(np.quantile(gap, 0.05))
    # Of thousands of sensors nearly all have a reading in each row of an even grid: there is no silence.
    kept = {n: c for n, c in {**run.channels, **run.ambient}.items() if not even or np.isnan(c).any()}
    band = {n: b for n, column in kept.items() if (b := band_of(run.time_s, column)) > 0.0}
    if not band:
        return run
    time = _with_rows(run.time_s, [kept[n] for n in band])
    at = np.searchsorted(time, run.time_s)

    def wide(columns: dict[str, Array]) -> dict[str, Array]:
        found = {}
        for n, column in columns.items():
            found[n] = np.full(len(time), np.nan)
            found[n][at] = column
            if n in band:
                found[n] = _between(found[n], band[n])
        return found

    least, most = (rounded(f(band.values())) for f in (min, max))
    by = least if least == most else f"{least} to {most}"
    text = f"logged only where they change by {by} K: taken to stay between: {listed(band, 6)}"
    guess = Guess("readings", text, "log at a steady interval, without a deadband")
    return replace(
        run,
        time_s=time,
        guesses=(*run.guesses, guess),
        channels=wide(run.channels),
        ambient=wide(run.ambient),
        inputs=wide(run.inputs),
        displacements=wide(run.displacements),
    )


def _between(values: Array, band: float) -> Array:
    """A column (N,) with readings in its silences: it has gone on, but not by a band, so half of one the way it went."""
    written = np.flatnonzero(np.isfinite(values))
    last = np.searchsorted(written, np.arange(len(values)), "right") - 1
    way = np.sign(np.diff(values[written], prepend=values[written[0]]))
    held = values[written][np.maximum(last, 0)] + 0.5 * band * way[np.maximum(last, 0)]
    return np.asarray(np.where(np.isfinite(values), values, np.where(last >= 0, np.round(held, 6), np.nan)))


def _with_rows(time_s: Array, columns: list[Array]) -> Array:
    """Times with more of them where such columns are silent and no other is written."""
    usual = min(float(np.quantile(np.diff(time_s[np.isfinite(c)]), 0.05)) for c in columns)
    length = float(time_s[-1] - time_s[0])
    step = max(min(usual, length / FEWEST_ADDED), length / MOST_ADDED)
    far = np.flatnonzero(np.diff(time_s) > 1.5 * step)
    more = [np.arange(time_s[k] + step, time_s[k + 1] - 0.5 * step, step) for k in far.tolist()]
    return np.union1d(time_s, np.concatenate(more)) if more else time_s
