"""An effect written as a plug-in where the heat that a record needs follows its logged columns: a file to read, change and add."""

import keyword
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Template

import numpy as np

from thermofast.models import Observations
from thermofast.models.uncertainty.unknown_heat import POWERS, Follows

from ..errors import UsageError
from ..observing.task import LoopTask, first_model, ready
from ..output.files import check_target, write_text_whole
from ..plugins.effects import load_effect
from ..reading import Run
from .unknown_heat import in_words, needed_of

TEMPLATE = Template('''\
"""Heat that follows $columns. Written by thermofast diagnose from $run: read it, change it, add it.

On that run $words.

    thermofast improve $run --add $file:$kind
"""

import numpy as np

from thermofast.models.effects import Choice, Effect, Parameter

# The logged columns and their largest size in the run that this was written from, by which they are scaled.
COLUMNS = {
$scales}


class $kind(Effect):
    """A share of the heat follows $columns, the rest is constant."""

    id = "$id"
    summary = "the heat follows $columns"
    equation = "$equation"
    tell_tale = "the heat that the base model needs moves with $columns (compare --unknown-heat)"
    needs = "$columns as logged"
    separate = "run at another level of $columns"
    logged = True
    uses_sink = True
    changes_heat = True
    amplitude = "heat_share"
    parameters = (
$parameters    )

    def choices(self, run):
        logged = {**run.ambient, **run.inputs}
        return (Choice("$columns"),) if all(name in logged for name in COLUMNS) else ()

    def apply(self, drive, run, p):
        logged = {**run.ambient, **run.inputs}
        change = 0.0
$terms        drive.heat = drive.heat + p.heat_share * change
''')


@dataclass(frozen=True)
class EffectFile:
    """A plug-in written: its file, the class in it, the columns that it follows, what made it be written, in words, and how the
    run is read again.
    """

    path: str
    kind: str
    columns: tuple[str, ...]
    words: str
    again: str

    @property
    def spec(self) -> str:
        """As --add and --effect take it."""
        return f"{self.path}:{self.kind}"


def check_effect_target(path: str) -> None:
    """Raises UsageError where no effect can be written to `path`; a file that is there may have been edited, so it stays."""
    check_target(path, (".py",))
    if Path(path).exists():
        raise UsageError(f"{path}: is there already", do="give another name; what was edited in it would be lost")


def check_effect_runs(runs: Sequence[Run], drive: str | None) -> None:
    """Raises UsageError unless there is one run, with a logged column beside the drive that its heat may follow."""
    if len(runs) != 1:
        raise UsageError("an effect is written from one run", found=f"{len(runs)} runs", do="give one RUN")
    if not {*runs[0].inputs, *runs[0].ambient} - {drive}:
        raise UsageError(
            f"{runs[0].name}: --write-effect needs a logged column that heat may follow",
            found="sensors only" if drive is None else f"the drive {drive!r} only",
            do="name the columns with --inputs or --ambient",
        )


def write_effect(task: LoopTask, path: str) -> EffectFile | None:
    """Write the effect that a run's unknown heat asks for; None where it follows no logged column.

    Raises
    ------
    UsageError: no logged column, a file that is there already, and as the run's model raises it.
    """
    check_effect_target(path)
    check_effect_runs([task.run], task.drive)
    _, prepared = ready(task)
    if prepared is None:
        return None
    whole = prepared.whole
    fit, _ = first_model(task, prepared)
    follows = needed_of(task, fit, whole).follows
    follows = tuple(f for f in follows if f.column in whole.inputs or f.column in whole.ambient)
    if not follows:
        return None
    kind, text = _source(follows, whole, task.run.name, path)
    write_text_whole(path, text, at_once=True)  # it is read again below
    load_effect(f"{path}:{kind}")  # what is written passes the check, or says why not
    return EffectFile(path, kind, tuple(f.column for f in follows), in_words(follows), task.again)


def _source(follows: tuple[Follows, ...], whole: Observations, run: str, path: str) -> tuple[str, str]:
    """The class's name and the file's text."""
    logged = {**whole.ambient, **whole.inputs}
    # Names of columns become parts of Python names: what is no plain letter or digit does not.
    words = [re.sub(r"[^0-9A-Za-z]+", "_", f.column).strip("_").lower() or "input" for f in follows]
    words = [f"{w}_{k + 1}" if w in words[:k] or keyword.iskeyword(w) else w for k, w in enumerate(words)]
    parameters = [("heat_share", "1", -3.0, 10.0, 0.5, "share of the heat that follows", "null=0.0")]
    terms, equation, scales = [], [], []
    for k, (f, word) in enumerate(zip(follows, words, strict=True)):
        column, text = logged[f.column], _plain(f.column)
        top = float(np.abs(column).max())
        scales.append(f'    "{text}": {top:.6g},\n')
        last = "" if len(follows) == 1 else f"_{word}"
        free = f.powers != (min(POWERS), max(POWERS)) and float(column.min()) >= 0.0
        power, at, share = "", "run.middle", ""
        if free:
            parameters.append((f"power{last}", "1", 0.2, 5.0, f.power, f"exponent of {text}", "log=True"))
            power = f" ** p.power{last}"
        if f.delay_min > 0.0:
            parameters.append(
                (f"delay{last}", "min", 0.0, 0.3, min(f.delay_min / whole.span, 0.3), f"delay behind {text}", "share=True")
            )
            at = f"run.middle - p.delay{last}"
        if k > 0:
            parameters.append((f"share{last}", "1", -10.0, 10.0, 1.0, f"weight of {text} beside {_plain(follows[0].column)}", ""))
            share = f"p.share{last} * "
        terms.append(
            f'        column = np.interp({at}, run.time, logged["{text}"]) / COLUMNS["{text}"]\n'
            f"        change = change + {share}({f'np.maximum(column, 0.0){power}' if free else 'column'} - 1.0)\n"
        )
        equation.append(f"{share.replace('p.', '')}(({text} / max){power.replace('p.', '').replace(' ** ', '^')} - 1)")
    kind = "HeatFollows" + "".join(w.title().replace("_", "") for w in words)
    told = [
        f'        Parameter("{name}", "{unit}", {low:g}, {high:g}, {start:.3g}, "{meaning}"{", " + more if more else ""}),\n'
        for name, unit, low, high, start, meaning, more in parameters
    ]
    columns = " and ".join(_plain(f.column) for f in follows)
    return kind, TEMPLATE.substitute(
        columns=columns,
        run=_plain(Path(run).name),
        file=_plain(path),
        kind=kind,
        id="heat_follows_" + "_".join(words),
        words=_plain(in_words(follows)),
        equation=f"heat(t) = 1 + heat_share [{' + '.join(equation)}]",
        scales="".join(scales),
        parameters="".join(told),
        terms="".join(terms),
    )


def _plain(text: str) -> str:
    """Text that may stand in a Python string or docstring: a name in a file cannot become code."""
    return text.encode("unicode_escape").decode("ascii").replace('"', r"\"") if re.search(r'["\\\x00-\x1f]', text) else text
