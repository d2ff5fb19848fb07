"""A result as one page that needs nothing else: verdict, charts, table, and how it was made."""

import json
import math
from collections.abc import Mapping, Sequence
from datetime import date
from importlib.resources import files
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from ..meanings import meaning_of, unit_of
from ..text import plain
from .figures import figures_of
from .glance import GLANCED, glance_page
from .verdicts import verdict_of
from .words import TURNING, escape, run_names, status_cell, value_words

if TYPE_CHECKING:
    from ...results import Result

#: Characters from which a cell is broken into lines.
LONG = 40
#: Characters from which a cell is folded.
FOLDED = 240
#: Nothing is fetched, sent or run but what stands in the page.
POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
)


def page_of(result: "Result[Any]", made: Mapping[str, str] = MappingProxyType({})) -> str:
    """The HTML of a result's page; made: headings and texts of how it was made.

    What comes from files stays text: it is escaped, or set by the script as text.
    """
    rows, charts = [plain(r) for r in result.rows()], figures_of(result)
    data = json.dumps({"command": result.command, "charts": charts}, ensure_ascii=False, separators=(",", ":")).translate(TURNING)
    called = run_names(r["run"] for r in rows)
    names = " and ".join(called.values()) or "no run"
    title = f"thermofast {result.command}: {names if len(names) < 120 else f'{len(result.runs)} runs'}"
    verdict = "".join(f"<p>{escape(s)}</p>" for s in verdict_of(result, rows))
    style, script = (files(__package__).joinpath(f"page.{kind}").read_text(encoding="utf-8") for kind in ("css", "js"))
    parts = [
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f'<title>{escape(title)}</title><link rel="icon" href="data:,"><style>{style}</style></head><body><main>',
        f'<h1>{escape(title)}</h1><div class="verdict">{verdict}</div>',
        glance_page(rows, called) if result.command in GLANCED else "",
        _figures(charts),
        _ranking(rows) if result.command == "diagnose" else "",
        _table(list(result.kind.columns()), rows, called),
        _made(result, made),
        f'</main><script type="application/json" id="data">{_inert(data)}</script><script>{script}</script></body></html>\n',
    ]
    return "".join(parts)


def _inert(text: str) -> str:
    """JSON inside a script element: nothing in it ends the element."""
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _figures(charts: Sequence[dict[str, Any]]) -> str:
    if not charts:
        return ""
    drawn = "".join(
        f'<figure data-chart="{k}"><figcaption><h3>{escape(c["title"])}</h3>{_says(c)}{_key(c)}</figcaption></figure>'
        for k, c in enumerate(charts)
    )
    hint = (
        "Drag over a chart to zoom, double-click for all of it; a tap shows what stands there. "
        "By keyboard: arrows move the cursor, + and - zoom, 0 shows all."
    )
    return f'<h2>Charts</h2><p class="dim screen">{hint}</p><div class="charts">{drawn}</div>'


def _says(chart: dict[str, Any]) -> str:
    return f'<p class="key">{escape(chart["says"])}</p>' if chart["says"] else ""


def _key(chart: dict[str, Any]) -> str:
    """What each sign of a chart means."""
    drawn = []
    for strip in chart["strips"][:1]:
        for s in strip["series"]:
            style = f' style="stroke:{s["stroke"]}" stroke-dasharray="{s["dash"]}"' if s.get("stroke") else ""
            sign = {
                "points": '<circle cx="8" cy="4" r="2" class="measured"/>',
                "band": '<rect width="16" height="7" class="band"/>',
                "line": f'<path d="M0 4h16" class="line {escape(s["css"])}"{style}/>',
            }[s["kind"]]
            drawn.append((sign, s["label"]))
    drawn += [(f'<path d="M0 4h16" class="{m["css"]}"/>', m["label"]) for m in chart.get("marks", [])]
    drawn += [('<rect width="16" height="7" class="fails"/>', "the model fails")] if chart.get("areas") else []
    items = "".join(f'<li><svg viewBox="0 0 16 7" aria-hidden="true">{sign}</svg>{escape(label)}</li>' for sign, label in drawn)
    return f'<ul class="key">{items}</ul>'


def _ranking(rows: Sequence[dict[str, Any]]) -> str:
    """What each effect gains, per run, as bars."""
    parts = []
    for run in dict.fromkeys(r["run"] for r in rows):
        ranking: list[dict[str, Any]] = next((r["ranking"] for r in rows if r["run"] == run and r["ranking"]), [])
        if not ranking:
            continue
        most = max(max(float(e["gain"]), 0.0) for e in ranking) or 1.0
        lines = "".join(
            f'<tr><td>{escape(e["effect"])}</td><td><svg viewBox="0 0 100 8" width="160" height="13" aria-hidden="true">'
            f'<rect width="{100.0 * max(float(e["gain"]), 0.0) / most:.1f}" height="8" class="bar"/></svg></td>'
            f'<td class="number">{max(e["gain"], 0.0) + 0.0:g}</td><td class="number">{_chance(float(e["p"]))}</td>'
            f'<td class="long">{escape(e["why_not"])}</td></tr>'
            for e in ranking
        )
        head = (
            "<tr><th>effect</th><th>what it gains</th><th>likelihood-ratio statistic</th><th>chance by noise</th>"
            "<th>what speaks against it</th></tr>"
        )
        parts.append(
            f'<h3>{escape(run)}</h3><div class="wide" tabindex="0" role="region" aria-label="Ranking of {escape(run, quote=True)}">'
            f"<table><thead>{head}</thead><tbody>{lines}</tbody></table></div>"
        )
    return f"<h2>Ranking of the effects</h2>{''.join(parts)}" if parts else ""


