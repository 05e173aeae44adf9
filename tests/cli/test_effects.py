"""``tracknoise effects``, as a user types it."""

import polars as pl
import pytest

from tracknoise.experiments import effects_study

SMALL = ("effects", "--scenes", "1", "--frames", "4", "--age", "2", "--workers", "1", "--only", "JPEG")


def test_it_measures_once_and_writes_table_and_figure(tracknoise, tmp_path, monkeypatch):
    small = {**effects_study.base_options(), "width": 160, "height": 120, "supersampling": 1}
    monkeypatch.setattr(effects_study, "base_options", lambda: small)
    code, out, err = tracknoise(*SMALL, "--out", str(tmp_path))
    assert code == 0
    assert "measured 3 of 3: arvr-00, bad sizes" in err
    assert out.count("JPEG") == 6
    assert pl.read_csv(tmp_path / "effects.csv")["effect"].unique().to_list() == ["JPEG"]
    again = tracknoise(*SMALL, "--out", str(tmp_path), "--quiet")
    assert again == (0, out, "")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--only", "jpg"), "effect 'jpg'"),
        (("--motion", "up"), "motion 'up'"),
        (("--frames", "5", "--age", "5"), "age 5 of 5 frames, expected an age of at most 4"),
    ],
)
def test_bad_input_gives_one_line(tracknoise, tmp_path, arguments, message):
    code, out, err = tracknoise("effects", *arguments, "--out", str(tmp_path / "out"))
    assert (code, out) == (1, "")
    assert len(err.strip().splitlines()) == 1
    assert message in err
    assert not (tmp_path / "out").exists()
