"""Runs that are not yet: simulated, planned, proposed."""
