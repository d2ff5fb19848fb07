"""How well a displacement is predicted from temperatures, on readings not used, and which of two ways to trust."""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from .displacement import (
    BLOCKS,
    NORMAL_95,
    READINGS_PER_BLOCK,
    Array,
    Fitter,
    Mask,
    Prediction,
    blocks_of,
    checked,
    fit_least_squares,
    fit_network,
)

#: A displacement that moves less than this does not move [um].
STILL = 1e-6
#: A model is trusted where its held-out error is at most this share of that of the better rival without temperatures...
TRUSTED_SHARE = 0.7
#: ...and where the blocks agree on that: nearly all of the protection against a chance likeness is in the share above...
LEVEL = 0.2
#: ...and where its 95 % interval holds at least this share of the readings left out.
TRUSTED_COVERAGE = 0.85


@dataclass(frozen=True)
class Score:
    """How a model does on readings it has not seen.

    rmse, mean_rmse, time_rmse [um]: of the model, of the mean of the readings left in, and of a straight line in time across the
    block; coverage: share of the readings inside the 95 % interval; squares, rival_squares (blocks,) [um^2]: mean square error of
    each block, of the model and of the better of the two rivals; prediction: what was said of every reading when it was left out.
    """

    rmse: float
    mean_rmse: float
    time_rmse: float
    coverage: float
    squares: Array
    rival_squares: Array
    prediction: Prediction

    @property
    def rival_rmse(self) -> float:
        """Error of the better rival without temperatures [um]."""
        return min(self.mean_rmse, self.time_rmse)

    @property
    def chance(self) -> float:
        """P value of blocks agreeing this well on a model no better than its rival: t test on the logarithms of their errors."""
        return _chance(self.squares, self.rival_squares)


def score(temperatures: Array, displacement: Array, fit: Fitter) -> Score:
    """Error of fit(temperatures (N, S) [degC], displacement (N,) [um]) on contiguous blocks left out in turn.

    Raises ValueError as the fits do, and where a block has fewer than READINGS_PER_BLOCK readings.
    """
    temperatures, displacement = checked(temperatures, displacement)
    n = len(displacement)
    if n < BLOCKS * READINGS_PER_BLOCK:
        raise ValueError(f"{n} readings: at least {BLOCKS * READINGS_PER_BLOCK} are needed to leave blocks out")
    mean, deviation, average, line = (np.empty(n) for _ in range(4))
    folds = blocks_of(n)
    for left_in, left_out in folds:
        predicted = fit(temperatures[left_in], displacement[left_in]).predict(temperatures[left_out])
        mean[left_out], deviation[left_out] = predicted.mean, predicted.deviation
        average[left_out] = displacement[left_in].mean()
        line[left_out] = _across(displacement, left_in, left_out)
    squares, by_mean, by_line = ((guess - displacement) ** 2 for guess in (mean, average, line))
    rival = by_mean if by_mean.mean() <= by_line.mean() else by_line
    inside = np.abs(mean - displacement) <= NORMAL_95 * deviation
    return Score(
        rmse=math.sqrt(float(squares.mean())),
        mean_rmse=math.sqrt(float(by_mean.mean())),
        time_rmse=math.sqrt(float(by_line.mean())),
        coverage=float(inside.mean()),
        squares=np.array([squares[out].mean() for _, out in folds]),
        rival_squares=np.array([rival[out].mean() for _, out in folds]),
        prediction=Prediction(mean, deviation),
    )


