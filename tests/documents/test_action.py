"""The action of this repository, action.yml: its inputs and outputs, and its shell steps, run as GitHub runs them."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from tests.experiments.conftest import write_scene

from tracknoise.tables.store import RunFolder

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "action.yml").read_text(encoding="utf-8")
ACTION = yaml.safe_load(TEXT)
STEPS = {step["name"]: step for step in ACTION["runs"]["steps"]}
PAGE = (ROOT / "docs" / "ci.md").read_text(encoding="utf-8")
EXPRESSION = re.compile(r"\$\{\{ (.*?) \}\}")
SCENES, FRAMES = 6, 4
EXPERIMENT = """
name = "front-end"
speeds = [1]
[dataset]
reader = "sevenscenes"
root = "{data}"
[[trackers]]
name = "front-end"
kind = "oracle"
options = {{ n_features = 30, margin_px = 2, covariance_px2 = [[{variance}, 0.0], [0.0, {variance}]] }}
[statistics]
min_features = 2
"""
GATE = 'ages = "mean"\ntrackers = ["front-end"]\n[tolerances]\ncore = 0.25\nlifetime = 0.25\n'
QUICK = """
import sys
from unittest.mock import patch
from tracknoise import processes
from tracknoise.cli.app import main

processes.usable_cores = lambda: 1
if sys.argv[1] == "run":
    from tracknoise.experiments import execute
    from tracknoise.topics.catalogue import by_table

    execute.compute_findings = lambda run, _, statistics, **others: run.write_statistics(by_table(statistics))
    with patch("tracknoise.cli.run_summary.print_results"):
        main()
main()
"""
"""The program on one core. Runs have no findings, of which a comparison reads none."""
PROGRAM = f'#!/bin/sh\nPYTHONPATH="{ROOT}:$PYTHONPATH" exec "{sys.executable}" "$(dirname "$0")/quick.py" "$@"\n'
GH = f"""#!{sys.executable}
import json, os, re, sys
from pathlib import Path

given = " ".join(sys.argv[1:])
Path(os.environ["CALLED_WITH"]).write_text(given)
if sys.argv[1:3] == ["api", "graphql"]:
    print(os.environ.get("VIEWER", "github-actions[bot]"))
elif found := re.search(r'select\\(.user.login == "(.*)" and \\(.body \\| startswith\\("(.*)"\\)\\)\\) \\| .id', given):
    comments = json.loads(os.environ.get("LISTED", "[]"))
    of_us = [one["id"] for one in comments if one["user"]["login"] == found[1] and one["body"].startswith(found[2])]
    print("\\n".join(map(str, of_us)))
"""
"""Notes its last call, and lists comments."""
PIP = f"""#!{sys.executable}
import os, sys
from pathlib import Path

with Path(os.environ["CALLED_WITH"]).open("a") as file:
    print(*sys.argv[1:], file=file)
if sys.argv[-1] == "--help":
    os.execv({sys.executable!r}, sys.argv)
