"""The verdict of a result in a few sentences."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from ...errors import listed
from ...records import FAILURES
from ...standards.stopping import in_words
from .charts import MOST
from .words import interval_words, run_names, sentence

#: Runs, by as much of their paths as tells them apart.
Names = Mapping[str, str]
#: Sentences of the records that stand on top at most: the others are in the table.
MOST_SAID = 4


def verdict_of(result: Any, rows: list[dict[str, Any]]) -> list[str]:
    """Sentences that stand on top of a page."""
    tellers = {"identify": _settles, "compare": _holds, "diagnose": _missing, "improve": _improved, "sweep": _shortest}
    called = run_names(r["run"] for r in rows)
    told = tellers.get(result.command, _said)(rows, called) if rows else []
    if result.command == "identify":
        told += [f"{said}." for said in in_words(result.records)]
        curves = sum(c is not None for c in result.curves)
        if curves > MOST:
            told.append(f"{MOST} of {curves} sensors are drawn: those told of here, those in doubt, then by their order.")
    told += _of_each([r for r in rows if r.get("status") in FAILURES], called)
    # Of a model that grows the last step is what counts.
    steps = {r["run"]: r["step"] for r in rows if "step" in r}
    last = [r for r in rows if r.get("step") == steps.get(r["run"])]
    count = Counter(row.get("status", "") for row in last)
    states = ", ".join(f"{n} {status}" for status, n in count.items() if status)
    number = "1 row" if len(last) == 1 else f"{len(last)} rows"
    number += " of the last step" if len(last) < len(rows) else ""
    return [*told, f"{number}: {states}." if states else f"{number}."]


def _of_each(some: Sequence[dict[str, Any]], called: Names) -> list[str]:
    """What records say, each once with the names of those that say it; the first few."""
    whom: dict[str, list[str]] = {}
    for row in some:
        if row["message"]:
            whom.setdefault(row["message"], []).append(_who(row, called))
    said = [f"{listed(list(dict.fromkeys(names)), 6)}: {sentence(text)}" for text, names in list(whom.items())[:MOST_SAID]]
    return [*said, "The table says more."] if len(whom) > MOST_SAID else said


def _said(rows: list[dict[str, Any]], _called: Names) -> list[str]:
    """The records' own words, of commands whose answer these are."""
    sure = [r for r in rows if r.get("status") not in FAILURES]
    found = [f"Verdict: {sentence(text)}" for text in dict.fromkeys(r["verdict"].lower() for r in sure if r.get("verdict"))]
    found += [sentence(text) for text in dict.fromkeys(r["message"] for r in sure if r.get("message"))]
    return [*found[:MOST_SAID], "The table says more."] if len(found) > MOST_SAID else found


def _settles(rows: list[dict[str, Any]], called: Names) -> list[str]:
    # What a row doubts is no fact on top of the page.
    known = [r for r in rows if r["steady_state_c"] is not None and r["status"] == "ok"]
    doubted = [r for r in rows if r["status"] in ("model_doubtful", "not_determined")]
    told = []
    if known:
        hot = max(known, key=lambda r: r["steady_state_c"])
        of = " of those that are sure" if doubted else ""
        told.append(f"{_who(hot, called)} settles highest{of}, at {_with(hot, 'steady_state', 'c', 'degC', 2)}.")
    if doubted:
        names = listed([_who(r, called) for r in doubted], 6)
        told.append(f"In doubt or not determined: {names}{'' if known else '; no sensor is sure'}.")
        told += _of_each(doubted, called)
    timed = [r for r in known if r["t95_min"] is not None]
    if timed:
        last = max(timed, key=lambda r: r["t95_min"])
        of_these = "Of those that are sure, " if doubted else ""
        begun, first = last["start_min"] or 0.0, last["initial_c"]
        way = "fall" if first is not None and last["steady_state_c"] < first else "rise"
        since = f", counted from where it begins, at {begun:.4g} min" if begun else ""
        told.append(
            f"{of_these}{_who(last, called)} is the last to have done 95 % of its {way}, "
            f"after {_with(last, 't95', 'min', 'min', 0)}{since}."
        )
    off = [r for r in rows if r.get("switch_off_c") is not None]
    if off:
        hot = max(off, key=lambda r: r["switch_off_c"])
        told.append(
            f"When it was switched off, at {hot['switch_off_min']:.4g} min, {_who(hot, called)} was "
            f"{'the hottest, ' if len(off) > 1 else ''}at {_with(hot, 'switch_off', 'c', 'degC', 2)}."
        )
    limited = [r for r in rows if r.get("margin_k") is not None]
    if limited:
        least = min(limited, key=lambda r: r["margin_k"])
        side = "below" if least["margin_k"] >= 0.0 else "above"
        chance = least["over_limit_p"]
        percent = "" if chance is None else f", chance of exceeding it {_percent(chance)}"
        does = "comes nearest to" if least["margin_k"] >= 0.0 else "goes farthest beyond"
        doubt = "" if least["status"] == "ok" else ", which is in doubt"
        near = f"{_who(least, called)} {does} the limit of {least['limit_c']:g} degC"
        told.append(f"{near}: {abs(least['margin_k']):.2f} K {side} it{percent}{doubt}.")
    return told


