"""What the commands of the discovery loop share: runs into tasks, tasks into results over a pool of processes."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

from thermofast.models.search.discover import Spread

from ..discovery.loop import LoopTask, check_drive
from ..errors import UsageError
from ..output.files import TABLE_SUFFIXES, check_target, check_targets
from ..output.screen import progress, say
from ..pool import Shared, cores, map_tasks
from .session import choose_sources, read_all

#: Runs from which on a pool of processes pays.
POOL_FROM = 3
#: Readings of all sensors together from which on a single run is worth sharing.
SHARED_FROM = 1500


def loop_tasks(
    runs: tuple[str, ...],
    given: dict[str, Any],
    quiet: bool,
    targets: list[str | None],
    check_table: bool = True,
    from_rise: bool = False,
    **options: Any,
) -> tuple[list[LoopTask], list[tuple[str, str]]]:
    """(tasks, unreadable runs); effects, model and targets are checked before any work is done.

    An idle beginning is itself a finding (`transport_delay`): without --start the record counts from its first reading, unless
    ``from_rise``.

    Raises
    ------
    UsageError, InputError: as the reader, the catalogue and the model file raise them.
    """
    from ..discovery.plugins import chosen_effects
    from ..machine.learnt import check_effects
    from ..machine.modelfile import read_model

    if targets and targets[0] and check_table:
        check_target(targets[0], TABLE_SUFFIXES)
    chosen_effects(options.get("names", ()), options.get("extra", ()))
    drive = options.get("drive")  # the user's own; a model's is another run's business
    if options.get("model"):
        learnt = read_model(options["model"])
        check_effects(learnt, options["model"])
        if options.get("drive") not in (None, learnt.learnt_from.drive):
            raise UsageError(
                f"--drive {options['drive']!r} is not what the model was learnt with",
                found=f"{options['model']}: {learnt.learnt_from.drive or 'no drive'}",
                do="leave --drive out: the model file tells it",
            )
        options["drive"] = learnt.learnt_from.drive
    sources = choose_sources(runs)
    check_targets(targets, sources)
    told = given["start"] != "auto"
    readings = read_all(sources, given if told or from_rise else {**given, "start": "0"}, quiet)
    until = options.get("until_min")
    tasks = []
    for run, start in readings.runs:
        if until is not None and until > run.time_s[-1] / 60.0 * 1.001:
            raise UsageError(f"{run.name}: --until {until:g} is longer than the record", found=f"{run.time_s[-1] / 60.0:.4g} min")
        if drive is not None:
            check_drive(run, drive)
        tasks.append(LoopTask(run, start, **options))
    return tasks, readings.unreadable


@contextmanager
def _sharing(tasks: Sequence[Any], jobs: int) -> Iterator[Spread]:
    if jobs < 2 or max((len(t.run.time_s) * len(t.run.channels) for t in tasks), default=0) < SHARED_FROM:
        yield map
        return
    shared = Shared(jobs)
    try:
        yield shared
    finally:
        shared.close()


def _counted(spread: Spread, advance: Callable[[int], None]) -> Spread:
    """The same sharing out, telling each piece of work that is done."""

    def counting(work: Callable[[Any], Any], items: Any) -> Iterator[Any]:
        for result in spread(work, items):
            advance(1)
            yield result

    return counting


def run_loop(
    work: Callable[..., list[Any]],
    tasks: Sequence[Any],
    jobs: int | None,
    lost: Callable[[Any], list[Any]],
    quiet: bool,
    shares: bool = False,
) -> tuple[list[Any], bool]:
    """Results in the order of the runs, and whether the user interrupted; what was finished by then is kept.

    Many runs are spread over processes, a run each. ``shares``: the work takes a keyword `spread` and shares out a single large
    run by it.
    """
    wanted = jobs if jobs is not None else cores()
    several = len(tasks) >= POOL_FROM or (jobs is not None and len(tasks) > 1)
    found: list[Any] = []
    single = len(tasks) == 1
    with (
        progress(len(tasks), "models tried" if single else "runs", quiet) as advance,
        _sharing(tasks, 1 if several or not shares else wanted) as spread,
    ):
        try:
            processes = min(wanted, len(tasks)) if several else 1
            doing = partial(work, spread=_counted(spread, advance) if single else spread) if shares else work
            for results in map_tasks(doing, tasks, processes, lambda task: task.singles(), lost):
                advance(0 if single else 1)
                found += results
        except KeyboardInterrupt:
            say(f"interrupted: {len(found)} runs were finished")
            return found, True
    return found, False
