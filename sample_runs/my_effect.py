"""A user's own effect, worked through in docs/add-an-effect.md: the load is not switched but ramped up."""

import numpy as np

from thermofast.models.effects import Effect, Parameter


class LoadRamp(Effect):
    """The heat grows in a straight line from `begin` on, over `length` minutes, and stays there."""

    id = "load_ramp"
    summary = "the load is ramped up, not switched"
    equation = "heat(t) = 1 + change clip((t - begin) / length, 0, 1)"
    tell_tale = "a bend without a kink, in all sensors"
    uses_sink = True
    amplitude = "change"
    parameters = (
        Parameter("change", "1", -1.0, 4.0, 0.3, "change of the heat in the end", null=0.0),
        Parameter("begin", "min", 0.0, 0.9, 0.3, "begin of the ramp", belongs="run", share=True),
        Parameter("length", "min", 0.02, 0.8, 0.2, "length of the ramp", log=True, share=True),
    )

    def apply(self, drive, run, p):
        drive.heat = drive.heat + p.change * np.clip((run.middle - p.begin) / p.length, 0.0, 1.0)
