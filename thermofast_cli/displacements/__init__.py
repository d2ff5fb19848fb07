"""Methods to tell a displacement by their names, and what ``displacement`` says of a run."""

from thermofast.models.displacement import Method, fit_least_squares, fit_network, network_by_minute, neural_network, static

from .arx import arx

#: Methods by their name in records; an earlier one is preferred where others are hardly better.
METHODS: dict[str, Method] = {
    "least squares": static(fit_least_squares),
    "network": static(fit_network),
    "arx": arx(),
    "network by minute": network_by_minute,
    "neural network": neural_network,
}
#: Those that are tried unasked, of one run and of several together.
LONE = ("least squares", "network", "arx")
TOGETHER = (*LONE, "network by minute")
