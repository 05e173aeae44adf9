"""``tracknoise selfcheck``, as a user types it."""

from dataclasses import replace

import pytest

from tracknoise.experiments.resolve import resolve
from tracknoise.experiments.settings import parse_experiment
from tracknoise.experiments.validation.selfcheck import selfcheck_experiment
from tracknoise.tables.manifest import Manifest
from tracknoise.tables.store import RunFolder
from tracknoise.truth.anchored import BirthSession

SMALL = ("selfcheck", "--scenes", "1", "-w", "1", "--quiet")


@pytest.fixture
def half_a_pixel_off(monkeypatch):
    right = BirthSession.resolve

    def shifted(session):
        positions = right(session)
        return replace(positions, uv=positions.uv + 0.5)

    monkeypatch.setattr(BirthSession, "resolve", shifted)


def test_help_has_an_example(tracknoise):
    code, out, _ = tracknoise("selfcheck", "--help")
    assert code == 0
    assert "Example: tracknoise selfcheck" in " ".join(out.replace("│", " ").split())


def test_a_correct_program_passes(tracknoise, tmp_path):
    code, out, err = tracknoise(*SMALL, "--seed", "3", "--out", str(tmp_path / "kept"))
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0].split()[:3] == ["setting", "speed", "statistic"]
    assert lines[0].split()[4:6] == ["expected", "measured"]
    assert lines[-1] == "Self-test passed."
    numbers = [line for line in lines if line.endswith("ok")]
    assert f"0 of {len(numbers)} numbers are off" in out
    kept = RunFolder(tmp_path / "kept")
    assert parse_experiment(kept.experiment_toml(), place="kept") == resolve(selfcheck_experiment(scenes=1, seed=3))


def test_a_defect_fails_the_self_test_and_the_table_shows_where(tracknoise, half_a_pixel_off, tmp_path):
    code, out, _ = tracknoise(*SMALL)
    assert code == 2
    assert out.splitlines()[-1] == "Self-test FAILED."
    assert any(line.startswith("bias") and "nu u" in line and line.endswith("off") for line in out.splitlines())


def test_the_run_of_another_experiment_is_not_replaced(tracknoise, tmp_path):
    other = RunFolder(tmp_path / "mine")
    experiment = selfcheck_experiment(scenes=1).model_copy(update={"name": "mine"})
    other.create(experiment.to_toml(), Manifest(settings_hash="", versions={}, machine={}, seed=0))
    code, _, err = tracknoise(*SMALL, "--out", str(other.path))
    assert code == 1
    assert "holds the run of another experiment, expected a new folder or an earlier selfcheck" in err
    assert parse_experiment(other.experiment_toml(), place="mine").name == "mine"
