"""Past runs in which something happened at another time in each: what is foretold of a run before it happens?

python -m benchmarks.unlike_parts.events_ahead [--each 12] [--seed 620000] learns chains of linked parts (:mod:`.chains`) from
three runs of 360 min whose load falls to 0.5 to 0.7 of itself at 120 to 280 min (`improve --together --add load_step`), and
prints of a fourth one, read for 25, 40 and 60 min, before anything happens: rows that are `ok`, those of them whose interval
holds the limit under the load as it is (to the 1 % by which losses differ from run to run), and the median width; the same
without past runs.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor

import numpy as np

import thermofast as tf

from .chains import Chain

READ = (25.0, 40.0, 60.0)

#: (with past runs, minutes read, `ok`, held, width [K]) of one row.
Row = tuple[bool, float, bool, bool, float]


def rows_of(seed: int) -> list[Row]:
    """All rows of the fourth run of one machine."""
    rng = np.random.default_rng([seed, 5])
    chain = Chain.drawn(rng)
    falls = rng.uniform(0.5, 0.7)

    def run(name: str) -> tf.Run:
        at, load = rng.uniform(120.0, 280.0), rng.uniform(0.85, 1.15)
        return chain.logged(rng, name, lambda t: load * (falls if t >= at else 1.0))

    model = tf.improve([run(f"past {k}") for k in range(3)], add="load_step", together=True).model
    load = rng.uniform(0.85, 1.15)
    new = chain.logged(rng, "new", lambda _: load)
    links = np.diag(chain.link, 1) + np.diag(chain.link, -1)
    out = np.diag(links.sum(axis=1) + chain.loss) - links
    found: list[Row] = []
    for until in READ:
        room = float(new.room[np.searchsorted(new.time_s, 60.0 * until)])
        limit = room + np.linalg.solve(out, chain.share * chain.heat * load)
        for known in (model, None):
            for i, row in enumerate(tf.identify(new, until=until, model=known)):
                low = -np.inf if row.steady_state_lo_c is None else row.steady_state_lo_c - 0.01 * (limit[i] - room)
                high = np.inf if row.steady_state_hi_c is None else row.steady_state_hi_c + 0.01 * (limit[i] - room)
                found.append((known is not None, until, row.status == "ok", bool(low <= limit[i] <= high), float(high - low)))
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", type=int, default=12)
    parser.add_argument("--seed", type=int, default=620_000)
    given = parser.parse_args()
    with ProcessPoolExecutor() as pool:
        rows = [row for found in pool.map(rows_of, range(given.seed, given.seed + given.each)) for row in found]
    print("| | read, min | rows | held | `ok` | of `ok` rows held | median width K |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    for past in (True, False):
        for until in READ:
            mine = [r for r in rows if r[:2] == (past, until)]
            ok = [r for r in mine if r[2]]
            share = f"{100.0 * np.mean([r[3] for r in ok]):.0f} %" if ok else "-"
            held, width = 100.0 * np.mean([r[3] for r in mine]), np.median([r[4] for r in mine])
            name = "three past runs" if past else "alone"
            print(f"| {name} | {until:g} | {len(mine)} | {held:.0f} % | {len(ok)} | {share} | {width:.1f} |", flush=True)


if __name__ == "__main__":
    main()
