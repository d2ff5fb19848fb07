"""What is noise in a record, and what is not: outliers, patterns, colour, rounding."""
