"""The command line tool: reads records, joins filters and models, writes tables and pictures."""

__version__ = "0.3.0"
