"""Turns a logger's file into a :class:`Run`. Only ``source.py`` opens files; the rest are rules on text and arrays."""

from .run import Options, Run
from .source import read_run

__all__ = ["Options", "Run", "read_run"]
