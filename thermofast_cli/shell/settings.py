"""``thermofast.toml``: what a lab says once instead of on every command line."""

import tomllib
from pathlib import Path
from typing import Any

from ..errors import UsageError

FILE = "thermofast.toml"


def load_settings(path: str | None) -> dict[str, Any]:
    """Defaults per command, {command: {option: value}}, from the file named or from the one in this folder; empty without.

    Raises
    ------
    UsageError: no such file, not TOML, an unknown key or a wrong type; the message lists the known keys.
    """
    target = Path(path or FILE)
    if not target.is_file():
        if path:
            raise UsageError(f"{path}: no such file", do="check --config")
        return {}
    import msgspec

    try:
        raw = tomllib.loads(target.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{target}: not valid TOML", found=str(error), do="mend the line") from None
    from .settings_schema import Settings, known_keys

    try:
        settings = msgspec.convert(raw, Settings)
    except msgspec.ValidationError as error:
        raise UsageError(f"{target}: {error}", allowed=known_keys(), do="mend the key or its value") from None
    return settings.defaults(str(target))
