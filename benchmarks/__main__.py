"""All benchmarks, one after the other: ``python -m benchmarks``."""

from . import accuracy, certified, disturbance, loop_speed, real_loop, real_records, speed, states

for part in (accuracy, disturbance, speed, certified, states, real_records, real_loop, loop_speed):
    print(f"\n## {part.__name__.split('.')[-1]}\n")
    part.main()
