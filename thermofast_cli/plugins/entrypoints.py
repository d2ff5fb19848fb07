"""Plug-ins of installed packages: a broken one is told with its reason and never stops another's work."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

Member = TypeVar("Member")


@dataclass(frozen=True)
class Broken:
    """A plug-in that cannot be used, and why."""

    name: str
    why: str


def installed(group: str, check: Callable[[Any, str], Member]) -> tuple[list[Member], list[Broken]]:
    """The members of a group that load and pass `check`, and those that do not."""
    good: list[Member] = []
    broken: list[Broken] = []
    for point in entry_points(group=group):
        origin = f"plug-in {point.name!r} ({point.value})"
        try:
            good.append(check(point.load(), origin))
        except (Exception, SystemExit) as error:
            broken.append(Broken(point.name, _why(point, error)))
    return good, broken


def _why(point: EntryPoint, error: BaseException) -> str:
    text = " ".join(str(error).split())
    package = point.dist.name if point.dist is not None else "?"
    return f"of package {package}, {point.value}: {type(error).__name__}: {text}"
