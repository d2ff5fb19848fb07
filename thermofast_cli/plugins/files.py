"""A user's own file: imported under one module name in every process, and the class in it that is meant."""

import hashlib
import importlib.util
import inspect
import re
import sys
import traceback
from pathlib import Path
from typing import Any

from ..errors import UsageError, listed
from .guard import PluginError, alarm, imported, where


def is_file(name: str) -> bool:
    """Whether a name is that of a file: ``my_effect.py`` or ``my_effect.py:MyEffect``."""
    return path_and_class(name)[0].endswith(".py")


def path_and_class(spec: str) -> tuple[str, str]:
    """The file and the class of ``path/to/file.py:Class``; a path may hold colons itself."""
    path, _, wanted = spec.rpartition(":")
    return (path, wanted) if path.endswith(".py") else (spec, "")


def class_in(spec: str, base: type, what: str, guide: str) -> type[Any]:
    """The class derived from `base` in ``path/to/file.py`` or ``path/to/file.py:Class``; `what` it is in words, `guide` its page.

    Raises
    ------
    UsageError: no such file, no such class in it, or more than one.
    PluginError: the file cannot be imported.
    """
    path, wanted = path_and_class(spec)
    file = Path(path)
    if not file.is_file():
        raise UsageError(
            f"{path}: no such file", do=f"name a Python file with one {what} class, as in my_{what}.py:My{what.title()}"
        )
    name = f"thermofast_user_{file.stem}_{hashlib.sha256(str(file.resolve()).encode()).hexdigest()[:8]}"
    module_spec = importlib.util.spec_from_file_location(name, file)
    assert module_spec is not None
    assert module_spec.loader is not None
    module = importlib.util.module_from_spec(module_spec)
    sys.modules[name] = module
    try:
        with alarm(f"{path}: still importing", file=path), imported():
            module_spec.loader.exec_module(module)
    except PluginError:
        raise
    except BaseException as error:
        renamed = new_name(error)
        do = f"write {renamed}: the packages were renamed" if renamed else "run it with python to see more"
        if isinstance(error, TypeError) and "non-frozen dataclass" in str(error):
            do = "write @dataclass(frozen=True) above the class"
        raise PluginError(f"{path}: cannot be imported", found=where(error, path), do=do) from None
    there = [v for v in vars(module).values() if inspect.isclass(v) and issubclass(v, base) and v is not base]
    kinds = [k for k in there if k.__module__ == name and (not wanted or k.__name__ == wanted)]
    old = {b.__module__ for v in vars(module).values() if inspect.isclass(v) for b in v.__mro__} if not there else set()
    renamed = next((new for o in sorted(old) if (new := _new_module(o))), "")
    if renamed:
        raise PluginError(f"{path}: its {what} class is not thermofast's", do=f"write {renamed}: the packages were renamed")
    if len(kinds) != 1:
        raise UsageError(
            f"{spec}: {'no' if not kinds else 'more than one'} {what} class {wanted or ''}".rstrip(),
            found=listed([k.__name__ for k in there]) or f"no class derived from {base.__module__}.{base.__name__}",
            allowed="one class, or its name after a colon",
            do=f"see {guide}",
        )
    return kinds[0]


def new_name(error: BaseException) -> str:
    """What to import in the place of a name that thermofast up to 0.3 had at the top level; empty for any other error."""
    if not isinstance(error, ModuleNotFoundError):
        return ""
    # The name of the error is that of the package alone: its line tells which part of it was meant.
    missing = error.name or ""
    lines = [f.line for f in traceback.extract_tb(error.__traceback__) if f.line and missing in f.line]
    said = re.match(r"\s*(?:from|import)\s+([\w.]+)", lines[-1]) if lines else None
    whole = said[1] if said and said[1].partition(".")[0] == missing else missing
    return _new_module(whole)


def _new_module(name: str) -> str:
    first, _, rest = name.partition(".")
    new = {"models": "thermofast.models", "filters": "thermofast.filters", "thermofast_cli": "thermofast"}.get(first)
    if new is None:
        return ""
    rest = rest.removesuffix(".base")  # the class is given by the package above it
    if rest and importlib.util.find_spec(f"{new}.{rest}") is None:
        rest = ""
    return f"'from {new}.{rest} import ...'" if rest and rest != "base" else f"'from {new} import ...'"
