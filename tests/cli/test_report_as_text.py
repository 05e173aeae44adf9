"""What a run found, as a user asks for it."""

import json
import shutil

import pytest

from tracknoise.tables.findings_schema import FINDINGS


@pytest.fixture(scope="module")
def finished(make_run):
    """A made-up run with findings."""
    return make_run(told=True, scenes=("one", "two"), n_frames=14, min_features=20)


def test_sentences_then_verdicts_are_printed(tracknoise, finished):
    code, out, err = tracknoise("report", str(finished.path), "--text", "--all")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0].startswith(" 1. Truth: limited. ")
    assert any(line.startswith(" 2. Noise to set in a filter, windows of 11 frames at speed 1") for line in lines)
    assert any(line[4:].startswith("Every condition has only 2 scenes.") for line in lines)
    assert (
        sum(line[:2].strip().isdigit() and line[2:4] == ". " for line in lines) == finished.statistics(FINDINGS).height
    )
    assert any(line.startswith("Verdicts") for line in lines)
    assert any(line.startswith("lucas-kanade ") and "heavy-tailed" in line for line in lines)
    assert "Does the factor change the statistic?" in out
    assert all(len(line) <= 110 for line in lines[: lines.index("")])


def test_json_is_one_document_with_the_same_sentences(tracknoise, finished):
    code, out, err = tracknoise("report", str(finished.path), "--json")
    assert (code, err) == (0, "")
    document = json.loads(out)
    assert [row["text"] for row in document["findings"]] == finished.statistics(FINDINGS)["text"].to_list()
    assert {row["factor"] for row in document["dependence"]} >= {"tracker", "speed"}


def test_a_terminal_gets_tables_with_lines(tracknoise, finished, monkeypatch):
    monkeypatch.setattr("tracknoise.cli.text_table.sys.stdout.isatty", lambda: True)
    code, out, _ = tracknoise("report", str(finished.path), "--all")
    assert code == 0
    assert "━" in out


@pytest.mark.parametrize(("count", "text"), [(1, "1 sequence failed and is"), (2, "2 sequences failed and are")])
def test_failed_sequences_are_counted(tracknoise, finished, tmp_path, count, text):
    run = type(finished)(shutil.copytree(finished.path, tmp_path / "run"))
    manifest = run.manifest()
    manifest.failures |= {f"gone-{place}@default": "damaged" for place in range(count)}
    run.write_manifest(manifest)
    code, _, err = tracknoise("report", str(run.path), "--all")
    assert (code, err) == (0, f"tracknoise: warning: {run.path}: {text} not in these findings\n")


def test_a_run_without_findings_says_what_makes_them(tracknoise, finished, tmp_path):
    run = type(finished)(shutil.copytree(finished.path, tmp_path / "run"))
    manifest = run.manifest()
    del manifest.statistics["findings"]
    run.write_manifest(manifest)
    code, out, err = tracknoise("report", str(run.path), "--text")
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert "holds no findings" in err
