"""Fading rules: how much a filter forgets when its innovations contradict it. The other plug point of a Gaussian filter.

A rule sees the predicted covariance and the innovation of one reading and returns the updated state. Covariances are per unit
of the noise variance (the printed rule alone works in plain K^2). All updates but the printed one are in the form of
Joseph, the covariance of the gain that was really used.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass
from typing import ClassVar

import numpy as np

from .base import Array

#: Fading reported where a reading has moved for good: all that came before has lost its weight.
JUMP = 100.0
#: Settings of all rules as the compiled loop is given them, by name: a rule reads its own.
SETTINGS = np.dtype(
    [
        (name, float)
        for name in (
            "forgetting",
            "spread_forgetting",
            "gate",
            "noise_threshold",
            "wake_threshold",
            "fading_gain",
            "fading_most",
            "jump_readings",
            "weakening",
            "threshold",
            "factor",
            "process_noise",
            "noise",
        )
    ]
)


@dataclass
class Memory:
    """What a rule carries from reading to reading."""

    scale: float  # noise variance [K^2]
    seen: float  # readings behind it
    mean: float = 0.0  # running mean of the normalised innovation
    spread: float = 1.0  # running variance of it
    gated_run: float = 0.0  # signed count of readings gated in a row
    v: float = math.nan  # V_k of equation (22)
    noise: float = 1.0  # R of the printed rule
    process: float = 0.0  # Q of the printed rule
    forgotten: float = 0.0


@dataclass(frozen=True)
class Context:
    """What stays the same over a record: covariance at the start, innovations too small to matter [K]."""

    start_covariance: Array
    dead_band: float


@dataclass(frozen=True)
class Update:
    """One reading's outcome; the names are those of :class:`filters.base.Track`."""

    state: Array
    covariance: Array
    innovation_variance: float
    fading: float = 1.0
    process_noise: float = 0.0
    noise_factor: float = 1.0
    weight: float = 1.0


def joseph(state: Array, covariance: Array, innovation: float, s: float, r: float) -> tuple[Array, Array]:
    """Posterior state (n,) and covariance (n, n) for innovation variance s and noise r."""
    gain = covariance[:, 0] / s
    left = np.eye(len(state))
    left[:, 0] -= gain
    return state + gain * innovation, left @ covariance @ left.T + r * np.outer(gain, gain)


@dataclass(frozen=True)
class FadingRule(ABC):
    """Contract: ``update`` one reading; ``rule`` and ``compiled_settings`` name its compiled twin."""

    rule = "abstract"
    #: Whether the compiled loop knows this rule; where not, the readable loop is taken.
    compiled: ClassVar[bool] = True

    def memory(self, scale: float, dof: float) -> Memory:
        return Memory(scale, dof)

    @abstractmethod
    def update(self, m: Memory, state: Array, p: Array, e: float, context: Context) -> Update: ...

    @abstractmethod
    def compiled_settings(self) -> dict[str, float]:
        """Settings of the compiled twin by the names of :data:`SETTINGS`."""


@dataclass(frozen=True)
class NoFading(FadingRule):
    """The plain Kalman update."""

    rule = "none"

    def update(self, m: Memory, state: Array, p: Array, e: float, context: Context) -> Update:
        s = p[0, 0] + 1.0
        m.seen += 1.0
        m.scale += (e * e / s - m.scale) / m.seen
        return Update(*joseph(state, p, e, s, 1.0), s * m.scale)

    def compiled_settings(self) -> dict[str, float]:
        return {}


