"""Independent simulator of machine-tool warm-up temperature records with a known hidden cause.

    dT/dt = b [R heat(t) - loss(t) g(T - room) (T - room)] - sum_k kappa_k (T - Z_k);  reading = probe(T) + offset(t)

Units: time, delays in min; rates (b, kappa, lump rate) in 1/min; temperatures in K or degC; heat, loss dimensionless.
`draw` makes a case, `second_run` another run of the same machine, `simulate` turns a truth into noise-free readings.
"""

from __future__ import annotations

import copy
import itertools
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

Array = NDArray[np.float64]
Params = dict[str, Any]
Kind = tuple[str, ...]

EFFECTS: Kind = (
    "ambient",
    "second_mode",
    "load_step",
    "cooling_switch",
    "sensor_lag",
    "transport_delay",
    "nonlinear_loss",
    "neighbour_heat",
    "cyclic_load",
    "friction_decay",
    "sensor_drift",
    "reading_jump",
)
OUTSIDE: Kind = ("random_walk_heat", "hysteresis_friction", "worsening_contact")
COMPOSE = "product"  # causes that act on the heat multiply each other; "sum" adds their deviations from 1 instead
CLEAR = (3.2, 15.0)  # wanted clear_size of each effect on its own
FAINT, FAINT_PAIR = (45.0, 190.0), (45.0, 120.0)  # wanted faint_size of each effect on its own; the promise is 40..200
KNOT, DAY = 5.0, 2 * np.pi / 1440.0  # spacing of the random heat's knots [min]; one turn a day [rad/min]
OF_THE_RUN = ("event_min", "end_min", "phase", "unit", "path")  # parameters that a second run draws anew
HEAT: dict[str, Callable[[Params, float, float, float], float]] = {  # factor at time t [min] in the segment around mid
    "load_step": lambda p, mid, t, q: p["ratio"] if mid >= p["event_min"] else 1.0,
    "cyclic_load": lambda p, mid, t, q: (
        1
        + p["depth"]
        * (
            np.sign(np.sin(2 * np.pi * mid / p["period_min"] + p["phase"]))
            if p["wave"] == "square"
            else np.sin(2 * np.pi * t / p["period_min"] + p["phase"])
        )
    ),
    "friction_decay": lambda p, mid, t, q: 1 + p["a"] * np.exp(-t / p["tau_r"]),
    "random_walk_heat": lambda p, mid, t, q: 1 + p["size"] * float(p["path"](t)),
    "hysteresis_friction": lambda p, mid, t, q: 1 - p["depth"] * q,
    "planned": lambda p, mid, t, q: p["levels"][int(np.searchsorted(p["at_min"], mid))],  # a heat that is switched on purpose
}


@dataclass(frozen=True)
class Case:
    """One record and everything that is hidden in it."""

    kind: Kind  # hidden effects, () for none
    columns: dict[str, Array]  # time_min [min], T1..Tn [degC], ambient [degC]; NaN = missing cell
    noise: float  # white noise of the sensors, before rounding [K]
    step: float  # logger step [K]
    truth: Params  # machine, run and effect parameters; enough for `simulate`
    clean: Array  # (S, N) noise-free readings [degC]
    base_residual: Array  # (S, N) clean minus the best refit of L + D exp(-b t) [K]

    @property
    def clear_size(self) -> float:
        """Largest over the sensors of rms(base_residual) / noise [-]."""
        return _size(self.base_residual, self.noise, "clear")

    @property
    def faint_size(self) -> float:
        """Sum over all sensors and rows of base_residual^2 / noise^2 [-]."""
        return _size(self.base_residual, self.noise, "faint") ** 2


class Hidden(NamedTuple):
    """An effect drawn but for its amplitude: parameter `key` = origin + amplitude * unit, lo..hi if physical."""

    fixed: Params
    key: str
    unit: Any
    lo: float
    hi: float
    origin: float = 0.0

    def at(self, amplitude: float) -> Params:
        """Parameters of the effect at this amplitude."""
        return {**self.fixed, self.key: self.origin + amplitude * self.unit}


