"""Types of the compiled forward run."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

def forward(
    time: Array,
    rate: Array,
    rise: Array,
    start: Array,
    heat: Array,
    loss: Array,
    sink: Array,
    exponent: Array,
    hidden: Array,
    hidden_rate: Array,
    links: Array,
    linked: Array,
    lag: Array,
    delay: Array,
    out: Array,
) -> None: ...
def followed(time: Array, values: Array, lag: Array, out: Array) -> None: ...
