"""``python -m benchmarks.selfcheck``, as it is called."""

from dataclasses import replace

import polars as pl
import pytest
from benchmarks.selfcheck import __main__ as selfcheck
from benchmarks.selfcheck import exact_worlds

from tracknoise.tables.findings_schema import CURVES
from tracknoise.tables.store import RunFolder
from tracknoise.truth.anchored import BirthSession

SMALL = ("--scenes", "1")


@pytest.fixture(autouse=True)
def one_scene(monkeypatch):
    """The whole self-test is in `tests/selfcheck`."""
    monkeypatch.setattr(exact_worlds, "_SCENES", exact_worlds._SCENES[:1])
    monkeypatch.setattr(exact_worlds, "_WAYS", dict(list(exact_worlds._WAYS.items())[:1]))


@pytest.fixture
def half_a_pixel_off(monkeypatch):
    right = BirthSession.resolve

    def shifted(session):
        positions = right(session)
        return replace(positions, uv=positions.uv + 0.5)

    monkeypatch.setattr(BirthSession, "resolve", shifted)


@pytest.fixture
def called(capsys):
    def go(*arguments):
        code = selfcheck.main([*SMALL, *arguments])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return go


def test_a_correct_program_passes_and_an_earlier_self_test_is_replaced(called, tmp_path):
    out = tmp_path / "kept"
    (out / "files-run").mkdir(parents=True)
    earlier = [out / "files-run" / "earlier.txt", out / "selfcheck.csv"]
    for path in earlier:
        path.write_text("earlier")
    code, text, _ = called("--seed", "3", "--out", str(out))
    assert code == 0
    lines = text.splitlines()
    assert lines[0].startswith("Self-test passed: all ")
    assert lines[1].startswith("Not tested, because it takes more scenes: intervals, zero mean, growth, shape")
    assert lines[3].split() == ["area", "compared", "wrong"]
    assert all(line.endswith("ok") for line in lines[5:])
    assert len(lines) == 5 + 8
    assert not earlier[0].exists()
    checks = pl.read_csv(out / "selfcheck.csv")
    assert f"all {checks['n'].sum():,} values" in lines[0]
    assert RunFolder(out / "files-run").statistics(CURVES).height > 0


def test_a_fault_fails_the_self_test_which_says_what_is_wrong_and_what_is_suspect(called, half_a_pixel_off):
    code, out, _ = called()
    assert code == 2
    lines = out.splitlines()
    assert lines[0].startswith("Self-test FAILED: ")
    assert lines[1] == "First area that is wrong: true positions. Suspect: sequences, geometry, truth."
    assert lines[2].startswith("May follow from it: errors and ages, trimming, curves")
    assert lines[3].startswith("- true positions, world 'files': u_true_px: found ")
    assert any(line.startswith("true positions") and line.endswith("wrong") for line in lines)
    assert any(line.startswith("lifetimes") and line.endswith("ok") for line in lines)


def test_a_folder_with_other_files_is_not_replaced(called, tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    code, _, err = called("--out", str(tmp_path))
    assert code == 1
    assert "holds other files, expected a new or empty folder or an earlier self-test" in err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