def room_at(truth: Params, t: Any) -> Any:
    """Room temperature [degC] at time t [min]: constant, or ramp + daily sine (unit: K/min and K per K of swing)."""
    p = truth["effects"].get("ambient", {"unit": (0.0, 0.0), "phase": 0.0, "swing": 0.0})
    return truth["room"] + p["swing"] * (p["unit"][0] * t + p["unit"][1] * (np.sin(DAY * t + p["phase"]) - np.sin(p["phase"])))


def simulate(truth: Params, t: Array, method: str | None = None, rtol: float = 1e-8) -> Array:
    """Noise-free readings (S, N) [degC] at times t [min], integrated piecewise: exact across steps, dead times."""
    fx: dict[str, Params] = truth["effects"]
    b, rise, end, s = truth["b"], truth["R"], float(t[-1]), len(truth["b"])
    lump, lag, link, hyst = (fx.get(k) for k in ("second_mode", "sensor_lag", "neighbour_heat", "hysteresis_friction"))
    cyc, switch, power = fx.get("cyclic_load"), fx.get("cooling_switch"), fx.get("nonlinear_loss", {"n": 0.0})["n"]
    heaters, network, wait = [(HEAT[k], p) for k, p in fx.items() if k in HEAT], np.zeros((s, s)), np.zeros((s, 1))
    on_lump, on_lag = (p["sensors"] if p else np.arange(0) for p in (lump, lag))
    ip, iq = s + len(on_lump), s + len(on_lump) + len(on_lag)
    # state: true T of the sensors, [s:ip] their lumps, [ip:iq] late probes, bearing temperature and its friction's drop
    y, relay = np.concatenate([np.full(iq, truth["T0"]), [0.0, 0.0] if hyst else []]), 0.0
    if link:
        network[link["sensors"], link["source"]] = link["kappa"]
    if "transport_delay" in fx:
        wait[fx["transport_delay"]["sensors"], 0] = fx["transport_delay"]["delay_min"]

    def rhs(now: float, v: Array, mid: float) -> Array:
        out, temp = np.empty_like(v), v[:s]
        x, q = temp - room_at(truth, now), v[iq + 1] if hyst else 0.0
        loss = switch["ratio"] if switch and mid >= switch["event_min"] else 1.0
        factors = [f(p, mid, now, q) for f, p in heaters]
        heat = np.prod(factors) if COMPOSE == "product" else 1 + sum(f - 1 for f in factors)
        out[:s] = b * (rise * heat - loss * x * (np.abs(x / 40.0) ** power if power else 1.0))
        if link:
            out[:s] += network @ temp - network.sum(1) * temp
        if lump:
            out[s:ip] = lump["rate"] * (temp[on_lump] - v[s:ip])
            out[on_lump] -= lump["kappa"] * (temp[on_lump] - v[s:ip])
        if lag:
            out[ip:iq] = (temp[on_lag] - v[ip:iq]) / lag["tau_s"]
        if hyst:  # bearing temperature over its own rise, in a housing that warms; a hot bearing's friction drops
            housing = hyst["housing"] * (1 - np.exp(-hyst["housing_rate"] * now))
            out[iq] = hyst["rate"] * (1 - hyst["drop"] * q + housing - v[iq])
            out[iq + 1] = (relay - q) / hyst["tau_q"]
        return out

    def crossing(now: float, v: Array, mid: float) -> float:
        return float(v[iq] - hyst["theta_low"] if relay else hyst["theta_high"] - v[iq])  # type: ignore[index]

    crossing.terminal = True  # type: ignore[attr-defined]
    asked = np.unique(np.maximum(t - wait, 0.0))
    states = np.empty((len(asked), len(y)))
    square = cyc and cyc["wave"] == "square"  # many short pieces: one-step method (not with late probes)
    method = method or ("DOP853" if square and not lag else "LSODA")
    longest = min(cyc["period_min"] / 4 if cyc else np.inf, KNOT if "random_walk_heat" in fx else np.inf, 10.0 if hyst else np.inf)
    jumps = [fx[k]["event_min"] for k in ("load_step", "cooling_switch") if k in fx]
    jumps += list(fx["planned"]["at_min"]) if "planned" in fx else []
    if square:
        jumps += list((np.arange(2 * end / cyc["period_min"] + 3) / 2 - cyc["phase"] / 2 / np.pi) * cyc["period_min"])
    edges = [0.0, *(x for x in sorted(jumps) if 1e-9 < x < end - 1e-9), end]
    for left, right in itertools.pairwise(edges):
        mid = 0.5 * (left + right)
        while left < right:
            here = np.flatnonzero((asked >= left) & (asked <= right))
            sol = solve_ivp(
                rhs,
                (left, right),
                y,
                method,
                np.union1d(asked[here], [left, right]),
                args=(mid,),
                events=crossing if hyst else None,
                rtol=rtol,
                atol=10 * rtol,
                max_step=longest,
            )
            got = here[asked[here] <= sol.t[-1]]
            states[got] = sol.y.T[np.searchsorted(sol.t, asked[got])]
            left, y = right, sol.y[:, -1]
            if sol.status == 1:
                left, y, relay = float(sol.t_events[0][0]), sol.y_events[0][0], 1.0 - relay

    column = np.arange(s)
    column[on_lag] = np.arange(ip, iq)
    reading = states[np.searchsorted(asked, np.maximum(t - wait, 0.0)), column[:, None]]
    contact, drift, jump = (fx.get(k) for k in ("worsening_contact", "sensor_drift", "reading_jump"))
    if contact:
        who, late = contact["sensors"], (t - contact["event_min"]) / (contact["end_min"] - contact["event_min"])
        reading[who] -= contact["loss"] * np.maximum(late, 0.0) ** contact["power"] * (reading[who] - room_at(truth, t))
    if drift:
        reading[drift["sensors"]] += drift["d"] * t
    if jump:
        reading[jump["sensors"]] += jump["jump"] * (t >= jump["event_min"])
    return reading


