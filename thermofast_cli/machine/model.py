"""A learnt model as a value: loaded, saved, and handed to what takes a model."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .modelfile import ModelFile, read_model, write_model


@dataclass(frozen=True)
class Model:
    """What was learnt of one machine. source names it in messages: its file, or the run it was learnt from."""

    file: ModelFile
    source: str

    @classmethod
    def load(cls, path: "str | Path | Model") -> "Model":
        """A model file, checked; a model that is loaded already is given back.

        Raises
        ------
        UsageError: no such file, not TOML, another version, an unknown or missing key, a number that is none.
        """
        return path if isinstance(path, Model) else cls(read_model(str(path)), str(path))

    def save(self, path: str | Path) -> None:
        """Write the model, whole or not at all: .toml.

        Raises
        ------
        UsageError: another suffix, or a place that cannot be written.
        """
        from ..output.files import check_target

        check_target(str(path), (".toml",))
        write_model(str(path), self.file)

    @property
    def channels(self) -> tuple[str, ...]:
        """The sensors it knows."""
        return self.file.channels

    @property
    def effects(self) -> tuple[str, ...]:
        """Ids of its effects, in order."""
        return tuple(e.id for e in self.file.effects)

    @property
    def drive(self) -> str | None:
        """The logged column that is its heat."""
        return self.file.learnt_from.drive

    def parameters(self) -> list[dict[str, Any]]:
        """Each number with its unit, standard error, sensor and effect (empty for the base model)."""
        found = [("", n) for n in self.file.base] + [(e.id, n) for e in self.file.effects for n in e.parameters]
        return [
            {
                "effect": owner,
                "name": n.name,
                "channel": n.channel,
                "value": n.value,
                "standard_error": n.standard_error,
                "unit": n.unit,
            }
            for owner, n in found
        ]
