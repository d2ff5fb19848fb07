"""Known keys of ``thermofast.toml`` and their types."""

from typing import Any, Literal

import msgspec

from ..reading_options import joined


class Reading(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """How records are read: the same words as the options."""

    time: str | None = None
    time_unit: Literal["ns", "us", "ms", "s", "min", "h", "d"] | None = None
    time_format: str | None = None
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
    strict: bool | None = None


class Identify(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """Defaults of ``identify``."""

    until: float | None = None


class Sweep(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """Defaults of ``sweep``."""

    windows: tuple[float, ...] = ()
    times: str | None = None
    tolerance: float | None = None


class Settings(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """The whole file."""

    runs: tuple[str, ...] = ()
    filter: str | None = None
    preset: Literal["paper"] | None = None
    set: tuple[str, ...] = ()
    jobs: int | None = None
    input: Reading = Reading()
    identify: Identify = Identify()
    sweep: Sweep = Sweep()
    rates: Literal["auto", "own", "shared"] | None = None
    imperfection: dict[str, Any] | None = None

    def defaults(self, source: str) -> dict[str, Any]:
        """As Click's default map: what a command takes where its option is not given; source is the settings file itself."""
        reads = {k: joined(v) if isinstance(v, tuple) else v for k, v in msgspec.structs.asdict(self.input).items()}
        shared = {**reads, "filter_name": self.filter, "preset": self.preset, "settings": self.set, "jobs": self.jobs}
        sweep = msgspec.structs.asdict(self.sweep)
        sweep["windows"] = ",".join(f"{w:g}" for w in self.sweep.windows)
        given = {"runs": self.runs}
        reading = {**reads, "jobs": self.jobs}
        loop = {name: _given(reading) | given for name in ("compare", "diagnose", "improve")}
        loop["inspect"] = _given(reads) | given
        machine = {"rates": self.rates, "imperfection": source if self.imperfection is not None else None}
        return loop | {
            "identify": _given(shared | machine | msgspec.structs.asdict(self.identify)) | given,
            "sweep": _given(shared | machine | sweep) | given,
        }


def _given(values: dict[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in values.items() if v not in (None, "", ())}


def known_keys() -> str:
    """All keys, tables with theirs in brackets."""
    tables = {"input": Reading, "identify": Identify, "sweep": Sweep}
    top = [f for f in Settings.__struct_fields__ if f not in (*tables, "imperfection")]
    inner = [f"[{name}] {' '.join(table.__struct_fields__)}" for name, table in tables.items()]
    return " ".join(top) + "; " + "; ".join(inner) + "; [imperfection], see thermofast identify --imperfection"
