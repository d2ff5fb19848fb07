"""Events that belong to a run, or to a logged column, and not to the machine's own course."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermofast as tf
from thermofast.models.search.logged import _jumps_before
from thermofast.observing.observe import observe
from thermofast.plugins.effects import load_effect
from thermofast.plugins.guard import PluginError

RISES, TAUS = (9.0, 12.0, 7.0), (60.0, 66.0, 55.0)


def run(seed, load=1.0, minutes=400.0, step=None, pump=None, lag=0.0, interval=1.0, room=21.0):
    """Three bodies by scipy's solver: a load that falls to 0.6 at `step`, a pump that raises the loss of two from `pump` on."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, minutes + interval / 2.0, interval)
    columns = {"time_min": time}
    for i, (rise, tau) in enumerate(zip(RISES, TAUS, strict=True)):

        def slope(t, y, rise=rise, tau=tau, i=i):
            heat = load * rise * (0.6 if step is not None and t >= step else 1.0)
            loss = 1.8 if pump is not None and t >= pump and i < 2 else 1.0
            body = (heat - loss * (y[0] - room)) / tau
            return [body, (y[0] - y[1]) / max(lag, 1e-3)] if lag else [body, body]

        exact = solve_ivp(slope, (0.0, minutes), [room, room], t_eval=time, max_step=1.0, rtol=1e-7, method="LSODA").y[1]
        columns[f"T{i}"] = exact + 0.03 * rng.standard_normal(len(time))
    if pump is not None:
        columns["pump"] = (time >= pump).astype(float)
    return columns


def test_a_step_that_came_at_another_time_in_each_run_is_not_foretold():
    """The shape of such runs had the step in it: limits of a run before its step were that of after it, as `ok`."""
    runs = [tf.read(run(k, load, step=at), name=f"r{k}") for k, (load, at) in enumerate(((1.0, 180.0), (0.9, 220.0), (1.1, 260.0)))]
    found = tf.improve(runs, add="load_step", together=True)
    assert max(r.rmse_other_runs_c for r in found if r.step == 1) < 0.1  # when it came is this run's own, and known
    rows = tf.identify(tf.read(run(9, 1.05, 40.0), name="next"), model=found.model)
    for row, rise in zip(rows, RISES, strict=True):
        assert row.steady_state_lo_c <= 21.0 + 1.05 * rise <= row.steady_state_hi_c
        assert row.steady_state_hi_c - row.steady_state_lo_c < 0.6 * rise
        assert row.status == "ok"
    if found.model.file.past.without_effects:
        assert "in its runs came load_step (at 180 to 260 min)" in rows[0].message


def test_a_pump_that_is_logged_is_the_cause_though_probes_are_late():
    some = ("load_step", "cooling_switch", "sensor_lag")
    row = tf.diagnose(tf.read(run(4, pump=92.0, lag=1.2, interval=0.25, minutes=240.0)), effects=some)[0]
    assert "cooling_switch" in row.verdict.split("+")
    assert "pump" in row.message
    assert row.parameters["cooling_switch.ratio"]["value"] == pytest.approx(1.8, abs=0.1)
    assert "cooling_switch.event" not in row.parameters


def test_what_a_column_does_after_the_readings_used_names_no_cause():
    columns = run(4, pump=92.0, minutes=240.0) | {"pump": np.select([np.arange(241) < 92, np.arange(241) < 200], [0.0, 1.0], 9.0)}
    seen = observe(tf.read(columns)).seen
    early, pump = seen.until(150.0), seen.inputs["pump"]
    assert _jumps_before(early, pump, 93.0)
    assert not _jumps_before(early, pump, 97.0)
    assert not _jumps_before(early, pump, 80.0)
    assert _jumps_before(seen, pump, 202.0)
    assert not _jumps_before(early, pump, 202.0)


SEAL = """
import numpy as np
from thermofast.models.effects import Choice, Effect, Parameter


class Seal(Effect):
    id = "seal"
    summary = "heat of the seal above a speed"
    equation = "heat(t) = 1 + gain max(0, rpm - limit) / 1000"
    tell_tale = "heat above a speed alone"
    uses_sink = True
    amplitude = "gain"
    parameters = (
        Parameter("gain", "1", -1, 20, 0.5, "heat per 1000 rpm above the limit", null=0.0),
        Parameter("limit", "rpm", 500, 4000, 1500, "speed above which it heats"),
    )

    def choices(self, run):
        return (Choice("rpm", {"column": "rpm"}),) if "rpm" in run.inputs else ()

    def apply(self, drive, run, p):
        speed = np.interp(run.middle, run.time, run.inputs[p.column])
        drive.heat = drive.heat + p.gain * np.maximum(0.0, speed - p.limit) / 1000.0
"""


def test_an_effect_may_ask_for_as_much_as_a_speed_is(tmp_path):
    """At the trial's columns of 1 to 2 it does nothing, and was refused."""
    (tmp_path / "seal.py").write_text(SEAL)
    assert load_effect(str(tmp_path / "seal.py")).id == "seal"
    (tmp_path / "idle.py").write_text(SEAL.replace("p.gain * np.maximum", "0.0 * np.maximum"))
    with pytest.raises(
        PluginError, match=r"changes nothing, whatever it is .columns of the trial go from 1 to 2 and as many times"
    ):
        load_effect(str(tmp_path / "idle.py"))


def test_a_model_that_does_not_say_what_comes_is_not_ok():
    """A second mass fitted to a third of a time constant leaves open where the rise ends."""
    time, rng = np.arange(0.0, 300.0, 0.5), np.random.default_rng(8)
    line = 20.0 + 9.0 * -np.expm1(-time / 90.0)
    columns = {"time_min": time} | {f"T{i}": line + 0.02 * rng.standard_normal(len(time)) for i in range(2)}
    row = tf.compare(columns, 30, effects="second_mode")[0]
    assert row.rmse_ahead_c > 5.0 * row.noise_c
    assert row.status == "not_determined"
    assert "times the noise, within what it leaves open" in row.message
    assert tf.compare(columns, 30)[0].status == "ok"
