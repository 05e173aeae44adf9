"""The GitHub Actions example of docs/compare.md: its shell steps are run in a small repository."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from tests.experiments.conftest import write_scene

from tracknoise.tables.store import RunFolder

DOCUMENT = Path(__file__).parents[2] / "docs" / "compare.md"
SCENES, FRAMES = 6, 4
EXPERIMENT = """
name = "front-end"
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
ONE_CORE = "import os; os.cpu_count = lambda: 1; from tracknoise.cli.app import main; main()"
PROGRAM = f'#!/bin/sh\nexec "{sys.executable}" -c "{ONE_CORE}" "$@"\n'
GIT = ["git", "-c", "user.name=someone", "-c", "user.email=someone@example.org"]


def shell_steps():
    """The shell scripts of the steps in order, by name, but for the one that installs the package."""
    text = DOCUMENT.read_text().split("```yaml\n")[1].split("```")[0]
    steps = yaml.safe_load(text)["jobs"]["compare"]["steps"]
    return {step["name"]: step["run"] for step in steps if "run" in step and step["name"] != "Install"}


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A repository whose last commit makes the tracker worse, with the runs of both commits."""
    root = tmp_path_factory.mktemp("workflow")
    for number in range(SCENES):
        write_scene(root / "data" / f"seq-{number + 1:02d}", FRAMES, number)
    folder = root / "repository"
    folder.mkdir()
    subprocess.run([*GIT, "init", "-q"], cwd=folder, check=True)
    for message, variance in (("before", 0.25), ("after", 1.0)):
        (folder / "experiment.toml").write_text(EXPERIMENT.format(data=root / "data", variance=variance))
        (folder / "gate.toml").write_text(GATE)
        subprocess.run([*GIT, "add", "."], cwd=folder, check=True)
        subprocess.run([*GIT, "commit", "-q", "-m", message], cwd=folder, check=True)
    (root / "bin").mkdir()
    (root / "bin" / "tracknoise").write_text(PROGRAM)
    (root / "bin" / "tracknoise").chmod(0o755)
    *measuring, (name, _) = shell_steps().items()
    assert name == "Compare"
    for _, script in measuring:
        done = step(folder, script)
        assert done.returncode == 0, done.stdout + done.stderr
    return folder


def step(folder, script):
    """What became of a step, as the runner calls it."""
    search = f"{folder.parent / 'bin'}:{os.environ['PATH']}"
    summary = folder.parent / "summary.md"
    environment = {**os.environ, "PATH": search, "BASE": "HEAD~1", "GITHUB_STEP_SUMMARY": str(summary)}
    command = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


def compared(folder):
    """Status and output of the last step, and the summary of the job."""
    summary = folder.parent / "summary.md"
    summary.unlink(missing_ok=True)
    done = step(folder, shell_steps()["Compare"])
    return done.returncode, done.stdout, summary.read_text()


def test_the_job_fails_where_the_tracker_became_worse(measured):
    found, _, summary = compared(measured)
    assert found == 3
    assert "The gate fails" in summary
    assert (measured / "compare.html").exists()


@pytest.fixture
def same(measured):
    """The repository as if its last commit had changed nothing."""
    after, kept = measured / "runs" / "after", measured / "runs" / "kept"
    after.rename(kept)
    shutil.copytree(measured / "runs" / "before", after)
    yield measured
    shutil.rmtree(after)
    kept.rename(after)


def test_the_job_passes_where_nothing_changed(same):
    found, _, summary = compared(same)
    assert found == 0
    assert "The gate passes" in summary
    assert (same / "compare.html").exists()


def test_an_undecided_gate_is_a_warning(same):
    """As where a scene could not be measured."""
    run = RunFolder(same / "runs" / "after")
    manifest = run.manifest()
    manifest.failures["seq-01@default"] = "damaged image"
    run.write_manifest(manifest)
    found, out, summary = compared(same)
    assert found == 0
    assert "::warning::the comparison is undecided" in out
    assert "The gate is undecided" in summary