def _percent(chance: float) -> str:
    """A chance in words: never quite nothing, nor quite sure."""
    return "below 0.1 %" if chance < 1e-3 else "above 99.9 %" if chance > 0.999 else f"{100.0 * chance:.3g} %"


def _holds(rows: list[dict[str, Any]], called: Names) -> list[str]:
    failing = [r for r in rows if r["worst_error_c"] is not None]
    if not failing:
        return ["The model holds in every sensor: what it leaves is noise."]
    worst = max(failing, key=lambda r: abs(r["worst_error_c"]))
    side = "above" if worst["worst_error_c"] > 0.0 else "below"
    return [
        f"The model fails in {len(failing)} of {len(rows)} sensors, most in {_who(worst, called)}: "
        f"from {worst['worst_from_min']:.0f} to {worst['worst_to_min']:.0f} min it reads "
        f"{abs(worst['worst_error_c']):.2f} K {side} the model, on average.",
        *dict.fromkeys(sentence(r["message"]) for r in failing[:1] if r["message"]),
    ]


def _missing(rows: list[dict[str, Any]], called: Names) -> list[str]:
    told = []
    for run, name in called.items():
        mine = [r for r in rows if r["run"] == run]
        named = list(dict.fromkeys(r["verdict"] for r in mine if r["verdict"]))
        words = ", ".join("nothing is missing" if n == "none" else n for n in named) or "nothing was searched"
        told.append(f"{name}: {sentence(words)}")
        told += [sentence(text) for text in dict.fromkeys(r["message"] for r in mine if r["status"] not in FAILURES) if text][:1]
        told += [f"Advice: {sentence(mine[0]['advice'])}"] if mine[0]["advice"] else []
    return told


def _improved(rows: list[dict[str, Any]], called: Names) -> list[str]:
    told = []
    for run, name in called.items():
        mine = [r for r in rows if r["run"] == run and r["rmse_ahead_c"] is not None]
        if not mine:
            continue
        last = max(r["step"] for r in mine)
        errors = [[r["rmse_ahead_c"] for r in mine if r["step"] == step] for step in (0, last)]
        means = [sum(e) / len(e) for e in errors if e]
        added: list[str] = next((r["effects"] for r in mine if r["step"] == last), [])
        goes = f"goes from {means[0]:.3f} to {means[-1]:.3f} K" if last else f"is {means[0]:.3f} K"
        told.append(f"{name}: with {' + '.join(added) or 'nothing added'} the error on readings that were not fitted {goes}.")
        others = [r for r in mine if r["rmse_other_runs_c"] is not None]
        left_out = [[r["rmse_other_runs_c"] for r in others if r["step"] == step] for step in (0, last)]
        if last and all(left_out):
            before, after = (sum(e) / len(e) for e in left_out)
            told[-1] = f"{told[-1][:-1]}, on this run with what is shared told by the others from {before:.3f} to {after:.3f} K."
        why = mine[-1]["stopped_because"]
        told += [sentence(f"it stopped because {why.removeprefix('none: ')}")] if why else []
    return told


def _shortest(rows: list[dict[str, Any]], _called: Names) -> list[str]:
    sensors = list(dict.fromkeys((r["run"], r["channel"]) for r in rows))
    # Windows that do not agree on a time say that none of it serves for another stretch.
    sure = [r for r in rows if r["shortest_time_min"] is not None and r["agreed"] and r["status"] == "ok"]
    served = list(dict.fromkeys((r["run"], r["channel"]) for r in sure))
    told = [f"An identification time serves in {len(served)} of {len(sensors)} sensors, whatever the window."]
    if sure:
        first, last = min(r["shortest_time_min"] for r in sure), max(r["shortest_time_min"] for r in sure)
        when = f"from {first:g} min for the first of them, from {last:g} min for the last" if last > first else f"from {last:g} min"
        told = [f"{told[0][:-1]}: {when}."]
    within = [r["tolerance_time_min"] for r in rows if r["tolerance_time_min"] is not None]
    reached = len({(r["run"], r["channel"]) for r in rows if r["tolerance_time_min"] is not None})
    after = f", the last of them after {max(within):g} min" if within else ""
    return [*told, f"The steady state is known to within the tolerance in {reached} of {len(sensors)}{after}."]


def _who(row: dict[str, Any], called: Names) -> str:
    return row["channel"] if len(called) < 2 else f"{row['channel']} of {called[row['run']]}"


def _with(row: dict[str, Any], name: str, unit: str, said: str, digits: int) -> str:
    """'26.80 degC (95 %: 26.10 to 27.50)'; an open side is told as such."""
    ends = (f"{name}_lo_{unit}", f"{name}_hi_{unit}")
    return f"{row[f'{name}_{unit}']:.{digits}f} {said} (95 %: {interval_words(row, ends, digits)})"
