"""From one sensor to its record: identify, sweep, and the filters beside each other."""