def base_refit_residual(t: Array, reading: Array) -> Array:
    """Reading (S, N) minus its best L + D exp(-b t), each sensor alone [K]; b from a grid, then golden section."""
    yc = reading - reading.mean(1, keepdims=True)

    def basis(log_b: Array) -> Array:
        e = np.exp(-np.exp(log_b)[:, None] * t)
        e -= e.mean(1, keepdims=True)
        return e / np.sqrt(np.einsum("in,in->i", e, e))[:, None]

    grid = np.linspace(np.log(0.05 / t[-1]), 0.0, 60)
    best, width, golden = grid[np.argmax((yc @ basis(grid).T) ** 2, axis=1)], grid[1] - grid[0], 0.5 * (5**0.5 - 1)
    lo, hi = best - width, np.minimum(best + width, grid[-1])
    for _ in range(28):
        one, two = hi - golden * (hi - lo), lo + golden * (hi - lo)
        left = np.abs(np.einsum("in,in->i", basis(one), yc)) > np.abs(np.einsum("in,in->i", basis(two), yc))
        lo, hi = np.where(left, lo, one), np.where(left, two, hi)
    e = basis(0.5 * (lo + hi))
    return yc - e * np.einsum("in,in->i", e, yc)[:, None]


def _size(residual: Array, noise: float, size: str | None) -> float:
    """clear: largest rms / noise of a sensor; faint: root of the sum of squares / noise^2 (linear in the amplitude)."""
    square = (residual / noise) ** 2
    return float(np.sqrt(square.mean(1).max() if size == "clear" else square.sum()))


