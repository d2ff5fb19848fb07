"""All benchmarks, one after the other: ``python -m benchmarks``."""

from .analysis import changed, criterion, switch_off, thermal_constants, unknown_heat
from .discovery import auto, clean_stretches, dominant, loop_speed, next_experiment, real_loop, row_and_flow, several_effects
from .estimation import accuracy, certified, coarse_readings, disturbance, filter_table, joint, real_records, speed, states
from .intervals import imperfect, past_runs, planning, real_settling, watching
from .reading import corpus, reading_speed
from .scale import reports

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
    unknown_heat,
    thermal_constants,
    criterion,
    switch_off,
    corpus,
    reading_speed,
    reports,
    row_and_flow,
    several_effects,
    next_experiment,
    real_records,
    real_settling,
    filter_table,
    joint,
    coarse_readings,
    clean_stretches,
    real_loop,
    loop_speed,
):
    print(f"\n## {part.__name__.split('.')[-1]}\n")
    part.main()
