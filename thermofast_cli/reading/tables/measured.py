"""Binary files of measurement programs: TDMS of National Instruments, MATLAB's .mat; their channels as a table."""

import io
import logging
import struct
import zlib
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import InputError, UsageError, listed
from ..table import Table
from .frames import table_of
from .limits import Limits, matlab_elements, matlab_order

TDMS, MATLAB, NEW_MATLAB = b"TDSm", b"MATLAB 5.0", b"MATLAB 7.3"
#: Kinds of the elements of a MATLAB file that hold numbers or text, that of a matrix, and how deep those may stand in each other.
MATLAB_KINDS, MATLAB_MATRIX, MATLAB_DEPTH = frozenset([1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18]), 14, 20
#: Of a matrix: the kind of its flags, the bit that says it is complex, and its class.
FLAGS_KIND, COMPLEX, CHARACTERS, SPARSE, LAST_NUMERIC = 6, 0x800, 4, 5, 15
#: Kinds of scales that npTDMS applies; of another kind it would hand on the raw numbers.
SCALES = frozenset(
    ["Linear", "Polynomial", "RTD", "Strain", "Table", "Thermistor", "Thermocouple", "Add", "Subtract", "AdvancedAPI"]
)


def is_measured(data: bytes) -> bool:
    """Whether these are the bytes of such a file."""
    return data.startswith((TDMS, MATLAB, NEW_MATLAB))


def measured_table(data: bytes, name: str, group: str | None, limits: Limits) -> Table:
    """The channels of a file as columns; group: which of several groups or structures, as ``--sheet`` names it.

    Raises
    ------
    InputError: it cannot be read, holds no channels, a scale that cannot be applied, or groups of which one must be named.
    UsageError: no group of that name.
    """
    if data.startswith(TDMS):
        return _tdms(data, name, group)
    if data.startswith(MATLAB):
        try:
            for element in matlab_elements(data, name, limits):
                _check_tags(element, matlab_order(data), 0)
        except (zlib.error, ValueError) as error:
            raise _damaged(name, error) from None
    return _matlab(data, name, group)


def _check_tags(held: memoryview, order: str, depth: int) -> None:
    """Raises ValueError where something else stands in place of numbers: scipy (1.17) then looks its kind up beyond a table.

    Elements follow each other, each with a tag of its kind and size, or of up to four bytes within the tag. A matrix holds its
    flags, its size, its name, and then its numbers or, of cells and structures, matrices.
    """
    if depth > MATLAB_DEPTH:
        raise ValueError(f"more than {MATLAB_DEPTH} structures within each other")
    for kind, inside in _elements(held, order):
        if kind != MATLAB_MATRIX or not len(inside):
            continue
        parts = _elements(inside, order)
        if len(parts) < 3 or parts[0][0] != FLAGS_KIND or len(parts[0][1]) != 8:
            raise ValueError("a variable without its flags, size and name")
        flags = struct.unpack(f"{order}I", parts[0][1][:4])[0]
        numbers = _numbers_in(flags & 0xFF) + (1 if flags & COMPLEX and _numbers_in(flags & 0xFF) else 0)
        if len(parts) < 3 + numbers or any(k not in MATLAB_KINDS for k, _ in parts[3 : 3 + numbers]):
            raise ValueError("a variable without its numbers")
        _check_tags(inside, order, depth + 1)


def _numbers_in(of: int) -> int:
    """How many elements of numbers a matrix of a class has: sparse ones rows, columns and values, others their values."""
    return 3 if of == SPARSE else 1 if of == CHARACTERS or (of > SPARSE and of <= LAST_NUMERIC) else 0


