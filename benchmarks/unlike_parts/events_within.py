"""A heat or a cooling that nobody logged changed while a machine was read: is it seen, and what do the intervals hold?

python -m benchmarks.unlike_parts.events_within [--each 60] [--seed 640000]: chains of three to six bodies (see
``benchmarks.unlike_parts.chains``), read for 0.7 to 2.5 of their slowest time constants. At 30 to 80 % of that nothing happens, the
losses grow by 10 to 60 % (a fan), fall by as much, or the heat changes by 10 to 30 % either way. Printed: of how many runs a row
says that all points turn, and how far from there; rows that are `ok`, and how many of them hold the limit of the state that stays.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np

import thermofast as tf
from benchmarks.unlike_parts.chains import STEP, Chain, holds, path, warmed

KINDS = ("nothing", "fan on", "fan off", "heat")


def after(kind: str, chain: Chain, rng: np.random.Generator) -> Chain:
    """The chain after what happens."""
    more = float(rng.uniform(1.1, 1.3) if kind == "heat" else rng.uniform(1.1, 1.6))
    if kind == "heat":
        return replace(chain, heat=chain.heat * more ** rng.choice([-1.0, 1.0]))
    return replace(chain, loss=chain.loss * {"fan on": more, "fan off": 1.0 / more}.get(kind, 1.0))


def judged(kind: str, seed: int) -> tuple[bool, float, list[tuple[bool, bool]]]:
    """Whether a turn is told, how far from where it is [min], and of each row whether it is `ok` and whether its limit is held."""
    rng = np.random.default_rng([seed, 6])
    chain = Chain.drawn(rng)
    slowest = 1.0 / float(np.min(-np.linalg.eigvals(chain.matrix).real))
    minutes = max(40.0, slowest * float(rng.uniform(0.7, 2.5)))
    at, wander, flutter = minutes * float(rng.uniform(0.3, 0.8)), rng.uniform(0.05, 0.3), rng.uniform(0.005, 0.01)
    then, time = after(kind, chain, rng), np.arange(0.0, minutes, STEP)
    room, load = 21.0 + wander * path(rng, len(time), 80.0), 1.0 + flutter * path(rng, len(time), 12.0)
    clean = warmed([(0.0, chain), (at, then)], time, room, load)
    seen = clean[:, ::4] + chain.noise[:, None] * rng.standard_normal(clean[:, ::4].shape)
    run = tf.read({"time_min": time[::4], **{f"T{i} [degC]": row for i, row in enumerate(seen)}}, name="run")
    rows = tf.identify(run, details=False).records
    told = [float(r.message.partition("all points turn at about ")[2].split()[0]) for r in rows if "all points turn" in r.message]
    limits = room[-1] + then.rises
    each = [(r.status == "ok", holds(r, float(limit), np.inf)[0]) for r, limit in zip(rows, limits, strict=True)]
    return bool(told), abs(told[0] - at) if told else np.nan, each


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=60)
    parser.add_argument("--seed", type=int, default=640_000)
    asked = parser.parse_args()
    print("| changed within | runs | a turn told | within min (half, nine in ten) | rows `ok` | of these held |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    with ProcessPoolExecutor() as pool:
        for kind in KINDS:
            found = list(pool.map(partial(judged, kind), range(asked.seed, asked.seed + asked.each)))
            off = [away for told, away, _ in found if told]
            near = ", ".join(f"{q:.1f}" for q in np.quantile(off, (0.5, 0.9))) if off else ""
            held = [h for *_, rows in found for ok, h in rows if ok]
            seen, share = sum(told for told, *_ in found), 100 * np.mean(held)
            print(f"| {kind} | {len(found)} | {seen} | {near} | {len(held)} | {share:.0f} % |", flush=True)


if __name__ == "__main__":
    main()
