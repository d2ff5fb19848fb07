"""Turns a logger's file into runs. Only ``source.py`` opens files; the rest are rules on text and arrays."""

from .run import Guess, Options, Run, told
from .source import read_runs

__all__ = ["Guess", "Options", "Run", "read_runs", "told"]
