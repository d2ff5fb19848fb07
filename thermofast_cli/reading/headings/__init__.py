"""What the lines above the readings of a text table say: names, units, and what stands at each channel."""
