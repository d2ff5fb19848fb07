"""What the discovery loop says of measured records: ``python -m benchmarks.discovery.real_loop`` (docs/real-records.md)."""

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import sys
from pathlib import Path

from thermofast.models.effects import BUILT_IN
from thermofast.models.joint import Fit, fit_model
from thermofast.models.search.candidates import try_add
from thermofast.models.search.discover import discover
from thermofast.models.search.heldout import held_out_errors
from thermofast.observing.observe import observe
from thermofast.observing.task import pooled
from thermofast.reading import Options, read_runs

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
#: (record, sensors or all, column that drives the heat, effects that the physics is said to be)
RECORDS = (
    ("heatshield/duty_sequence.csv", (), "heater_duty", ("nonlinear_loss", "second_mode")),
    ("daisy_heating/lamp_steps.csv", (), None, ("load_step", "second_mode")),
    ("tclab/energy_balance.csv", ("T1",), "heater_1", ("sensor_lag", "nonlinear_loss")),
    ("tclab/second_order.csv", ("T1", "T2"), "heater_1", ("sensor_lag", "neighbour_heat")),
    ("laptop/cooling_Test_300.csv", ("GPU_Temp", "CPU_Temp"), None, ("neighbour_heat",)),
    ("cooking_pot/0cm_1L_a.csv", ("T3", "T5"), None, ("nonlinear_loss",)),
    ("cooking_pot/20cm_3L_b.csv", ("T10", "T5"), None, ("second_mode", "ambient")),
    ("ulg_pipe/151204_1.csv", ("outlet_pipe", "inlet_pipe"), None, ("transport_delay", "second_mode")),
)


def with_effects(base: Fit, ids: tuple[str, ...]) -> Fit | None:
    """Effects added one after the other."""
    kinds = {kind.id: kind for kind in BUILT_IN}
    fit = base
    for name in ids:
        found = try_add(fit, kinds[name]())
        if found is None:
            return None
        fit = found.fit
    return fit


def judged(name: str, channels: tuple[str, ...], drive: str | None, known: tuple[str, ...]) -> dict[str, object]:
    """What the loop finds in one record."""
    run = read_runs(str(DATA / name), Options(channels=channels))[0]
    seen = observe(run, 0.0, drive).seen
    assert seen is not None
    base = fit_model(seen)
    found = discover(seen, [kind() for kind in BUILT_IN])
    first = found.singles[0]
    told = with_effects(base, known)
    return {
        "verdict": found.verdict,
        "before": pooled(held_out_errors(base)),
        "first": first.ids[0] + (f" ({first.parts[0].choice.label})" if first.parts[0].choice.label else ""),
        "first_after": pooled(held_out_errors(first.fit)),
        "known": " + ".join(known),
        "known_after": pooled(held_out_errors(told)) if told is not None else float("nan"),
        "noise": pooled(seen.noise),
    }


def main() -> None:
    """Print the table."""
    if not DATA.is_dir():
        sys.exit(f"no folder {DATA}: the measured records are not part of this repository")
    heads = (
        "record",
        "sensors",
        "drive",
        "base ahead K",
        "verdict",
        "first in the ranking",
        "ahead K",
        "said to be",
        "ahead K",
        "noise K",
    )
    print("| " + " | ".join(heads) + " |")
    print("| --- | --- | --- | ---: | --- | --- | ---: | --- | ---: | ---: |")
    for name, channels, drive, known in RECORDS:
        r = judged(name, channels, drive, known)
        numbers = {k: f"{v:.3g}" if isinstance(v, float) else v for k, v in r.items()}
        cells = [name, ", ".join(channels) or "all", drive or "-"]
        cells += [numbers[k] for k in ("before", "verdict", "first", "first_after", "known", "known_after", "noise")]
        print("| " + " | ".join(map(str, cells)) + " |", flush=True)


if __name__ == "__main__":
    main()
