"""Comparisons of runs, hidden heat, thermal constants, denoised curves and validated models."""