def _machine(rng: Generator) -> Params:
    """A machine and its run without effects; starts near the room, in equilibrium with itself."""
    s, b, room = int(rng.integers(2, 11)), 3.0 / rng.uniform(100, 400), rng.uniform(15, 24)
    end = rng.uniform(2, 3) / b if rng.random() < 0.1 else np.clip(rng.uniform(3, 8) / b, 150, 700)
    return {
        "sensors": s,
        "b": b * rng.uniform(0.7, 1.3, s),
        "R": rng.uniform(3, 15, s),
        "room": room,
        "T0": room + rng.uniform(-0.3, 0.3),
        "load_level": 1.0,
        "duration_min": float(end),
        "effects": {},
        "dt_min": float(rng.choice([1.0, 2.0, 5.0, 0.5], p=[0.7, 0.12, 0.1, 0.08])),
    }


def _course(end: float, rng: Generator) -> Params:
    """Room course that swings 1 K peak to peak within the record: ramp [K/min], daily sine [K] and its phase [rad]."""
    while True:
        t, phase, ramp = np.linspace(0, end, 200), rng.uniform(0, 2 * np.pi), rng.uniform(-1.5, 1.5) / end
        swing = np.ptp(ramp * t + np.sin(DAY * t + phase))
        if swing > 0.7:
            return {"unit": np.array([ramp, 1.0]) / swing, "phase": phase}


def _walk(end: float, rng: Generator) -> CubicSpline:
    """Ornstein-Uhlenbeck path (70 %) or random walk on the knots, mean 0, scaled to largest size 1; function of min."""
    keep = np.exp(-KNOT / rng.uniform(20, 200)) if rng.random() < 0.7 else 1.0
    path = lfilter([1.0], [1.0, -keep], rng.standard_normal(int(np.ceil(end / KNOT)) + 2))
    path -= path.mean()
    return CubicSpline(KNOT * np.arange(len(path)), path / np.abs(path).max())


def _effect(name: str, m: Params, rng: Generator) -> Hidden:
    """Draw one effect for the machine; raises ValueError if the machine cannot show it. `sensors` count from 0."""
    s, b, end, u = m["sensors"], m["b"], m["duration_min"], rng.uniform
    event, sign, one = {"event_min": u(0.15, 0.85) * end}, rng.choice([-1.0, 1.0]), {"sensors": rng.integers(s, size=1)}
    order, up = rng.permutation(s), int(sign > 0)
    who = np.arange(s) if name == "second_mode" and rng.random() < 0.6 else np.sort(order[: rng.integers(1, s + 1)])
    some, own, slow = {"sensors": who}, u(0.5, 1.0, len(who)), u(0.1, 0.6, len(who))
    few = order[: rng.integers(1, 3) if s > 2 else 1]
    low, (short, long) = u(0.62, 0.72), (max(8.0, 6 * m["dt_min"]), min(120.0, end / 4.05))
    if name == "cyclic_load" and short >= long:
        raise ValueError("record too short for four periods")
    cycle = {
        "period_min": float(np.exp(u(*np.log([short, max(short, long)])))),
        "phase": u(0, 2 * np.pi),
        "wave": str(rng.choice(["sine", "square"])),
    }
    link = {"sensors": few, "source": rng.choice(order[len(few) :], len(few))}
    loop = {
        "rate": 1 / u(8, 25),
        "tau_q": u(2, 6),
        "drop": u(0.66, 0.8),
        "theta_low": low,
        "theta_high": low + u(0.1, 0.2),
        "housing": u(0.15, 0.25),
        "housing_rate": 2 / end,
    }
    fade = {"event_min": u(0.25, 0.6) * end, "end_min": end, "power": u(1.6, 3.0)}
    return {
        "ambient": lambda: Hidden(_course(end, rng), "swing", 1.0, 1.0, 4.0),
        "second_mode": lambda: Hidden(some | {"rate": b[who] * slow}, "kappa", b[who] * own, 0.05, 3.0),
        "load_step": lambda: Hidden(event, "ratio", sign, 0.02, (0.5, 0.6)[up], 1.0),
        "cooling_switch": lambda: Hidden(event, "ratio", sign, 0.02, (0.4, 0.7)[up], 1.0),
        "sensor_lag": lambda: Hidden(some, "tau_s", own, 0.3, 20.0),
        "transport_delay": lambda: Hidden(some, "delay_min", own, 0.3, 20.0),
        "nonlinear_loss": lambda: Hidden({}, "n", 1.0, 0.15, 0.8),
        "neighbour_heat": lambda: Hidden(link, "kappa", b[few] * u(0.5, 1.0, len(few)), 0.03, 2.0),
        "cyclic_load": lambda: Hidden(cycle, "depth", 1.0, 0.02, 0.6),
        "friction_decay": lambda: Hidden({"tau_r": min(u(0.2, 2.5) / b.mean(), end / 2.5)}, "a", 1.0, 0.2, 1.5),
        "sensor_drift": lambda: Hidden(one, "d", sign / end, 0.02, 4.0),
        "reading_jump": lambda: Hidden(one | event, "jump", sign, 0.02, 3.0),
        "random_walk_heat": lambda: Hidden({"path": _walk(end, rng)}, "size", 1.0, 0.02, 0.6),
        "hysteresis_friction": lambda: Hidden(loop, "depth", 1.0, 0.02, 0.8),
        "worsening_contact": lambda: Hidden(one | fade, "loss", 1.0, 0.01, 0.6),
    }[name]()


