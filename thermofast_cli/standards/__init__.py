"""What test standards ask of runs: stopping rules, limits, the temperature at switch-off."""
