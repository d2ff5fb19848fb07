"""What effects explain of a misfit, one after the other, and how what remains looks."""

import numpy as np

from thermofast.models.core.kernel import Array
from thermofast.models.joint import Fit
from thermofast.models.noise.spectral import block_means
from thermofast.models.search.discover import Discovery
from thermofast.models.search.dominant import misfit, misfit_power
from thermofast.models.swing import later_swing, swing_of

from ..errors import listed, rounded
from ..observing.task import pooled
from ..records import finite

#: A sensor holds what remains where this share of it is its own, a stretch where it is in a fifth of the record.
ALONE = 0.7
#: Correlation with a logged column from which what remains goes along with it.
ALONG = 0.7
#: Share of what a model leaves of a sensor that is not its swing, at most, where it is said to swing.
SWINGS = 0.5
#: Cycles in the record below which a disturbance is slow.
SLOW = 6


def shares(found: Discovery) -> list[dict[str, object]]:
    """Of each effect named, in the order of what they explain: share of the misfit, error on readings left out, rival."""
    if found.named is None:
        return []
    total = misfit_power(found.base)
    steps: list[dict[str, object]] = []
    if found.stages:
        before = found.base
        for stage, held in zip(found.stages, found.held[1:], strict=True):
            after = stage.fits[0]
            steps.append(_step(_added(before, after), before, after, total, pooled(held)))
            steps[-1]["evidence"] = round(stage.named.evidence, 1)
            steps[-1]["or"] = _added(before, stage.rival.shown[0].candidate.fit) if stage.rival is not None else ""
            before = after
        return steps
    new = [p.id for p in found.named.parts if p not in found.base.model.parts]
    singles = {c.parts[-1].id: c for c in found.singles}
    first = sorted(new, key=lambda i: misfit_power(singles[i].fit) if i in singles else np.inf)
    before = found.base
    for number, name in enumerate(first):
        last = number == len(first) - 1
        after = found.named.fit if last or name not in singles else singles[name].fit
        ahead = pooled(found.ahead) if last and found.ahead is not None else None
        steps.append(_step(name, before, after, total, ahead))
        before = after
    return steps


def _added(before: Fit, after: Fit) -> str:
    return "+".join(p.id for p in after.model.parts[len(before.model.parts) :])


def _step(name: str, before: Fit, after: Fit, total: float, ahead: float | None) -> dict[str, object]:
    share = (misfit_power(before) - misfit_power(after)) / total if total > 0.0 else 0.0
    return {"effect": name, "share": round(max(0.0, share), 4), "rmse_ahead_c": finite(ahead)}


def explained(found: Discovery, sensor: int) -> float | None:
    """Share of one sensor's misfit that the model named explains; None where nothing is named or nothing was missing."""
    before = float(misfit(found.base)[sensor]) ** 2
    if found.named is None or before <= 0.0:
        return None
    return round(max(0.0, 1.0 - float(misfit(found.named.fit)[sensor]) ** 2 / before), 4)


def remaining_words(fit: Fit) -> str:
    """Size and look of what a model leaves: ``0.04 K, 2.1 times the noise: slow, most of it in T2, along coolant``."""
    run, left = fit.run, misfit(fit)
    size, noise = pooled(left), pooled(run.noise)
    look = [_pace(fit)]
    power = left**2
    if run.sensors > 1 and power.max() > ALONE * power.sum():
        look.append(f"most of it in {run.channels[int(power.argmax())]}")
    stretch, cycle = _stretch(fit), cycle_of(fit)
    look += [stretch] if stretch else []
    along = _along(fit)
    look += [f"along {along}"] if along else []
    told = f"{rounded(size)} K, {rounded(size / max(noise, 1e-12))} times the noise: {', '.join(look)}"
    return f"{told}; {cycle}" if cycle else told


def _pace(fit: Fit) -> str:
    means, _ = block_means(fit.residual, fit.run.weight, fit.run.time)
    power = np.abs(np.fft.rfft(means - means.mean(axis=1, keepdims=True), axis=1)) ** 2
    slow = float(power[:, : SLOW + 1].sum() / max(float(power.sum()), 1e-300))
    return "slow" if slow > 0.5 else "quick"


def cycle_of(fit: Fit) -> str:
    """Which sensors swing with one period beside a model, in words; empty where none does."""
    run = fit.run
    seen = run.used.all(axis=0)
    found = swing_of(run.time[seen], fit.residual[:, seen], run.resolution)
    since = ""
    if found is None and (found := later_swing(run.time[seen], fit.residual[:, seen], run.resolution)) is not None:
        seen &= run.time >= found.start
        since = f" from {run.clock[seen][0]:.3g} min on at the latest"
    if found is None:
        return ""
    left, beyond = fit.residual[:, seen], fit.residual[:, seen] - found.at(run.time[seen])
    mostly = found.swings & (beyond.var(axis=1) < SWINGS * left.var(axis=1))
    who = [c for c, swings in zip(run.channels, mostly, strict=True) if swings]
    if not who:
        return ""
    return f"{listed(who)} swing{'s' if len(who) == 1 else ''} with a period of {found.period:.3g} min{since}"


def _stretch(fit: Fit) -> str:
    """The fifth of the record that holds most of what remains, if it does."""
    means, _ = block_means(fit.residual, fit.run.weight, fit.run.time)
    power = (means**2).sum(axis=0)
    width = max(1, len(power) // 5)
    sums = np.convolve(power, np.ones(width), "valid")
    first = int(sums.argmax())
    if float(sums[first]) < ALONE * float(power.sum()):
        return ""
    seen = fit.run.clock[fit.run.used.any(axis=0)]
    # Blocks lie around their own times: the last one of a stretch is where it ends.
    scale = (seen[-1] - seen[0]) / max(1, len(power) - 1)
    return f"most of it from {seen[0] + first * scale:.4g} to {seen[0] + (first + width - 1) * scale:.4g} min"


def _along(fit: Fit) -> str:
    """The logged column that what remains goes along with, if there is one."""
    run = fit.run
    seen = run.used.any(axis=0)
    mean = _over_sensors(fit.residual, run.weight)[seen]
    best, name = ALONG, ""
    for column, values in {**run.ambient, **run.inputs}.items():
        own = values[seen]
        if float(np.ptp(own)) <= 0.0 or float(np.ptp(mean)) <= 0.0:
            continue
        alike = abs(float(np.corrcoef(own, mean)[0, 1]))
        if alike > best:
            best, name = alike, column
    return name


def _over_sensors(residual: Array, weight: Array) -> Array:
    mean: Array = (residual * weight).sum(axis=0) / np.maximum(weight.sum(axis=0), 1e-300)
    return mean