def _across(displacement: Array, left_in: Mask, left_out: Mask) -> Array:
    """Straight line in time across a block, from the mean of a few readings before it to that of a few after; level at the ends."""
    where, few = np.flatnonzero(left_out), max(READINGS_PER_BLOCK // 2, 1)
    index = np.flatnonzero(left_in)
    before, after = index[index < where[0]][-few:], index[index > where[-1]][:few]
    ends = [(group.mean(), displacement[group].mean()) for group in (before, after) if len(group)]
    return np.asarray(np.interp(where, [at for at, _ in ends], [value for _, value in ends]))


def _chance(squares: Array, rival_squares: Array) -> float:
    """One-sided p value of the t test that errors (blocks,) are no smaller than a rival's, by their logarithms."""
    tiny = 1e-12 * float(rival_squares.max()) + 1e-300
    gain = np.log((rival_squares + tiny) / (squares + tiny))
    deviation = float(gain.std(ddof=1)) / math.sqrt(len(gain))
    if deviation == 0.0:
        return 0.0 if gain[0] > 0.0 else 1.0
    return float(student.sf(float(gain.mean()) / deviation, len(gain) - 1))


@dataclass(frozen=True)
class Verdict:
    """Which model to trust: "network", "least squares" or "neither"; why, in words; the scores, None on too few readings."""

    choice: str
    reason: str
    network: Score | None = None
    least_squares: Score | None = None


def compare(temperatures: Array, displacement: Array) -> Verdict:
    """Score both models on temperatures (N, S) [degC] and displacement (N,) [um], and say which to trust.

    Too few readings are a verdict, not an error; ValueError only on shapes that do not fit or values that are not finite.
    """
    if len(displacement) < BLOCKS * READINGS_PER_BLOCK:
        return Verdict(
            "neither", f"{len(displacement)} readings are too few: {BLOCKS * READINGS_PER_BLOCK} are needed to leave blocks out"
        )
    found = verdict(score(temperatures, displacement, fit_network), score(temperatures, displacement, fit_least_squares))
    if found.choice == "neither":
        return found
    held = later_coverage(temperatures, displacement, fit_network if found.choice == "network" else fit_least_squares)
    if held < TRUSTED_COVERAGE:
        why = f"{found.choice}: on the last quarter, predicted from what was before, its 95 % interval holds {100.0 * held:.0f} %"
        return replace(found, choice="neither", reason=f"{why}: something drifts or lags")
    return found


def later_coverage(temperatures: Array, displacement: Array, fit: Fitter) -> float:
    """Share of the last quarter of a record inside the 95 % interval of a model fitted to the first three.

    Blocks left out between others are predicted well by a model that a slow drift or a lag will leave behind; the end is not.
    """
    cut = 3 * len(displacement) // 4
    predicted = fit(temperatures[:cut], displacement[:cut]).predict(temperatures[cut:])
    return float(np.mean(np.abs(predicted.mean - displacement[cut:]) <= NORMAL_95 * predicted.deviation))


def verdict(network: Score, least_squares: Score) -> Verdict:
    """Which of two scored models to trust: the better one, if it may be trusted at all; least squares where they are alike."""
    doubts = {"network": _doubt(network), "least squares": _doubt(least_squares)}
    scores = {"network": network, "least squares": least_squares}
    good = [name for name, doubt in doubts.items() if not doubt]
    if not good:
        reason = "; ".join(f"{name}: {doubt}" for name, doubt in doubts.items())
        return Verdict("neither", reason, network, least_squares)
    ahead = network.rmse <= 0.9 * least_squares.rmse
    choice = good[0] if len(good) == 1 else "network" if ahead else "least squares"
    own, other = scores[choice], "least squares" if choice == "network" else "network"
    reason = (
        f"error {own.rmse:.3g} um on readings left out, against {own.rival_rmse:.3g} um without temperatures; "
        f"its 95 % interval holds {100.0 * own.coverage:.0f} %; {other} {scores[other].rmse:.3g} um"
    )
    return Verdict(choice, reason + (f", but {doubts[other]}" if doubts[other] else ""), network, least_squares)


def _doubt(own: Score) -> str:
    """Why a model may not be trusted, or nothing."""
    if not own.rival_rmse > STILL:
        return "the displacement does not move"
    if own.rmse > TRUSTED_SHARE * own.rival_rmse:
        rival = "their mean" if own.mean_rmse <= own.time_rmse else "a straight line in time"
        return f"error {own.rmse:.3g} um on readings left out, {rival} alone gives {own.rival_rmse:.3g} um"
    if own.chance > LEVEL:
        return f"the blocks left out do not agree that it helps (chance {own.chance:.2g})"
    if own.coverage < TRUSTED_COVERAGE:
        return f"its 95 % interval holds {100.0 * own.coverage:.0f} % of the readings left out"
    return ""
