"""All benchmarks, one after the other: ``python -m benchmarks``."""

from . import (
    accuracy,
    certified,
    clean_stretches,
    disturbance,
    filter_table,
    joint,
    loop_speed,
    real_loop,
    real_records,
    speed,
    states,
)

for part in (
    accuracy,
    disturbance,
    speed,
    certified,
    states,
    real_records,
    filter_table,
    joint,
    clean_stretches,
    real_loop,
    loop_speed,
):
    print(f"\n## {part.__name__.split('.')[-1]}\n")
    part.main()
