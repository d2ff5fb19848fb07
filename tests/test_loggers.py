"""Real logger files of others: each right as it comes, or refused with the option that then reads it right."""

import json
import sys

import pytest
from conftest import ROOT, SHARED

sys.path.insert(0, str(ROOT))

from benchmarks.reading.corpus import FORMS, judged
from benchmarks.reading.loggers import FOLDER, GIVEN, judge

TRUTHS = json.loads((FOLDER / "truth.json").read_text()) if (FOLDER / "truth.json").is_file() else {}


@pytest.mark.skipif(not TRUTHS, reason=f"no folder {FOLDER}: the logger files are not part of this repository")
@pytest.mark.parametrize("name", TRUTHS or ["none"])
def test_a_real_file_is_right_or_refused_with_the_option_to_give(name):
    verdict, why = judge(name, TRUTHS[name]["truth"])
    assert verdict == ("right with options" if name in GIVEN else "right"), why


def test_the_folder_is_where_the_measured_records_are():
    assert FOLDER.parent == SHARED.parent


@pytest.mark.parametrize("form", FORMS)
def test_files_made_by_rule_are_read_exactly(form):
    first = 700_000 + list(FORMS).index(form) - 700_000 % len(FORMS)
    for number in range(first, first + 8 * len(FORMS), len(FORMS)):
        assert judged(number) == (form, "exact", "")
