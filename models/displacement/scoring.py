"""How well a displacement is predicted from temperatures, on readings not used, and which method to trust."""

import math
from collections import Counter
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.stats import t as student

from .fits import BLOCKS, NORMAL_95, READINGS_PER_BLOCK, Array, Mask, Prediction
from .sample import Method, Sample

#: Runs that are needed to leave some out.
FEWEST_RUNS = 3
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
    block, or the mean of the other runs at that minute; coverage: share of the readings inside the 95 % interval; squares,
    rival_squares (folds,) [um^2]: mean square error of what was left out, of the model and of the better of the two rivals;
    prediction: what was said of every reading when it was left out; clock: the second rival, in words; fitted [um]: the error where
    all readings are used.
    """

    rmse: float
    mean_rmse: float
    time_rmse: float
    coverage: float
    squares: Array
    rival_squares: Array
    prediction: Prediction
    clock: str = "a straight line in time"
    fitted: float = math.nan

    @property
    def rival_rmse(self) -> float:
        """Error of the better rival without temperatures [um]."""
        return min(self.mean_rmse, self.time_rmse)

    @property
    def chance(self) -> float:
        """P value of blocks agreeing this well on a model no better than its rival: t test on the logarithms of their errors."""
        return _chance(self.squares, self.rival_squares)


def score(sample: Sample, method: Method) -> Score:
    """Error of a method on readings left out in turn: contiguous blocks of one run, whole runs of several.

    Raises ValueError as the method does, and on too few readings.
    """
    too_few(sample)
    n = len(sample.displacement)
    mean, deviation, average, line = (np.empty(n) for _ in range(4))
    folds, notes = sample.folds(), []
    for left_in, left_out in folds:
        predicted = method(sample, left_in)
        mean[left_out], deviation[left_out] = predicted.mean[left_out], predicted.deviation[left_out]
        average[left_out] = sample.displacement[left_in].mean()
        line[left_out] = (_across if sample.runs == 1 else _clock)(sample, left_in, left_out)
        notes.append(predicted.note)
    squares, by_mean, by_line = ((guess - sample.displacement) ** 2 for guess in (mean, average, line))
    rival = by_mean if by_mean.mean() <= by_line.mean() else by_line
    inside = np.abs(mean - sample.displacement) <= NORMAL_95 * deviation
    return Score(
        rmse=math.sqrt(float(squares.mean())),
        mean_rmse=math.sqrt(float(by_mean.mean())),
        time_rmse=math.sqrt(float(by_line.mean())),
        coverage=float(inside.mean()),
        squares=np.array([squares[out].mean() for _, out in folds]),
        rival_squares=np.array([rival[out].mean() for _, out in folds]),
        prediction=Prediction(mean, deviation, Counter(notes).most_common(1)[0][0]),
        clock="a straight line in time" if sample.runs == 1 else "the other runs at that minute",
    )


def too_few(sample: Sample) -> None:
    """Raises ValueError where readings, or runs together, are too few to leave some out."""
    n = len(sample.displacement)
    if n < BLOCKS * READINGS_PER_BLOCK:
        raise ValueError(f"{n} readings are too few: {BLOCKS * READINGS_PER_BLOCK} are needed to leave blocks out")
    if 1 < sample.runs < FEWEST_RUNS:
        raise ValueError(f"{sample.runs} runs are too few: {FEWEST_RUNS} are needed to leave runs out")


def _clock(sample: Sample, left_in: Mask, left_out: Mask) -> Array:
    """Mean of the runs left in at each minute of those left out; what a clock knows."""
    minutes = sample.minutes[left_out]
    runs = [np.flatnonzero(left_in & (sample.run == r)) for r in np.unique(sample.run[left_in])]
    return np.asarray(np.mean([np.interp(minutes, sample.minutes[rows], sample.displacement[rows]) for rows in runs], axis=0))


def _across(sample: Sample, left_in: Mask, left_out: Mask) -> Array:
    """Straight line in time across a block, from the mean of a few readings before it to that of a few after; level at the ends."""
    displacement = sample.displacement
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
    """Which method to trust, or "neither"; why, in words; scores of those that could be tried, why others could not, doubts."""

    choice: str
    reason: str
    scores: dict[str, Score] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    doubts: dict[str, str] = field(default_factory=dict)


def compare(sample: Sample, methods: dict[str, Method]) -> Verdict:
    """Score the methods by their names, the plainest first, and say which to trust.

    Too few readings, or a method that they do not bear, are a verdict, not an error.
    """
    try:
        too_few(sample)
    except ValueError as error:
        return Verdict("neither", str(error), {}, dict.fromkeys(methods, str(error)))
    scores: dict[str, Score] = {}
    refused: dict[str, str] = {}
    for name, method in methods.items():
        try:
            fitted = method(sample, np.ones(len(sample.displacement), dtype=bool)).mean - sample.displacement
            scores[name] = replace(score(sample, method), fitted=math.sqrt(float(np.mean(fitted**2))))
        except ValueError as error:
            refused[name] = str(error)
    found = replace(verdict(scores), refused=refused)
    if found.choice == "neither" or sample.runs > 1:
        return found
    held = later_coverage(sample, methods[found.choice])
    if held < TRUSTED_COVERAGE:
        why = f"{found.choice}: on the last quarter, predicted from what was before, its 95 % interval holds {100.0 * held:.0f} %"
        return replace(found, choice="neither", reason=f"{why}: something drifts or lags")
    return found


def later_coverage(sample: Sample, method: Method) -> float:
    """Share of the last quarter of a record inside the 95 % interval of a method that may use the first three.

    Blocks left out between others are predicted well by a model that a slow drift or a lag will leave behind; the end is not.
    """
    used = np.arange(len(sample.displacement)) < 3 * len(sample.displacement) // 4
    try:
        predicted = method(sample, used)
    except ValueError:
        return 0.0
    inside = np.abs(predicted.mean - sample.displacement) <= NORMAL_95 * predicted.deviation
    return float(np.mean(inside[~used]))


def verdict(scores: dict[str, Score]) -> Verdict:
    """Which of scored methods to trust: the best, if it may be trusted at all; an earlier one that is all but as good before it."""
    doubts = {name: _doubt(one) for name, one in scores.items()}
    good = [name for name, doubt in doubts.items() if not doubt]
    if not good:
        reason = "; ".join(f"{name}: {doubt}" for name, doubt in doubts.items()) or "no method could be tried"
        return Verdict("neither", reason, scores, doubts=doubts)
    least = min(scores[name].rmse for name in good)
    choice = next(name for name in good if 0.9 * scores[name].rmse <= least)
    own = scores[choice]
    others = [
        f"not {name}: {doubts[name]}" if doubts[name] else f"{name} {one.rmse:.3g} um"
        for name, one in scores.items()
        if name != choice
    ]
    reason = (
        f"error {own.rmse:.3g} um on readings left out, against {own.rival_rmse:.3g} um without temperatures; "
        f"its 95 % interval holds {100.0 * own.coverage:.0f} %"
    )
    return Verdict(choice, "; ".join([reason, *others]), scores, doubts=doubts)


def _doubt(own: Score) -> str:
    """Why a model may not be trusted, or nothing."""
    if not own.rival_rmse > STILL:
        return "the displacement does not move"
    if own.rmse > TRUSTED_SHARE * own.rival_rmse:
        rival = "their mean" if own.mean_rmse <= own.time_rmse else own.clock
        return f"error {own.rmse:.3g} um on readings left out, {rival} alone gives {own.rival_rmse:.3g} um"
    if own.chance > LEVEL:
        return f"the readings left out do not agree that it helps (chance {own.chance:.2g})"
    if own.coverage < TRUSTED_COVERAGE:
        return f"its 95 % interval holds {100.0 * own.coverage:.0f} % of the readings left out"
    return ""
