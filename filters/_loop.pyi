from typing import Any

from .base import Array

def run(
    step_capsule: Any,
    jacobian_capsule: Any,
    t: Array,
    y: Array,
    first: int,
    x0: Array,
    p0: Array,
    scale: float,
    dof: float,
    dead_band: float,
    rule: str,
    moments: Array,
    settings: Array,
    states: Array,
    covariances: Array,
    columns: Array,
) -> int: ...
