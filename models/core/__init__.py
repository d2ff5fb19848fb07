"""Numerical cores: compiled where a compiler was, in numpy otherwise; and tails of distributions."""
