"""The temperature of each sensor at switch-off, from readings that begin later."""

from dataclasses import replace

import numpy as np

from thermofast.models import third_difference_noise
from thermofast.models.standards import temperature_at_switch_off

from ..errors import UsageError
from ..reading import Run
from ..records import IdentifyRecord

#: Probability of a second mode from which it is told.
TOLD = 0.5
#: Noises by which readings must rise, and readings from which on they are asked.
RISES, FEWEST = 10.0, 8


def after_switch_off(run: Run, start_min: float, at_min: float) -> float:
    """From when on a run is a cooling [min]: a law of one rise or fall holds from the switch-off on at the earliest.

    Raises
    ------
    UsageError: the switch-off lies behind the record's end.
    """
    end = float(run.time_s[-1]) / 60.0
    if at_min >= end:
        raise UsageError(
            f"{run.name}: --switch-off-at {at_min:g} is not before the record's end",
            found=f"{end:.4g} min",
            allowed="a time before it; negative before the first reading",
        )
    return max(start_min, at_min)


def _rises(reading: np.ndarray) -> bool:
    """Whether readings (n,) [degC] as a whole rise by far more than their noise: their last tenth above the first."""
    if len(reading) <= FEWEST:
        return False
    some = max(len(reading) // 10, 1)
    gone = float(np.median(reading[-some:]) - np.median(reading[:some]))
    return gone > RISES * third_difference_noise(reading)


def with_switch_off(record: IdentifyRecord, run: Run, at_min: float, until_min: float | None) -> IdentifyRecord:
    """The record with the temperature at switch-off, at_min after the first reading of the run, negative before it.

    Of readings after it, until `until_min` of the run where that is told. The record itself where they are too few to tell.
    """
    values = run.channels.get(record.channel)
    if values is None:
        return record
    time = run.time_s / 60.0
    good = np.isfinite(values) & (time >= at_min - 1e-9)  # a reading at that moment, too: temperatures do not jump
    if until_min is not None:
        good &= time <= until_min + 1e-9
    if good.any() and float(time[good][0]) - at_min > float(np.ptp(time[good])):
        found, why = (
            None,
            "the first reading comes longer after the switch-off than the readings last: the temperature then is not told",
        )
    elif _rises(values[good]):
        found, why = None, "the readings rise after the switch-off, when a machine cools down: the temperature then is not told"
    else:
        found, why = temperature_at_switch_off(time[good], values[good], at_min), "too few readings after the switch-off"
    if found is None:
        return replace(record, message="; ".join(filter(None, (record.message, why))))
    late = 60.0 * float(time[good][0] - at_min)
    modes = f"two modes or more (probability {found.two_modes:.2g})" if found.two_modes > TOLD else "one mode"
    said = f"at switch-off, {late:.3g} s before the first reading after it: {modes}"
    return replace(
        record,
        switch_off_min=at_min,
        switch_off_c=found.temperature,
        switch_off_lo_c=found.low,
        switch_off_hi_c=found.high,
        message="; ".join(filter(None, (record.message, said))),
    )
