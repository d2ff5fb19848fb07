"""Known keys of ``thermofast.toml`` and their types."""

from typing import Any, Literal

import msgspec

from ..reading_options import joined


class Reading(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """How records are read: the same words as the options."""

    time: str | None = None
    time_unit: Literal["ns", "us", "ms", "s", "min", "h", "d"] | None = None
    time_format: str | None = None
    tz: str | None = None
    interval: float | None = None
    start: float | Literal["auto"] | None = None
    ambient: str | None = None
    inputs: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    delimiter: str | None = None
    decimal: Literal[".", ","] | None = None
    encoding: str | None = None
    header_line: int | None = None
    sheet: str | None = None
    long: str | None = None
    units: tuple[str, ...] = ()
    rename: tuple[str, ...] = ()
    resistance: str | None = None
    skip_footer: int | None = None
    from_min: float | None = msgspec.field(default=None, name="from")
    to_min: float | None = msgspec.field(default=None, name="to")
    max_bytes: int | None = None
    max_rows: int | None = None
    max_columns: int | None = None
    strict: bool | None = None


class Settings(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """The whole file."""

    runs: tuple[str, ...] = ()
    filter: str | None = None
    preset: Literal["paper"] | None = None
    set: tuple[str, ...] = ()
    jobs: int | None = None
    input: Reading = Reading()
    rates: Literal["auto", "own", "shared"] | None = None
    imperfection: dict[str, Any] | None = None

    def defaults(self, source: str) -> dict[str, Any]:
        """As Click's default map: what a command takes where its option is not given; source is the settings file itself."""
        reads = {k: joined(v) if isinstance(v, tuple) else v for k, v in msgspec.structs.asdict(self.input).items()}
        shared = {**reads, "filter_name": self.filter, "preset": self.preset, "settings": self.set, "jobs": self.jobs}
        machine = {"rates": self.rates, "imperfection": source if self.imperfection is not None else None}
        given, reading = {"runs": self.runs}, {**reads, "jobs": self.jobs}
        return {
            **dict.fromkeys(("identify", "sweep"), _given(shared | machine) | given),
            **dict.fromkeys(("compare", "diagnose", "improve", "inspect"), _given(reading) | given),
            "watch": _given({k: v for k, v in (shared | machine).items() if k != "jobs"}),
            "plan": _given(reads | {"imperfection": machine["imperfection"]}),
            "sensitivity": _given(shared),
            **dict.fromkeys(("calibrate", "changed", "displacement", "validate"), _given(reads)),
        }


def _given(values: dict[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in values.items() if v not in (None, "", ())}


def known_keys() -> str:
    """All keys, tables with theirs in brackets."""
    top = [f for f in Settings.__struct_fields__ if f not in ("input", "imperfection")]
    reading = f"[input] {' '.join(Reading.__struct_encode_fields__)}"
    return f"{' '.join(top)}; {reading}; [identify], [compare], ...: options of that command, with underlines; [imperfection]"
