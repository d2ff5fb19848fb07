"""What is noise in a record, and what is not: stray readings, patterns, colour, rounding."""
