"""What happens in one run of several only: the machine that is learnt from them is not that run's."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermofast as tf
from thermofast.learning.foretold import Foretold
from thermofast.machine.learnt import carry
from thermofast.models.joint import RATE
from thermofast.observing.observe import observe

TAUS, RISES = (40.0, 46.0, 52.0), (8.0, 10.0, 7.0)


def run(seed, load=1.0, step=None):
    """Three lumps by scipy's solver, their heat half as large again from `step` on."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 361.0)
    table = {"time_min": time}
    for i, (tau, rise) in enumerate(zip(TAUS, RISES, strict=True)):

        def law(t, y, tau=tau, rise=rise):
            return (load * rise * (1.5 if step is not None and t > step else 1.0) - y) / tau

        whole = solve_ivp(law, (0.0, 360.0), [0.0], t_eval=time, max_step=1.0, rtol=1e-8)
        table[f"T{i}"] = 20.0 + whole.y[0] + rng.normal(0.0, 0.02, len(time))
    return table


@pytest.fixture(scope="module")
def learnt():
    runs = [run(1), run(2, 1.05, step=150.0), run(3, 0.95)]
    return runs, tf.improve(runs, together=True, auto=True)


def test_a_step_of_one_run_is_told_and_left_out_of_the_machines_course(learnt):
    said = {r.message for r in learnt[1].records}
    assert any("load_step: an event of" in m and "alone, and its course is left out of the machine's" in m for m in said)
    assert len(learnt[1].model.file.past.stretches) == 2


def test_the_next_run_is_foretold_as_if_the_step_had_never_been(learnt):
    new = {n: c[:46] for n, c in run(4).items()}
    told = tf.identify(new, model=learnt[1].model)
    for one, rise in zip(told, RISES, strict=True):
        assert one.steady_state_lo_c < 20.0 + rise < one.steady_state_hi_c
        assert one.steady_state_c == pytest.approx(20.0 + rise, abs=0.15)


def test_runs_of_one_machine_are_not_of_two_for_a_step_in_one():
    """Beside a second mass in all of them the step, late in one, is named by nothing, and bends that run's rate to a fifth."""
    runs = [run(1), run(2, 1.05, step=200.0), run(3, 0.95)]
    for table in runs:
        for name in ("T0", "T1", "T2"):
            rise = table[name] - 20.0
            late = np.zeros_like(rise)
            for k in range(1, len(late)):
                late[k] = late[k - 1] + (rise[k] - late[k - 1]) / 200.0
            table[name] = 20.0 + rise + 0.3 * late
    told = tf.diagnose(runs, together=True, effects=["second_mode", "load_step"])
    assert not any("two machines" in r.message for r in told)


@pytest.mark.proof
def test_what_a_probe_that_drifts_shows_is_not_learnt_as_the_machines_course(monkeypatch):
    """T1 goes up by 0.36 K an hour in every run: the rates that are learnt are those of the lumps."""

    def drifting(seed, load=1.0):
        table = run(seed, load)
        return table | {"T1": table["T1"] + 0.006 * table["time_min"]}

    monkeypatch.setattr("thermofast.discovery.together.from_first_part", lambda *_: Foretold(True))
    found = tf.improve([drifting(1), drifting(2, 1.05), drifting(3, 0.95)], together=True, add=["sensor_drift"])
    rates = {shape.channel: shape.rate_per_min for shape in found.model.file.past.shapes}
    assert [1.0 / rates[name] for name in ("T0", "T1", "T2")] == pytest.approx(TAUS, rel=0.02)


def test_why_too_few_runs_can_be_used_is_told():
    short = {n: c[:16] for n, c in run(2).items()}
    for ask in (tf.improve, tf.diagnose):
        with pytest.raises(tf.UsageError, match=r"1 that can be used; .*16 readings; at least 24 are needed"):
            ask([run(1), short], together=True)


def _bodies(seed, load=1.0, slow=False, switched=None):
    """Three bodies by Euler's steps, each with a slow mass of its own or none; the cooling grows by half at a minute."""
    rng, sizes, n = np.random.default_rng(seed), np.random.default_rng(5), 3
    rate, rise = 1.0 / sizes.uniform(30, 50, n), sizes.uniform(8, 15, n)
    behind = sizes.uniform(140, 180, n)
    warm, mass, found = np.zeros(n), np.zeros(n), []
    for minute in np.arange(0.0, 300.1, 0.25):
        found.append(warm)
        more = 1.5 if switched is not None and minute >= switched else 1.0
        flow = rate * rise * load - rate * more * warm - (0.35 * rate * (warm - mass) if slow else 0.0)
        mass = mass + 0.25 * (warm - mass) / behind
        warm = warm + 0.25 * flow
    readings = np.array(found)[::4] + 20.0 + rng.normal(0.0, 0.03, (301, n))
    return tf.read({"time_min": np.arange(301.0)} | {f"T{i}": readings[:, i] for i in range(n)}, name=f"run {seed}")


@pytest.mark.proof
@pytest.mark.parametrize("slow", [False, True])
def test_an_event_of_the_run_learnt_from_is_found_again_only_where_it_happened(slow):
    """A curve that a slow mass bends is nearer to a cooling that was switched than the constants are, which were let go beside it."""
    model = tf.improve(_bodies(1, slow=slow, switched=150.0), add="cooling_switch").model
    second = _bodies(2, 1.2, slow)
    plain, found = (tf.identify(second, model=known, until=60, at=200) for known in (None, model))
    for alone, beside in zip(plain, found, strict=True):
        for name in ("steady_state_{}_c", "t95_{}_min", "at_{}_c"):
            (low, high), (mine, most) = [[getattr(r, name.format(side)) for side in ("lo", "hi")] for r in (alone, beside)]
            least = 0.02 * (high - low)  # how fast the machine is sets the grid on which both are worked out
            assert mine <= low + least
            assert most >= high - least
    runs = (second, _bodies(2, 1.2, slow, 60.0))
    without, again = (tf.identify(run, model=model, until=120)[0].message for run in runs)
    assert "cooling_switch: found in this run too" in again
    assert "found in this run too" not in without
    assert "cooling_switch: an event of the run learnt from; not seen in the readings used here" in without
    assert (
        "learnt from one run in which something happened (cooling_switch): what slower masses do may be hidden in it, and"
        in without
    )


def test_beside_an_event_that_happened_again_the_machine_stays_as_it_was_learnt():
    """Twenty minutes after it the readings alone tell the rates three times less surely; its constants had been let go of."""
    model = tf.improve(_bodies(1, switched=150.0), add="cooling_switch").model
    learnt = np.array([n.value for n in model.file.base if n.name == "rate"])
    for seed in (3, 4, 5):
        carried = carry(model.file, observe(_bodies(seed, 1.2, switched=60.0), until_min=80.0).seen, "again", "model")
        assert "cooling_switch: found in this run too" in carried.notes
        assert carried.fit.values[RATE] == pytest.approx(learnt, rel=0.002)


def test_what_may_hide_in_a_run_is_said_of_other_runs_and_of_one_alone():
    """Of the run learnt from nothing is foretold, and two runs show what they have in common."""
    once, again = (_bodies(seed, switched=150.0) for seed in (1, 2))
    alone = tf.improve(once, add="cooling_switch").model
    both = tf.improve([once, again], add="cooling_switch", together=True).model
    said = [
        tf.identify(run, model=known, until=120)[0].message for run, known in ((again, alone), (once, alone), (_bodies(3), both))
    ]
    assert ["may be hidden in it" in message for message in said] == [True, False, False]
