"""Workers beside the user's own processes and threads: what the program starts changes nothing of them."""

import subprocess
import sys

import pytest

from thermofast.workers.pool import new_pool
from thermofast.workers.processes import METHOD, WORKERS, context_of

SCRIPT = """
import multiprocessing.forkserver, pickle, signal, threading
import numpy as np
import thermofast as tf

print("runs", flush=True)
time = np.arange(0.0, 90.0)
runs = [tf.read({"time_min": time, "a": 20 - 5 * np.expm1(-time / 30), "b": 20 - 4 * np.expm1(-time / 25)}, name=n) for n in "xy"]

def mine():
    print("interrupts:", signal.getsignal(signal.SIGINT) is signal.default_int_handler)

def pickled(failed, end):
    while not end.wait(1e-4):
        try:
            pickle.dumps(mine)
        except Exception as error:
            failed.append(error)

if __name__ == "__main__":
    multiprocessing.set_forkserver_preload(["fractions"])
    failed, end = [], threading.Event()
    thread = threading.Thread(target=pickled, args=(failed, end))
    thread.start()
    print(len(tf.identify(runs, until=60, jobs=2)))
    end.set()
    thread.join()
    print("failed:", len(failed))
    print("loads:", multiprocessing.forkserver._forkserver._preload_modules)
    process = multiprocessing.get_context("forkserver").Process(target=mine)
    process.start()
    process.join()
"""


@pytest.mark.skipif(METHOD != "forkserver", reason="no server of processes here")
def test_own_processes_and_threads_are_as_without_the_program(tmp_path):
    """An interrupt ends them, their server loads what the user said, and what the script defines can be pickled meanwhile."""
    (tmp_path / "own.py").write_text(SCRIPT)
    done = subprocess.run([sys.executable, "own.py"], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    # The user's own process imports the script once more, as Python has it; none of the program's does.
    assert done.stdout.splitlines() == [
        "runs",
        "4",
        "failed: 0",
        "loads: ['fractions']",
        "runs",
        "interrupts: True",
    ]


def main_file(_):
    return getattr(sys.modules["__main__"], "__file__", "none")


@pytest.mark.parametrize("method", sorted(WORKERS))
def test_no_worker_holds_the_script(method):
    """By each way to start one: the server's, and that of systems without."""
    process = context_of(["thermofast.workers.starting"], method).Process(target=main_file, args=(0,))
    process.start()
    process.join(60)
    assert process.exitcode == 0
    with new_pool(2) as pool:
        assert set(pool.map(main_file, range(4))) == {"none"}
