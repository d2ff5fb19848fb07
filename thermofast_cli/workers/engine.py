"""Work over processes: runs into tasks, tasks into results in order. Knows no screen and no command."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from ..errors import UsageError
from ..estimation.sensor import Signals, run_start
from ..reading import Run
from .flow import Crew, Flow, Given, Local, in_order
from .pool import Shared, cores, keep_freed_memory, worth

if TYPE_CHECKING:
    from thermofast.models.search.discover import Spread

#: A run and when its rise begins [min].
Started = tuple[Run, float]
#: Sensors per task: enough to make the way to a worker worth it, few enough to share out evenly.
MOST_PER_TASK = 250
#: The same where sensors are worked out in groups, which takes so long that the way does not count.
GROUPS_PER_TASK = 2
#: Tasks from which on a process keeps the memory that each frees for the next.
MANY = 4
#: Runs from which on a pool of processes pays.
POOL_FROM = 3
#: Readings of all sensors together from which on a single run is worth sharing.
SHARED_FROM = 1500
#: Workers that somebody's executor is taken to have at least.
MOST_ASKED = 64


def with_start(run: Run, start_min: float | None, from_rise: bool) -> Started:
    """A run with its start [min]: the one given, else where its rise begins, else its first reading.

    from_rise: without it a record counts from its first reading: an idle beginning is itself a finding of the discovery loop.

    Raises
    ------
    UsageError: a start outside the record.
    """
    minutes = run.time_s / 60.0
    if start_min is None:
        return run, run_start(minutes, list(run.channels.values())) if from_rise else 0.0
    if not 0.0 <= start_min < minutes[-1]:
        raise UsageError(
            f"{run.name}: --start {start_min:g} is outside the record",
            found=f"{minutes[-1]:.4g} min",
            allowed="a time inside the record",
        )
    return run, start_min


@dataclass(frozen=True)
class Work:
    """How work is done: processes (None: as many as it pays for), somebody's executor or a crew, who is told of progress.

    keep: what is finished when the user interrupts is given back, marked as interrupted; else the interrupt goes on its way.
    limit_s [s]: a task that takes longer hangs.
    """

    jobs: int | None = None
    executor: Executor | None = None
    advance: Callable[[int], None] = lambda _steps: None
    keep: bool = False
    limit_s: float | None = None
    crew: Crew | None = None

    def over(
        self,
        work: Callable[[Any], Sequence[Any]],
        tasks: Sequence[Any],
        processes: int,
        lost: Callable[[Any, str], list[Any]],
        together: Callable[[Sequence[Any]], Any] | None = None,
    ) -> Iterator[Sequence[Any]]:
        """Results of ``work`` for each task, in order; the arguments are those of :class:`~.flow.Flow`."""
        flow = Flow(work, lambda task: task.singles(), lost, together, self.limit_s)
        if self.crew is not None:
            yield from in_order(flow, tasks, self.crew)
        elif self.executor is None and processes <= 1 and self.limit_s is None:  # what hangs here hangs for good
            yield from map(work, tasks)
        else:
            own = (
                Local(max(1, min(processes, len(tasks))))
                if self.executor is None
                else Given(self.executor, max(processes, MOST_ASKED))
            )
            with closing(own):
                yield from in_order(flow, tasks, own)


class Asked(Sequence[Any]):
    """Tasks that are made each time they are asked for."""

    def __init__(self, makers: Sequence[Callable[[], Any]]) -> None:
        self._makers = makers

    def __len__(self) -> int:
        return len(self._makers)

    def __getitem__(self, i: Any) -> Any:
        return [make() for make in self._makers[i]] if isinstance(i, slice) else self._makers[i]()


def share_out(
    started: Sequence[Started],
    jobs: int | None,
    weight: float,
    make: Callable[[Signals], Any],
    whole: bool = False,
    together: int = 1,
) -> tuple[Sequence[Any], int]:
    """Tasks over all sensors of all runs, and the number of processes that they pay for.

    `whole` runs, or parts of them that hold each `together` neighbouring columns or a multiple. A task takes its readings from the
    run when it is asked for: a large file is not held twice.
    """
    sensors = sum(len(run.channels) for run, _ in started)
    longest = max((len(run.time_s) for run, _ in started), default=0)
    processes = jobs if jobs is not None else worth(sensors, longest, weight)

    def task(run: Run, start: float, part: tuple[str, ...]) -> Any:
        return make(Signals.of(run, start, part))

    tasks = []
    for run, start in started:
        channels = list(run.channels)
        most = MOST_PER_TASK if together == 1 else GROUPS_PER_TASK * together
        size = max(1, min(most, -(-len(channels) // (4 * processes)))) if processes > 1 else most
        size = len(channels) if whole else -(-size // together) * together
        tasks += [partial(task, run, start, tuple(channels[i : i + size])) for i in range(0, len(channels), size)]
    return Asked(tasks), processes


def over_sensors(
    work: Callable[[Any], Sequence[Any]],
    tasks: Sequence[Any],
    processes: int,
    lost: Callable[[Any, str], list[Any]],
    how: Work,
    together: Callable[[Sequence[Any]], Any] | None = None,
) -> tuple[list[Sequence[Any]], bool]:
    """Results of each task in the order of the sensors, one of each of its sensors, and whether the user interrupted the work."""
    if len(tasks) > MANY:
        keep_freed_memory()
    return _kept(how.over(work, tasks, processes, lost, together), how, lambda results: len(results))


def _kept(several: Iterator[Sequence[Any]], how: Work, steps: Callable[[Sequence[Any]], int]) -> tuple[list[Sequence[Any]], bool]:
    """The results of each task, and whether the user interrupted; steps of progress are counted from them."""
    found: list[Sequence[Any]] = []
    try:
        for results in several:
            how.advance(steps(results))
            found.append(results)
    except KeyboardInterrupt:
        if not how.keep:
            raise
        return found, True
    return found, False


def over_runs(
    work: Callable[..., list[Any]],
    tasks: Sequence[Any],
    lost: Callable[[Any, str], list[Any]],
    how: Work,
    shares: bool = False,
    long: bool = False,
) -> tuple[list[Any], bool]:
    """Results in the order of the runs, and whether the user interrupted.

    Many runs are spread over processes, a run each. ``shares``: the work takes a keyword `spread` and shares out a single large
    run by it, and a small one where the work is `long`.
    """
    wanted = how.jobs if how.jobs is not None else cores()
    elsewhere = how.executor is not None or how.crew is not None or how.limit_s is not None
    several = len(tasks) >= POOL_FROM or (how.jobs is not None and len(tasks) > 1) or elsewhere
    single = len(tasks) == 1
    with sharing(tasks, 1 if several or not shares else wanted, long) as spread:
        doing = partial(work, spread=_counted(spread, how.advance) if single and not several else spread) if shares else work
        processes = min(wanted, len(tasks)) if several else 1
        told, stopped = _kept(how.over(doing, tasks, processes, lost), how, lambda _results: 0 if single and shares else 1)
    return [one for results in told for one in results], stopped


@contextmanager
def sharing(tasks: Sequence[Any], jobs: int, long: bool) -> Iterator["Spread"]:
    """A spread over processes for runs that are large, or for work that is long; else a plain map."""
    if jobs < 2 or not (long or max((len(t.run.time_s) * len(t.run.channels) for t in tasks), default=0) >= SHARED_FROM):
        yield map
        return
    shared = Shared(jobs)
    try:
        yield shared
    finally:
        shared.close()


def _counted(spread: "Spread", advance: Callable[[int], None]) -> "Spread":
    """The same sharing out, telling each piece of work that is done."""

    def counting(work: Callable[[Any], Any], items: Any) -> Iterator[Any]:
        for result in spread(work, items):
            advance(1)
            yield result

    return counting
