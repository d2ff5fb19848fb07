"""Work on other machines: a Dask scheduler with two workers, one killed midway; MPI; workers of another build."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import ROOT

import thermofast as tf
from benchmarks.scale.killed import make_archive, same
from thermofast.workers.cluster import STARTED_BY_MPI, Dask, Mpi, build, checked, crew_of
from thermofast.workers.flow import Flow, Given, Here, Local, in_order

ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "DASK_DISTRIBUTED__WORKER__DAEMON": "False"}


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """(address of a scheduler, its two workers' processes)."""
    yield from started(tmp_path_factory.mktemp("cluster"), 2)


@pytest.fixture
def lone(tmp_path):
    """The same with one worker."""
    yield from started(tmp_path, 1)


def started(where, count):
    pytest.importorskip("distributed", reason="the extra thermofast[dask] is not installed")
    told = where / "scheduler.json"
    start = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(told)]
    work = [sys.executable, "-m", "distributed.cli.dask_worker", "--nthreads", "1", "--no-dashboard", "--no-nanny"]
    quiet = {"env": ENVIRONMENT, "cwd": where, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    scheduler = subprocess.Popen(start, **quiet)
    workers = [subprocess.Popen([*work, "--scheduler-file", str(told), "--name", str(i)], **quiet) for i in range(count)]
    from distributed import Client

    for _ in range(300):
        if told.exists():
            break
        time.sleep(0.1)
    with Client(scheduler_file=str(told), set_as_default=False) as client:
        client.wait_for_workers(count, timeout=60)
        address = client.scheduler.address
    yield address, workers
    for process in (*workers, scheduler):
        process.kill()
        process.wait()


def squares(numbers):
    time.sleep(0.02)
    return [n * n for n in numbers]


def dies_on_seven(numbers):
    if 7 in numbers:
        raise MemoryError("seven")
    return squares(numbers)


@pytest.mark.proof
@pytest.mark.filterwarnings("ignore")
def test_an_archive_on_a_cluster_of_which_a_worker_is_killed_equals_the_local_run(cluster, tmp_path):
    address, workers = cluster
    make_archive(tmp_path / "in", 30, sensors=10)
    tf.archive("identify", str(tmp_path / "in"), str(tmp_path / "local"), until=60, jobs=1)
    crew = Dask(address)
    flow = Flow(dies_on_seven, lambda task: [[n] for n in task], lambda task, why: [(task[0], why)])
    results = [r for part in in_order(flow, [[1, 2], [7, 3], [4]], crew) for r in part]
    crew.close()
    assert results[:2] == [1, 4]
    assert "out of memory" in results[2][1]
    assert results[3:] == [9, 16]

    def kill(progress):
        if progress.done == 8 and workers[0].poll() is None:
            workers[0].kill()

    found = tf.archive("identify", str(tmp_path / "in"), str(tmp_path / "dask"), until=60, cluster=address, progress=kill)
    assert found.done == 30
    assert workers[0].wait(10) != 0
    assert workers[1].poll() is None
    assert same(tmp_path / "local", tmp_path / "dask")
    shutil.rmtree(tmp_path / "dask")


@pytest.mark.proof
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_of_which_nobody_is_left_is_given_up(lone, tmp_path, monkeypatch):
    monkeypatch.setattr("thermofast.workers.cluster.PATIENCE_S", 2.0)
    monkeypatch.setattr("thermofast.workers.flow.LOOK_S", 0.5)
    address, workers = lone
    make_archive(tmp_path / "in", 12, sensors=10)

    def kill(progress):
        if progress.done == 2:
            workers[0].kill()

    found = tf.archive("identify", str(tmp_path / "in"), str(tmp_path / "dask"), until=60, cluster=address, progress=kill)
    assert found.done == 12
    assert "failed" not in found.statuses
    tf.archive("identify", str(tmp_path / "in"), str(tmp_path / "local"), until=60, jobs=1)
    assert same(tmp_path / "local", tmp_path / "dask")


@pytest.mark.filterwarnings("ignore")
def test_one_run_is_worked_on_there_too(cluster, tool):
    run = ROOT / "sample_runs" / "spindle.csv"
    there = tool("identify", run, "--until", 60, "--cluster", cluster[0], "--format", "csv", "-q")
    here = tool("identify", run, "--until", 60, "--format", "csv", "-q")
    assert there.code == here.code == 0
    assert there.out == here.out


def test_a_worker_of_another_build_is_refused():
    assert checked(build(), squares, [3]) == [9]
    with pytest.raises(tf.UsageError, match="runs another thermofast"):
        checked("0.1 numpy 000000000000", squares, [3])


def test_who_works_is_told_once(tool):
    assert isinstance(crew_of(1), Here)
    crew = crew_of(2)
    assert isinstance(crew, Local)
    crew.close()
    with pytest.raises(tf.UsageError, match="--cluster and --mpi: each says who works"):
        crew_of(None, "tcp://nowhere", True)
    pytest.importorskip("distributed")
    done = tool("identify", ROOT / "sample_runs" / "spindle.csv", "--cluster", "nonsense://x", "-q")
    assert done.code == 2
    assert "no Dask scheduler answers" in done.err


MPI = shutil.which("mpiexec") or str(Path(sys.executable).with_name("mpiexec"))


@pytest.mark.skipif(not Path(MPI).exists(), reason="no mpiexec on this machine")
def test_an_archive_over_mpi_equals_the_local_run(tmp_path):
    pytest.importorskip("mpi4py", reason="the extra thermofast[mpi] is not installed")
    make_archive(tmp_path / "in", 12, sensors=6)
    call = ["-m", "thermofast", "identify", "in", "--until", "60", "-q"]
    subprocess.run([sys.executable, *call, "-o", "local/", "--jobs", "1"], cwd=tmp_path, env=ENVIRONMENT, check=True)
    mpi = [MPI, "-n", "3", sys.executable, "-m", "mpi4py.futures", *call, "-o", "mpi/"]
    done = subprocess.run(mpi, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert same(tmp_path / "local", tmp_path / "mpi")


def test_an_executor_of_ones_own_is_left_open():
    class Counting:
        def __init__(self):
            self.closed = False

        def submit(self, work, task):
            return Here().submit(work, task)

    theirs = Counting()
    flow = Flow(squares, lambda t: [[n] for n in t], lambda t, why: [])
    crew = Given(theirs, 1)
    assert [r for part in in_order(flow, [[1], [2]], crew) for r in part] == [1, 4]
    crew.close()
    assert not theirs.closed


def test_a_cluster_is_given_up_only_where_nobody_is_there_for_some_time(monkeypatch):
    from types import SimpleNamespace

    clock, there = [0.0], [True]
    monkeypatch.setattr("thermofast.workers.cluster.time", SimpleNamespace(monotonic=lambda: clock[0]))
    crew = object.__new__(Dask)
    crew._own, crew._alone_since, crew._looked = None, None, -1e9
    crew._client = SimpleNamespace(status="running", nthreads=lambda: {"w": 1} if there[0] else {})
    there[0] = False
    assert not crew.gone()
    clock[0] = 3600.0  # results came in for an hour, and nobody looked
    assert not crew.gone()
    for clock[0] in (3605.0, 3610.0, 3615.0, 3620.0):
        assert not crew.gone()
    clock[0] = 3625.0
    assert crew.gone()


def test_a_place_without_port_and_mpi_without_launcher_are_refused_at_once(monkeypatch):
    pytest.importorskip("distributed", reason="the extra thermofast[dask] is not installed")
    with pytest.raises(tf.UsageError, match=r"--cluster foo: no Dask scheduler answers(?s:.*)no port"):
        Dask("foo")
    pytest.importorskip("mpi4py", reason="the extra thermofast[mpi] is not installed")
    for name in STARTED_BY_MPI:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(tf.UsageError, match="no launcher that could start some"):
        Mpi()
