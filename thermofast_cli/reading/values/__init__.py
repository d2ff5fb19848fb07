"""What the cells of a column are worth: units of temperature, faults of probes and loggers, marks beside readings."""
