"""All benchmarks, one after the other: ``python -m benchmarks``."""

from . import accuracy, certified, disturbance, speed

for part in (accuracy, disturbance, speed, certified):
    print(f"\n## {part.__name__.split('.')[-1]}\n")
    part.main()
