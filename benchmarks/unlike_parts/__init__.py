"""Machines whose parts are far apart in time: quick sources, heavy masses."""