@dataclass(frozen=True)
class InnovationFading(FadingRule):
    """Conventional fading, equations (18)-(22), on the moving states alone so that it stays stable."""

    rule = "innovation"
    forgetting: float = 0.95
    weakening: float = 3.0

    def update(self, m: Memory, state: Array, p: Array, e: float, context: Context) -> Update:
        s = p[0, 0] + 1.0
        nu2 = e * e / (s * m.scale)
        square = e * e / m.scale
        m.v = square if math.isnan(m.v) else (self.forgetting * m.v + square) / (1.0 + self.forgetting)
        alpha = max(1.0, (m.v - self.weakening) / s)
        added = (alpha - 1.0) * p[0, 0]
        if alpha > 1.0:
            factor = np.ones(len(state))
            factor[0] = math.sqrt(alpha)
            p = p * np.outer(factor, factor)
            s = p[0, 0] + 1.0
            m.forgotten += math.log(alpha)
        m.seen += 1.0
        m.scale += (min(nu2, 9.0) * m.scale - m.scale) / m.seen
        return Update(*joseph(state, p, e, s, 1.0), s * m.scale, alpha, added * m.scale)

    def compiled_settings(self) -> dict[str, float]:
        return asdict(self)


@dataclass(frozen=True)
class Evidence:
    """One innovation as the adaptive rule sees it.

    nu: in its standard deviations; z: deviations of the running mean from none; threshold: those at which fading wakes;
    gated: outside the gate; matters: the mean is more than the logger's rounding.
    """

    nu: float
    z: float
    threshold: float
    caution: float
    gated: bool
    matters: bool

    @property
    def wakes(self) -> float:
        """Z over its threshold where it is beyond it, else 0."""
        return self.z / self.threshold if self.z > self.threshold and self.matters else 0.0


@dataclass(frozen=True)
class AdaptiveFading(FadingRule):
    """Adaptive fading in a form that stays stable: noise that grew, an outlier and a wrong model are told apart.

    The paper moves Q and R by the signs of the prior and posterior residual (figure 1). Here the same three causes are
    told apart by what each does to the innovations: an outlier is one far outside (gate), grown noise widens
    their spread (R follows it), a wrong model gives them a mean (the covariance fades, which is Q). Below the
    thresholds nothing moves, so that with a right model this is the plain filter.
    """

    rule = "adaptive"
    forgetting: float = 0.9
    spread_forgetting: float = 0.85
    gate: float = 5.0
    noise_threshold: float = 2.5
    wake_threshold: float = 4.0
    fading_gain: float = 0.3
    fading_most: float = 1.5
    jump_readings: float = 4.0

    def update(self, m: Memory, state: Array, p: Array, e: float, context: Context) -> Update:
        evidence = self.weigh(m, p, e, context)
        return self.apply(m, state, p, e, context, evidence, evidence.wakes)

    def weigh(self, m: Memory, p: Array, e: float, context: Context) -> "Evidence":
        """What an innovation says before anything is done about it; advances the running mean and spread."""
        s = p[0, 0] + 1.0
        nu = e / math.sqrt(s * m.scale)
        # Until the noise is known from enough readings, every threshold stands further out.
        caution = 1.0 + 5.0 / m.seen
        gate, wake_threshold = self.gate * caution, self.wake_threshold * caution
        gated = abs(nu) > gate
        if gated:
            m.gated_run = m.gated_run + math.copysign(1.0, nu) if m.gated_run * nu > 0.0 else math.copysign(1.0, nu)
        mean_c, z = 0.0, 0.0
        if not (gated and abs(m.gated_run) < 2.0):  # one outlier teaches nothing
            deviation = nu - m.mean
            m.spread = self.spread_forgetting * m.spread + (1.0 - self.spread_forgetting) * min(deviation**2, gate**2)
            # A mean counts against the spread of the moment: grown noise is no news of the physics.
            u = nu / math.sqrt(max(m.spread, 1.0))
            m.mean = self.forgetting * m.mean + (1.0 - self.forgetting) * min(max(u, -3.0), 3.0)
            z = abs(m.mean) * math.sqrt((1.0 + self.forgetting) / (1.0 - self.forgetting))
            mean_c = abs(m.mean) * math.sqrt(s * m.scale)
        if not gated:
            m.gated_run = 0.0
        return Evidence(nu, z, wake_threshold, caution, gated, mean_c > context.dead_band)

    def apply(self, m: Memory, state: Array, p: Array, e: float, context: Context, evidence: "Evidence", wakes: float) -> Update:
        """The update of one reading; `wakes` is how far the evidence stands over the threshold, 0 where nothing wakes."""
        nu, gated = evidence.nu, evidence.gated
        noise_threshold = self.noise_threshold * evidence.caution**2
        r = m.spread if m.spread > noise_threshold else 1.0
        alpha, weight = 1.0, 1.0
        if gated and abs(m.gated_run) >= self.jump_readings:  # no outlier: the readings have moved for good
            alpha, r = JUMP, 1.0
            m.gated_run, m.mean, m.spread = 0.0, 0.0, 1.0
        else:
            if gated:
                weight = 0.0
            if wakes > 0.0:
                alpha = min(1.0 + self.fading_gain * wakes**2, self.fading_most)
        added, before = 0.0, p[0, 0]
        if alpha > 1.0:
            factor = np.full(len(state), math.sqrt(alpha))
            # Forget no more than brings back what was known at the start.
            for i, (now, start) in enumerate(zip(np.diag(p), np.diag(context.start_covariance), strict=True)):
                if now * alpha > start:
                    factor[i] = math.sqrt(start / now) if start > now else 1.0
            p = p * np.outer(factor, factor)
            if alpha == JUMP:
                p[0, 0] += e * e / m.scale  # the reading is anew
            added = p[0, 0] - before
            m.forgotten += math.log(alpha)
        s = p[0, 0] + r
        if not gated and m.spread <= noise_threshold:
            m.seen += 1.0
            if alpha == 1.0:
                m.scale += (min(nu * nu, 9.0) * m.scale - m.scale) / m.seen
        if weight > 0.0:
            state, p = joseph(state, p, e, s, r)
        return Update(state, p, s * m.scale, alpha, added * m.scale, r, weight)

    def compiled_settings(self) -> dict[str, float]:
        return asdict(self)


