"""A run as a model is fitted to it: its readings prepared, its drive, and what a task of the loop asks of it."""
