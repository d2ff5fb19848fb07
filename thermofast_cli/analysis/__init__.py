"""Around the result: sensitivity, displacement, simulated records."""
