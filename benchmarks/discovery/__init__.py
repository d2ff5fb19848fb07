"""Whether the effect that is missing is named, and nothing else."""
