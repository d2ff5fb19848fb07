"""The verdict of a result in a few sentences."""

from collections import Counter
from pathlib import Path
from typing import Any

from ...errors import listed
from ...standards.stopping import in_words
from .charts import MOST


def verdict_of(result: Any, rows: list[dict[str, Any]]) -> list[str]:
    """Sentences that stand on top of a page."""
    tellers = {"identify": _settles, "compare": _holds, "diagnose": _missing, "improve": _improved, "sweep": _shortest}
    told = tellers[result.command](rows) if result.command in tellers and rows else []
    if result.command == "identify":
        told += [f"{sentence}." for sentence in in_words(result.records)]
        curves = sum(c is not None for c in result.curves)
        if curves > MOST:
            told.append(f"{MOST} of {curves} sensors are drawn: those told of here, those in doubt, then by their order.")
    count = Counter(row.get("status", "") for row in rows)
    states = ", ".join(f"{n} {status}" for status, n in count.items() if status)
    number = "1 row" if len(rows) == 1 else f"{len(rows)} rows"
    return [*told, f"{number}: {states}." if states else f"{number}."]


def _settles(rows: list[dict[str, Any]]) -> list[str]:
    # What a row doubts is no fact on top of the page.
    known = [r for r in rows if r["steady_state_c"] is not None and r["status"] == "ok"]
    doubted = [r for r in rows if r["status"] in ("model_doubtful", "not_determined")]
    told = []
    if known:
        hot = max(known, key=lambda r: r["steady_state_c"])
        of = " of those that are sure" if doubted else ""
        told.append(f"{_who(hot, rows)} settles highest{of}, at {_with(hot, 'steady_state', 'c', 'degC', 2)}.")
    if doubted:
        names = listed([_who(r, rows) for r in doubted], 6)
        told.append(f"In doubt or not determined: {names}; the table says why{'' if known else ', and no sensor is sure'}.")
    timed = [r for r in known if r["t95_min"] is not None]
    if timed:
        last = max(timed, key=lambda r: r["t95_min"])
        of_these = "Of those that are sure, " if doubted else ""
        told.append(
            f"{of_these}{_who(last, rows)} is the last to have done 95 % of its rise, after {_with(last, 't95', 'min', 'min', 0)}."
        )
    limited = [r for r in rows if r.get("margin_k") is not None]
    if limited:
        least = min(limited, key=lambda r: r["margin_k"])
        side = "below" if least["margin_k"] >= 0.0 else "above"
        chance = least["over_limit_p"]
        percent = "" if chance is None else f", chance of exceeding it {_percent(chance)}"
        does = "comes nearest to" if least["margin_k"] >= 0.0 else "goes farthest beyond"
        doubt = "" if least["status"] == "ok" else ", which is in doubt"
        near = f"{_who(least, rows)} {does} the limit of {least['limit_c']:g} degC"
        told.append(f"{near}: {abs(least['margin_k']):.2f} K {side} it{percent}{doubt}.")
    return told


def _percent(chance: float) -> str:
    """A chance in words: never quite nothing, nor quite sure."""
    return "below 0.1 %" if chance < 1e-3 else "above 99.9 %" if chance > 0.999 else f"{100.0 * chance:.3g} %"


def _holds(rows: list[dict[str, Any]]) -> list[str]:
    failing = [r for r in rows if r["worst_error_c"] is not None]
    if not failing:
        return ["The model holds in every sensor: what it leaves is noise."]
    worst = max(failing, key=lambda r: abs(r["worst_error_c"]))
    return [
        f"The model fails in {len(failing)} of {len(rows)} sensors, most in {_who(worst, rows)}: by {worst['worst_error_c']:.2f} K "
        f"from {worst['worst_from_min']:.0f} to {worst['worst_to_min']:.0f} min."
    ]


def _missing(rows: list[dict[str, Any]]) -> list[str]:
    told = []
    for run in dict.fromkeys(r["run"] for r in rows):
        mine = [r for r in rows if r["run"] == run]
        named = list(dict.fromkeys(r["verdict"] for r in mine if r["verdict"]))
        told.append(f"{Path(run).name}: {', '.join(named) or 'nothing could be searched'}. Advice: {mine[0]['advice']}".strip())
    return told


def _improved(rows: list[dict[str, Any]]) -> list[str]:
    told = []
    for run in dict.fromkeys(r["run"] for r in rows):
        mine = [r for r in rows if r["run"] == run and r["rmse_ahead_c"] is not None]
        if not mine:
            continue
        last = max(r["step"] for r in mine)
        errors = [[r["rmse_ahead_c"] for r in mine if r["step"] == step] for step in (0, last)]
        means = [sum(e) / len(e) for e in errors if e]
        added: list[str] = next((r["effects"] for r in mine if r["step"] == last), [])
        told.append(
            f"{Path(run).name}: with {' + '.join(added) or 'nothing added'} the error on readings that were not fitted goes from "
            f"{means[0]:.3f} to {means[-1]:.3f} K. {mine[-1]['stopped_because']}".strip()
        )
    return told


def _shortest(rows: list[dict[str, Any]]) -> list[str]:
    sensors = list(dict.fromkeys((r["run"], r["channel"]) for r in rows))
    # Windows that do not agree on a time say that none of it serves for another stretch.
    sure = [r for r in rows if r["shortest_time_min"] is not None and r["agreed"] and r["status"] == "ok"]
    served = list(dict.fromkeys((r["run"], r["channel"]) for r in sure))
    told = [f"An identification time serves in {len(served)} of {len(sensors)} sensors, whatever the window."]
    if sure:
        first, last = min(r["shortest_time_min"] for r in sure), max(r["shortest_time_min"] for r in sure)
        told = [f"{told[0][:-1]}: from {first:g} min for the first of them, from {last:g} min for the last."]
    within = [r["tolerance_time_min"] for r in rows if r["tolerance_time_min"] is not None]
    reached = len({(r["run"], r["channel"]) for r in rows if r["tolerance_time_min"] is not None})
    after = f", the last of them after {max(within):g} min" if within else ""
    return [*told, f"The steady state is known to within the tolerance in {reached} of {len(sensors)}{after}."]


def _who(row: dict[str, Any], rows: list[dict[str, Any]]) -> str:
    return row["channel"] if len({r["run"] for r in rows}) < 2 else f"{row['channel']} of {Path(row['run']).name}"


def _with(row: dict[str, Any], name: str, unit: str, said: str, digits: int) -> str:
    """'26.80 degC (95 %: 26.10 to 27.50)'; an open side is told as such."""
    low, high = row[f"{name}_lo_{unit}"], row[f"{name}_hi_{unit}"]
    sides = ["open" if v is None else f"{v:.{digits}f}" for v in (low, high)]
    return f"{row[f'{name}_{unit}']:.{digits}f} {said} (95 %: {sides[0]} to {sides[1]})"
