"""Tasks over workers, a few in flight: one that dies, hangs or fails is tried again alone, and who did it is named."""

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from ..errors import ThermofastError
from .pool import cores, ended, import_all, new_pool

Task = TypeVar("Task")
Result = TypeVar("Result")

#: Single tasks that fail one after another, after which no more are tried: then it is not the tasks.
MOST_FAILURES = 5
#: How often it is looked whether anybody is still at work where nothing comes back [s].
LOOK_S = 5.0
#: Tasks in flight for each worker: one at work, one waiting for it.
AHEAD = 2
DIED = "the worker process died on this; run it alone with --jobs 1 to see why"
NOT_TRIED = f"not tried again: {MOST_FAILURES} in a row had failed before it"


class Crew(ABC):
    """Where tasks go: ``slots`` of them are worked on at once; near where the workers see the files of this machine."""

    slots: int
    near: bool

    @abstractmethod
    def submit(self, work: Callable[[Any], Any], task: Any) -> "Future[Any]":
        """Hand a task over."""

    @abstractmethod
    def renew(self, overdue: Collection["Future[Any]"]) -> bool:
        """Get rid of workers that died or are overdue; whether the tasks in flight went with them."""

    def gone(self) -> bool:
        """Whether nobody is there to work any more; pools and executors tell of their dead by the futures."""
        return False

    @abstractmethod
    def close(self) -> None:
        """No more tasks will come."""


class Here(Crew):
    """The process that asks, itself."""

    slots, near = 1, True

    def submit(self, work: Callable[[Any], Any], task: Any) -> "Future[Any]":
        """The task is done when this returns."""
        future: Future[Any] = Future()
        try:
            future.set_result(work(task))
        except Exception as error:
            future.set_exception(error)
        return future

    def renew(self, overdue: Collection["Future[Any]"]) -> bool:
        """Nothing to renew."""
        return False

    def close(self) -> None:
        """Nothing to end."""


class Local(Crew):
    """Processes of this machine."""

    near = True

    def __init__(self, jobs: int, pool: Executor | None = None) -> None:
        self.slots = jobs
        self._pool = pool if pool is not None else new_pool(jobs)

    def submit(self, work: Callable[[Any], Any], task: Any) -> "Future[Any]":
        """Hand a task over."""
        return self._pool.submit(work, task)

    def renew(self, overdue: Collection["Future[Any]"]) -> bool:
        """New processes for the old."""
        ended(self._pool)
        self._pool = new_pool(self.slots)
        return True

    def close(self) -> None:
        """Ends the processes, those at work too: nobody waits for them any more."""
        ended(self._pool)


class Given(Crew):
    """Somebody's executor: not ours to close; where it breaks, processes of this machine take its place."""

    near = False

    def __init__(self, executor: Executor, slots: int) -> None:
        if isinstance(executor, ThreadPoolExecutor):
            import_all()
        self.slots = slots
        self._executor = executor
        self._own: Local | None = None

    def submit(self, work: Callable[[Any], Any], task: Any) -> "Future[Any]":
        """Hand a task over."""
        return self._executor.submit(work, task) if self._own is None else self._own.submit(work, task)

    def renew(self, overdue: Collection["Future[Any]"]) -> bool:
        """What hangs in somebody's executor stays there: only what has not begun can be called back."""
        if self._own is not None:
            return self._own.renew(overdue)
        for future in overdue:
            future.cancel()
        if not overdue:
            self._own = Local(cores())
        return not overdue

    def close(self) -> None:
        """Left as it is, its successor ended."""
        if self._own is not None:
            self._own.close()