"""
"""As python: it notes its calls, and lets pip say its help alone."""
GIT = ["git", "-c", "user.name=someone", "-c", "user.email=someone@example.org"]


def test_it_is_a_composite_action_whose_scripts_have_no_expressions():
    """Expressions inside of a script would run what a pull request is called."""
    assert ACTION["runs"]["using"] == "composite"
    assert all(step["shell"] == "bash" for step in STEPS.values())
    assert [name for name, step in STEPS.items() if "${{" in step["run"]] == []


def test_every_input_is_declared_used_and_documented():
    used = {name for found in EXPRESSION.findall(TEXT) for name in re.findall(r"inputs\.([\w-]+)", found)}
    used |= {name for step in STEPS.values() for name in re.findall(r"inputs\.([\w-]+)", step.get("if", ""))}
    assert used == set(ACTION["inputs"])
    assert [name for name in used if f"| `{name}` |" not in PAGE] == []
    assert all(one["description"] for one in (*ACTION["inputs"].values(), *ACTION["outputs"].values()))


def test_every_output_is_written_by_its_step_and_documented():
    ids = {step.get("id"): step for step in STEPS.values()}
    for name, output in ACTION["outputs"].items():
        (_, step, _, written) = EXPRESSION.findall(output["value"])[0].split(".")
        assert f'echo "{written}=' in ids[step]["run"]
        assert f"`{name}`" in PAGE


def test_the_workflow_of_the_page_gives_inputs_that_exist():
    block = re.search(r"```yaml\n(.*?)```", PAGE, flags=re.DOTALL)
    assert block is not None
    steps = yaml.safe_load(block[1])["jobs"]["compare"]["steps"]
    (ours,) = [step for step in steps if step.get("id") == "tracknoise"]
    assert set(ours["with"]) <= set(ACTION["inputs"])


def values(step, given, folder):
    """Environment of a step: its expressions replaced, of which a GitHub runner knows the values."""
    known = {name: given.get(name, str(one["default"])) for name, one in ACTION["inputs"].items()}
    found = {}
    for key, text in step.get("env", {}).items():
        names = re.findall(r"inputs\.([\w-]+)", text)
        is_expression = EXPRESSION.fullmatch(text)
        assert is_expression, text
        found[key] = known[names[0]] if names else ""
    found |= {"FOLDER": str(folder)} if "FOLDER" in found else {}
    return found


def act(repository, name, folder, known=None, **given):
    """What became of a step, as the runner calls it; what it added to outputs and summary lies in the folder.

    `known`: what the runner knows beside the inputs.
    """
    step = STEPS[name]
    environment = {
        **os.environ,
        **values(step, given, folder),
        "PATH": f"{repository.parent / 'bin'}:{os.environ['PATH']}",
        "GITHUB_STEP_SUMMARY": str(folder.parent / f"{folder.name}-summary.md"),
        "GITHUB_OUTPUT": str(folder.parent / f"{folder.name}-output"),
        "CALLED_WITH": str(folder.parent / "called-with"),
        "GITHUB_REPOSITORY": "someone/front-end",
        **(known or {}),
    }
    command = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]]
    return subprocess.run(command, cwd=repository, env=environment, capture_output=True, text=True)


def outputs(folder):
    lines = (folder.parent / f"{folder.name}-output").read_text().splitlines()
    return dict(line.split("=", 1) for line in lines)


def gated(outcome, undecided="warning"):
    """Exit status and text of the last step."""
    environment = {**os.environ, "OUTCOME": outcome, "UNDECIDED": undecided}
    done = subprocess.run(["bash", "-eo", "pipefail", "-c", STEPS["Gate"]["run"]], env=environment, capture_output=True)
    return done.returncode, done.stdout.decode()


@pytest.fixture(scope="module")
def repository(tmp_path_factory):
    """A repository whose last commit makes the tracker worse."""
    root = tmp_path_factory.mktemp("action")
    for number in range(SCENES):
        write_scene(root / "data" / f"seq-{number + 1:02d}", FRAMES, number)
    (root / "bin").mkdir()
    for name, text in (("tracknoise", PROGRAM), ("quick.py", QUICK), ("gh", GH), ("python", PIP)):
        (root / "bin" / name).write_text(text)
        (root / "bin" / name).chmod(0o755)
    folder = root / "repository"
    (folder / "tracknoise").mkdir(parents=True)
    subprocess.run([*GIT, "init", "-q"], cwd=folder, check=True)
    for message, variance in (("before", 0.25), ("after", 1.0)):
        text = EXPERIMENT.format(data="nowhere", variance=variance)
        (folder / "tracknoise" / "simulated.toml").write_text(text.replace("nowhere", str(root / "data")))
        (folder / "recorded.toml").write_text(text)
        (folder / "gate.toml").write_text(GATE)
        subprocess.run([*GIT, "add", "."], cwd=folder, check=True)
        subprocess.run([*GIT, "commit", "-q", "-m", message], cwd=folder, check=True)
    return folder


@pytest.fixture(scope="module")
def measured(repository):
    """Runs of both commits, of both experiments, and the comparison of the action."""
    folder = repository.parent / "worse"
    given = {
        "base": "HEAD~1",
        "recorded": "recorded.toml",
        "data": str(repository.parent / "data"),
        "prepare": "echo built >> $(git rev-parse --show-toplevel)/built",
        "gate": "gate.toml",
    }
    for name in ("Measure the base", "Measure this commit", "Compare"):
        done = act(repository, name, folder, **given)
        assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_a_worse_tracker_is_reported_and_fails_the_gate(repository, measured):
    assert outputs(measured) == {"outcome": "worse", "folder": str(measured)}
    summary = (measured.parent / "worse-summary.md").read_text()
    assert "# Simulated scenes" in summary
    assert "# Recorded scenes" in summary
    assert summary.count("The gate fails") == 2
    assert {path.name for path in measured.glob("*.html")} == {"simulated.html", "recorded.html"}
    assert (repository / "built").exists()
    assert (measured / "base" / "built").exists()
    status, text = gated("worse")
    assert status == 3
    assert "::error::" in text


def test_the_comment_is_the_comparison(repository, measured):
    """The call that would write it is noted instead of made."""
    assert act(repository, "Comment", measured).returncode == 0
    assert f"--body-file {measured}/comment.md" in (measured.parent / "called-with").read_text()
    mark, comment = (measured / "comment.md").read_text().split("\n", 1)
    assert mark == "<!-- tracknoise -->"
    assert comment == (measured / "comparison.md").read_text()


def test_only_a_comment_of_its_own_is_changed(repository, measured):
    mark = "<!-- tracknoise -->"
    strangers = [{"id": 1, "body": mark, "user": {"login": "someone"}}]
    ours = [{"id": number, "body": mark + "x", "user": {"login": "app[bot]"}} for number in (7, 8)]
    for viewer, comments, expected in (
        ("app[bot]", strangers + ours, "comments/7"),
        ("app[bot]", strangers, "pr comment"),
        ("no such field", [*strangers, {**ours[0], "user": {"login": "github-actions[bot]"}}], "comments/7"),
    ):
        known = {"VIEWER": viewer, "LISTED": json.dumps(comments)}
        assert act(repository, "Comment", measured, known).returncode == 0
        assert expected in (measured.parent / "called-with").read_text()


def test_pip_is_not_that_of_the_checkout_and_what_it_needs_is_locked(repository, tmp_path):
    checkout = tmp_path / "checkout"
    (checkout / "pip").mkdir(parents=True)
    (checkout / "pip" / "__main__.py").write_text("raise SystemExit('pip of the checkout')")
    (tmp_path / "bin").symlink_to(repository.parent / "bin")
    assert act(checkout, "Install", tmp_path / "out", package="--help").returncode == 0
    (tmp_path / "called-with").unlink()
    assert act(checkout, "Install", tmp_path / "out", {"ACTION": str(ROOT)}).returncode == 0
    first, second = (tmp_path / "called-with").read_text().splitlines()
    assert first.startswith("-P -m pip install --no-deps --require-hashes")
    assert [Path(word).is_file() for word in first.split() if word.startswith("/")] == [True, True]
    assert second == f"-P -m pip install --no-deps --no-build-isolation {ROOT}"


def test_what_an_earlier_call_measured_is_removed(repository, measured):
    folder = measured.parent / "again"
    (folder / "after" / "recorded").mkdir(parents=True)
    done = act(repository, "Measure this commit", folder, simulated="missing.toml")
    assert done.returncode != 0
    assert not (folder / "after").exists()


def test_a_pull_request_cannot_loosen_its_own_gate(repository, measured):
    folder = measured.parent / "loose"
    shutil.copytree(measured, folder, ignore=shutil.ignore_patterns("base"))
    gate = repository / "gate.toml"
    try:
        gate.write_text(GATE.replace("0.25", "9.0"))
        assert compared(repository, folder, gate="gate.toml")[0] == "pass"  # without a base: as it is
        for name in ("gate.toml", str(gate), "tracknoise/../gate.toml"):
            assert compared(repository, folder, gate=name, base="HEAD~1")[0] == "worse"
        gate.unlink()
        assert compared(repository, folder, gate="gate.toml", base="HEAD")[0] == "worse"
        done = act(repository, "Compare", folder, gate="gate.toml", base="0" * 40)
        assert done.returncode == 1
        assert "found no commit" in done.stdout
    finally:
        gate.write_text(GATE)
    (repository / "new.toml").write_text(GATE)
    done = act(repository, "Compare", folder, gate="new.toml", base="HEAD")
    assert "::warning::the base has no new.toml" in done.stdout


def compared(repository, folder, **given):
    """Outcome and summary of a comparison of runs that are there."""
    for name in ("output", "summary.md"):
        (folder.parent / f"{folder.name}-{name}").unlink(missing_ok=True)
    done = act(repository, "Compare", folder, **given)
    assert done.returncode == 0, done.stdout + done.stderr
    return outputs(folder)["outcome"], (folder.parent / f"{folder.name}-summary.md").read_text()


def test_an_earlier_run_is_the_baseline_and_nothing_changed(repository, measured):
    folder = measured.parent / "same"
    done = act(repository, "Measure the base", folder, baseline=str(measured / "after"))
    assert done.returncode == 0, done.stderr
    shutil.copytree(measured / "after" / "simulated", folder / "after" / "simulated")
    outcome, summary = compared(repository, folder, gate="gate.toml")
    assert outcome == "pass"
    assert summary.count("The gate passes") == 1
    assert compared(repository, folder)[0] == "compared"
    assert gated("pass")[0] == gated("compared")[0] == 0


def test_an_undecided_gate_is_a_warning_or_a_failure(repository, measured):
    """As where a scene could not be measured."""
    folder = measured.parent / "undecided"
    for side in ("before", "after"):
        shutil.copytree(measured / "before" / "recorded", folder / side / "recorded")
    run = RunFolder(folder / "after" / "recorded")
    manifest = run.manifest()
    manifest.failures["seq-01@default"] = "damaged image"
    run.write_manifest(manifest)
    assert compared(repository, folder, gate="gate.toml")[0] == "undecided"
    status, text = gated("undecided")
    assert status == 0
    assert "::warning::" in text
    assert gated("undecided", "failure")[0] == gated("undecided", "fail")[0] == 4


def test_a_base_without_the_experiment_is_not_compared(repository, measured):
    folder = measured.parent / "new"
    shutil.copytree(measured / "after", folder / "after")
    outcome, summary = compared(repository, folder, gate="gate.toml")
    assert outcome == "none"
    assert "No simulated scenes were compared" in summary
    shutil.copytree(measured / "before" / "recorded", folder / "before" / "recorded")
    assert compared(repository, folder)[0] == "none"
    status, text = gated("none")
    assert status == 0
    assert "::warning::" in text
    assert gated("none", "failure")[0] == 4


def test_runs_that_cannot_be_compared_end_the_step(repository, measured):
    folder = measured.parent / "other"
    shutil.copytree(measured, folder, ignore=shutil.ignore_patterns("base"))
    manifest = folder / "before" / "simulated" / "manifest.json"
    manifest.write_text("{}")
    assert act(repository, "Compare", folder).returncode == 1
