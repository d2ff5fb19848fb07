"""A learnt model as a value: loaded, saved, and handed to what takes a model."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec

from ..errors import UsageError
from .modelfile import ModelFile, read_model, write_model


@dataclass(frozen=True, repr=False)
class Model:
    """What was learnt of one machine. source names it in messages: its file, or the run it was learnt from; what is equal tells the
    same of a machine, wherever it is from.
    """

    file: ModelFile
    source: str = field(compare=False)

    def __repr__(self) -> str:
        """Of what and with what: all its numbers would flood a prompt."""
        effects = ", ".join(self.effects) or "no effects"
        return f"<Model of {self.source}: {len(self.channels)} sensors, {effects}; .parameters() lists its numbers>"

    @classmethod
    def load(cls, path: "str | Path | Model", extra: str | Sequence[str] = ()) -> "Model":
        """A model file, checked; a model that is loaded already is given back.

        extra: files with the effects of your own that it speaks of, FILE.py[:CLASS]. A model is data: no code that it names is run
        unless you name it.

        Raises
        ------
        UsageError: no such file, not TOML, another version, an unknown or missing key, a number that is none; an effect of
        somebody's own that `extra` does not give.
        """
        if isinstance(path, Model):
            return path
        return cls(_with_own_effects(read_model(str(path)), str(path), [extra] if isinstance(extra, str) else extra), str(path))

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


def _with_own_effects(model: ModelFile, path: str, extra: Sequence[str]) -> ModelFile:
    """The model with the files that the user named for effects of somebody's own, wherever the model was learnt."""
    if not any(entry.file for entry in model.effects):
        return model
    from ..plugins.effects import load_effect

    given = {load_effect(spec).id: spec for spec in extra}
    entries = []
    for entry in model.effects:
        spec = given.get(entry.id.partition(".")[0])
        if entry.file and spec is None:
            raise UsageError(
                f"{path}: its effect {entry.id!r} is code of somebody's own, in {entry.file}",
                allowed="code that you name: no file that a model speaks of is run by itself",
                do=f"look into it, and say --effect {entry.file}, in Python tf.Model.load({path!r}, extra={entry.file!r})",
            )
        entries.append(msgspec.structs.replace(entry, file=spec) if entry.file else entry)
    return msgspec.structs.replace(model, effects=tuple(entries))
