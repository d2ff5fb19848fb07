"""Turns a logger's file into runs. Only ``source.py`` opens files; the rest are rules on text and arrays."""

from ..reading_options import Options, options_from
from .headings.called import columns_named
from .run import Guess, Run, told
from .source import read_runs

__all__ = ["Guess", "Options", "Run", "columns_named", "options_from", "read_runs", "told"]
