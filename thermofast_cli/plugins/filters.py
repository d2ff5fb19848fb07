"""Filters: built in, of installed packages, of a user's own file. All pass one check, which says what to write instead."""

from dataclasses import Field, fields, is_dataclass
from typing import Any

import numpy as np

from thermofast.filters import BUILT_IN, Filter, Track
from thermofast.models import Lump
from thermofast.models.observations import read_only

from .entrypoints import Broken, installed, taken
from .files import class_in, is_file
from .guard import PluginError, misspelt, watched

GROUP = "thermofast.filters"
GUIDE = "docs/add-a-filter.md"
PER_READING = (
    "noise_variance",
    "innovation",
    "innovation_variance",
    "fading",
    "process_noise",
    "noise_factor",
    "weight",
    "forgotten",
)
#: Readings of the check, of which the first are filtered once more before others, and a difference of states that is no rounding.
READINGS, BEFORE, FORESEEN = 60, 50, 1e-6
CLOSINGS = ("never", "when consistent", "always")


def known_filters() -> dict[str, type[Filter]]:
    """Built-in filters by name, then those of installed plug-ins."""
    known: dict[str, type[Filter]] = {f.name: f for f in BUILT_IN}
    for plugin in installed(GROUP, checked)[0]:
        known.setdefault(plugin.name, plugin)
    return known


def broken_filters() -> list[Broken]:
    """Installed plug-ins that cannot be used."""
    good, broken = installed(GROUP, checked)
    return [*broken, *taken(good, [kind.name for kind in BUILT_IN], "name")]


_LOADED: dict[str, type[Filter]] = {}


def load_filter(spec: str) -> type[Filter]:
    """The filter class of ``path/to/file.py`` or ``path/to/file.py:Class``; another process loads the file itself.

    Raises
    ------
    UsageError: no such file or class. PluginError: it cannot be imported, or does not pass the check.
    """
    if spec not in _LOADED:
        kind = checked(class_in(spec, Filter, "filter", GUIDE), spec)
        if kind.name in [built.name for built in BUILT_IN]:
            raise PluginError(f"{spec}: its name {kind.name!r} is taken", allowed="a name of its own", do="rename it")
        extra = {"__reduce__": _reduce, "spec": spec, "__guard__": True, "__module__": kind.__module__, "__doc__": kind.__doc__}
        _LOADED[spec] = type(kind.__name__, (kind,), extra)
    return _LOADED[spec]


def _reduce(own: Any) -> Any:
    return _again, (own.spec, {f.name: getattr(own, f.name) for f in fields(own)})


def _again(spec: str, settings: dict[str, Any]) -> Filter:
    return load_filter(spec)(**settings)


def checked(candidate: Any, origin: str) -> type[Filter]:
    """A filter class that passed the check.

    Raises
    ------
    PluginError: what is wrong with it, and what to write instead.
    """
    problem = declaration_problem(candidate)
    if problem:
        raise PluginError(f"{origin}: {problem}", do=f"see {GUIDE}")
    check(candidate(), origin)
    found: type[Filter] = candidate
    return found


def declaration_problem(candidate: Any) -> str | None:
    """What is wrong with what a would-be filter class says of itself, or None."""
    if not (isinstance(candidate, type) and issubclass(candidate, Filter)):
        return f"found {candidate!r}, needed a class derived from thermofast.filters.Filter"
    for attribute in ("name", "summary", "reference"):
        value = getattr(candidate, attribute, None)
        if not isinstance(value, str) or not value or value == "abstract":
            return f"its {attribute} must be a non-empty text"
    if candidate.track is Filter.track:
        return "it has no track(self, model, time, reading, resolution)"
    if any(isinstance(value, Field) for value in vars(candidate).values()):
        return "its settings are not made: write @dataclass(frozen=True) above the class"
    if candidate.__init__ is not object.__init__ and not is_dataclass(candidate):
        return "its settings must be fields of a frozen dataclass: @dataclass(frozen=True) above the class"
    for f in fields(candidate):
        if isinstance(f.default, bool):
            continue
        if not {"meaning", "low", "high"} <= set(f.metadata):
            return f"its setting {f.name!r} must say its meaning and range: {f.name}: float = setting(DEFAULT, MEANING, LOW, HIGH)"
        low, high = f.metadata["low"], f.metadata["high"]
        if not isinstance(f.default, int | float):
            return f"its setting {f.name!r} must be a number (found {f.default!r})"
        if not low <= f.default <= high:
            return f"its setting {f.name!r} has a default outside {low:g} to {high:g} (found {f.default!r})"
    if slip := misspelt(candidate, Filter):
        return slip
    try:
        made = candidate()
    except Exception as error:  # whatever a stranger's class does when it is made
        return f"it must have a default for every setting ({error})"
    if made.closing not in CLOSINGS:
        return f"its closing must be one of {', '.join(map(repr, CLOSINGS))} (found {made.closing!r})"
    return None


