"""The joint fit against scipy's least squares, and its errors against what many draws show."""

import numpy as np
import pytest
from machines import draw
from scipy.optimize import least_squares
from test_effects_contract import record

from thermofast.models import Observations
from thermofast.models.arrow import BEYOND, finite_slopes
from thermofast.models.effects import BUILT_IN
from thermofast.models.joint import LEVEL, RATE, Model, Part, Prior, fit_model, search
from thermofast.observing.observe import observe
from thermofast.reading import Run

KINDS = {kind.id: kind() for kind in BUILT_IN}


def stepped(seed, noise=0.02):
    rng = np.random.default_rng(seed)
    time = np.arange(300.0)
    reading = []
    for rate, rise in ((0.02, 6.0), (0.03, 9.0)):
        before = 18.0 + rise * (1.0 - np.exp(-rate * time))
        after = (
            18.0 + 1.3 * rise + (18.0 + rise * (1.0 - np.exp(-rate * 120.5)) - 18.0 - 1.3 * rise) * np.exp(-rate * (time - 120.5))
        )
        reading.append(np.where(time < 120.5, before, after) + noise * rng.standard_normal(300))
    reading = np.array(reading)
    return Observations(
        "s", ("T1", "T2"), time, reading, np.ones_like(reading), np.full(2, noise), np.zeros(2), {"room": np.full(300, 18.0)}
    )


def test_the_optimum_is_scipys():
    run = stepped(1)
    effect = KINDS["load_step"]
    fit = fit_model(run, [Part(effect, effect.choices(run)[0])], {(0, "event"): 130.0, (0, "change"): 0.1})
    model = fit.model
    sizes = fit.local.shape

    def residual(x):
        local, shared = x[: sizes[0] * sizes[1]].reshape(sizes), x[sizes[0] * sizes[1] :]
        return (model.forward(local, np.broadcast_to(shared, (2, len(shared))), np.arange(2)) - run.reading).ravel() / 0.02

    start = np.concatenate([fit.local.ravel(), fit.shared]) * 1.003
    theirs = least_squares(residual, start, x_scale="jac")
    assert (fit.rss.sum() / 0.02**2) == pytest.approx(2.0 * theirs.cost, rel=1e-4)
    assert fit.values[0, "change"] == pytest.approx(0.3, abs=0.005)
    assert fit.values[0, "event"] == pytest.approx(120.5, abs=0.5)


def test_standard_errors_are_those_that_draws_show():
    effect = KINDS["load_step"]
    found = []
    for seed in range(60):
        run = stepped(seed)
        fit = fit_model(run, [Part(effect, effect.choices(run)[0])], {(0, "event"): 125.0, (0, "change"): 0.2})
        found.append((fit.values[0, "change"], fit.deviations[0, "change"]))
    values, errors = np.array(found).T
    assert values.mean() == pytest.approx(0.3, abs=3.0 * values.std() / np.sqrt(60))
    assert errors.mean() == pytest.approx(values.std(), rel=0.3)


def test_what_is_known_holds_and_what_is_not_is_free():
    run = record(2)
    base = fit_model(run)
    precision = np.zeros((2, 3, 3))
    precision[:, 0, 0] = 1e12
    known = base.local.copy()
    known[:, 0] = np.log(0.02)
    prior = Prior(known, precision, np.zeros(0), np.zeros((0, 0)))
    fit = search(Model(run), base.local.copy(), base.shared, prior)
    assert fit.values[RATE] == pytest.approx([0.02, 0.02], rel=1e-4)
    assert not np.allclose(fit.values[LEVEL], base.values[LEVEL])


def test_a_gap_and_thinning_change_no_answer():
    case = draw(("second_mode",), np.random.default_rng(38), "clear")
    columns = case.columns
    sensors = {k: v for k, v in columns.items() if k.startswith("T")}
    whole = observe(Run("w", columns["time_min"] * 60.0, sensors, {"ambient": columns["ambient"]})).seen
    keep = (columns["time_min"] < 100.0) | (columns["time_min"] > 160.0)
    cut = observe(
        Run("c", columns["time_min"][keep] * 60.0, {k: v[keep] for k, v in sensors.items()}, {"ambient": columns["ambient"][keep]})
    ).seen
    effect = KINDS["second_mode"]
    fits = [
        fit_model(r, [Part(effect, effect.choices(r)[0])], {(0, "kappa"): np.full(4, 0.006), (0, "rate"): np.full(4, 0.006)})
        for r in (whole, cut)
    ]
    for name in ("kappa", "rate"):
        error = np.hypot(*(f.deviations[0, name] * (f.values[0, name] if name == "rate" else 1.0) for f in fits))
        assert np.all(np.abs(fits[0].values[0, name] - fits[1].values[0, name]) < 4.0 * error)
    fine = np.linspace(0.0, columns["time_min"][-1], 20 * len(columns["time_min"]))
    rng = np.random.default_rng(0)
    fast = {
        k: np.interp(fine, columns["time_min"], row) + 0.02 * rng.standard_normal(len(fine))
        for k, row in zip(sensors, case.clean, strict=True)
    }
    thinned = observe(Run("f", fine * 60.0, fast)).seen
    assert len(thinned.time) < 1000
    assert thinned.weight.max() > 5


def test_slopes_beyond_all_numbers_are_no_step_and_no_warning():
    found = finite_slopes(np.array([np.inf, np.nan, -1e200, 3.0]))
    assert found.tolist() == [BEYOND, 0.0, -BEYOND, 3.0]
    assert np.isfinite((found**2).sum())
    plain = np.array([[1.0, -2.0]])
    assert finite_slopes(plain) is plain
