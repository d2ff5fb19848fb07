"""Which state to filter in: ``python -m benchmarks.estimation.states``; the table of docs/architecture.md.

A plain sigma-point filter on T = 26.7 - 8.8 exp(-0.01536 t) in three coordinates, 2000 draws at once; RMS error of the
steady state over that of least squares. The readings before the start go into a fit: a straight line with a wide prior for
log b, else the law.
"""

import numpy as np

from thermofast.models import fit_decay
from thermofast.models.core.fit import growth

RATE, STEADY = 0.01536, 26.7
TIMES = (28, 120)


def log_rate(x: np.ndarray) -> np.ndarray:
    """(T, s, log b) one minute on."""
    b = np.exp(np.clip(x[..., 2], -14.0, 2.0))
    return np.stack([x[..., 0] + x[..., 1] * growth(b, 1.0), x[..., 1] * np.exp(-b), x[..., 2]], -1)


def curvature(x: np.ndarray) -> np.ndarray:
    """(T, s, ds/dt) one minute on."""
    b = np.clip(-x[..., 2] / x[..., 1], -0.5, 2.0)
    return np.stack([x[..., 0] + x[..., 1] * growth(b, 1.0), x[..., 1] * np.exp(-b), x[..., 2] * np.exp(-b)], -1)


def rate(x: np.ndarray) -> np.ndarray:
    """(T, s, b) one minute on."""
    b = np.clip(x[..., 2], -0.5, 2.0)
    return np.stack([x[..., 0] + x[..., 1] * growth(b, 1.0), x[..., 1] * np.exp(-b), x[..., 2]], -1)


STEADY_OF = {
    log_rate: lambda x: x[:, 0] + x[:, 1] / np.exp(x[:, 2]),
    curvature: lambda x: x[:, 0] - x[:, 1] ** 2 / x[:, 2],
    rate: lambda x: x[:, 0] + x[:, 1] / x[:, 2],
}


def start(y: np.ndarray, noise: float, step: object) -> tuple[int, np.ndarray, np.ndarray]:
    """Reading to start after, state (3,) and covariance (3, 3) of one record."""
    if step is log_rate:
        t = np.arange(-5.0, 1.0)
        design = np.column_stack([np.ones(6), t])
        inverse = np.linalg.inv(design.T @ design)
        covariance = np.zeros((3, 3))
        covariance[:2, :2] = inverse * noise**2
        covariance[2, 2] = 0.8**2
        return 5, np.array([*(inverse @ design.T @ y[:6]), np.log(0.01)]), covariance
    for m in range(5, len(y)):
        t = np.arange(m + 1.0)
        mean, unit = fit_decay(t, y[: m + 1], signed=True).state(float(m))
        covariance = unit * noise**2
        if np.sqrt(covariance[2, 2]) * m < 0.15:
            break
    if step is curvature:
        jacobian = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -mean[2], -mean[1]]])
        return m, np.array([mean[0], mean[1], -mean[2] * mean[1]]), jacobian @ covariance @ jacobian.T
    return m, mean, covariance


def filtered(y: np.ndarray, noise: float, step: object) -> dict[int, np.ndarray]:
    """Steady states (draws,) after each of TIMES for records y (draws, n)."""
    starts = [start(row, noise, step) for row in y]
    first = np.array([s[0] for s in starts])
    x, p = np.array([s[1] for s in starts]), np.array([s[2] for s in starts])
    found = {}
    for k in range(1, y.shape[1]):
        arms = np.sqrt(3.0) * np.swapaxes(np.linalg.cholesky(p + 1e-18 * np.eye(3)), 1, 2)
        with np.errstate(all="ignore"):
            points = step(np.concatenate([x[:, None] + arms, x[:, None] - arms], 1))
        mean = points.mean(1)
        points -= mean[:, None]
        spread = np.einsum("mki,mkj->mij", points, points) / 6.0
        gain = spread[:, :, 0] / (spread[:, 0, 0] + noise**2)[:, None]
        left = np.eye(3) - gain[:, :, None] * np.eye(3)[0]
        moved = mean + gain * (y[:, k] - mean[:, 0])[:, None]
        after = left @ spread @ np.swapaxes(left, 1, 2) + noise**2 * gain[:, :, None] * gain[:, None, :]
        going = k > first
        x[going], p[going] = moved[going], after[going]
        if k in TIMES:
            found[k] = STEADY_OF[step](x)
    return found


def main(draws: int = 2000) -> None:
    print("| state | noise mK | " + " | ".join(f"{k} min" for k in TIMES) + " |")
    print("| --- |" + " ---: |" * (1 + len(TIMES)))
    for noise in (0.02, 0.05):
        rng = np.random.default_rng(1)
        t = np.arange(TIMES[-1] + 1.0)
        y = STEADY - 8.8 * np.exp(-RATE * t) + noise * rng.standard_normal((draws, len(t)))
        peer = {k: np.array([fit_decay(t[: k + 1], row[: k + 1]).steady_state for row in y]) - STEADY for k in TIMES}
        for step in (log_rate, curvature, rate):
            found = filtered(y, noise, step)
            ratios = [np.sqrt(np.mean((found[k] - STEADY) ** 2) / np.mean(peer[k] ** 2)) for k in TIMES]
            name = {log_rate: "(T, s, log b)", curvature: "(T, s, curvature)", rate: "(T, s, b)"}[step]
            print(f"| {name} | {1e3 * noise:.0f} | " + " | ".join(f"{r:.2f}" for r in ratios) + " |", flush=True)


if __name__ == "__main__":
    main()
