"""The forward run of any drive, in numpy: the readable twin of ``_forward.pyx``, and its fallback.

Rows are independent lumps; columns are readings. See docs/architecture.md for the picture.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: No interval is cut into more pieces than this.
MOST_SUBSTEPS = 256
#: Fastest rate times substep that the Runge-Kutta rule is used with: an error of 1e-5 of the rise.
STEP = 0.3
#: Times the exponent, the share of its excess over the surroundings by which a temperature may move in one step that takes the
#: loss for straight.
BENDS = 0.05
#: Temperature difference at which a nonlinear loss equals the linear one [K] (physics of the catalogue).
REFERENCE_K = 40.0


def forward(
    time: Array,
    rate: Array,
    rise: Array,
    start: Array,
    heat: Array,
    loss: Array,
    sink: Array,
    exponent: Array,
    hidden: Array,
    hidden_rate: Array,
    links: Array,
    linked: Array,
    lag: Array,
    delay: Array,
    out: Array,
) -> None:
    """Readings out (B, N) of B lumps at times (N,) [min].

    dT/dt = rate [rise heat - loss g (T - sink)] - sum hidden (T - Z) - (links T - linked), g = (|T - sink| / 40 K)^exponent,
    dZ/dt = hidden_rate (T - Z), Z(0) = T(0) = start; the reading follows T with time constant `lag`, `delay` minutes late.

    rate, rise, start, exponent, links, lag, delay are (B,); hidden, hidden_rate (B, H), one column a hidden mass; heat, loss
    (1 or B, N) are means over the interval that ends at each reading; sink, linked (1 or B, N) are values at the readings,
    straight in between. links is the sum of the couplings to measured neighbours, linked that of coupling times temperature.
    """
    rows, n = out.shape
    shape = (rows, n)
    heat, loss, sink, linked = (np.broadcast_to(a, shape) for a in (heat, loss, sink, linked))
    masses = (hidden != 0.0).sum(axis=1)
    simple = (exponent == 0.0) & (masses <= 1)
    # Of a row with one mass: which.
    one = np.argmax(hidden != 0.0, axis=1) if hidden.shape[1] else np.zeros(rows, dtype=int)
    pick = np.arange(rows), one
    coupling, follow = (v[pick] if v.shape[1] else np.zeros(rows) for v in (hidden, hidden_rate))
    temperature, reading = start.copy(), start.copy()
    mass = np.repeat(start[:, None], hidden.shape[1], axis=1)
    slope = np.zeros(shape)
    out[:, 0] = start

    def moves(T: Array, Z: Array, k: int, s: Array, q: Array) -> Array:
        above = T - s
        g = loss[:, k] * np.where(exponent == 0.0, 1.0, ((np.abs(above) + 1e-9) / REFERENCE_K) ** exponent)
        change: Array = rate * (rise * heat[:, k] - g * above) - (hidden * (T[:, None] - Z)).sum(axis=1) - (links * T - q)
        return change

    for k in range(1, n):
        dt = float(time[k] - time[k - 1])
        lam = rate * loss[:, k] + links
        a = lam * dt
        small = a < 1e-3
        safe = np.where(small, 1.0, lam)
        phi = np.where(small, dt * (1.0 - 0.5 * a + a * a / 6.0), -np.expm1(-a) / safe)
        psi = np.where(small, dt * dt * (0.5 - a / 6.0 + a * a / 24.0), (dt - phi) / safe)
        u0 = rate * (rise * heat[:, k] + loss[:, k] * sink[:, k - 1]) + linked[:, k - 1]
        u1 = rate * (rise * heat[:, k] + loss[:, k] * sink[:, k]) + linked[:, k]
        exact, exact_mass = temperature * np.exp(-a) + u0 * phi + (u1 - u0) / dt * psi, mass.copy()
        pair = (masses == 1) & simple
        if pair.any():
            w, good = _two_lumps(lam, coupling, follow, dt)
            pair &= good
            ramp, own = (u1 - u0) / dt, mass[pick]
            first = w[0] * temperature + w[1] * own + w[4] * u0 + w[6] * ramp
            second = w[2] * temperature + w[3] * own + w[5] * u0 + w[7] * ramp
            exact = np.where(pair, first, exact)
            exact_mass[pick] = np.where(pair, second, own)
        direct = simple & ((masses == 0) | pair)
        begin = moves(temperature, mass, k, sink[:, k - 1], linked[:, k - 1])
        end = moves(exact, exact_mass, k, sink[:, k], linked[:, k])
        probed = _late_probe(reading, temperature, exact, begin, end, dt, lag)
        parts = (rate, loss, exponent, hidden, hidden_rate, links, sink, linked, lag)
        stepped, stepped_mass, stepped_probe = _substeps(k, dt, temperature, mass, reading, parts, moves, direct)
        temperature, mass = np.where(direct, exact, stepped), np.where(direct[:, None], exact_mass, stepped_mass)
        reading = np.where(lag > 0.0, np.where(direct, probed, stepped_probe), temperature)
        out[:, k] = reading
        follows = (temperature - reading) / np.where(lag > 0.0, lag, 1.0)
        slope[:, k] = np.where(lag > 0.0, follows, moves(temperature, mass, k, sink[:, k], linked[:, k]))
    still = np.repeat(start[:, None], hidden.shape[1], axis=1)
    slope[:, 0] = np.where(lag > 0.0, 0.0, moves(start, still, 1, sink[:, 0], linked[:, 0]))
    for b in np.flatnonzero(delay > 0.0):
        out[b] = _late(time, out[b].copy(), slope[b], float(delay[b]))


def _substeps(
    k: int, dt: float, T: Array, Z: Array, y: Array, parts: tuple[Array, ...], moves: Any, direct: NDArray[np.bool_]
) -> tuple[Array, Array, Array]:
    """One interval by the classical Runge-Kutta rule, each row in its own number of equal pieces.

    What neighbours hold closely, without masses and with a prompt probe, needs no smaller pieces by :func:`_rosenbrock`.
    """
    rate, loss, exponent, hidden, hidden_rate, links, sink, linked, lag = parts
    own = np.where(direct, 0.0, rate * loss[:, k] * (1.0 + exponent))
    fast = own + np.where(direct, 0.0, (hidden + np.where(hidden != 0.0, hidden_rate, 0.0)).sum(axis=1) + links)
    few, pieces = (_pieces(f, dt) for f in (own, fast))
    held = (few * STEP < fast * dt) & ~direct & (hidden == 0.0).all(axis=1) & (lag == 0.0)
    begun, above = T, np.abs(T - sink[:, k - 1]) + 1e-9
    moved = exponent * np.abs(moves(T, Z, k, sink[:, k - 1], linked[:, k - 1])) * dt
    held &= moved < BENDS * above * np.maximum(1.0, links * dt)
    pieces = np.where(held, few, pieces)
    for i in range(int(pieces.max())):
        live = i < pieces
        h = dt / pieces
        ds, dq = (sink[:, k] - sink[:, k - 1]) / pieces, (linked[:, k] - linked[:, k - 1]) / pieces
        s, q = sink[:, k - 1] + i * ds, linked[:, k - 1] + i * dq
        hm = h[:, None]
        k1, z1 = moves(T, Z, k, s, q), hidden_rate * (T[:, None] - Z)
        T2, Z2 = T + 0.5 * h * k1, Z + 0.5 * hm * z1
        k2, z2 = moves(T2, Z2, k, s + 0.5 * ds, q + 0.5 * dq), hidden_rate * (T2[:, None] - Z2)
        T3, Z3 = T + 0.5 * h * k2, Z + 0.5 * hm * z2
        k3, z3 = moves(T3, Z3, k, s + 0.5 * ds, q + 0.5 * dq), hidden_rate * (T3[:, None] - Z3)
        T4, Z4 = T + h * k3, Z + hm * z3
        k4, z4 = moves(T4, Z4, k, s + ds, q + dq), hidden_rate * (T4[:, None] - Z4)
        T1 = T + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        Z1 = Z + hm / 6.0 * (z1 + 2.0 * z2 + 2.0 * z3 + z4)
        y1 = _late_probe(y, T, T1, k1, moves(T1, Z1, k, s + ds, q + dq), h, lag)
        T, Z, y = np.where(live, T1, T), np.where(live[:, None], Z1, Z), np.where(live, y1, y)
    if held.any():
        T = np.where(held, _rosenbrock(k, dt, begun, parts, moves, Z, pieces), T)
    return T, Z, y


def _pieces(fast: Array, dt: float) -> Array:
    """Number of equal pieces of an interval, a power of two, in which a rate (B,) times the piece is at most STEP."""
    return np.array([min(MOST_SUBSTEPS, 1 << max(0, math.ceil(math.log2(max(f * dt / STEP, 1.0))))) for f in fast])


def _rosenbrock(k: int, dt: float, T: Array, parts: tuple[Array, ...], moves: Any, Z: Array, pieces: Array) -> Array:
    """One interval by an exponential rule of fourth order: what is linear where a piece begins, however fast, is exact.

    T' = f(t, T) = J (T - T0) + v (t - t0) + f0 + the rest, that J and v leave: with the phi functions of J h and its value at
    3/4 of the piece. V. T. Luan, "Fourth-order two-stage explicit exponential integrators for time-dependent PDEs", Applied
    Numerical Mathematics 112 (2017) 91.
    """
    rate, loss, exponent, _, _, links, sink, linked, _ = parts
    ds, dq = (sink[:, k] - sink[:, k - 1]) / dt, (linked[:, k] - linked[:, k - 1]) / dt
    h = dt / pieces
    for i in range(int(pieces.max())):
        s, q = sink[:, k - 1] + i * h * ds, linked[:, k - 1] + i * h * dq
        bend = (1.0 + exponent) * rate * loss[:, k] * ((np.abs(T - s) + 1e-9) / REFERENCE_K) ** exponent
        f0, J, v = moves(T, Z, k, s, q), -bend - links, dq + bend * ds
        part, whole = _phis(0.75 * h * J), _phis(h * J)
        T2 = T + 0.75 * h * (part[0] * f0 + 0.75 * h * part[1] * v)
        rest = moves(T2, Z, k, s + 0.75 * h * ds, q + 0.75 * h * dq) - f0 - J * (T2 - T) - 0.75 * h * v
        after = T + h * (whole[0] * f0 + h * whole[1] * v + 32.0 / 9.0 * whole[2] * rest)
        T = np.where(i < pieces, after, T)
    return T


def _phis(z: Array) -> tuple[Array, Array, Array]:
    """phi_1, phi_2 and phi_3 of z <= 0: e^z = 1 + z phi_1, phi_1 = 1 + z phi_2, phi_2 = 1/2 + z phi_3."""
    small = z > -0.05
    safe = np.where(small, -1.0, z)
    third = (1.0 + z * (1.0 + z * (1.0 + z * (1.0 + z / 7.0) / 6.0) / 5.0) / 4.0) / 6.0
    first = np.where(small, 1.0 + z * (0.5 + z * third), np.expm1(safe) / safe)
    second = np.where(small, 0.5 + z * third, (first - 1.0) / safe)
    return first, second, np.where(small, third, (second - 0.5) / safe)


def _two_lumps(lam: Array, hidden: Array, r: Array, dt: float) -> tuple[list[Array], NDArray[np.bool_]]:
    """Exact weights of one step of T' = u - lam T - hidden (T - Z), Z' = r (T - Z), u straight; and where modes are apart."""
    a = lam + hidden
    square = (a - r) ** 2 + 4.0 * hidden * r
    good = square > 1e-8 * (a + r) ** 2
    root = np.sqrt(np.where(good, square, 1.0))
    l1 = -0.5 * (a + r + root)
    l2 = -(lam * r) / (0.5 * (a + r + root))
    e1, e2 = np.exp(l1 * dt), np.exp(l2 * dt)
    safe = np.where(l2 * dt < -1e-12, l2, -1.0)
    f1, f2 = np.expm1(l1 * dt) / l1, np.where(l2 * dt < -1e-12, np.expm1(l2 * dt) / safe, dt)
    g1 = (f1 - dt) / l1
    g2 = np.where(l2 * dt < -1e-5, (f2 - dt) / safe, dt * dt * (0.5 + l2 * dt / 6.0))
    d = l1 - l2
    # Projectors (A - l2)/d and (l1 - A)/d with A = [[-a, hidden], [r, -r]].
    weights = [
        (e1 * (-a - l2) + e2 * (l1 + a)) / d,
        (e1 - e2) * hidden / d,
        (e1 - e2) * r / d,
        (e1 * (-r - l2) + e2 * (l1 + r)) / d,
        (f1 * (-a - l2) + f2 * (l1 + a)) / d,
        (f1 - f2) * r / d,
        (g1 * (-a - l2) + g2 * (l1 + a)) / d,
        (g1 - g2) * r / d,
    ]
    return weights, good


def _late_probe(y: Array, T0: Array, T1: Array, s0: Array, s1: Array, h: Array | float, lag: Array) -> Array:
    """A first-order probe one step on, exactly, while its object moves along the cubic of these ends and slopes."""
    lag = np.where(lag > 0.0, lag, 1.0)
    c = (3.0 * (T1 - T0) / h - 2.0 * s0 - s1) / h
    d = (2.0 * (T0 - T1) / h + s0 + s1) / h**2
    first = T0 - lag * (s0 - lag * (2.0 * c - lag * 6.0 * d))
    last = T1 - lag * (s1 - lag * (2.0 * c + 6.0 * d * h - lag * 6.0 * d))
    moved: Array = last + (y - first) * np.exp(-h / lag)
    return moved


def _late(time: Array, curve: Array, slope: Array, delay: float) -> Array:
    """The curve `delay` minutes later; cubic between readings, its first value before."""
    at = time - delay
    j = np.clip(np.searchsorted(time, at, "left") - 1, 0, len(time) - 2)
    dt = time[j + 1] - time[j]
    x = (at - time[j]) / dt
    value: Array = (
        curve[j] * (1.0 + 2.0 * x) * (1.0 - x) ** 2
        + slope[j] * dt * x * (1.0 - x) ** 2
        + curve[j + 1] * x * x * (3.0 - 2.0 * x)
        + slope[j + 1] * dt * x * x * (x - 1.0)
    )
    return np.where(at <= time[0], curve[0], value)


def followed(time: Array, values: Array, lag: Array, out: Array) -> None:
    """First-order followers out (B, N) of values (N,) at times (N,) with time constants lag (B,) [min]; 0 follows at once."""
    out[:, 0] = values[0]
    for k in range(1, len(time)):
        a = (time[k] - time[k - 1]) / np.where(lag > 0.0, lag, 1.0)
        E = np.exp(-a)
        phi = np.where(a > 1e-8, (1.0 - E) / np.where(a > 1e-8, a, 1.0), 1.0 - 0.5 * a)
        moved = E * out[:, k - 1] + (phi - E) * values[k - 1] + (1.0 - phi) * values[k]
        out[:, k] = np.where(lag > 0.0, moved, values[k])
