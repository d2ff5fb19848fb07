"""A prior of small slow parts, for tests of something else whose bounds slow parts of the usual size would blur."""

from dataclasses import replace

from thermofast.models.imperfection import TYPICAL

SMALL_SLOW = replace(
    TYPICAL,
    background=replace(TYPICAL.background, slow=0.02),
    strong_share=0.15,
    strong_weights=(3.0, *TYPICAL.strong_weights[1:]),
)
