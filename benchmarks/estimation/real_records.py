"""What identify says of the measured records in ../shared/data: ``python -m benchmarks.estimation.real_records``.

It prints the table of docs/real-records.md.
"""

from collections import Counter
from pathlib import Path

import thermofast as tf

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "data"
#: file -> sensor shown in the table
RECORDS = {
    "cooking_pot/0cm_1L_a.csv": "T5",
    "cooking_pot/20cm_3L_b.csv": "T10",
    "cooking_pot/boil_tests.csv": "water_100W_a",
    "heatshield/duty_sequence.csv": "block",
    "laptop/cooling_Test_300.csv": "GPU_Temp",
    "daisy_heating/lamp_steps.csv": "plate",
    "tclab/energy_balance.csv": "T1",
    "tclab/second_order.csv": "T2",
    "tclab/step_kelvin.csv": "T_kelvin",
    "ulg_pipe/150801.csv": "outlet_pipe",
    "leaf_battery/cell-discharge-temperature-3c.lvm": "column 4",
}


def shown(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def main() -> None:
    if not FOLDER.is_dir():
        print(f"skipped: no folder {FOLDER}")
        return
    print("| record | until min | statuses of its sensors | sensor | steady state °C | t95 min | fit rms K | ahead rms K |")
    print("| --- | ---: | --- | --- | ---: | ---: | ---: | ---: |")
    for name, sensor in RECORDS.items():
        run = tf.read(str(FOLDER / name), **({"interval_s": 1.0} if name.endswith(".lvm") else {}))
        minutes = run.time_s / 60.0
        for until in (0.4 * minutes[-1], None):
            records = {r.channel: r for r in tf.identify(run, until=until).records}
            counts = ", ".join(f"{n} {status}" for status, n in Counter(r.status for r in records.values()).items())
            r = records[sensor]
            steady = f"{shown(r.steady_state_c)} ({shown(r.steady_state_lo_c)} .. {shown(r.steady_state_hi_c)})"
            t95 = f"{shown(r.t95_min)} ({shown(r.t95_lo_min)} .. {shown(r.t95_hi_min)})"
            print(
                f"| {name} | {shown(until or minutes[-1])} | {counts} | {sensor} | {steady} | {t95} "
                f"| {shown(r.rmse_fit_c)} | {shown(r.rmse_ahead_c)} |"
            )


if __name__ == "__main__":
    main()
