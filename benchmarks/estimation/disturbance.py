"""Error ahead under disturbances that the model does not know: ``python -m benchmarks.estimation.disturbance [DRAWS]``.

Each record is 400 min at one reading a minute, identified on the first part named; the model then runs freely to the end. The
error ahead is against the noiseless truth, disturbance included. Peers: the plain UKF and least squares of the same program.
"""

import sys
from dataclasses import dataclass

import numpy as np

from thermofast.estimation.closing import estimate_at
from thermofast.filters import Afukf, FadingUkf, LeastSquares, Ukf
from thermofast.models import Lump

METHODS = {"afukf": Afukf(), "fading_ukf": FadingUkf(), "ukf": Ukf(), "least_squares": LeastSquares()}


@dataclass(frozen=True)
class Case:
    """A disturbance, what it is called, and the minutes identified on."""

    name: str
    kind: str
    until: int


CASES = (
    Case("2 K/h ambient ramp from the middle of 120 min", "ramp", 120),
    Case("2 K/h ambient ramp from the middle of 240 min", "ramp", 240),
    Case("noise 5 x larger for 10 min, 50 to 60 of 120", "burst", 120),
    Case("noise 5 x larger for the last 10 of 120 min", "late burst", 120),
    Case("1 % outliers of 5 K, 120 min", "outliers", 120),
    Case("1 % outliers of 5 K, 240 min", "outliers", 240),
)


def truth(case: Case) -> np.ndarray:
    """Noiseless temperatures (401,): the lump's equation with the ramp solved in closed form."""
    t = np.arange(401.0)
    curve = 26.7 - 8.8 * np.exp(-0.01536 * t)
    if case.kind == "ramp":
        since = np.maximum(0.0, t - case.until / 2)
        curve += 2.0 / 60.0 * (since - (1.0 - np.exp(-0.01536 * since)) / 0.01536)
    return curve


def readings(case: Case, rng: np.random.Generator, noise: float) -> np.ndarray:
    """One noisy record (401,)."""
    spread = np.full(401, noise)
    if case.kind == "burst":
        spread[50:60] *= 5.0
    if case.kind == "late burst":
        spread[case.until - 10 : case.until + 1] *= 5.0
    y = truth(case) + spread * rng.standard_normal(401)
    if case.kind == "outliers":
        y += 5.0 * rng.choice([-1.0, 1.0], 401) * (rng.random(401) < 0.01)
    return y


def compare(case: Case, draws: int, noise: float, seed: int = 1) -> dict[str, float]:
    """RMS error ahead [K] of each method; a record that a method leaves undetermined or broken counts with the error it made."""
    rng = np.random.default_rng([seed, case.until, round(1e3 * noise)])
    t, real, model = np.arange(401.0), truth(case), Lump()
    squares: dict[str, list[float]] = {name: [] for name in METHODS}
    for _ in range(draws):
        y = readings(case, rng, noise)
        for name, method in METHODS.items():
            k = case.until
            track = method.track(model, t[: k + 1], y[: k + 1], 0.0)
            if track.diverged_at is not None:
                squares[name].append(np.inf)
                continue
            ahead = estimate_at(model, method, track, t[: k + 1], y[: k + 1], k, 0.0).free_run(t[k + 1 :])
            squares[name].append(float(np.mean((ahead - real[k + 1 :]) ** 2)))
    return {name: float(np.sqrt(np.mean(values))) for name, values in squares.items()}


def main(draws: int = 300) -> None:
    print(f"RMS error ahead, K, over {draws} records a row (to reach: afukf no larger than ukf and least_squares)")
    print("| disturbance | noise mK | afukf | fading_ukf | ukf | least_squares | afukf / ukf | afukf / least_squares |")
    print("| --- |" + " ---: |" * 7)
    for case in CASES:
        for noise in (0.005, 0.02, 0.05):
            e = compare(case, draws, noise)
            print(
                f"| {case.name} | {1e3 * noise:.0f} | {e['afukf']:.4g} | {e['fading_ukf']:.4g} | {e['ukf']:.4g} "
                f"| {e['least_squares']:.4g} "
                f"| {e['afukf'] / e['ukf']:.3f} | {e['afukf'] / e['least_squares']:.3f} |",
                flush=True,
            )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