def _there(value: Any) -> bool:
    """Whether a cell says anything; a number of numpy's does, and is not to be compared with a list."""
    return isinstance(value, int | float) or value not in (None, "", [], {})


def _table(columns: Sequence[str], rows: Sequence[dict[str, Any]], called: Mapping[str, str]) -> str:
    """The records without columns that are empty throughout, to be sorted, copied and saved."""
    kept = [c for c in columns if any(_there(r[c]) for r in rows)]
    told = {c: f"{meaning_of(c)}{f' [{unit_of(c)}]' if unit_of(c) else ''}" for c in kept}
    head = "".join(
        f'<th scope="col"{_who(c)} title="{escape(told[c])}"><button type="button">{escape(c)}</button></th>' for c in kept
    )
    body = "".join(f"<tr>{''.join(_run(r[c], called) if c == 'run' else _cell(c, r[c]) for c in kept)}</tr>" for r in rows)
    tools = (
        '<div class="tools"><button type="button" id="copy">Copy the table</button>'
        '<button type="button" id="save">Save as CSV</button><span id="said" role="status"></span></div>'
    )
    region = '<div class="wide" tabindex="0" role="region" aria-label="Table of the records">'
    hint = '<p class="dim screen">A press on a heading sorts.</p>'
    before = "".join(f'#records td:nth-child({k}):before{{content:"{c}: "}}' for k, c in enumerate(kept, 1))
    table = f'<table id="records"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'
    means = "".join(f"<dt>{escape(c)}</dt><dd>{escape(told[c])}</dd>" for c in kept)
    key = f"<details><summary>What the columns mean</summary><dl>{means}</dl></details>"
    return f"<h2>Records</h2><style>@media print{{{before}}}</style>{tools}{hint}{region}{table}</div>{key}"


def _who(column: str) -> str:
    """What stays in sight where a wide table is moved."""
    return ' class="who"' if column in ("channel", "column") else ""


def _run(run: str, called: Mapping[str, str]) -> str:
    """A run by as much of its path as tells it from the others; copied and saved by all of it."""
    whole = escape(run, quote=True)
    return f'<td data-value="{whole}" title="{whole}">{escape(called[run])}</td>'


def _cell(column: str, value: Any) -> str:
    if isinstance(value, bool):
        return f"<td>{'yes' if value else 'no'}</td>"
    if isinstance(value, int | float):
        shown = f"{value:.5g}" if math.isfinite(value) else ""
        return f'<td class="number" data-value="{value!r}">{shown}</td>'
    if value is None:
        return "<td></td>"
    if isinstance(value, list) and all(isinstance(v, str) for v in value):
        value = ", ".join(value)
    if not isinstance(value, str):
        if not value:
            return "<td></td>"
        whole, words = json.dumps(value, ensure_ascii=False), value_words(value)
        if len(words) <= FOLDED:
            return f'<td class=long data-value="{escape(whole, quote=True)}">{escape(words)}</td>'
        return _folded(f"{len(value)} entries" if len(value) > 1 else "1 entry", whole, words)
    if column == "status":
        return status_cell(value)
    if len(value) > FOLDED:
        return _folded(f"{value[:LONG]} ...", value)
    return f"<td{_who(column) or (' class=long' if len(value) > LONG else '')}>{escape(value)}</td>"


def _chance(p: float) -> str:
    """A probability; one that is less than what a number can hold is not nothing."""
    return f"{p:.2g}" if p >= 1e-300 else "&lt; 1e-300"


def _folded(summary: str, whole: str, shown: str | None = None) -> str:
    """A cell that opens on request, as it is `shown`; sorted and copied by all of it."""
    kind = "" if shown else ' class="words"'  # on paper words are told whole, lists by their count
    told = f"<details{kind}><summary>{escape(summary)}</summary><code>{escape(shown or whole)}</code></details>"
    return f'<td data-value="{escape(whole, quote=True)}">{told}</td>'


def _made(result: "Result[Any]", made: Mapping[str, str]) -> str:
    """Command, version, date; of each run its file's hash, how it was read, and what was guessed."""
    from ... import __version__
    from ...reading.source import sha256_of

    told = {"Command": f"{result.command}, from Python", **made}
    lines = [f"<dt>{escape(heading)}</dt><dd><code>{escape(text)}</code></dd>" for heading, text in told.items()]
    lines.append(f"<dt>Made by</dt><dd>thermofast {escape(__version__)}, on {date.today():%Y-%m-%d}</dd>")
    read = {t["run"]: t for t in result.input()}
    for run in result.runs:
        digest = sha256_of(run.name)
        notes = [f"{len(run.time_s)} rows, {run.time_s[-1] / 60.0:.4g} min", *read[run.name]["notes"]]
        notes += [f"guessed: {g['text']} ({g['option']})" for g in read[run.name]["guesses"]]
        notes += [f"SHA-256 {digest}"] if digest else []
        lines.append(f"<dt>{escape(run.name)}</dt>" + "".join(f"<dd>{escape(n)}</dd>" for n in notes))
    return f"<h2>How this was made</h2><dl>{''.join(lines)}</dl>"
