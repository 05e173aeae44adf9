"""The GitHub Actions example of docs/compare.md: its shell steps are run in a small repository."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from tests.experiments.conftest import write_scene

DOCUMENT = Path(__file__).parents[2] / "docs" / "compare.md"
SCENES, FRAMES = 6, 6
EXPERIMENT = """
name = "front-end"
[dataset]
reader = "sevenscenes"
root = "{data}"
[[trackers]]
name = "front-end"
kind = "oracle"
options = {{ n_features = 100, margin_px = 2, covariance_px2 = [[{variance}, 0.0], [0.0, {variance}]] }}
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


@pytest.fixture
def repository(tmp_path):
    """A repository whose last commit changes the noise of the tracker."""

    def made(variance, scenes=SCENES):
        for number in range(scenes):
            write_scene(tmp_path / "data" / f"seq-{number + 1:02d}", FRAMES, number)
        folder = tmp_path / "repository"
        folder.mkdir()
        subprocess.run([*GIT, "init", "-q"], cwd=folder, check=True)
        for message, noise in (("before", 0.25), ("after", variance)):
            (folder / "experiment.toml").write_text(EXPERIMENT.format(data=tmp_path / "data", variance=noise))
            (folder / "gate.toml").write_text(GATE)
            subprocess.run([*GIT, "add", "."], cwd=folder, check=True)
            subprocess.run([*GIT, "commit", "-q", "--allow-empty", "-m", message], cwd=folder, check=True)
        (tmp_path / "bin").mkdir()
        (tmp_path / "bin" / "tracknoise").write_text(PROGRAM)
        (tmp_path / "bin" / "tracknoise").chmod(0o755)
        return folder

    return made


def run_steps(folder):
    """Status and output of the last step, and the summary of the job."""
    summary = folder.parent / "summary.md"
    search = f"{folder.parent / 'bin'}:{os.environ['PATH']}"
    environment = {**os.environ, "PATH": search, "BASE": "HEAD~1", "GITHUB_STEP_SUMMARY": str(summary)}
    for name, script in shell_steps().items():
        command = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script]  # as the runner calls it
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
        assert name == "Compare" or done.returncode == 0, done.stdout + done.stderr
    return done.returncode, done.stdout, summary.read_text()


@pytest.mark.parametrize(("variance", "status", "answer"), [(1.0, 3, "The gate fails"), (0.25, 0, "The gate passes")])
def test_the_job_fails_where_the_tracker_became_worse(repository, variance, status, answer):
    folder = repository(variance)
    found, _, summary = run_steps(folder)
    assert found == status
    assert answer in summary
    assert (folder / "compare.html").exists()


def test_an_undecided_gate_is_a_warning(repository):
    found, out, summary = run_steps(repository(1.0, scenes=2))
    assert found == 0
    assert "::warning::the comparison is undecided" in out
    assert "The gate is undecided" in summary
