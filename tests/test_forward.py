"""The forward run of any drive: compiled and readable twins agree, and both agree with scipy's stiff solver."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from thermofast.models.core import _forward_numpy, kernel

FIELDS = ["rate", "rise", "start", "heat", "loss", "sink", "exponent", "hidden", "hidden_rate", "links", "linked", "lag", "delay"]


def drawn(rows, n, seed=0):
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.5, 2.0, n))

    def some(value):
        return np.where(rng.random(rows) < 0.5, 0.0, value)

    hidden = some(0.02)
    links = some(0.01)
    values = {
        "rate": rng.uniform(0.01, 0.05, rows),
        "rise": rng.uniform(3.0, 9.0, rows),
        "start": rng.uniform(15.0, 20.0, rows),
        "heat": 1.0 + 0.3 * rng.random((rows, n)),
        "loss": 1.0 + 0.3 * rng.random((1, n)),
        "sink": 18.0 + rng.random((rows, n)),
        "exponent": some(rng.uniform(0.1, 1.0, rows)),
        "hidden": np.stack([hidden, np.where(rng.random(rows) < 0.5, 0.0, 0.007)], axis=1),
        "hidden_rate": np.tile([0.01, 0.003], (rows, 1)),
        "links": links,
        "linked": links[:, None] * (20.0 + rng.random((rows, n))),
        "lag": some(2.0),
        "delay": some(3.3),
    }
    return time - time[0], values


def run(function, time, values, rows):
    out = np.empty((rows, len(time)))
    function(time, *(np.ascontiguousarray(values[f]) for f in FIELDS), out)
    return out


@pytest.mark.skipif(not kernel.COMPILED, reason="no compiler here: there is but one core")
def test_the_twins_agree_to_rounding():
    time, values = drawn(40, 80)
    assert run(kernel.forward, time, values, 40) == pytest.approx(run(_forward_numpy.forward, time, values, 40), abs=1e-11)
    lags = np.array([0.0, 5.0, 50.0])
    ours, theirs = np.empty((3, 80)), np.empty((3, 80))
    kernel.followed(time, np.ascontiguousarray(values["sink"][0]), lags, ours)
    _forward_numpy.followed(time, values["sink"][0], lags, theirs)
    assert ours == pytest.approx(theirs, abs=1e-12)


def test_the_run_is_that_of_the_differential_equation():
    rows, n = 16, 50
    time, values = drawn(rows, n, 1)
    values["delay"] = np.zeros(rows)
    curves = run(kernel.forward, time, values, rows)
    for b in range(rows):
        state = np.full(4, values["start"][b])
        for k in range(1, n):

            def slope(t, y, b=b, k=k):
                x = (t - time[k - 1]) / (time[k] - time[k - 1])
                sink = values["sink"][b, k - 1] * (1 - x) + values["sink"][b, k] * x
                linked = values["linked"][b, k - 1] * (1 - x) + values["linked"][b, k] * x
                above = y[0] - sink
                g = (abs(above) / 40.0) ** values["exponent"][b] if values["exponent"][b] else 1.0
                heat, loss = values["rise"][b] * values["heat"][b, k], values["loss"][0, k] * g * above
                held = values["hidden"][b] @ (y[0] - y[1:3])
                own = values["rate"][b] * (heat - loss) - held - (values["links"][b] * y[0] - linked)
                late = (y[0] - y[3]) / values["lag"][b] if values["lag"][b] else own
                return [own, *(values["hidden_rate"][b] * (y[0] - y[1:3])), late]

            state = solve_ivp(slope, time[k - 1 : k + 1], state, rtol=1e-9, atol=1e-9).y[:, -1]
            assert curves[b, k] == pytest.approx(state[3] if values["lag"][b] else state[0], abs=5e-4)


def test_a_bent_loss_beside_a_neighbour_that_holds_closely():
    """Couplings of 0.5 to 4 a minute, read every minute: no pieces of an interval are needed, and no accuracy is lost."""
    rng = np.random.default_rng(4)
    rows, n = 6, 60
    time, values = np.arange(float(n)), drawn(6, 60, 4)[1]
    links = np.array([0.5, 1.0, 2.0, 4.0, 0.4, 3.0])
    neighbour = 20.0 + 6.0 * -np.expm1(-time / 25.0) + 0.2 * np.cumsum(rng.normal(0.0, 0.1, (rows, n)), axis=1)
    values |= {"exponent": np.array([0.2, 0.5, 1.0, 0.25, 0.01, 1.5]), "links": links, "linked": links[:, None] * neighbour}
    values |= {"hidden": np.zeros((rows, 2)), "lag": np.zeros(rows), "delay": np.zeros(rows), "sink": np.full((rows, n), 14.0)}
    values["start"] = neighbour[:, 0].copy()
    curves = run(kernel.forward, time, values, rows)
    assert curves == pytest.approx(run(_forward_numpy.forward, time, values, rows), abs=1e-11)
    for b in range(rows):
        state = values["start"][b : b + 1]
        for k in range(1, n):

            def slope(t, y, b=b, k=k):
                above, x = y - 14.0, t - time[k - 1]
                held = links[b] * (y - neighbour[b, k - 1] * (1.0 - x) - neighbour[b, k] * x)
                bent = values["loss"][0, k] * (np.abs(above) / 40.0) ** values["exponent"][b] * above
                return values["rate"][b] * (values["rise"][b] * values["heat"][b, k] - bent) - held

            state = solve_ivp(slope, (0.0 + time[k - 1], time[k]), state, rtol=1e-10, atol=1e-10).y[:, -1]
            assert curves[b, k] == pytest.approx(state[0], abs=2e-5)


def test_a_delay_shifts_the_curve():
    time = np.linspace(0.0, 200.0, 201)
    values = {f: np.zeros(1) for f in FIELDS}
    values |= {"rate": np.array([0.02]), "rise": np.array([8.0]), "start": np.array([18.0]), "delay": np.array([7.3])}
    values |= {f: np.zeros((1, 0)) for f in ("hidden", "hidden_rate")}
    values |= {f: np.ones((1, 201)) for f in ("heat", "loss")} | {"sink": np.full((1, 201), 18.0), "linked": np.zeros((1, 201))}
    late = run(kernel.forward, time, values, 1)[0]
    exact = 18.0 + 8.0 * (1.0 - np.exp(-0.02 * np.maximum(time - 7.3, 0.0)))
    assert late == pytest.approx(exact, abs=2e-7)
