"""The library: judging a result. ``sensitivity``, ``validate``, ``displacement``, ``bench``; the rest is in ``api``."""

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from .errors import UsageError
from .given import Source, Start, checked, in_range, model_of, setting_texts, started_of, work_of
from .reading_options import ReadingOptions, names
from .results import Bench, Displacement, Sensitivity, Validation

if TYPE_CHECKING:
    from .machine.model import Model


@checked
def bench(runs: Source, until: float | None = None, *, start: Start = "auto", **reading: Unpack[ReadingOptions]) -> Bench:
    """Every filter on each run, and which one to use there: ``thermofast filters bench``.

    Raises
    ------
    ThermofastError: as the command would refuse.
    """
    from .pipeline.around import bench_runs

    in_range(until=until)
    return bench_runs(started_of(runs, start, True, reading), until)


@checked
def sensitivity(
    runs: Source,
    until: float | None = None,
    *,
    sizes: Mapping[str, float] | None = None,
    uniform: str | Iterable[str] = (),
    filter: str = "afukf",  # noqa: A002 - the name of the option
    settings: Mapping[str, Any] | None = None,
    model: "Model | str | Path | None" = None,
    start: Start = "auto",
    jobs: int | None = 1,
    executor: Executor | None = None,
    **reading: Unpack[ReadingOptions],
) -> Sensitivity:
    """How much each uncertain thing contributes to the spread; sizes: offset, start, room [K], jitter [s], until [min], limit [K].

    uniform: those of offset, start, room, until that lie evenly within +- their size instead of normally about it.

    Raises
    ------
    ThermofastError: as the command would refuse.
    """
    from .analysis.sensitivity import BOUNDS, Sizes
    from .pipeline.around import sensitivity_runs
    from .pipeline.methods import choose

    known = [f.name for f in fields(Sizes) if f.name != "uniform"]
    for key in sizes or {}:
        if key not in known:
            raise UsageError(f"unknown size {key!r}", allowed=", ".join(known))
    spreads = dict.fromkeys(known, (0.0, 10000000.0))
    in_range(spreads, **(sizes or {}))
    in_range(until=until)
    even = names(uniform)
    if wrong := [name for name in even if name not in BOUNDS]:
        raise UsageError(f"uniform: {wrong[0]!r} is no size whose bounds may be given", allowed=", ".join(BOUNDS))
    learnt = model_of(model)
    if learnt is not None and (filter != "afukf" or settings):
        raise UsageError(
            "a model foretells by itself", found=f"filter {filter!r} beside it", do="leave out the filter, or the model"
        )
    method = choose(filter, None, setting_texts(filter, settings))
    started = started_of(runs, start, learnt is None, reading)
    return sensitivity_runs(started, method, Sizes(**(sizes or {}), uniform=even), until, learnt, work_of(jobs, executor, None))


@checked
def displacement(
    runs: Source,
    columns: str | Iterable[str] = (),
    *,
    methods: str | Iterable[str] = (),
    order: tuple[int, int] | None = None,
    together: bool = False,
    start: Start = "auto",
    **reading: Unpack[ReadingOptions],
) -> Displacement:
    """Thermal displacement from the temperatures, and which method to trust.

    methods: some of least_squares, network, arx, network_by_minute, neural_network; order (outputs, inputs) is that of arx.
    together: the runs are of one machine, learned from as one and left out in turn.

    Raises
    ------
    ThermofastError: as the command would refuse.
    """
    from .pipeline.around import displacement_runs

    if order is not None and not (len(order) == 2 and all(isinstance(n, int) and 0 < n <= 50 for n in order)):
        raise UsageError("order: not two whole numbers", found=repr(order), allowed="1 to 50 each, as (2, 1)")
    return displacement_runs(started_of(runs, start, False, reading), names(columns), names(methods), order, together)


@checked
def validate(
    model: "Model | str | Path",
    runs: Source,
    until: float,
    *,
    input_range: Mapping[str, float] | None = None,
    start: Start = "auto",
    jobs: int | None = 1,
    executor: Executor | None = None,
    progress: Callable[[int], None] | None = None,
    **reading: Unpack[ReadingOptions],
) -> Validation:
    """A learnt model against a set of runs: the area between distributions of measured and foretold temperatures.

    Each run is carried on from its first `until` minutes; input_range says by how much [its unit] a logged input may be wrong.

    Raises
    ------
    ThermofastError: as the command would refuse.
    """
    from .pipeline.around import validate_runs

    learnt = model_of(model)
    in_range(until=until)
    if learnt is None:
        raise UsageError("no model is given", do="learn one with tf.improve(...).model, or give the path of its file")
    started = started_of(runs, start, False, reading)
    return validate_runs(started, learnt, until, tuple((input_range or {}).items()), work_of(jobs, executor, progress))
