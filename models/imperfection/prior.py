"""How far real machines leave the law of one exponential: sizes of what they do beside it, and how often.

The law y = T0 + R (1 - exp(-b t)) is a good first word about every warming body and the last word about none. What a machine
does beside it enters the fit as a Gaussian process of small known shapes with unknown sizes: a **discrepancy**. Its prior is in
two parts: a background that every machine has, and rarer strong effects, of which a record holds one or none.

Sizes are standard deviations. Those without a unit are relative to the rise R, so that they are the same for a spindle and for a
pot; times are counted in **units** of a sixtieth of the time constant, so that a machine with a time constant of an hour counts
in minutes.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: What a discrepancy is made of, in the order of the covariances of ``shapes.py``.
COMPONENTS = ("slow", "fast", "exponent", "decay", "load", "cycle", "walk", "start", "room", "ramp", "logged")
#: How fast slow modes are against the law; their own covariances stand behind those of the components.
SLOW = (0.05, 0.1, 0.2, 0.4)
#: The slowest, a large cold mass behind a weak link, is looked for by itself alone.
ALONE = 0
#: Of the variance of the slow mode at work, what each of its neighbours has: rates lie between, and one mass is not all.
NEIGHBOUR_SHARE = 0.02
ABSOLUTE = frozenset({"room", "ramp", "logged"})


@dataclass(frozen=True)
class Sizes:
    """Standard deviations of one kind of discrepancy.

    slow: modes 0.05 to 0.4 times as fast as the law's (a mass behind the one measured), in the background together; fast: modes
    1.5 to 9 times as fast, together, and ever smaller ones up to 72 times; exponent: of the loss, about 1; decay: a drive that dies
    out (running-in friction), initial share of the heat; load: of a heat that flutters with a memory of 30 units; cycle: of a heat
    that swings with a period of 6 to 45 units; walk: of a heat that wanders, per root hour of units; start: of the first minutes (a
    late or uneven start); room [K per root hour of units]: of surroundings that wander; ramp [K per hour of units]: of a room and
    of a probe that drift evenly; logged: of the gain of a room that is logged, about 1.
    """

    slow: float = 0.0
    fast: float = 0.0
    exponent: float = 0.0
    decay: float = 0.0
    load: float = 0.0
    cycle: float = 0.0
    walk: float = 0.0
    start: float = 0.0
    room: float = 0.0
    ramp: float = 0.0
    logged: float = 0.0

    def variances(self) -> tuple[Array, Array]:
        """(relative, absolute) (len(COMPONENTS),) squares of the sizes, in the order of COMPONENTS."""
        squares = np.array([getattr(self, name) ** 2 for name in COMPONENTS])
        absolute = np.array([name in ABSOLUTE for name in COMPONENTS])
        return np.where(absolute, 0.0, squares), np.where(absolute, squares, 0.0)

    def scaled(self, factor: float) -> "Sizes":
        """All sizes times `factor`."""
        return Sizes(**{f.name: factor * getattr(self, f.name) for f in fields(self)})


def _load(size: float, **others: float) -> Sizes:
    return Sizes(load=size, walk=size / 2.0, **others)


#: Strong effects, each rare; which of them a record holds is part of what is estimated.
STRONG = (
    Sizes(slow=0.4),
    Sizes(fast=0.2),
    Sizes(slow=0.2, fast=0.2),
    Sizes(slow=0.2, fast=0.2, start=0.1),
    Sizes(exponent=0.3),
    Sizes(decay=0.5),
    Sizes(ramp=0.15),
    Sizes(cycle=0.6, start=0.05),
    _load(0.1),
    _load(0.3, start=0.1),
    _load(0.1, start=0.1, slow=0.2, fast=0.1),
)


#: Share of its heat (1 sd) that a body with a strong faster or slower part follows at each of other rates, where the heat is known.
FOLLOWS = 0.2
#: How likely it is that a sensor feels a slow part of its machine that is seen to take heat.
BESIDE_SLOW = 0.5
#: A strong effect in no more than so many records is known to be rare: ``calibrate`` says so where complete runs showed none.
RARE = 0.05


@dataclass(frozen=True)
class Imperfection:
    """The prior of the discrepancy; ``TYPICAL`` is for machines that nobody knows, ``NONE`` the bare law.

    background: what every machine has, times a scale that is estimated: one of `scales`, log-normal about 1 with deviation
    `scale_spread`; `clean` of all machines have the least. strong: effects one of which a record holds with probability
    `strong_share`, in shares as `strong_weights` (alike without), each times one of `strong_scales`, over a background times one
    of `strong_over`: below the usual, else a quiet record speaks against every effect, as of what lies beneath it; a slow mode is
    one of `SLOW`. evidence_power: to which the evidence for a strong effect counts, because its shapes are caricatures;
    from_others: the share of another sensor's evidence that counts, because disturbances are common to a
    run. rate_spread: deviation of the log rate between sensors of a machine that agree; apart: probability that one does not.
    log_rate_spread: prior deviation of the log rate about the pilot's. multiplier: of all sizes. lean: mean of a strong slow
    mode's amplitude over its root mean square, in the direction of the rise: a part that is still cold takes heat and gives none,
    so that the limit is farther than the law says. factors: (time constants read, factor on half-widths), learnt from complete
    runs.
    """

    background: Sizes = Sizes(slow=0.02, fast=0.02, exponent=0.05, load=0.01, room=0.10, logged=0.3)
    strong: tuple[Sizes, ...] = STRONG
    strong_share: float = 0.3
    strong_weights: tuple[float, ...] = (5.0,) + (1.0,) * (len(STRONG) - 1)
    scales: tuple[float, ...] = (0.03, 0.08, 0.2, 0.4, 0.7, 1.1, 1.8, 3.0)
    strong_scales: tuple[float, ...] = (0.3, 1.0, 3.0)
    strong_over: tuple[float, ...] = (0.1, 0.6)
    scale_spread: float = 0.8
    clean: float = 0.1
    evidence_power: float = 0.5
    from_others: float = 0.27
    rate_spread: float = 0.05
    apart: float = 0.1
    log_rate_spread: float = 0.6
    multiplier: float = 1.0
    factors: tuple[tuple[float, float], ...] = ()
    lean: float = 0.5

    @property
    def none(self) -> bool:
        """Whether this is the bare law: no discrepancy at all."""
        return self.background == Sizes() and not self.strong

    def beside_slow(self) -> "Imperfection":
        """Of sensors of a machine of which a slow part is seen to warm: that they feel it is as likely as not."""
        weights = np.array(self.strong_weights or (1.0,) * len(self.strong))
        alone = np.array([sizes == Sizes(slow=sizes.slow) for sizes in self.strong], dtype=bool)
        share = self.strong_share * weights / max(weights.sum(), 1e-12)
        if not alone.any() or share[alone].sum() >= BESIDE_SLOW:
            return self
        found = np.where(alone, BESIDE_SLOW * weights / weights[alone].sum(), (1.0 - BESIDE_SLOW) * share)
        return replace(self, strong_share=float(found.sum()), strong_weights=tuple(found.tolist()))

    @property
    def rarely_strong(self) -> bool:
        """Whether strong effects are known to be rare, as of a lab whose complete runs were looked at."""
        return not self.none and self.strong_share <= RARE

    def factor_at(self, read: float) -> float:
        """What past runs ask half-widths to be multiplied by, `read` time constants into the record."""
        if not self.factors:
            return 1.0
        turns, factors = np.array(self.factors).T
        return float(np.interp(np.log(max(read, 1e-9)), np.log(turns), factors))

    def effects(self) -> list[tuple[int, int]]:
        """(which of `strong`, which slow mode or -1 for none) of every effect: one mass behind has one rate, which nobody knows."""
        found = []
        for i, sizes in enumerate(self.strong):
            alone = sizes == Sizes(slow=sizes.slow)
            modes = [q for q in range(len(SLOW)) if alone or q != ALONE] if sizes.slow else [-1]
            found += [(i, q) for q in modes]
        return found

    def kinds(self) -> tuple[Array, Array]:
        """(relative, absolute) (1 + effects, components + slow modes): variances of the background and of every strong effect."""
        effects = self.effects()
        both = [sizes.scaled(self.multiplier).variances() for sizes in (self.background, *(self.strong[i] for i, _ in effects))]
        none = np.zeros((len(both), len(SLOW)))
        relative = np.concatenate([np.array([relative for relative, _ in both]), none], axis=1)
        slow = COMPONENTS.index("slow")
        relative[1:, slow] *= 1.0 - self.lean**2
        for row, (_, mode) in zip(relative[1:], effects, strict=True):
            if mode >= 0:
                row[len(COMPONENTS) :] = row[slow] * np.where(np.abs(np.arange(len(SLOW)) - mode) == 1, NEIGHBOUR_SHARE, 0.0)
                row[len(COMPONENTS) + mode], row[slow] = row[slow], 0.0
        return relative, np.concatenate([np.array([absolute for _, absolute in both]), none], axis=1)

    def follows(self, share: float) -> Array:
        """(1 + effects,) variances of what a body follows of its heat at other rates, over that of the background, `share` (1 sd).

        A strong faster or slower part follows each change of the heat, and not only the first, as the shapes of its component do.
        """
        strong = (FOLLOWS / share) ** 2 if share > 0.0 else 0.0
        return np.array([1.0, *(strong if self.strong[i].slow or self.strong[i].fast else 0.0 for i, _ in self.effects())])

    def leans(self) -> Array:
        """Mean amplitude (H, slow modes), relative to the rise, of each hypothesis; that of the background is nought."""
        kind, squares, *_ = self.hypotheses()
        share = np.zeros((1 + len(self.effects()), len(SLOW)))
        for row, (i, mode) in zip(share[1:], self.effects(), strict=True):
            row[:] = self.strong[i].slow * (np.arange(len(SLOW)) == mode)
        found: Array = self.lean * self.multiplier * np.sqrt(squares)[:, None] * share[kind]
        return found

    def hypotheses(self) -> tuple[NDArray[np.intp], Array, Array, Array]:
        """(kind, scale squared, scale squared of the background under an effect, log prior), each (H,): kind 0 is the background
        alone, another that effect over the background.
        """
        effects = self.effects()
        scales, under, count = np.array(self.scales), np.array(self.strong_over), len(effects)
        weight = self._as_usual(scales)
        weight *= (1.0 - self.clean) / weight.sum()
        weight[0] += self.clean
        over = self._as_usual(under) / self._as_usual(under).sum()
        sizes, levels = (a.ravel() for a in np.meshgrid(self.strong_scales, under))
        kind = np.concatenate([np.zeros(len(scales), dtype=np.intp), np.repeat(np.arange(1, count + 1), len(sizes))])
        squares = np.concatenate([scales, np.tile(sizes, count)]) ** 2
        below = np.concatenate([np.zeros(len(scales)), np.tile(levels, count)]) ** 2
        share = self.strong_share if count else 0.0
        which, weights = np.array([i for i, _ in effects], dtype=int), self.strong_weights or (1.0,) * len(self.strong)
        apiece = np.array([weights[i] / (which == i).sum() for i in which])
        each = np.repeat(share * apiece / max(apiece.sum(), 1e-12) / len(self.strong_scales), len(sizes))
        prior = np.concatenate([(1.0 - share) * weight, each * np.tile(np.repeat(over, len(self.strong_scales)), count)])
        return kind, squares, below, np.log(np.maximum(prior, 1e-300))

    def few(self) -> NDArray[np.intp]:
        """Hypotheses enough to find where a posterior lies: every other scale of the background, each effect in its middle size."""
        count, sizes = len(self.scales), len(self.strong_scales)
        each = np.arange(len(self.effects())) * sizes * len(self.strong_over)
        middle = np.arange(len(self.strong_over))[:, None] * sizes + sizes // 2
        found: NDArray[np.intp] = np.concatenate(
            [np.arange(count)[1::2] if count > 1 else np.arange(count), (count + each + middle).ravel()]
        )
        return found

    def _as_usual(self, scales: Array) -> Array:
        """How likely sizes of the background are, against the most likely."""
        found: Array = np.exp(-0.5 * (np.log(scales) / self.scale_spread) ** 2)
        return found


TYPICAL = Imperfection()
NONE = replace(
    TYPICAL,
    background=Sizes(),
    strong=(),
    strong_weights=(),
    scales=(1.0,),
    clean=0.0,
    strong_share=0.0,
    rate_spread=0.002,
)