def check(method: Filter, origin: str) -> None:
    """Runs a filter, built in or not, on a small made-up record.

    Raises
    ------
    PluginError: it raises, never ends, what it gives back is no track of the record, or looks at readings that come later.
    """
    time = np.arange(float(READINGS))
    reading = 20.0 + 5.0 * -np.expm1(-0.03 * time) + 0.01 * np.sin(7.0 * time)
    with watched(method, f"filter {method.name!r}"):
        track = method.track(Lump(), read_only(time), read_only(reading), 0.0)
        other = method.track(
            Lump(), read_only(time), read_only(np.where(np.arange(READINGS) < BEFORE, reading, reading + 0.5)), 0.0
        )
    problem = (
        track_problem(track, len(time), method.closing)
        or track_problem(other, len(time), method.closing)
        or _foresight_problem(track, other)
    )
    if problem:
        raise PluginError(f"{origin}: {problem}", do=f"see {GUIDE}")


def track_problem(track: Any, count: int, closing: str) -> str | None:
    """What is wrong with what a filter of such a `closing` gave back for `count` readings, or None."""
    if not isinstance(track, Track):
        return f"track() gave {type(track).__name__}, needed thermofast.filters.Track"
    return (
        _shape_problem(track, count)
        or _place_problem(track, count, closing)
        or _weight_problem(track)
        or _noise_problem(track)
        or _state_problem(track, count)
    )


def _foresight_problem(track: Track, other: Track) -> str | None:
    """What is wrong with a track whose states change with readings after them: what it says at a time would be hindsight."""
    ends = [BEFORE, *(t.diverged_at for t in (track, other) if t.diverged_at is not None)]
    kept = slice(max(track.first, other.first), min(ends))
    if not (np.abs(track.state - other.state)[kept] > FORESEEN * (1.0 + np.abs(other.state[kept]))).any():
        return None
    return (
        "its track's state is another where other readings come later, needed one that knows none after its own, and a seed"
        " where it draws at random"
    )


def _shape_problem(track: Track, count: int) -> str | None:
    """What is wrong with the shapes and types of a track's arrays."""
    shapes: dict[str, tuple[int, ...]] = {"state": (count, 3), "covariance": (count, 3, 3)}
    for name in PER_READING:
        shapes[name] = (count,)
    for name, shape in shapes.items():
        values = getattr(track, name)
        if np.shape(values) != shape:
            return f"its track's {name} has the shape {np.shape(values)}, needed {shape}"
        if not isinstance(values, np.ndarray) or values.dtype.kind != "f":
            kind = values.dtype if isinstance(values, np.ndarray) else type(values).__name__
            return f"its track's {name} is of type {kind}, needed an array of floats"
    return None


def _place_problem(track: Track, count: int, closing: str) -> str | None:
    """What is wrong with where a track begins, and from where on it diverged."""
    for name in ("first", "diverged_at"):
        at = getattr(track, name)
        if name == "diverged_at" and at is None:
            continue
        if not isinstance(at, int | np.integer) or isinstance(at, bool) or not 0 <= at <= count:
            return f"its track's {name} is {at!r}, needed the number of a reading of {count}, from 0 on"
    if closing == "never" and track.first >= count:
        return "its track begins at no reading, and its closing is 'never': nothing would be estimated"
    return None


def _weight_problem(track: Track) -> str | None:
    """What is wrong with the weights of the readings."""
    kept = track.weight[: track.diverged_at]
    wrong = kept[~((kept >= 0.0) & (kept <= 1.0))]
    if len(wrong):
        return f"its track's weight holds {wrong[0]:g}, needed 0 for a reading that it left out, else 1"
    if len(kept) and not kept.any():
        return "its track's weight leaves out every reading"
    return None


def _noise_problem(track: Track) -> str | None:
    """What is wrong with the factors of the noise, of readings that count."""
    factor = track.noise_factor[: track.diverged_at][track.weight[: track.diverged_at] > 0.0]
    if not ((factor > 0.0) & np.isfinite(factor)).all():
        found = factor[~((factor > 0.0) & np.isfinite(factor))][0]
        return f"its track's noise_factor holds {found:g}, needed more than 0: 1 where the noise is as ever"
    return None


def _state_problem(track: Track, count: int) -> str | None:
    """What is wrong with states and variances, before the filter diverged."""
    good = slice(track.first, track.diverged_at)
    if not np.isfinite(track.state[good]).all():
        return "its track's state is not finite, and diverged_at does not say from which reading on"
    for name in ("noise_variance", "innovation_variance"):
        if (getattr(track, name)[good] < 0.0).any():
            return f"its track's {name} holds {np.nanmin(getattr(track, name)[good]):.3g}, needed 0 or more"
    variance = np.diagonal(track.covariance[good], axis1=1, axis2=2)
    if track.diverged_at is None and not (variance >= 0.0).all():
        if track.first >= count - 1:
            return "no beginning of these readings tells a rate: they did not move until late; say --start, or measure on"
        return f"its track's covariance has a variance of {np.nanmin(variance):.3g}, needed 0 or more"
    return None


def filter_class(name: str, known: dict[str, type[Filter]]) -> type[Filter] | None:
    """The class of a filter's name, or of a user's own file; None for an unknown name."""
    return load_filter(name) if is_file(name) else known.get(name)