def _with(m: Params, effects: dict[str, Params]) -> Params:
    """The machine with these effects; under a nonlinear loss R and b keep the steady rise and about the speed."""
    g = (m["R"] / 40.0) ** effects.get("nonlinear_loss", {"n": 0.0})["n"]
    return {**m, "R": m["R"] * g, "b": m["b"] / g, "effects": effects}


def _rows(m: Params, fixed: Iterable[Params], rng: Generator) -> tuple[Array, bool]:
    """Times of the rows [min], perhaps with a missing stretch away from the events, and whether cells are missing.
    ValueError if two events are closer than 10 % of the record."""
    events, guard = sorted(p["event_min"] for p in fixed if "event_min" in p), 5 * m["dt_min"]
    if np.any(np.diff(events) < 0.1 * m["duration_min"]):
        raise ValueError("events too close")
    t, gaps = np.arange(0.0, m["duration_min"] + 1e-9, m["dt_min"]), rng.random() < 0.35
    for _ in range(20 if gaps and rng.random() < 0.7 else 0):
        left, right = np.array([0.0, rng.uniform(0.03, 0.12) * t[-1]]) + rng.uniform(0.15, 0.8) * t[-1]
        if all(not left - guard < e < right + guard for e in events):
            return t[(t < left) | (t > right)], gaps
    return t, gaps


def _amplitude(h: Hidden, grow: Callable[[float], float], wanted: Array, lo: float, rng: Generator) -> float:
    """Amplitude in lo..h.hi whose size is a target drawn from the reachable part of `wanted`; ValueError if none."""
    top = grow(h.hi)
    least, most = max(wanted[0], grow(lo) if lo and top > wanted[0] else 0.0), min(wanted[1], top)
    if least >= most:
        raise ValueError("size out of reach")
    target, below, above = rng.uniform(least, most), lo, h.hi
    a = h.hi * target / top
    for _ in range(12):
        a = a if below < a < above else 0.5 * (below + above)
        value = grow(a)
        if abs(value / target - 1) < 0.03:
            return a
        below, above = (a, above) if value < target else (below, a)
        a *= target / max(value, 1e-12)
    raise ValueError("no convergence")