@dataclass(frozen=True)
class PrintedFading(FadingRule):
    """The paper's gain (12), covariance (13) and, where ``adapts``, its rule for Q and R (figure 1), as printed.

    The covariance (13) is not that of the gain alpha K, so it loses definiteness as soon as alpha > 1 acts: kept for comparison.
    With one sensor the normalised residual (23)-(29) is the residual itself.
    """

    rule = "printed"
    forgetting: float = 0.95
    weakening: float = 3.0
    threshold: float = 1e-4
    factor: float = 10.0
    process_noise: float = 1e-6
    noise: float = 1e-6
    adapts: bool = True

    def memory(self, scale: float, dof: float) -> Memory:
        return Memory(1.0, dof, noise=self.noise, process=self.process_noise)

    def update(self, m: Memory, state: Array, p: Array, e: float, context: Context) -> Update:
        p = p + m.process * np.eye(len(state))
        m.v = e * e if math.isnan(m.v) else (self.forgetting * m.v + e * e) / (1.0 + self.forgetting)
        s = p[0, 0] + m.noise
        alpha = max(1.0, (m.v - self.weakening * m.noise) / s)
        posterior = e * (1.0 - alpha * p[0, 0] / s)
        if self.adapts and abs(posterior) > self.threshold:
            m.process *= self.factor if posterior < 0.0 else 1.0 / self.factor
            step = m.noise / 100.0 * (1.0 if (posterior < 0.0) == (e > 0.0) else -1.0)
            for _ in range(10000):
                if m.noise + step <= 0.0:
                    break
                m.noise += step
                s = p[0, 0] + m.noise
                posterior = e * (1.0 - alpha * p[0, 0] / s)
                if abs(posterior) <= self.threshold:
                    break
        gain = alpha * p[:, 0] / s
        return Update(state + gain * e, p - s * np.outer(gain, gain), s, alpha, m.process, m.noise)

    def compiled_settings(self) -> dict[str, float]:
        settings = asdict(self)
        return settings if settings.pop("adapts") else {**settings, "threshold": math.inf}