def _elements(held: memoryview, order: str) -> list[tuple[int, memoryview]]:
    """(kind, content) of what stands one after the other; raises ValueError where a kind is none or a size cannot be."""
    found, at = [], 0
    while at + 8 <= len(held):
        kind, size = struct.unpack(f"{order}II", held[at : at + 8])
        small, kind = kind >> 16, kind & 0xFFFF
        if (kind != MATLAB_MATRIX and kind not in MATLAB_KINDS) or small > 4:
            raise ValueError(f"an element of kind {kind} and {small or size} bytes")
        begin = at + 4 if small else at + 8
        found.append((kind, held[begin : begin + (small or size)]))
        at += 8 if small else 8 + -(-size // 8) * 8
    return found


def _damaged(name: str, error: Exception) -> InputError:
    return InputError(f"{name}: a MATLAB file that cannot be read", found=str(error)[:120], do="save it again, or as CSV")


def _tdms(data: bytes, name: str, group: str | None) -> Table:
    try:
        import nptdms
        from nptdms.log import log_manager
    except ImportError:
        raise InputError(
            f"{name}: a National Instruments TDMS file",
            do="pip install 'thermofast[tdms]', or export it as text from LabVIEW, DIAdem or the TDMS importer of Excel",
        ) from None
    log_manager.set_level(logging.ERROR)  # what it warns of is refused below, in our words
    try:
        file = nptdms.TdmsFile.read(io.BytesIO(data))
        groups = {g.name: [c for c in g.channels() if len(c)] for g in file.groups()}
    except Exception as error:
        raise InputError(f"{name}: a TDMS file that cannot be read", found=str(error)[:120], do="export it as text") from None
    chosen, channels = _one_of(groups, name, group, "TDMS groups of channels")
    for channel in channels:
        kinds = {str(v) for key, v in channel.properties.items() if key.endswith("_Scale_Type")}
        if channel.properties.get("NI_Scaling_Status", "") != "scaled" and (unknown := sorted(kinds - SCALES)):
            raise InputError(
                f"{name}: channel {channel.name!r} has a scale that cannot be applied here",
                found=listed(unknown),
                allowed=listed(sorted(SCALES)),
                do="export it as text, scaled, from LabVIEW or DIAdem",
            )
    lengths = {len(c) for c in channels}
    steps = {float(c.properties.get("wf_increment", 0.0)) for c in channels}
    if len(lengths) > 1 or len(steps) > 1:
        raise InputError(
            f"{name}: channels of group {chosen!r} that do not run alike",
            found=f"{listed([str(n) for n in sorted(lengths)])} readings, every {listed([f'{s:g}' for s in sorted(steps)])} s",
            allowed="one clock for all channels",
            do="export the channels that belong together as text",
        )
    columns: dict[str, Any] = {}
    step = steps.pop()
    if step > 0.0:
        columns["time [s]"] = step * np.arange(lengths.pop())
    units = {}
    for channel in channels:
        told = str(channel.properties.get("unit_string") or channel.properties.get("NI_UnitDescription") or "")
        columns[channel.name] = channel[:]
        units[channel.name] = {"Volts": "V", "Deg C": "°C", "deg C": "°C", "Kelvins": "K"}.get(told, told)
    table = table_of(columns, name)
    return replace(table, units=table.units | units, notes=(f"TDMS, group {chosen!r}, {len(channels)} channels",))


def _matlab(data: bytes, name: str, group: str | None) -> Table:
    if data.startswith(NEW_MATLAB):
        raise InputError(
            f"{name}: a MATLAB 7.3 file",
            allowed="MATLAB 5 to 7",
            do="save it with save(..., '-v7'), or as CSV by writetable",
        )
    from scipy.io import loadmat

    try:
        held = loadmat(io.BytesIO(data), squeeze_me=True, struct_as_record=True)
    except Exception as error:
        raise _damaged(name, error) from None
    whole: list[tuple[str, Any]] = []
    groups: dict[str, list[tuple[str, Any]]] = {}
    for key, value in held.items():
        if key.startswith("__"):
            continue
        if isinstance(value, np.ndarray) and value.dtype.names and value.ndim == 0:
            groups[key] = list(_vectors((n, value[n].item()) for n in value.dtype.names))
        else:
            whole += _vectors([(key, value)])
    if whole:
        groups["variables"] = whole
    chosen, vectors = _one_of({g: v for g, v in groups.items() if v}, name, group, "MATLAB structures of vectors")
    count = max(len(v) for _, v in vectors)
    kept = {n: v for n, v in vectors if len(v) == count}
    other = [n for n, v in vectors if len(v) != count]
    table = table_of(kept, name)
    notes = [f"MATLAB, {chosen}, {len(kept)} columns"]
    notes += [f"of another length, left out: {listed(other, 6)}"] if other else []
    return replace(table, notes=tuple(notes))


def _vectors(values: Iterable[tuple[str, Any]]) -> list[tuple[str, Any]]:
    """Columns of numbers by name; a matrix gives one for each of its columns."""
    found = []
    for name, value in values:
        array = np.asarray(value)
        if array.dtype.kind not in "fiu" or array.size < 2:
            continue
        if array.ndim == 1:
            found.append((name, array.astype(float)))
        elif array.ndim == 2:
            long = array if array.shape[0] >= array.shape[1] else array.T
            found += [(f"{name}_{i + 1}", column.astype(float)) for i, column in enumerate(long.T)]
    return found


def _one_of(groups: dict[str, list[Any]], name: str, wanted: str | None, what: str) -> tuple[str, list[Any]]:
    """The group that is wanted, or the only one that holds anything."""
    held = {g: members for g, members in groups.items() if members}
    if wanted is not None:
        if wanted not in held:
            raise UsageError(f"{name}: --sheet {wanted!r} is none of its {what}", allowed=listed(list(held), 12))
        return wanted, held[wanted]
    if len(held) != 1:
        do = "say which: --sheet NAME" if held else ""
        raise InputError(f"{name}: {len(held) or 'no'} {what}", found=listed(list(held), 8), allowed="one", do=do)
    return next(iter(held.items()))
