"""LabVIEW measurement files of several segments."""

import re

from ...errors import InputError

#: Lines above the readings of each segment of a LabVIEW measurement file.
_SEGMENT_HEAD = re.compile(
    rb"(Channels|Samples|Date|Time|X_Dimension|X0|Delta_X|Y_Dimension|Y_Unit_Label|Notes|Test_\w+|UUT_\w+|Units_\w+)\t"
)
_SEGMENT_END = b"***End_of_Header***"


def joined_segments(data: bytes, name: str) -> tuple[bytes, list[str]]:
    """A LabVIEW measurement file of several segments with the readings of all of them under the first header.

    Raises
    ------
    InputError: the segments have different channels.
    """
    if not data.startswith(b"LabVIEW Measurement") or data.count(_SEGMENT_END) <= 2:
        return data, []
    ending = b"\r\n" if b"\r\n" in data else b"\n"
    lines = data.split(ending)
    ends = [i for i, line in enumerate(lines) if line.startswith(_SEGMENT_END)]
    head, names = lines[: ends[1] + 2], lines[ends[1] + 1]
    rows = list(head)
    for number, end in enumerate(ends[1:]):
        if lines[end + 1] != names:
            raise InputError(
                f"{name}, line {end + 2}: segment {number + 1} has other channels than the first",
                found=lines[end + 1].decode("latin-1")[:80],
                allowed="the same channels in all segments",
                do="export each segment to a file of its own",
            )
        until = ends[number + 2] if number + 2 < len(ends) else len(lines)
        rows += [b""] * (end + 2 - len(rows))  # lines that are left out stay as empty ones: line numbers hold
        rows += [b"" if _SEGMENT_HEAD.match(r) else r for r in lines[end + 2 : until]]
    return ending.join(rows) + ending, [f"{len(ends) - 1} segments joined"]
