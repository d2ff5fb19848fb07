"""Records as CSV, JSON, JSON lines and Markdown text: the same columns in each, nothing for an absent number."""

import csv
import io
import json
import math
from collections.abc import Sequence
from typing import Any

Row = dict[str, Any]
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


def plain(value: Any) -> Any:
    """A JSON value; nan and infinities become null."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    return value


def harmless(text: str) -> str:
    """A cell that no spreadsheet takes for a formula."""
    return "'" + text if text.startswith(FORMULA_STARTS) else text


def cell(value: Any) -> str:
    """A value as a CSV cell: numbers in full, nothing for an absent one."""
    kind = type(value)
    if kind is float:
        return repr(value) if math.isfinite(value) else ""
    if value is None:
        return ""
    if isinstance(value, float):
        return cell(float(value))
    if kind is str:
        return harmless(value)
    if kind is bool:
        return "true" if value else "false"
    if isinstance(value, dict) or (isinstance(value, (list, tuple)) and any(isinstance(v, dict) for v in value)):
        return json.dumps(plain(value), ensure_ascii=False)
    if isinstance(value, (list, tuple)):
        return harmless(",".join(cell(v) for v in value))
    return repr(value)


def to_csv(columns: Sequence[str], rows: Sequence[Row], header: bool = True, excel: bool = False) -> str:
    """excel: as Excel opens it by a double click where the decimal mark is a comma: a mark of UTF-8, semicolons, decimal commas."""
    out = io.StringIO("\ufeff" if excel else "", newline="")
    out.seek(0, io.SEEK_END)
    writer = csv.writer(out, delimiter=";", lineterminator="\r\n") if excel else csv.writer(out, lineterminator="\n")
    if header:
        writer.writerow(columns)
    writer.writerows([[_comma(row[c]) if excel else cell(row[c]) for c in columns] for row in rows])
    return out.getvalue()


def _comma(value: Any) -> str:
    return cell(value).replace(".", ",") if isinstance(value, float) else cell(value)


def to_json(command: str, rows: Sequence[Row], input_: Sequence[Row] = ()) -> str:
    """An object with the schema, how each run was read (``input``), and the records."""
    document = {"schema": f"thermofast.{command}/1", "input": list(input_), "records": [_jsonable(row) for row in rows]}
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def to_jsonl(rows: Sequence[Row]) -> str:
    return "".join(json.dumps(_jsonable(row), ensure_ascii=False) + "\n" for row in rows)


def _jsonable(row: Row) -> Row:
    return {k: plain(v) for k, v in row.items()}


def to_markdown(columns: Sequence[str], rows: Sequence[Row]) -> str:
    """A table with numbers to five digits, without columns that are empty throughout: for reading, not for computing."""
    told = {c: [_as_text(short(row[c])) for row in rows] for c in columns}
    columns = [c for c in columns if any(told[c])] or columns
    lines = ["| " + " | ".join(columns) + " |", "|" + " --- |" * len(columns)]
    lines += ["| " + " | ".join(told[c][k] for c in columns) + " |" for k in range(len(rows))]
    return "\n".join(lines) + "\n"


def _as_text(told: str) -> str:
    """A cell of a Markdown table that is neither its end nor HTML, whatever name stands in it."""
    return told.replace("|", "\\|").replace("&", "&amp;").replace("<", "&lt;")


def short(value: Any) -> str:
    """A value for a reader's eye."""
    value = plain(value)
    if isinstance(value, str):
        return " ".join(value.split())  # no spreadsheet reads it here
    return f"{value:.5g}" if isinstance(value, float) else " ".join(cell(value).split())
