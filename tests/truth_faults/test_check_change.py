"""What a run says of the verdict that a check had given: the same, or what changed and why."""

import json
from types import SimpleNamespace

import polars as pl
import pytest

from tracknoise.exceptions import DataError
from tracknoise.tables.trust import TRUST, AssessedTruth
from tracknoise.truth_faults.check_change import read_check, truth_change

UNKNOWN = {"every": (0.0, 0.7), "poses": (0.0, 0.6), "any fault": (0.1, 0.12)}


def checked(verdict="unknown", found=UNKNOWN, sequence="hall@default"):
    return {"sequence": sequence, "truth": {"verdict": verdict}, "ranges": found}


def change(trust, *sequences):
    document = json.dumps({"sequences": sequences})
    run = SimpleNamespace(
        document=lambda name: document if sequences else None,
        manifest=lambda: SimpleNamespace(sequences={"hall@default": None, "yard%2F1@default": None}),
    )
    text = truth_change(run, AssessedTruth(trust))
    return None if text is None else text.replace("\N{NO-BREAK SPACE}", " ")


def trust(verdict, **by_cause):
    rows = [{"cause": "every", "verdict": verdict}]
    rows += [
        {"cause": cause.replace("_", " "), "tracker": tracker, "low": low, "high": high}
        for cause, bounds in by_cause.items()
        for tracker, (low, high) in zip("ab", bounds, strict=False)
    ]
    return pl.DataFrame(rows, schema=dict(TRUST))


def test_a_run_without_a_check_says_nothing():
    assert change(trust("trusted")) is None


def test_what_changed_is_named_with_both_ranges():
    now = trust(
        "not trusted", every=[(None, 0.72), (None, 0.6)], poses=[(0.3, 0.5), (0.2, 0.4)], any_fault=[(0.0, 0.1)]
    )
    assert change(now, checked()) == (
        "`tracknoise check` said unknown. With the tracks of the run, shares of the squared errors changed: "
        "camera motions missing in the poses 30.0 % to 50.0 % (check: up to 60.0 %); constant faults, established or "
        "not up to 10.0 % (check: 10.0 % to 12.0 %)."
    )


def test_a_fault_that_only_the_run_established_is_named():
    found = change(trust("not trusted", every=[(None, 0.7)], poses=[(0.0, 0.6)], faults=[(0.2, 0.3)]), checked())
    assert "established faults 20.0 % to 30.0 % (check: up to 0.0 %)" in found


def test_a_verdict_that_changes_with_little_else_says_so():
    found = change(trust("limited", every=[(0.0, 0.68)], poses=[(0.0, 0.6)], any_fault=[(0.1, 0.12)]), checked())
    assert found == "`tracknoise check` said unknown. Shares changed by less than 5.0 %, but one crossed a limit."


def test_an_unchanged_verdict_is_said_to_be_unchanged():
    now = trust("unknown", every=[(None, 0.68)], poses=[(0.0, 0.6)], any_fault=[(0.1, 0.12)])
    assert change(now, checked()) == "`tracknoise check` said unknown too."


def test_what_one_of_both_could_not_measure_is_said():
    now = trust("limited", every=[(None, 0.3)])
    assert change(now, checked(found={})) == (
        "`tracknoise check` said unknown. The check could not measure what the truth explains."
    )
    assert change(trust("unknown"), checked("trusted")).endswith("The run could not measure what the truth explains.")


def test_the_worst_of_the_sequences_that_were_measured_counts():
    better, other = checked("trusted"), checked("not trusted", sequence="street@default")
    now = trust("limited", every=[(None, 0.3)])
    assert change(now, better, checked("unknown", sequence="yard/1@default"), other).startswith(
        "`tracknoise check` said unknown."
    )
    assert change(now, other) == "`tracknoise check` was of street@default, which this run did not measure."


def test_ranges_are_of_the_tracker_of_which_a_cause_may_explain_most():
    now = trust("limited", every=[(None, 0.2), (None, 0.3)], poses=[(0.1, 0.2), (0.0, 0.4)])
    assert AssessedTruth(now).ranges == {"every": (0.0, 0.3), "poses": (0.1, 0.4)}


@pytest.mark.parametrize("text", ["{}", '{"sequences": [{"sequence": "x"}]}', '{"sequences": 3}', "[]", "no"])
def test_a_file_that_no_check_wrote_is_refused(tmp_path, text):
    (tmp_path / "x.json").write_text(text)
    with pytest.raises(DataError, match=r"x\.json"):
        read_check(tmp_path / "x.json")
