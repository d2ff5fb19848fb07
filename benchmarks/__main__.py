"""All benchmarks, one after the other: ``python -m benchmarks``."""

from . import (
    accuracy,
    auto,
    certified,
    changed,
    clean_stretches,
    disturbance,
    dominant,
    filter_table,
    imperfect,
    joint,
    loop_speed,
    past_runs,
    planning,
    real_loop,
    real_records,
    real_settling,
    speed,
    states,
    watching,
)

for part in (
    accuracy,
    disturbance,
    speed,
    certified,
    states,
    imperfect,
    past_runs,
    watching,
    planning,
    dominant,
    auto,
    changed,
    real_records,
    real_settling,
    filter_table,
    joint,
    clean_stretches,
    real_loop,
    loop_speed,
):
    print(f"\n## {part.__name__.split('.')[-1]}\n")
    part.main()
