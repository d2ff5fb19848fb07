"""What a fit may claim: is it down to the noise, does the record determine its parameters, could chance have done it?"""

import math
from dataclasses import dataclass

import numpy as np

from ..core.kernel import Array
from ..core.tails import chi2_tail
from ..effects.base import Effect, Parameter
from ..joint import RATE, Fit, Part
from ..noise.rounding import cell_residual
from ..noise.whiteness import pattern_p_value, variance_inflation
from .rules import RULES

#: How the doubt of an amplitude near nothing ends.
NEAR = "standard errors of no effect"


def sensor_p_values(fit: Fit) -> Array:
    """P values (S,): would white noise leave residuals as patterned as these? 0 where they are far larger than the noise."""
    run = fit.run
    values = np.ones(run.sensors)
    residual = fit.unrounded
    for i in range(run.sensors):
        used = run.used[i]
        n = int(used.sum())
        if n < 12:
            continue
        root = np.sqrt(run.weight[i][used])
        values[i] = pattern_p_value(residual[i][used] * root, fit.tangent(i) * root[:, None], _input_noise(fit, i))
        if values[i] < RULES.pattern and _coarse(fit, i):
            values[i] = max(values[i], _in_cells(fit, i)[0])
        if fit.rmse[i] <= RULES.rounding * run.resolution[i]:
            values[i] = 1.0
        largest = RULES.too_large * max(float(run.noise[i]), run.resolution[i] / math.sqrt(12.0)) * (1.0 + 3.0 / math.sqrt(n))
        if math.sqrt(fit.rss[i] / n) > largest:
            values[i] = 0.0
    return values


def rounded_residual(fit: Fit, sensor: int) -> Array | None:
    """Residuals (N,) [K] beside a logger's rounding, where that explains their pattern; else None."""
    used = fit.run.used[sensor]
    if int(used.sum()) < 12 or not _coarse(fit, sensor):
        return None
    p, told = _in_cells(fit, sensor)
    if p < RULES.pattern:
        return None
    whole = np.zeros(len(used))
    whole[used] = told
    return whole


def _in_cells(fit: Fit, sensor: int) -> tuple[float, Array]:
    """P value of the residuals (n used,) [K] of the curve that suits the cells of rounded readings best, and they."""
    used, step = fit.run.used[sensor], float(fit.run.resolution[sensor])
    tangent = fit.tangent(sensor)
    told = cell_residual(fit.run.reading[sensor][used], fit.curve[sensor][used], tangent, step)
    if np.abs(told).max() <= RULES.rounding * step:
        return 1.0, told
    return pattern_p_value(told, tangent, _input_noise(fit, sensor)), told


def _coarse(fit: Fit, sensor: int) -> bool:
    """Whether a sensor's residuals may be the logger's rounding alone: single readings, and no more than that leaves."""
    run, step = fit.run, float(fit.run.resolution[sensor])
    weight = run.weight[sensor][run.used[sensor]]
    return step > 0.0 and float(np.ptp(weight)) == 0.0 and float(fit.rss[sensor] / fit.dof[sensor]) < weight[0] * (0.5 * step) ** 2


def least_p(floor: Array) -> float:
    """The smaller of the least p value (S,) times the number of sensors, and Fisher's combination of all."""
    together = chi2_tail(2 * len(floor), float(-2.0 * np.log(np.maximum(floor, 1e-300)).sum()))
    return min(1.0, 2.0 * min(float(floor.min()) * len(floor), together))


def widening(fit: Fit) -> float:
    """How many times as large as under white noise the errors of slow parameters are, with residuals as coloured as these.

    The root of the number of dependent readings that count as one (Bartlett); 1 for a model that is down to the noise.
    """
    if least_p(sensor_p_values(fit)) >= RULES.pattern:
        return 1.0
    run = fit.run
    factors = [variance_inflation((np.sqrt(w) * r)[used]) for r, w, used in zip(fit.residual, run.weight, run.used, strict=True)]
    return math.sqrt(float(np.median(factors)))


def _input_noise(fit: Fit, sensor: int) -> float:
    """Low-frequency variance, relative to the sensor's noise, that the noise of the inputs puts into the model's curve."""
    total, own = 0.0, max(float(fit.run.noise[sensor]), 1e-9)
    for p, part in enumerate(fit.model.parts):
        if part.concerns(fit.run.sensors)[sensor]:
            named = {k[1]: float(np.ravel(v)[sensor if np.ndim(v) else 0]) for k, v in fit.values.items() if k[0] == p}
            rate = float(fit.values[RATE][sensor])
            total += (part.effect.borrowed_noise(fit.run, part.choice, sensor, rate, named) / own) ** 2
    return total


def log_ratio(before: Array, after: Array, dof: Array, floor: Array | float = 1e-12) -> Array:
    """Twice the log-likelihood ratio (S,) of residual sums of squares after over before (S,) [K^2]."""
    return np.asarray(dof * np.log((before + floor) / (after + floor)))


def likelihood_ratios(before: Fit, after: Fit, careful: bool = True) -> Array:
    """Log-likelihood ratios times two (S,) of `after` over `before`.

    The smaller of that of the readings as they are and that without the logger's rounding: a model may imitate the pattern of
    the rounding, or bend so that its correction helps; it gains by neither. Not careful, for telling rivals that are all down to
    the noise apart: without the rounding alone, which sees finer.
    """
    run = before.run
    floor = (run.resolution**2 / 12.0) * np.maximum(before.readings, 1) * 1e-3 + 1e-12
    plain = log_ratio(before.rss, after.rss, after.dof, floor)
    rss = [(run.weight * f.unrounded**2).sum(axis=1) for f in (before, after)]
    corrected = log_ratio(rss[0], rss[1], after.dof, floor)
    return np.asarray(np.minimum(plain, corrected) if careful else corrected)


