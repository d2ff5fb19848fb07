"""Tasks that hang, die or fail: how soon they are found, and what becomes of the others."""

import subprocess
import sys
import time
from functools import partial

import pyarrow.parquet as papq
import pytest
from conftest import ROOT

import thermofast as tf
from benchmarks.scale.killed import make_archive
from thermofast.archives.blocks import Analysis
from thermofast.archives.library import into_folder
from thermofast.errors import ThermofastError, UsageError
from thermofast.reading import Options
from thermofast.records import IdentifyRecord
from thermofast.workers.engine import Work
from thermofast.workers.flow import MOST_FAILURES, Flow, Local, in_order


def hangs_on_seven(numbers):
    time.sleep(60.0 if 7 in numbers else 0.05)
    return [n * n for n in numbers]


def fails_on_odd(numbers):
    if any(n % 2 for n in numbers):
        raise ValueError("odd")
    return [n * n for n in numbers]


class Numbers(list):
    def singles(self):
        return [Numbers([n]) for n in self]


def flow_of(work, **more):
    return Flow(work, lambda task: [[n] for n in task], lambda task, why: [(task[0], why)], **more)


def test_a_hang_is_found_while_other_tasks_go_on_finishing():
    tasks = [[7], *([n] for n in range(100, 190))]
    crew = Local(2)
    seen = []
    for place, results in flow_of(hangs_on_seven, limit_s=0.5).results(iter(tasks), crew):
        seen.append(place)
        if place == 0:
            assert "did not end within 0.5 s" in results[0][1]
        else:
            assert results == [tasks[place][0] ** 2]
    crew.close()
    assert sorted(seen) == list(range(len(tasks)))
    # The others did not have to come to an end first.
    assert seen.index(0) < 75


def test_failures_in_a_row_end_it_only_where_the_workers_are_at_fault():
    odd = [[n] for n in range(1, 4 * MOST_FAILURES + 6, 2)]  # more than twice as many; what comes in beside the last may be good
    asked = []

    def told(sound):
        crew = Local(1)
        flow = flow_of(fails_on_odd, sound=lambda: asked.append(sound) or sound)
        results = [r for part in in_order(flow, [*odd, [4]], crew) for r in part]
        crew.close()
        return results

    results = told(True)
    assert results[-1] == 16
    assert all("odd" in why for _, why in results[:-1])
    assert len(asked) == 2
    results = told(False)
    left_out = [("not tried" in why) for _, why in results]
    # Two are in flight: which of them is looked at first is not known.
    assert sum(left_out) == len(odd) + 1 - MOST_FAILURES
    assert not any(left_out[: MOST_FAILURES - 1])
    assert all(left_out[MOST_FAILURES + 1 :])


def raises(started, how=None, bad=lambda run: True, **_):
    if bad(started[0][0]):
        raise RuntimeError("a plug-in that is wrong")
    return tf.identify(started[0][0], until=60, details=False)


def of_a_file(run):
    return run.name != "sound"


def archived(folder, into, call, resume=False):
    analysis = Analysis("identify", IdentifyRecord, call, 0, {"filter": "afukf"})
    return into_folder(analysis, [str(folder)], str(into), resume, Local(1), Options(), None, 60.0, True)


def test_files_that_fail_one_after_another_do_not_end_an_archive_but_an_analysis_that_cannot_work_does(tmp_path):
    make_archive(tmp_path / "in", MOST_FAILURES + 2, sensors=1)
    assert archived(tmp_path / "in", tmp_path / "files", partial(raises, bad=of_a_file)).statuses == {"failed": MOST_FAILURES + 2}
    with pytest.raises(UsageError, match="so does a record without fault"):
        archived(tmp_path / "in", tmp_path / "analysis", raises)


def test_what_failed_is_done_again_on_resume_and_so_is_all_that_another_version_made(tmp_path, monkeypatch):
    make_archive(tmp_path / "in", 3, sensors=1)
    into = tmp_path / "r"
    assert archived(tmp_path / "in", into, partial(raises, bad=of_a_file)).statuses == {"failed": 3}
    (part, *_) = into.rglob("*.parquet")
    assert papq.read_schema(part).metadata[b"thermofast.failed"] == b"1"
    again = archived(tmp_path / "in", into, partial(raises, bad=bool_of_nothing), resume=True)
    assert (again.done, again.skipped, again.statuses.get("failed")) == (3, 0, None)
    assert archived(tmp_path / "in", into, partial(raises, bad=bool_of_nothing), resume=True).skipped == 3
    monkeypatch.setattr(tf, "__version__", "99.0")
    newer = archived(tmp_path / "in", into, partial(raises, bad=bool_of_nothing), resume=True)
    assert (newer.done, newer.skipped) == (3, 0)
    assert len(list(into.rglob("*.parquet"))) == 3


def bool_of_nothing(run):
    return False


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"untill": 3}, "no option 'untill'"),
        ({"until": -3}, "until"),
        ({"filter": "kalmann"}, "kalmann"),
        ({"power": "x"}, "power"),
        ({"time_unit": "fortnight"}, "fortnight"),
    ],
)
def test_wrong_options_of_an_archive_are_refused_before_anything_is_read(tmp_path, options, words):
    with pytest.raises(ThermofastError, match=words):
        tf.archive("identify", str(tmp_path / "not there"), str(tmp_path / "r"), **options)
    assert not (tmp_path / "r").exists()


def test_a_time_limit_holds_with_one_process_too():
    tasks = [Numbers([1]), Numbers([7]), Numbers([3])]
    how = Work(jobs=1, limit_s=0.6)
    found = list(how.over(hangs_on_seven, tasks, 1, lambda task, why: [why]))
    assert found[0] == [1]
    assert found[2] == [9]
    assert "did not end within 0.6 s" in found[1][0]


def test_workers_that_share_a_process_import_nothing_while_they_work():
    """A package that two threads import at once may be half there for one of them (issue of Python's own import locks)."""
    script = (
        "import sys\n"
        "from concurrent.futures import ThreadPoolExecutor\n"
        "import thermofast as tf\n"
        "from thermofast.workers.flow import Given\n"
        "with ThreadPoolExecutor(2) as threads:\n"
        "    Given(threads, 2)\n"
        "    before = set(sys.modules)\n"
        f"    records = tf.identify({str(ROOT / 'sample_runs' / 'spindle.csv')!r}, until=60, executor=threads)\n"
        "late = {m for m in set(sys.modules) - before if m.startswith(('thermofast.models', 'thermofast.filters', "
        "'thermofast.estimation'))}\n"
        "print(len(records), sorted(late))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split()[1:] == ["[]"]
    assert int(done.stdout.split()[0]) > 1
