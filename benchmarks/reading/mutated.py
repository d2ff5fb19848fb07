"""Damaged files: is every one read or refused in words, and at once?

python -m benchmarks.reading.mutated [--files 20000] [--seed 0] takes the sample runs, and real loggers' files where they are
beside the checkout, flips bits, cuts, doubles, swaps and overwrites, reads each, and prints how many were read, refused, ended in
a traceback or took longer than a second. What is not read or refused is told by its number, with which it can be made again.
"""

import argparse
import random
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path

import thermofast as tf

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = (ROOT / "sample_runs", ROOT.parent / "shared" / "loggers")
#: Larger files say nothing more and take longer; of text the first lines are enough [bytes].
LARGEST, OF_TEXT = 400_000, 20_000
#: Longer than this is a hang [s].
HANG = 1.0
NO_RECORDS = (".md", ".json", ".py", ".toml")


@cache
def originals() -> tuple[tuple[str, bytes], ...]:
    """Names and bytes of the files that are damaged."""
    found = [p for folder in FOLDERS if folder.is_dir() for p in sorted(folder.iterdir()) if p.suffix not in NO_RECORDS]
    return tuple((p.name, _first_lines(p.read_bytes())) for p in found if p.is_file() and p.stat().st_size <= LARGEST)


def _first_lines(data: bytes) -> bytes:
    return data if b"\0" in data[:OF_TEXT] else data[: data.rfind(b"\n", 0, OF_TEXT) + 1 or None]


def damaged(number: int) -> tuple[str, bytes]:
    """(name, bytes) of the damaged file of that number."""
    rng = random.Random(number)
    name, data = rng.choice(originals())
    whole = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        if len(whole) < 10:
            break
        a = rng.randrange(len(whole))
        b = min(len(whole), a + rng.randint(1, 60))
        how = rng.randrange(6)
        if how == 0:
            whole[a] ^= 1 << rng.randrange(8)
        elif how == 1:
            del whole[a:b]
        elif how == 2:
            whole[a:a] = whole[a:b]
        elif how == 3:
            del whole[a:]
        elif how == 4:
            lines = bytes(whole).split(b"\n")
            i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
            lines[i], lines[j] = lines[j], lines[i]
            whole = bytearray(b"\n".join(lines))
        else:
            whole[a:b] = rng.randbytes(b - a)
    return name, bytes(whole)


def outcome(numbers: Iterable[int]) -> list[tuple[int, str]]:
    """What became of each file: read, refused, slow, or the error that is a fault of the program."""
    told = []
    with tempfile.TemporaryDirectory() as folder:
        for number in numbers:
            name, data = damaged(number)
            path = Path(folder) / name
            path.write_bytes(data)
            began = time.process_time()
            try:
                tf.inspect(path)
                said = "read"
            except tf.ThermofastError:
                said = "refused"
            except Exception as error:
                said = f"{type(error).__name__}: {error}"[:120]
            told.append((number, "slow" if time.process_time() - began > HANG else said))
    return told


def blocks(first: int, count: int, size: int = 500) -> Iterator[range]:
    return (range(a, min(a + size, first + count)) for a in range(first, first + count, size))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    count: Counter[str] = Counter()
    with ProcessPoolExecutor() as pool:
        for part in pool.map(outcome, blocks(asked.seed, asked.files)):
            for number, said in part:
                fault = said not in ("read", "refused", "slow")
                count["traceback" if fault else said] += 1
                if fault or said == "slow":
                    print(f"{number}: {said}", flush=True)
    print("| files | read | refused | traceback | longer than 1 s |")
    print("| ---: | ---: | ---: | ---: | ---: |")
    print(f"| {asked.files} | {count['read']} | {count['refused']} | {count['traceback']} | {count['slow']} |")


if __name__ == "__main__":
    main()