def chance(effect: Effect, own: Array, free: int, trials: float) -> float:
    """Probability that an effect which is not there gains this much on a record of this many sensors.

    own (S,) gains by sensor (0 where not concerned), `free` parameters in all or per sensor, `trials` the effective number of
    independent places at which it was looked for (docs/false-alarms.md tells how these were found).
    """
    if effect.scope == "run":
        return min(1.0, trials * chi2_tail(free, float(own.sum())))
    best = float(own.max(initial=0.0))
    single = min(1.0, trials * len(own) * chi2_tail(free, best))
    if effect.scope == "one":
        return single
    summed = min(1.0, trials * chi2_tail(free * len(own), float(own.sum())))
    return min(1.0, 2.0 * min(single, summed))


@dataclass(frozen=True)
class Identifiability:
    """Whether the record determines an effect's parameters, and why not.

    near: all that speaks against it is that its amplitude is near nothing by the curvature there, which a ridge (an effect that
    depends on surroundings that nobody logged) makes of a plain effect too.
    """

    ok: bool
    why: str = ""

    @property
    def near(self) -> bool:
        return not self.ok and self.why.endswith(NEAR)


def identifiability(fit: Fit) -> Identifiability:
    """No flat direction, no parameter at a bound, none that another one imitates, no scale without a value."""
    model = fit.model
    local, shared, cross = fit.covariance
    for p, part in enumerate(model.parts):
        effect = part.effect
        for j, c in enumerate(model.shared):
            if c.part != p:
                continue
            why = _doubt(
                effect, c.parameter, float(fit.shared[j]), float(shared[j, j]), model.low_shared[j], model.high_shared[j], fit
            )
            if why:
                return Identifiability(False, f"{part.id}: {why}")
            deviation = math.sqrt(max(float(shared[j, j]), 1e-300))
            others = np.sqrt(np.maximum(np.diag(shared), 1e-300))
            with np.errstate(invalid="ignore"):  # what is not determined at all is told by its own doubt
                alike = np.nan_to_num(np.abs(shared[j] / (deviation * others)))
            # Surroundings that nobody logged are known by nothing else: how large a heat is then stands or falls with them, not
            # that it is there.
            alike = alike[[k != j and other.part >= 0 for k, other in enumerate(model.shared)]]
            own = np.abs(cross[:, :, j]) / (deviation * np.sqrt(np.maximum(np.einsum("sii->si", local), 1e-300)))
            if len(alike) and alike.max() > RULES.alike:
                return Identifiability(False, f"{part.id}: {c.parameter.name} cannot be told from another parameter")
            if float(np.nan_to_num(own[model.active]).max(initial=0.0)) > RULES.alike and fit.run.sensors == 1:
                return Identifiability(False, f"{part.id}: {c.parameter.name} cannot be told from the sensor's own parameters")
        if effect.scope != "run":
            why = _own_doubts(fit, p, part, local)
            if why:
                return Identifiability(False, why)
    return Identifiability(True)


def _own_doubts(fit: Fit, p: int, part: Part, local: Array) -> str:
    """Why the sensors' own parameters of a part are not determined: nothing where at least half of the sensors' are."""
    model, found, good = fit.model, "", 0
    who = np.flatnonzero(part.concerns(fit.run.sensors))
    for i in who:
        spread = np.sqrt(np.maximum(np.diag(local[i]), 1e-300))
        why = ""
        for j, c in enumerate(model.local):
            if c.part != p or why or not model.active[i, j]:
                continue
            bounds = model.low_local[j], model.high_local[j]
            why = _doubt(part.effect, c.parameter, float(fit.local[i, j]), float(local[i, j, j]), *bounds, fit)
            others = np.flatnonzero(model.active[i] & (np.arange(len(spread)) != j))
            if float(np.abs(local[i, j, others] / (spread[j] * spread[others])).max(initial=0.0)) > RULES.alike:
                why = why or f"{c.parameter.name} cannot be told from another parameter"
        good += not why
        found = found or (f"{part.id} in {fit.run.channels[i]}: {why}" if why else "")
    return "" if 2 * good >= len(who) else found


def _doubt(effect: Effect, parameter: Parameter, value: float, variance: float, low: float, high: float, fit: Fit) -> str:
    """Why one searched parameter is not determined, or nothing."""
    if parameter.name == effect.event:  # between two readings an event may lie anywhere
        return f"{parameter.name} is at the end of the record" if value <= low or value >= high else ""
    if not variance < 1e12 or not variance >= 0.0:
        return f"{parameter.name} is not determined"
    deviation = math.sqrt(variance)
    width = high - low
    at_bound = value <= low + 1e-6 * width or value >= high - 1e-6 * width
    if parameter.name == effect.amplitude:
        scale = fit.run.span if parameter.share else 1.0
        if abs(value - (parameter.null or 0.0) * scale) < RULES.sure * deviation:
            return f"{parameter.name} is within {RULES.sure:g} {NEAR}"
        return f"{parameter.name} is at the end of its range" if at_bound else ""
    if parameter.periodic:
        return ""
    if at_bound:
        return f"{parameter.name} is at the end of its range"
    if parameter.log and deviation > RULES.vague:
        return f"{parameter.name} is known only to a factor of {math.exp(min(deviation, 20.0)):.1f}"
    return ""
