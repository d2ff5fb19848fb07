"""Polynomial chaos: a cheap polynomial in place of a costly model whose inputs are uncertain, fitted to a few dozen of its runs.

All inputs are independent standard normal numbers. A physical input is made of them by the caller: ``mean + deviation * xi``
where it is normal, :func:`to_uniform` where it is uniform. A normal input is expanded in Hermite polynomials, a uniform one in
Legendre polynomials of ``2 Phi(xi) - 1``: both are orthonormal under the normal law, so that mean, variance and the shares of
the inputs in it (Sobol indices) can be read from the coefficients. Source: Zhang et al., dynamic accuracy of a harmonic reducer
(J. Beijing Univ. Aeronautics and Astronautics 44(5), 2018, 1056-1065), equations (16)-(36).
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from ..core.kernel import Array

#: An expansion that leaves more than this share of the variance unexplained, at runs it has not seen, is not to be trusted.
UNEXPLAINED = 0.05
#: Designs drawn, of which the best conditioned one is kept.
DRAWS = 50
#: Condition number of the basis at the runs above which they do not determine the coefficients.
CONDITION = 1e8


@dataclass(frozen=True)
class Chaos:
    """A fitted expansion: sum over j of coefficients[j] times the product over i of the polynomial of degree powers[j, i].

    Attributes:
        powers: (m, d) degree of each of the m terms in each of the d inputs; the first term is the constant
        coefficients: (m,) of orthonormal polynomials [unit of the output]
        uniform: numbers of the inputs that are uniform
        runs: model runs it was fitted to
        unexplained: mean square leave-one-out error over the variance of the outputs; infinite where a run is left no freedom
        moved: (runs, m) what each run's error moves the coefficients by (HC2); empty where a run is left no freedom
    """

    powers: Array
    coefficients: Array
    uniform: tuple[int, ...]
    runs: int
    unexplained: float
    moved: Array

    @property
    def dimension(self) -> int:
        """Number of inputs d."""
        return int(self.powers.shape[1])

    @property
    def degree(self) -> int:
        """Total degree of the expansion."""
        return int(self.powers.sum(axis=1).max())

    @property
    def mean(self) -> float:
        """Mean of the output, equation (30)."""
        return float(self.coefficients[0])

    @property
    def standard_deviation(self) -> float:
        """Standard deviation of the output: the root of equation (31), whose sum starts at the first term after the constant."""
        return math.sqrt(float((self.coefficients[1:] ** 2).sum()))

    @property
    def first_order(self) -> Array:
        """Share (d,) of the variance due to each input alone, equation (35); 0 where the output does not vary."""
        return self._shares((self.powers > 0) & ((self.powers > 0).sum(axis=1, keepdims=True) == 1))

    @property
    def total(self) -> Array:
        """Share (d,) of the variance in which each input has any part, alone or with others; 0 where the output does not vary."""
        return self._shares(self.powers > 0)

    def alone(self, inputs: Sequence[int]) -> float:
        """Share of the variance due to a group of inputs by themselves, together with each other or not."""
        others = np.ones(self.dimension, dtype=bool)
        others[list(inputs)] = False
        return self._share(np.asarray(~(self.powers[:, others] > 0).any(axis=1)))

    def in_all(self, inputs: Sequence[int]) -> float:
        """Share of the variance in which a group of inputs has any part."""
        return self._share(np.asarray((self.powers[:, list(inputs)] > 0).any(axis=1)))

    def ranks(self, groups: Sequence[Sequence[int]], draws: int = 2000, seed: int = 0) -> tuple[NDArray[np.int64], Array]:
        """Rank (g,) of each group by its part in the variance (:meth:`in_all`), 1 the largest, and how sure it is (g,).

        Sure is the share of wild bootstrap draws of the coefficients, each run's error with a random sign and size,
        in which the group has that very rank; nan where the errors are not known.
        """
        concerned = np.array([(self.powers[1:, list(group)] > 0).any(axis=1) for group in groups], dtype=float).T
        rank = _ranks((self.coefficients[1:] ** 2 @ concerned)[None])[0]
        if not len(self.moved):
            return rank, np.full(len(groups), np.nan)
        weights = np.random.default_rng(seed).standard_normal((draws, len(self.moved)))
        drawn = self.coefficients[1:] + (weights @ self.moved)[:, 1:]
        return rank, np.asarray((_ranks(drawn**2 @ concerned) == rank).mean(axis=0))

    def _share(self, concerned: NDArray[np.bool_]) -> float:
        squares = self.coefficients[1:] ** 2
        return float(squares[concerned[1:]].sum() / squares.sum()) if squares.sum() > 0.0 else 0.0

    @property
    def doubt(self) -> str:
        """Why the expansion must not be trusted, or nothing."""
        if math.isinf(self.unexplained):
            return f"{self.runs} runs leave {len(self.powers)} coefficients no freedom: the error of the expansion is not known"
        if self.unexplained > UNEXPLAINED:
            share, most = 100.0 * self.unexplained, 100.0 * UNEXPLAINED
            return f"{share:.0f} % of the variance is not explained at runs left out; at most {most:.0f} % may be"
        return ""

    def __call__(self, inputs: Array) -> Array:
        """Output (n,) of the expansion for standard normal inputs (n, d)."""
        return np.asarray(basis(inputs, self.powers, self.uniform) @ self.coefficients)

    def gradient(self, inputs: Array) -> Array:
        """Derivatives (n, d) of the output with respect to the standard normal inputs (n, d)."""
        points = _points(inputs, self.dimension)
        value, slope = _polynomials(points, int(self.powers.max()), self.uniform)
        columns = [value[self.powers[:, i], :, i] for i in range(self.dimension)]
        out = np.empty(points.shape)
        for i in range(self.dimension):
            product = slope[self.powers[:, i], :, i].copy()
            for k in range(self.dimension):
                if k != i:
                    product *= columns[k]
            out[:, i] = self.coefficients @ product
        return out

    def _shares(self, concerned: NDArray[np.bool_]) -> Array:
        """Share (d,) of the variance in the terms (m, d) that concern each input."""
        variance = float((self.coefficients[1:] ** 2).sum())
        return np.asarray(concerned.T @ self.coefficients**2 / variance if variance > 0.0 else np.zeros(self.dimension))


def _ranks(sizes: Array) -> NDArray[np.int64]:
    """Ranks (k, g) of sizes (k, g) in their row, 1 the largest."""
    return np.argsort(np.argsort(-sizes, axis=1, kind="stable"), axis=1) + 1


def to_uniform(inputs: Array, low: Array | float, high: Array | float) -> Array:
    """Uniform numbers between low and high, of the shape of the standard normal `inputs`."""
    from scipy.special import ndtr  # at the first use: it takes long to load

    return np.asarray(low + (np.asarray(high) - low) * ndtr(inputs))


def terms(dimension: int, degree: int) -> Array:
    """Degrees (m, d) of all terms up to a total degree, constant first; m = (d + p)! / (d! p!), equation (22).

    Raises ValueError where there is no input or the degree is below one.
    """
    if dimension < 1 or degree < 1:
        raise ValueError(f"an expansion needs at least one input and degree one, not {dimension} inputs and degree {degree}")
    rows = [np.bincount(c, minlength=dimension) for p in range(degree + 1) for c in _choices(dimension, p)]
    return np.array(rows, dtype=np.int64)


def _choices(dimension: int, degree: int) -> Iterable[Array]:
    return (np.array(c, dtype=np.int64) for c in combinations_with_replacement(range(dimension), degree))


def basis(inputs: Array, powers: Array, uniform: tuple[int, ...] = ()) -> Array:
    """Orthonormal terms (n, m) of degrees (m, d) at standard normal inputs (n, d): the matrix of equation (29).

    Raises ValueError where the inputs have another shape or are not finite.
    """
    points = _points(inputs, powers.shape[1])
    value, _ = _polynomials(points, int(powers.max()), uniform)
    out = np.ones((len(points), len(powers)))
    for i in range(powers.shape[1]):
        out *= value[powers[:, i], :, i].T
    return out


def design(dimension: int, degree: int, runs: int | None = None, seed: int = 0, uniform: tuple[int, ...] = ()) -> Array:
    """Standard normal inputs (runs, d) at which to run the model; twice as many as coefficients where `runs` is not given.

    Latin hypercubes, of which the best conditioned is kept; not the paper's points, drawn in pairs symmetric about the centre from
    the grid of the roots of the polynomials of the next degree: a polynomial of that degree vanishes at all of its roots, so that
    neither the fit nor its leave-one-out error can see such a term there, and with runs in mirrored pairs the one left out is
    told by its twin.

    Raises ValueError for fewer runs than coefficients.
    """
    powers = terms(dimension, degree)
    count = 2 * len(powers) if runs is None else runs
    if count < len(powers):
        raise ValueError(f"{count} runs do not determine {len(powers)} coefficients")
    rng = np.random.default_rng(seed)
    best, least = np.empty((0, dimension)), math.inf
    for _ in range(DRAWS):
        points = _latin(rng, count, dimension)
        condition = float(np.linalg.cond(basis(points, powers, uniform)))
        if condition < least or not len(best):
            best, least = points, condition
    return best


def fit_chaos(inputs: Array, outputs: Array, degree: int, uniform: tuple[int, ...] = ()) -> Chaos:
    """Least-squares expansion of outputs (n,) at standard normal inputs (n, d), equation (28) with the transpose in its place.

    Raises ValueError where shapes do not fit, a number is not finite, or the runs do not determine the coefficients.
    """
    points, y = np.asarray(inputs, dtype=float), np.asarray(outputs, dtype=float)
    if points.ndim != 2 or y.shape != (len(points),):
        raise ValueError(f"inputs (n, d) and outputs (n,) are needed, not {points.shape} and {y.shape}")
    if not np.isfinite(y).all():
        raise ValueError("an output is not finite")
    if any(i not in range(points.shape[1]) for i in uniform):
        raise ValueError(f"uniform inputs {uniform} of {points.shape[1]}")
    powers = terms(points.shape[1], degree)
    if len(y) < len(powers):
        raise ValueError(f"{len(y)} runs do not determine {len(powers)} coefficients")
    matrix = basis(points, powers, uniform)
    if not float(np.linalg.cond(matrix)) < CONDITION:
        raise ValueError(f"the {len(y)} runs lie such that they do not determine {len(powers)} coefficients")
    q, r = np.linalg.qr(matrix)
    # About their mean: a large constant must not drown the small rest.
    centre = float(y.mean())
    coefficients = np.linalg.solve(r, q.T @ (y - centre))
    residual = y - centre - matrix @ coefficients
    errors = _left_out(q, residual)
    variance = float(y.var(ddof=1)) if len(y) > 1 else 0.0
    unexplained = math.inf if not len(errors) else float((errors**2).mean()) / variance if variance > 0.0 else 0.0
    # Of a residual and the error at a run left out the first is too small and the second too large by the same factor.
    scatter = np.sqrt(np.abs(residual * errors)) if len(errors) else errors
    moved = np.linalg.solve(r, q.T[:, : len(scatter)] * scatter).T
    coefficients[0] += centre
    return Chaos(powers, coefficients, tuple(sorted(set(uniform))), len(y), unexplained, moved)


def _left_out(q: Array, residual: Array) -> Array:
    """Error (n,) at each run when it is left out; q (n, m) spans the terms at the runs. Empty where a run is left no freedom."""
    free = 1.0 - (q**2).sum(axis=1)
    return np.empty(0) if float(free.min()) < 1e-9 else residual / free


def _points(inputs: Array, dimension: int) -> Array:
    points = np.asarray(inputs, dtype=float)
    if points.ndim != 2 or points.shape[1] != dimension:
        raise ValueError(f"inputs (n, {dimension}) are needed, not {points.shape}")
    if not np.isfinite(points).all():
        raise ValueError("an input is not finite")
    return points


def _polynomials(points: Array, degree: int, uniform: tuple[int, ...]) -> tuple[Array, Array]:
    """Orthonormal polynomials and their slopes (degree + 1, n, d) at standard normal points (n, d)."""
    value, slope = hermite(points, degree)
    if uniform:
        from scipy.special import ndtr

        own = list(uniform)
        value[:, :, own], inner = legendre(2.0 * ndtr(points[:, own]) - 1.0, degree)
        slope[:, :, own] = inner * 2.0 * np.exp(-0.5 * points[:, own] ** 2) / math.sqrt(2.0 * math.pi)
    return value, slope


def hermite(x: Array, degree: int) -> tuple[Array, Array]:
    """Hermite polynomials of degrees 0..degree over the root of k!, and their slopes: (degree + 1, *x.shape), equation (18)."""
    value, slope = np.ones((degree + 1, *x.shape)), np.zeros((degree + 1, *x.shape))
    for k in range(1, degree + 1):
        before = math.sqrt(k - 1.0) * value[k - 2] if k > 1 else 0.0
        value[k] = (x * value[k - 1] - before) / math.sqrt(k)
        slope[k] = math.sqrt(k) * value[k - 1]
    return value, slope


def legendre(u: Array, degree: int) -> tuple[Array, Array]:
    """Legendre polynomials of degrees 0..degree times the root of 2k + 1, and their slopes: (degree + 1, *u.shape), |u| <= 1."""
    value, slope = np.ones((degree + 1, *u.shape)), np.zeros((degree + 1, *u.shape))
    for k in range(1, degree + 1):
        before, steep = (value[k - 2], slope[k - 2]) if k > 1 else (0.0, 0.0)
        value[k] = ((2 * k - 1) * u * value[k - 1] - (k - 1) * before) / k
        slope[k] = steep + (2 * k - 1) * value[k - 1]
    norm = np.sqrt(2.0 * np.arange(degree + 1) + 1.0).reshape(-1, *(1,) * u.ndim)
    return value * norm, slope * norm


def _latin(rng: np.random.Generator, runs: int, dimension: int) -> Array:
    """One Latin hypercube (runs, d): each input takes one value in each of `runs` slices of equal probability."""
    from scipy.special import ndtri

    slices = rng.permuted(np.tile(np.arange(runs)[:, None], (1, dimension)), axis=0)
    return np.asarray(ndtri((slices + rng.uniform(1e-6, 1.0 - 1e-6, slices.shape)) / runs))
