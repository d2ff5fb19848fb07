"""The discovery loop over all sensors of a run: compare, diagnose, improve."""
