"""Up to 1,000 workers on paper: a schedule simulated with costs that are measured here.

python -m benchmarks.scale.saturation measures what a block costs the client (reading and hashing its files, packing it, unpacking
and writing what comes back) and a worker (unpacking, working, packing), for archives of small and of large files, with and
without the closing estimate that counts the machine; adds a network and Dask's scheduler (dask documentation: about 200 us a
task; 10 Gbit/s); and lets one client feed N workers with two blocks in flight for each, as the program does.
"""

import heapq
import pickle
import tempfile
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from benchmarks.scale.archives import make as make_wide
from benchmarks.scale.killed import make_archive
from thermofast.archives.blocks import Analysis, Block, Reading, WholeFile, cut, work_block
from thermofast.archives.parts import Manifest, Parts
from thermofast.archives.sources import SourceFile, sources_of
from thermofast.archives.stream import BLOCK_S
from thermofast.pipeline.methods import choose
from thermofast.pipeline.sensors import identify_runs
from thermofast.reading import Options
from thermofast.reading.source import content_of

SCHEDULER_S, BYTES_PER_S = 2e-4, 10e9 / 8
WORKERS = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1000)


@dataclass(frozen=True)
class Costs:
    """Of a block [s]: the client's before it goes out and after it is back, on its way, and the worker's."""

    before: float
    after: float
    way: float
    work: float


def measured(folder: Path, imperfection: str, shared: bool) -> Costs:
    """Costs of a block of so many files as take a worker BLOCK_S; shared: workers read and write the files themselves."""
    from thermofast.machine.lab import read_imperfection

    rates = "auto" if imperfection == "typical" else "own"
    method = choose("afukf", None, (), read_imperfection(imperfection), rates)
    analysis = Analysis("identify", identify_runs([], method).kind, partial(identify_runs, method=method), 50, {"filter": "afukf"})
    sources = sources_of([str(folder)])
    reader = Reading(Options(), None, True)
    if shared:
        return _shared(analysis, sources, reader)
    clock, began = time.perf_counter, time.perf_counter()
    contents, pieces = [], []
    for number, source in enumerate(sources):
        content, data = content_of(source.path)
        contents.append(content)
        pieces += cut(number, reader.started(source.path, data), 50, 10**9)
    reading = clock() - began
    block = Block(analysis, tuple(pieces))
    began = clock()
    packed = pickle.dumps(block, 5)
    packing = clock() - began
    work_block(Block(analysis, tuple(pieces[:1])))  # what is loaded at the first call is not the block's
    began = clock()
    done = work_block(pickle.loads(packed))
    working = clock() - began
    back = pickle.dumps(done, 5)
    began = clock()
    with tempfile.TemporaryDirectory() as results:
        parts = Parts(results, Manifest("identify", "0", "compiled", {}))
        for one in pickle.loads(back):
            parts.write(sources[one.source], contents[one.source], one.table)
        writing = clock() - began
    share = BLOCK_S / working
    return Costs(
        share * (reading + packing), share * writing, share * (len(packed) + len(back)) / BYTES_PER_S + SCHEDULER_S, BLOCK_S
    )


def _shared(analysis: Analysis, sources: list[SourceFile], reader: Reading) -> Costs:
    clock = time.perf_counter
    with tempfile.TemporaryDirectory() as results:
        parts = Parts(results, Manifest("identify", "0", "compiled", {}))
        began = clock()
        block = Block(analysis, tuple(WholeFile(i, s, reader, parts) for i, s in enumerate(sources)))
        packed = pickle.dumps(block, 5)
        packing = clock() - began
        work_block(Block(analysis, block.pieces[:1]))
        began = clock()
        back = pickle.dumps(work_block(pickle.loads(packed)), 5)
        working = clock() - began
        began = clock()
        pickle.loads(back)
        after = clock() - began
    share = BLOCK_S / working
    return Costs(share * packing, share * after, share * (len(packed) + len(back)) / BYTES_PER_S + SCHEDULER_S, BLOCK_S)


def throughput(costs: Costs, workers: int, blocks: int = 20_000) -> float:
    """Blocks per second: one client, a bounded number in flight, workers that take the first that waits."""
    blocks = min(blocks, 60 * workers + 400)
    client, back, free = 0.0, list[float](), [0.0] * workers
    flying = sent = finished = 0
    while finished < blocks:
        if sent < blocks and flying < 2 * workers:
            client += costs.before
            start = max(client + costs.way, heapq.heappop(free))
            heapq.heappush(free, start + costs.work)
            heapq.heappush(back, start + costs.work + costs.way)
            flying, sent = flying + 1, sent + 1
        else:
            client = max(client, heapq.heappop(back)) + costs.after
            flying, finished = flying - 1, finished + 1
    return blocks / client


def main() -> None:
    """Print a row for each archive."""
    print("| archive | client per block | " + " | ".join(map(str, WORKERS)) + " | saturates at |")
    print("| --- | ---: |" + " ---: |" * (len(WORKERS) + 1))
    with tempfile.TemporaryDirectory() as scratch:
        small, large = Path(scratch) / "small", Path(scratch) / "large"
        make_archive(small, 40, sensors=10)
        make_wide(large, 1, 2000)
        for name, folder in (("CSV of 10 sensors", small), ("Parquet of 2,000 sensors", large)):
            for kind in ("typical", "none"):
                for shared in (False, True):
                    costs = measured(folder, kind, shared)
                    client = costs.before + costs.after
                    gain = [throughput(costs, n) * (costs.work + client + 2.0 * costs.way) for n in WORKERS]
                    told = " | ".join(f"{g:.0f}" if g >= 10 else f"{g:.1f}" for g in gain)
                    who = "workers read" if shared else "client reads"
                    print(f"| {name}, {kind}, {who} | {1e3 * client:.1f} ms | {told} | {costs.work / client:.0f} workers |")


if __name__ == "__main__":
    main()
