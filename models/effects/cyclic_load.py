"""``cyclic_load``: a duty cycle, the hysteresis of a chiller."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..core.kernel import Array
from ..drive import Drive
from ..observations import Observations
from .base import Choice, Effect, Parameter, driven, heated


class CyclicLoad(Effect):
    """The heat is a periodic wave, of which the record holds at least three: fewer are not known to repeat."""

    id = "cyclic_load"
    summary = "the heat comes and goes: duty cycle, chiller hysteresis"
    equation = "heat(t) = 1 + depth wave(t / period - phase), wave a sine or a square of mean 0"
    tell_tale = "a spectral line"
    mistaken_for = ()
    separate = "log the duty or the power"
    reference = "response of a lump to periodic heating, Carslaw & Jaeger, Conduction of Heat in Solids, ch. 2"
    uses_sink = True
    changes_heat = True
    places = (2.0, 1.0)
    amplitude = "depth"
    parameters = (
        Parameter("depth", "1", -6.0, 6.0, 0.2, "amplitude of the heat's wave over its mean", null=0.0, typical=(0.3, 0.5)),
        Parameter(
            "period", "min", 0.0, 0.36, 0.1, "period of the wave", log=True, share=True, least_steps=2.5, typical=(0.06, 0.15)
        ),
        Parameter("phase", "1", -2.0, 3.0, 0.25, "start of the wave, in periods", belongs="run", typical=(0.0, 1.0), periodic=True),
        Parameter("duty", "1", 0.08, 0.92, 0.5, "share of the period that a square wave is on"),
    )

    def choices(self, run: Observations) -> Sequence[Choice]:
        return (
            Choice("sine", {"wave": "sine", "duty": 0.5, **driven(run)}, ("duty",)),
            Choice("square", {"wave": "square", "duty": 0.5, **driven(run)}, ("duty",), simple=False),
            Choice("square, uneven", {"wave": "square", **driven(run)}, simple=False),
        )

    def grid(self, run: Observations, choice: Choice) -> list[dict[str, float]]:
        """Periods half a line apart, each with two phases; 400 at most."""
        low, high = self.parameter("period").bounds(run)
        lines = np.arange(1.0 / high, 1.0 / low, 0.4 / run.span)
        lines = lines if len(lines) <= 300 else np.geomspace(1.0 / high, 1.0 / low, 300)
        return [{"period": float(1.0 / f), "phase": phase} for f in lines for phase in (0.0, 0.25)]

    def starts(
        self, points: list[dict[str, float]], amplitude: Array, gain: Array, most: int
    ) -> list[tuple[float, dict[str, float]]]:
        """A wave's two phases, a quarter apart, are one depth and one phase."""
        quarter, both, found = amplitude.reshape(-1, 2), gain.reshape(-1, 2).sum(axis=1), []
        left = both.copy()
        deepest = 0.9 * self.parameter("depth").high
        for _ in range(most):
            best = int(np.argmax(left))
            sine, cosine = quarter[best]
            # sin(x) sine + sin(x - 90 deg) cosine = depth sin(x - phase)
            phase = float(np.arctan2(cosine, sine) / (2 * np.pi)) % 1.0
            depth = min(float(np.hypot(sine, cosine)), deepest)
            found.append((float(both[best]), {"period": points[2 * best]["period"], "phase": phase, "depth": depth}))
            left[max(0, best - 2) : best + 3] = -1.0
        return found

    def response(self, points: list[dict[str, float]], run: Observations, rate: Array, rise: Array) -> Array | None:
        """A lump answers a wave with a wave; what its start adds decays like the curve and lies in the fit's own directions."""
        if run.heat is not None:
            return None
        omega = 2.0 * np.pi / np.array([p["period"] for p in points[::2]])
        sine, cosine = np.sin(omega[:, None] * run.time), np.cos(omega[:, None] * run.time)
        answer = (rise * rate)[:, None] / (rate[:, None] + 1j * omega)
        both = np.empty((len(rate), len(points), len(run.time)))
        both[:, ::2] = answer.real[:, :, None] * sine + answer.imag[:, :, None] * cosine
        both[:, 1::2] = answer.imag[:, :, None] * sine - answer.real[:, :, None] * cosine
        return both

    def apply(self, drive: Drive, run: Observations, p: Any) -> None:
        length = np.maximum(np.diff(run.time, prepend=run.time[0] - run.step), 1e-12)
        # All sensors share the wave: it is worked out once for each set of values, not for each row.
        values = np.concatenate([np.broadcast_to(v, p.depth.shape) for v in (p.period, p.phase, p.duty)], axis=1)
        places: dict[tuple[float, ...], int] = {}
        row = [places.setdefault(tuple(v), len(places)) for v in values.tolist()]
        period, phase, duty = np.array(list(places)).T[:, :, None]
        edges = np.concatenate([run.time[:1] - run.step, run.time]) / period - phase
        area: Array = -np.cos(2 * np.pi * edges) / (2 * np.pi) if p.wave == "sine" else _square_area(edges, duty)
        whole = np.diff(area, axis=1) * (period / length)
        drive.heat = heated(drive, p.depth * whole[row], p)


def _square_area(x: Array, duty: Any) -> Array:
    """Integral of the square wave of mean 0 (1 while on) that is on during the first `duty` of each period, at x periods."""
    rest = x - np.floor(x)
    area: Array = 2.0 * (np.minimum(rest, duty) - duty * rest)
    return area
