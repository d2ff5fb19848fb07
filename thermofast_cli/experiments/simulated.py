"""What ``simulate`` gives: a record with the truth behind it."""

from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..reading import Run, read_runs
from ..reading_options import Options

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa


@dataclass(frozen=True, eq=False)
class Simulated:
    """A simulated record: its columns (N,) by name, the time first, and the truth behind it."""

    columns: dict[str, Any]
    truth: dict[str, Any]

    def __eq__(self, other: object) -> bool:
        """Whether both have the same columns of the same numbers, and the same truth."""
        if not isinstance(other, Simulated):
            return NotImplemented
        alike = list(self.columns) == list(other.columns) and self.truth == other.truth
        pairs = zip(self.columns.values(), other.columns.values(), strict=False)
        return alike and all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)

    __hash__ = None  # type: ignore[assignment]

    def _repr_html_(self) -> str:
        """For a notebook: the first and last readings, and what is behind them."""
        frame = self.to_frame()
        hidden = ", ".join(effect["id"] for effect in self.truth["effects"]) or "nothing"
        return f"{frame.to_html(max_rows=6, float_format=lambda v: f'{v:.4g}')}<p>hidden: {escape(hidden)}</p>"

    def run(self, name: str = "simulated") -> Run:
        """The record as it is read."""
        (found,) = read_runs(self.columns, Options(inputs=tuple(self.truth.get("inputs", ()))), name=name)
        return found

    def to_frame(self) -> "pd.DataFrame":
        """A row for each reading, a column for each sensor, the time [min] first."""
        import pandas as pd

        return pd.DataFrame(self.columns)

    def to_arrow(self) -> "pa.Table":
        """As the Parquet file of ``save``."""
        import pyarrow as pa

        return pa.table(self.columns)

    def save(self, path: str | Path, key: str | Path | None = None) -> None:
        """Write the record (.csv, .parquet) and the truth (.json), each whole or not at all."""
        from ..output.files import check_target, write_columns, write_json

        check_target(str(path), (".csv", ".parquet"))
        if key is not None:
            check_target(str(key), (".json",))
        write_columns(str(path), self.columns)
        if key is not None:
            write_json(str(key), self.truth)