@dataclass
class Flow(Generic[Task, Result]):
    """``work`` on tasks by a crew.

    split gives a task's parts, each a task with one result; lost the results of a part that failed, from it and why; together
    makes one task of several parts, where parts done together come out otherwise than alone. limit_s [s]: a task that takes
    longer hangs. sound tells, where several failed in a row, whether a worker can do what is known to be sound; without it no more
    are tried.
    """

    work: Callable[[Task], Sequence[Result]]
    split: Callable[[Task], list[Task]]
    lost: Callable[[Task, str], list[Result]]
    together: Callable[[Sequence[Task]], Task] | None = None
    limit_s: float | None = None
    sound: Callable[[], bool] | None = None
    _failures: int = field(default=0, init=False)

    def results(self, tasks: Iterable[Task], crew: Crew) -> Iterator[tuple[int, Sequence[Result]]]:
        """(place, results) of each task as it is finished; tasks are drawn as there is room for them."""
        coming = enumerate(tasks)
        flying: dict[Future[Any], tuple[int, Task, float]] = {}
        again: list[tuple[int, Task]] = []
        more = True
        while True:
            while len(flying) < AHEAD * crew.slots and (again or more):
                drawn = again.pop(0) if again else next(coming, None)
                if drawn is None:
                    more = False
                    break
                if self._failures >= MOST_FAILURES:
                    yield drawn[0], self._given_up(drawn[1])
                else:
                    flying[_submitted(crew, self.work, drawn[1])] = (*drawn, time.monotonic())
            if not flying:
                return
            finished, _ = wait(flying, timeout=min(self._until_overdue(flying), LOOK_S), return_when=FIRST_COMPLETED)
            suspects: list[tuple[int, Task, str]] = []
            broken = not finished and crew.gone()
            for future in finished:
                place, task, _since = flying.pop(future)
                why, dead = _failure(future)
                if why:
                    suspects.append((place, task, why))
                    broken = broken or dead
                else:
                    self._failures = 0
                    yield place, future.result()
            if broken:
                # All that flew fell, and nobody knows which of them broke it.
                over = {future for future in flying if _done(future)}  # looked at once: some may still be coming in
                suspects += [(place, task, DIED) for future, (place, task, _) in flying.items() if future not in over]
                done = [(place, future.result()) for future, (place, _, _) in flying.items() if future in over]
                flying.clear()
                crew.renew(())
                yield from done
            # Others may go on finishing beside a task that hangs.
            elif overdue := {f: kept for f, kept in flying.items() if self._overdue(kept[2])}:
                suspects += [(place, task, self._hung()) for place, task, _ in overdue.values()]
                all_gone = crew.renew(overdue)
                again += [kept[:2] for f, kept in flying.items() if all_gone and f not in overdue]
                flying = {} if all_gone else {f: kept for f, kept in flying.items() if f not in overdue}
            for place, task, why in suspects:
                yield place, self.apart(task, why)

    def apart(self, task: Task, why: str) -> Sequence[Result]:
        """A task that failed, once more in a process of its own; if it fails again, its parts one after another."""
        if self._failures >= MOST_FAILURES:
            return self._given_up(task)
        whole, again = self.alone(task)
        if whole is not None:
            self._failures = 0
            return whole
        parts = self.split(task)
        if len(parts) < 2:
            self._failed()
            return self.lost(task, again or why)
        found: list[tuple[Task, Sequence[Result] | None, str]] = []
        for part in parts:
            results, why = self.alone(part) if self._failures < MOST_FAILURES else (None, NOT_TRIED)
            if results is None:
                self._failed()
            else:
                self._failures = 0
            found.append((part, results, why))
        sound = [part for part, results, _ in found if results is not None]
        joined = self.alone(self.together(sound))[0] if self.together is not None and sound else None
        same = iter(joined or [])
        return [
            r
            for part, results, why in found
            for r in (self.lost(part, why) if results is None else results if joined is None else [next(same)])
        ]

    def _failed(self) -> None:
        """One more in a row; where workers are sound all the same, it was the tasks."""
        self._failures += 1
        if self._failures >= MOST_FAILURES and self.sound is not None and self.sound():
            self._failures = 0

    def _given_up(self, task: Task) -> list[Result]:
        return [r for part in self.split(task) for r in self.lost(part, NOT_TRIED)]

    def alone(self, task: Task) -> tuple[Sequence[Result] | None, str]:
        """(results, "") of a task in a process of its own, or (None, why not)."""
        pool = new_pool(1)
        try:
            return pool.submit(self.work, task).result(self.limit_s), ""
        except ThermofastError:
            raise
        except BrokenExecutor:
            return None, DIED
        except TimeoutError:
            return None, self._hung()
        except Exception as error:
            return None, _words(error)
        finally:
            ended(pool)

    def _hung(self) -> str:
        return f"it did not end within {self.limit_s:g} s; run it alone with --jobs 1 to see why"

    def _overdue(self, since: float) -> bool:
        return self.limit_s is not None and time.monotonic() - since > AHEAD * self.limit_s

    def _until_overdue(self, flying: "dict[Future[Any], tuple[int, Task, float]]") -> float:
        if self.limit_s is None:
            return math.inf
        first = min(since for _, _, since in flying.values())
        return max(0.05, first + AHEAD * self.limit_s - time.monotonic() + 0.05)


def _submitted(crew: Crew, work: Callable[[Any], Any], task: Any) -> "Future[Any]":
    """What a crew gives for a task; where it takes none, a future that failed."""
    try:
        return crew.submit(work, task)
    except (BrokenExecutor, RuntimeError, OSError) as error:
        failed: Future[Any] = Future()
        failed.set_exception(error if isinstance(error, BrokenExecutor) else BrokenExecutor(str(error)))
        return failed


def _failure(future: "Future[Any]") -> tuple[str, bool]:
    """Why a task that is over failed, empty where it did not, and whether its worker is gone.

    Raises
    ------
    ThermofastError: the task itself says what the user is to mend.
    """
    if future.cancelled():
        return "it was called back", False
    error = future.exception()
    if isinstance(error, ThermofastError):
        raise error
    if error is None:
        return "", False
    return (DIED, True) if isinstance(error, BrokenExecutor) else (_words(error), False)


def _done(future: "Future[Any]") -> bool:
    return future.done() and not future.cancelled() and future.exception() is None


def _words(error: BaseException) -> str:
    text = str(error).strip().splitlines()
    what = "out of memory" if isinstance(error, MemoryError) else type(error).__name__
    return f"its work failed: {what}{': ' + text[0][:160] if text else ''}; run it alone with --jobs 1 to see why"


def in_order(flow: "Flow[Any, Any]", tasks: Sequence[Any], crew: Crew) -> Iterator[Sequence[Any]]:
    """Results of each task in the order of the tasks."""
    waiting: dict[int, Sequence[Any]] = {}
    following = 0
    for place, results in flow.results(tasks, crew):
        waiting[place] = results
        while following in waiting:
            yield waiting.pop(following)
            following += 1
