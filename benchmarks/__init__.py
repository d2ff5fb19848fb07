"""Every figure that the documentation states, each with one command. ``python -m benchmarks`` runs them all."""

import os

# Benchmarks fill the cores with processes: the threads of a linear algebra library under each of them would only queue.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