def draw(kind: Kind | str, rng: Generator, size: str | None = None, second_run_of: Case | None = None) -> Case:
    """Draw a case. size: 'clear' (each effect alone and all together have clear_size >= 3), 'faint' (faint_size
    40..200 alone and together) or None (any physical amplitude). second_run_of: that machine again, rest unused."""
    if second_run_of is not None:
        return second_run(second_run_of, rng)
    kind = tuple(k for k in ((kind,) if isinstance(kind, str) else kind) if k != "none")
    if size not in ("clear", "faint", None) or not set(kind) <= {*EFFECTS, *OUTSIDE}:
        raise ValueError(f"cannot draw {kind} of size {size!r}")
    wanted = np.array(CLEAR) if size == "clear" else np.sqrt(FAINT if len(kind) < 2 else FAINT_PAIR)
    for _ in range(1000):
        m, noise, step, found = _machine(rng), rng.uniform(0.01, 0.04), float(rng.choice([0.01, 0.05])), {}
        try:
            hidden = {k: _effect(k, m, rng) for k in kind}
            t, gaps = _rows(m, (h.fixed for h in hidden.values()), rng)
            for k, h in hidden.items():

                def grow(a: float, k: str = k, h: Hidden = h) -> float:
                    return _size(base_refit_residual(t, simulate(_with(m, {k: h.at(a)}), t)), noise, size)

                found[k] = h.at(
                    _amplitude(h, grow, wanted, h.lo if size == "clear" else 0.0, rng) if size else rng.uniform(h.lo, h.hi)
                )
        except ValueError:
            continue
        case = _record(kind, _with(m, found), t, gaps, noise, step, rng)
        if not kind or not size or (case.clear_size >= 3 if size == "clear" else 40 <= case.faint_size <= 200):
            return case
    raise RuntimeError(f"no {size} draw of {kind} in 1000 attempts")


def _record(kind: Kind, truth: Params, t: Array, gaps: bool, noise: float, step: float, rng: Generator) -> Case:
    """Simulate the truth at t [min]; add noise [K], rounding to the step [K] and missing cells."""
    clean, room_noise = simulate(truth, t), rng.uniform(0.01, 0.02)
    table = np.vstack([clean, room_at(truth, t) + 0.0 * t])
    table += np.array([*[noise] * len(clean), room_noise])[:, None] * rng.standard_normal(table.shape)
    table = np.round(np.round(table / step) * step, 4)
    if gaps:
        table[rng.random(table.shape) < rng.uniform(0, 0.02)] = np.nan
    columns = {"time_min": t, **{f"T{i + 1}": row for i, row in enumerate(table[:-1])}, "ambient": table[-1]}
    return Case(kind, columns, noise, step, truth | {"ambient_noise": room_noise}, clean, base_refit_residual(t, clean))


def second_run(case: Case, rng: Generator) -> Case:
    """Another run of the same machine: same constants, ratios, sensors and amplitudes; own start (up to 1.5 K warm),
    room, load level 0.7..1.3 (scales R), duration, event times, phases, random path and noise."""
    while True:
        truth, level, room = copy.deepcopy(case.truth), rng.uniform(0.7, 1.3), rng.uniform(15, 24)
        end = max(
            truth["duration_min"] * rng.uniform(0.8, 1.2),
            4.06 * truth["effects"].get("cyclic_load", {"period_min": 0.0})["period_min"],
        )
        truth |= {
            "room": room,
            "T0": room + rng.uniform(-0.3, 1.5),
            "duration_min": end,
            "load_level": level,
            "R": truth["R"] * level / truth["load_level"],
        }
        for k, p in truth["effects"].items():
            p |= {key: value for key, value in _effect(k, truth, rng).fixed.items() if key in OF_THE_RUN}
        try:
            t, gaps = _rows(truth, truth["effects"].values(), rng)
        except ValueError:
            continue
        return _record(case.kind, truth, t, gaps, case.noise, case.step, rng)


if __name__ == "__main__":
    pairs = ["ambient second_mode", "load_step sensor_lag", "cyclic_load neighbour_heat"]
    source = np.random.default_rng(1)
    print("kind                            size    S     N    clear       faint      s")
    for ids, wish in [(x, y) for x in ["none", *EFFECTS, *OUTSIDE, *pairs] for y in ["clear"] * 5 + ["faint"] * 5]:
        begin, c = time.perf_counter(), draw(tuple(ids.split()), source, wish)
        print(
            f"{ids:32}{wish:6}{len(c.clean):3d}{c.clean.shape[1]:6d}{c.clear_size:9.2f}{c.faint_size:12.1f}"
            f"{time.perf_counter() - begin:7.2f}"
        )
