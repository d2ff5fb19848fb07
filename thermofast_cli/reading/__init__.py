"""Turns a logger's file into runs. Only ``source.py`` opens files; the rest are rules on text and arrays."""

from ..reading_options import Options, options_from
from .run import Guess, Run, told
from .source import read_runs

__all__ = ["Guess", "Options", "Run", "options_from", "read_runs", "told"]
