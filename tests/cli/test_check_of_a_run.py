"""What is wrong with the truth of a run, as a user asks for it."""

import json

import pytest

from tracknoise.api.finished_run import open_run

TOML = """
name = "small"
keep = "statistics"
[dataset]
reader = "simulated"
[dataset.options]
motions = ["arvr"]
frames = 20
width = 240
height = 180
[[trackers]]
kind = "lucas-kanade"
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory, made_run):
    return made_run(TOML, tmp_path_factory.mktemp("run") / "out")


@pytest.fixture(scope="module")
def made_run():
    from tracknoise.experiments.execute import execute
    from tracknoise.experiments.settings import parse_experiment
    from tracknoise.tables.store import RunFolder

    class Silent:
        def __getattr__(self, name):
            return lambda *arguments: None

    def make(text, out):
        execute(parse_experiment(text, place="small.toml"), RunFolder(out), workers=1, listener=Silent())
        return out

    return make


def test_the_answer_then_the_numbers_are_printed(tracknoise, finished):
    code, out, err = tracknoise("check", str(finished))
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0] == "Truth: trusted. The truth is stated to be exact, and the tracks do not contradict it."
    assert lines[2] == "No constant fault of the stated truth was found."
    assert "Corrections of the stated truth" in out
    shares = out[out.index("What the verdict rests on") :].splitlines()
    assert [line.split("  ")[0] for line in shares[3:8]] == ["all together", "poses", "any fault", "depths", "stated"]
    assert "[truth.corrections]" not in out
    assert any(line.startswith("alone") and "focal length" in line for line in lines)


def test_python_gives_the_same_sentences(finished):
    first, unknown = open_run(finished).audit()
    assert first == "No constant fault of the stated truth was found."
    assert unknown.endswith("right cannot be determined here.")  # sixteen frames are few


def test_json_is_one_document(tracknoise, finished):
    code, out, err = tracknoise("check", str(finished), "--json")
    assert (code, err) == (0, "")
    document = json.loads(out)
    assert document["sentences"] == open_run(finished).audit()
    assert document["corrections"] is document["accuracy"] is None
    assert {row["family"] for row in document["audit"]} >= {"alone", "beside_bias", "at_most"}
    assert {row["correction"] for row in document["audit_curves"]} == {"measured"}


def test_a_folder_without_a_run_is_an_error_of_one_line(tracknoise, tmp_path):
    code, out, err = tracknoise("check", str(tmp_path))
    assert (code, out, err.count("\n")) == (1, "", 1)
