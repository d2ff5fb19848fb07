"""One sensor through the functions that take blocks of them."""

from thermofast.estimation.identify import identify_sensors
from thermofast.estimation.request import Question
from thermofast.estimation.sensor import Signals
from thermofast.estimation.sweep import sweep_sensors


def identify_sensor(run, channel, time_min, values, method, until_min=None, start_min=0.0, note="", want_trace=False):
    """As identify_sensors for one sensor, values (N,)."""
    signals = Signals(run, (channel,), time_min, values[None], start_min, (note,))
    return identify_sensors(signals, method, Question(until_min, details=want_trace))[0]


def sweep_sensor(run, channel, time_min, values, method, windows, times, tolerance_c, start_min=0.0, note=""):
    """As sweep_sensors for one sensor, values (N,)."""
    signals = Signals(run, (channel,), time_min, values[None], start_min, (note,))
    return sweep_sensors(signals, method, windows, times, tolerance_c)[0]
