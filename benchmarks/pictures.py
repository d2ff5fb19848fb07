"""Pictures of the README, from the sample runs: ``python -m benchmarks.pictures``."""

from pathlib import Path

from thermofast.main import cli

ROOT = Path(__file__).resolve().parents[1]


def main() -> None:
    spindle = str(ROOT / "sample_runs" / "spindle.csv")
    for arguments in (
        ["identify", spindle, "--until", "60", "--channels", "T5,T7,T8", "-q", "--save-plot", str(ROOT / "docs" / "identify.png")],
        ["sweep", spindle, "--channels", "T5", "-q", "--save-plot", str(ROOT / "docs" / "sweep.png")],
    ):
        cli.main([*arguments, "--format", "md"], standalone_mode=False)


if __name__ == "__main__":
    main()
