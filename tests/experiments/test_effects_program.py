"""``python -m benchmarks.effects``, as it is called."""

import polars as pl
import pytest
from benchmarks.effects import __main__ as effects
from benchmarks.effects import study as effects_study

SMALL = ("--scenes", "1", "--frames", "4", "--age", "2", "--workers", "1", "--only", "JPEG")


@pytest.fixture
def called(capsys):
    def go(*arguments):
        code = effects.main(list(arguments))
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return go


def test_it_measures_once_and_writes_table_and_figure(called, tmp_path, monkeypatch):
    small = {**effects_study.base_options(), "width": 160, "height": 120, "supersampling": 1}
    monkeypatch.setattr(effects, "base_options", lambda: small)
    code, out, err = called(*SMALL, "--out", str(tmp_path))
    assert code == 0
    assert "measured 3 of 3: arvr-00, bad sizes" in err
    assert out.count("JPEG") == 6
    assert pl.read_csv(tmp_path / "effects.csv")["effect"].unique().to_list() == ["JPEG"]
    again = called(*SMALL, "--out", str(tmp_path))
    assert again == (0, out, "")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--only", "jpg"), "effect 'jpg'"),
        (("--motion", "up"), "motion 'up'"),
        (("--frames", "5", "--age", "5"), "age 5 of 5 frames, expected an age of at most 4"),
    ],
)
def test_bad_input_gives_one_line(called, tmp_path, arguments, message):
    code, out, err = called(*arguments, "--out", str(tmp_path / "out"))
    assert (code, out) == (1, "")
    assert len(err.strip().splitlines()) == 1
    assert message in err
    assert not (tmp_path / "out").exists()
