"""What one filter over all sensors gains over one for each: ``python -m benchmarks.estimation.joint [DRAWS]``.

Ten sensors of one machine, 20 mK, one reading a minute; all identified on the first 120 min; the error ahead is against the
noiseless truth. The room begins to warm in the middle, faster or slower, which every sensor follows by its own rate. And the
share of machines on which any fading woke at all.
"""

import sys

import numpy as np

from thermofast.estimation.closing import estimate_at
from thermofast.filters import Afukf
from thermofast.filters.joint import track_together
from thermofast.models import Lump

SENSORS, UNTIL, END = 10, 120, 400
RAMPS = (0.0, 0.25, 0.5, 1.0, 2.0)


def machine(rng: np.random.Generator, ramp: float) -> tuple[np.ndarray, np.ndarray]:
    """Noiseless and noisy readings (SENSORS, END + 1); ramp [K/h] of the room from the middle of the identification time on."""
    t = np.arange(END + 1.0)
    rates, rises = rng.uniform(0.010, 0.025, SENSORS), rng.uniform(3.0, 12.0, SENSORS)
    since = np.maximum(0.0, t - UNTIL / 2)
    clean = np.array([20.0 + r * (1.0 - np.exp(-b * t)) for b, r in zip(rates, rises, strict=True)])
    clean += np.array([ramp / 60.0 * (since - (1.0 - np.exp(-b * since)) / b) for b in rates])
    return clean, clean + 0.02 * rng.standard_normal(clean.shape)


def errors(rng: np.random.Generator, ramp: float) -> tuple[float, float, bool, bool]:
    """Mean square error ahead alone and together, and whether any sensor's fading woke."""
    clean, y = machine(rng, ramp)
    t, model, method, k = np.arange(END + 1.0), Lump(), Afukf(), UNTIL
    records = [(t[: k + 1], row[: k + 1], 0.0) for row in y]
    alone = [method.track(model, *record) for record in records]
    together = track_together(model, method.moments, method.fading_rule, records)
    squares = []
    for tracks in (alone, together):
        ahead = [
            estimate_at(model, method, track, t[: k + 1], row[: k + 1], k, 0.0).free_run(t[k + 1 :])
            for track, row in zip(tracks, y, strict=True)
        ]
        squares.append(float(np.mean((np.array(ahead) - clean[:, k + 1 :]) ** 2)))
    woke = [any(bool((track.fading[track.first :] > 1.0).any()) for track in tracks) for tracks in (alone, together)]
    return squares[0], squares[1], woke[0], woke[1]


def main(draws: int = 60) -> None:
    """Print the table."""
    print(f"{SENSORS} sensors, {UNTIL} of {END} min, 20 mK, {draws} machines a row; RMS error ahead, K")
    print("| room K/h from the middle on | alone | together | together / alone | woke alone | woke together |")
    print("| ---: |" + " ---: |" * 5)
    for ramp in RAMPS:
        rng = np.random.default_rng([7, round(100 * ramp)])
        found = np.array([errors(rng, ramp) for _ in range(draws)])
        alone, together = np.sqrt(found[:, 0].mean()), np.sqrt(found[:, 1].mean())
        shares = " | ".join(f"{100 * share:.0f} %" for share in found[:, 2:].mean(axis=0))
        print(f"| {ramp:g} | {alone:.4g} | {together:.4g} | {together / alone:.3f} | {shares} |", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
