"""``tracknoise selfcheck``, as a user types it."""

import pytest

from tracknoise.experiments.resolve import resolve
from tracknoise.experiments.selfcheck import selfcheck_experiment
from tracknoise.experiments.settings import parse_experiment
from tracknoise.measurement import scene
from tracknoise.tables.store import RunFolder

SMALL = ("selfcheck", "--scenes", "1", "-w", "1", "--quiet")


@pytest.fixture
def half_a_pixel_off(monkeypatch):
    right = scene.true_paths

    def shifted(*arguments):
        paths = right(*arguments)
        return type(paths)(paths.uv + 0.5, paths.depth_m)

    monkeypatch.setattr(scene, "true_paths", shifted)


def test_help_has_an_example(tracknoise):
    code, out, _ = tracknoise("selfcheck", "--help")
    assert code == 0
    assert "Example: tracknoise selfcheck" in " ".join(out.replace("│", " ").split())


def test_a_right_instrument_is_said_to_be_right(tracknoise, tmp_path):
    code, out, err = tracknoise(*SMALL, "--seed", "3", "--out", str(tmp_path / "kept"))
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0].split()[:3] == ["setting", "speed", "number"]
    assert lines[-1] == "The instrument gives back what went in."
    numbers = [line for line in lines if line.endswith("ok")]
    assert f"0 of {len(numbers)} numbers are off" in out
    kept = RunFolder(tmp_path / "kept")
    assert parse_experiment(kept.experiment_toml(), place="kept") == resolve(selfcheck_experiment(scenes=1, seed=3))


def test_a_wrong_one_is_not_and_says_where(tracknoise, half_a_pixel_off, tmp_path):
    code, out, _ = tracknoise(*SMALL)
    assert code == 2
    assert out.splitlines()[-1] == "The instrument is NOT right."
    assert any(line.startswith("bias") and "nu u" in line and line.endswith("off") for line in out.splitlines())
