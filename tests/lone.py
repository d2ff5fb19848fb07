"""One sensor through the functions that take blocks of them."""

from thermofast.estimation.identify import identify_sensors
from thermofast.estimation.sweep import sweep_sensors


def identify_sensor(run, channel, time_min, values, method, until_min=None, start_min=0.0, note="", want_trace=False):
    """As identify_sensors for one sensor, values (N,)."""
    return identify_sensors(
        run, (channel,), time_min, values[None], method, until_min, start_min, notes=(note,), want_trace=want_trace
    )[0]


def sweep_sensor(run, channel, time_min, values, method, windows, times, tolerance_c, start_min=0.0, note=""):
    """As sweep_sensors for one sensor, values (N,)."""
    return sweep_sensors(run, (channel,), time_min, values[None], method, windows, times, tolerance_c, start_min, (note,))[0]
