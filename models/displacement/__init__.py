"""Displacement of a machine from its temperatures: methods to tell it, and which of them to trust on readings not used."""

from .by_minute import network_by_minute
from .fits import fit_least_squares, fit_network
from .neural import neural_network
from .sample import Method, Sample, static

__all__ = ["Method", "Sample", "fit_least_squares", "fit_network", "network_by_minute", "neural_network", "static"]
