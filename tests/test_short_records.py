"""What is read of a run decides: nothing that comes later, and constants of a machine are what they are in a short record, too."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermofast as tf
from benchmarks.discovery.dominant import runs_of
from benchmarks.machines import bar
from thermofast.experiments.next_experiment import Experiment, simulated
from thermofast.models.effects import BUILT_IN
from thermofast.models.joint import fit_model
from thermofast.observing.observe import observe

EVENTS = [kind() for kind in BUILT_IN if kind().event]


def cycling(seed: int, minutes: float, period: float = 40.0) -> dict[str, np.ndarray]:
    """Three bodies under a load that works and pauses, by scipy's solver."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, minutes + 0.25, 0.5)
    columns = {"time_min": time}
    for i, (rise, tau) in enumerate(((9.0, 60.0), (12.0, 62.0), (7.0, 58.0))):

        def slope(t, y, rise=rise, tau=tau):
            return (rise * (1.0 + 0.4 * np.sign(np.sin(2.0 * np.pi * (t / period + 0.1)))) - (y - 21.0)) / tau

        exact = solve_ivp(slope, (0.0, minutes), [21.0], t_eval=time, max_step=0.5, rtol=1e-7).y[0]
        columns[f"T{i}"] = exact + 0.02 * rng.standard_normal(len(time))
    return columns


def test_a_learnt_cycle_is_as_long_in_a_record_shorter_than_it():
    """A period of 40 min was cut to a third of what was read: of 45 min, to 16."""
    model = tf.improve(tf.read(cycling(1, 420.0), name="learnt"), add="cyclic_load").model
    whole = cycling(2, 420.0)
    cut = {name: column[whole["time_min"] <= 45.0] for name, column in whole.items()}
    alone, before = tf.identify(tf.read(cut), model=model), tf.identify(tf.read(whole), until=45, model=model)
    for a, b, limit in zip(alone, before, (30.0, 33.0, 28.0), strict=True):
        assert a.status == b.status == "ok"
        assert a.steady_state_c == pytest.approx(b.steady_state_c, abs=0.01)
        assert a.steady_state_lo_c <= limit <= a.steady_state_hi_c
        assert a.steady_state_hi_c - a.steady_state_lo_c < 3.0


def test_a_search_of_the_first_part_is_that_of_a_record_which_ends_there():
    """A load that rises by half after 74 of 120 min was looked for at places over all 420 min, and missed."""
    whole = runs_of(bar.simulate(741004, 1.0, "load_step"), 741004)[0]
    early = whole.time_s <= 7200.0
    cut = tf.read({"time_min": whole.time_s[early] / 60.0} | {n: c[early] for n, c in (whole.channels | whole.ambient).items()})
    some = ("load_step", "cooling_switch", "nonlinear_loss")
    found = [tf.diagnose(*given, effects=some)[0] for given in ((whole, 120), (cut,))]
    assert [r.verdict for r in found] == ["load_step"] * 2
    for name in ("load_step.event", "load_step.change"):
        assert found[0].parameters[name]["value"] == pytest.approx(found[1].parameters[name]["value"], rel=1e-3)


@pytest.mark.parametrize("effect", EVENTS, ids=lambda e: e.id)
def test_no_event_is_looked_for_after_what_is_read(effect):
    seen = observe(tf.read(cycling(1, 200.0))).seen.until(50.0)
    assert seen.span == pytest.approx(50.0)
    for choice in effect.choices(seen):
        assert all(point.get("event", 0.0) < 50.0 for point in effect.grid(seen, choice))


def test_a_next_run_is_as_long_as_it_is_planned():
    seen = observe(tf.read(cycling(1, 200.0))).seen.until(50.0)
    next_run = simulated(fit_model(seen), Experiment("the same run for 100 min", 4, longer=seen.span), None)
    assert next_run.time[-1] == pytest.approx(100.0)
    assert next_run.span == pytest.approx(100.0)


def test_quick_sensors_are_not_averaged_away_nor_bounded():
    """Chips of 5 s were told a running-in, or a cooling that changed: no rate above 4 per minute was looked for."""
    rng, time = np.random.default_rng(7), np.arange(0.0, 600.0, 0.25)
    columns = {
        f"T{i}": 20.0 + rise * -np.expm1(-time / tau) + rng.normal(0.0, 0.05, len(time))
        for i, (rise, tau) in enumerate(((30.0, 5.0), (18.0, 60.0), (12.0, 120.0)))
    }
    assert {r.verdict for r in tf.diagnose({"time_s": time} | columns)} == {"none"}
    fit = tf.compare({"time_s": time[:200], "T": columns["T0"][:200]})[0]
    assert fit.rmse_fit_c < 0.06


def test_what_is_likeliest_counts_before_it_is_sure():
    """A load that rises by half after 84 of 120 min: 2.7 K too high without it, and not sure enough to be named."""
    run, limits = runs_of(bar.simulate(741005, 1.0, "load_step"), 741005)[0], (31.06, 31.30, 38.11)
    for plain, row, limit in zip(tf.identify(run, until=120), tf.identify(run, until=120, auto=True), limits, strict=True):
        assert "load_step, which is likeliest and not sure, added" in row.message
        assert abs(plain.steady_state_c - limit) > 2.5
        assert abs(row.steady_state_c - limit) < 0.5
