"""Every figure that the documentation states, each with one command. ``python -m benchmarks`` runs them all."""
