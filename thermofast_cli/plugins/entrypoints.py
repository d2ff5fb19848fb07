"""Plug-ins of installed packages: a broken one is told with its reason and never stops another's work."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

from .guard import imported, said_by

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
    for point in _points(group, tuple(sys.path), entry_points):
        origin = f"plug-in {point.name!r} ({point.value})"
        try:
            with imported():
                member = point.load()
            good.append(check(member, origin))
        except (KeyboardInterrupt, GeneratorExit):
            raise
        except BaseException as error:
            broken.append(Broken(point.name, _why(point, error)))
    return good, broken


@lru_cache(maxsize=16)
def _points(group: str, path: tuple[str, ...], find: Callable[..., Sequence[EntryPoint]]) -> tuple[EntryPoint, ...]:
    """The entry points of a group, which are looked for in the files of all that is installed, along `path`: 30 ms each time."""
    return tuple(find(group=group))


def taken(members: Sequence[Any], names: Sequence[str], attribute: str) -> list[Broken]:
    """Members whose `attribute`, their name, is that of a built-in or of a plug-in before them, and which are not used for it."""
    seen, found = set(names), []
    for member in members:
        name = getattr(member, attribute)
        if name in seen:
            kind = member if isinstance(member, type) else type(member)
            found.append(Broken(name, f"{kind.__module__}:{kind.__qualname__}: its {attribute} {name!r} is taken: rename it"))
        seen.add(name)
    return found


def _why(point: EntryPoint, error: BaseException) -> str:
    package = point.dist.name if point.dist is not None else "?"
    return f"of package {package}, {point.value}: {type(error).__name__}: {said_by(error)}"
