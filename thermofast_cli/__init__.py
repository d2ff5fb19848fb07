"""Steady state and settling time of a machine from the first part of its temperature record; see docs/api.md.

``import thermofast as tf`` gives ``tf.read``, ``tf.identify``, ``tf.sweep``, ``tf.compare``, ``tf.diagnose``, ``tf.improve``,
``tf.simulate``, ``tf.archive``, ``tf.Model`` and more. Names are imported when they are first used: the import itself is quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

try:
    from ._version import __version__ as __version__
except ImportError:  # sources that were never built
    __version__ = "0+unbuilt"

if TYPE_CHECKING:
    from .api import (
        calibrate,
        changed,
        compare,
        diagnose,
        identify,
        improve,
        plan,
        read,
        read_all,
        simulate,
        sweep,
        watch,
        write_effect,
    )
    from .archives.library import archive
    from .catalogue import effects, filter_catalogue
    from .errors import InputError, ThermofastError, UsageError
    from .judging import bench, displacement, sensitivity, validate
    from .machine.model import Model
    from .pipeline.inspecting import inspect
    from .reading import Guess, Run

#: Name -> module that has it; most analyses are in ``api``.
_ELSEWHERE = {
    "Guess": "reading",
    "InputError": "errors",
    "Model": "machine.model",
    "Run": "reading",
    "ThermofastError": "errors",
    "UsageError": "errors",
    "archive": "archives.library",
    "bench": "judging",
    "displacement": "judging",
    "effects": "catalogue",
    "filter_catalogue": "catalogue",
    "inspect": "pipeline.inspecting",
    "sensitivity": "judging",
    "validate": "judging",
}

__all__ = [
    "Guess",
    "InputError",
    "Model",
    "Run",
    "ThermofastError",
    "UsageError",
    "archive",
    "bench",
    "calibrate",
    "changed",
    "compare",
    "diagnose",
    "displacement",
    "effects",
    "filter_catalogue",
    "identify",
    "improve",
    "inspect",
    "plan",
    "read",
    "read_all",
    "sensitivity",
    "simulate",
    "sweep",
    "validate",
    "watch",
    "write_effect",
]


if not TYPE_CHECKING:  # to a type checker a name that is not there is a mistake

    def __getattr__(name: str) -> Any:
        if name not in __all__:
            raise AttributeError(f"module 'thermofast' has no attribute {name!r}; it has {', '.join(__all__)}")
        found = getattr(import_module(f".{_ELSEWHERE.get(name, 'api')}", __name__), name)
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
