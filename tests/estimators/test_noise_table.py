import csv
import json

import numpy as np
import polars as pl
import pytest
from benchmarks.noise import table as program
from benchmarks.noise.noise_table import NoiseTable, noise_table, noise_table_csv, noise_table_json

from tracknoise.estimators.fit import fit_bias
from tracknoise.estimators.model import BiasKind, Purpose
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.exceptions import SettingsError
from tracknoise.inference.units import NO_GROUPS
from tracknoise.tables.store import RunFolder


@pytest.fixture(scope="module")
def table(planted_run) -> NoiseTable:
    return noise_table(RunFolder(planted_run))


def test_each_speed_has_a_row_for_all_motions_and_one_for_each(table):
    keys = [(row.speed, row.motion, len(row.scenes)) for row in table.rows]
    assert keys == [(speed, name, n) for speed in (1, 2) for name, n in ((None, 8), ("forward", 4), ("sideways", 4))]


def test_rows_hold_the_planted_noise(table):
    for row in table.rows:
        assert row.changes.uu == pytest.approx(2 * 0.09, rel=0.12)
        assert row.changes.vv == pytest.approx(2 * 0.04, rel=0.12)
        for one in row.errors:
            assert one.uu == pytest.approx(0.09, rel=0.25)
            assert abs(one.mean_u) < 0.1
        assert row.bias.kind is BiasKind.REFUSED


def test_moments_are_those_of_the_errors_of_the_run(table, planted_run):
    run = RunFolder(planted_run)
    errors = pl.concat(run.sequence_tables("observations")).filter(
        pl.col("age") == 2, pl.col("scene").str.starts_with("forward"), speed=1, truth="valid"
    )
    u, v = errors.select("du_px", "dv_px").drop_nulls().to_numpy().T
    found = next(
        one for row in table.rows for one in row.errors if (row.speed, row.motion, one.age) == (1, "forward", 2)
    )
    assert found.n == len(u)
    np.testing.assert_allclose(
        [found.uu, found.uv, found.vv], [(u * u).mean(), (u * v).mean(), (v * v).mean()], rtol=1e-6
    )
    np.testing.assert_allclose([found.mean_u, found.mean_v], [u.mean(), v.mean()], atol=1e-9)


def test_sigmas_are_those_of_the_noise_model_of_the_same_scenes(table, planted_run):
    scenes = [f"forward-{place:02}" for place in range(4)]
    model = NoiseModel.fit(planted_run, tracker="oracle", scenes=scenes)
    found = next(row for row in table.rows if (row.speed, row.motion) == (1, "forward"))
    assert found.scenes == tuple(scenes)
    for purpose in Purpose:
        assert found.sigma[purpose] == model.sigma(window=10, purpose=purpose)


def test_noise_that_is_the_same_everywhere_has_no_gain_by_motion_or_speed(table):
    gains = table.gains.filter(pl.col("gain_nats").abs() > 0.05)
    assert gains.is_empty()
    assert not table.gains["established"].any()


def test_bias_needs_whole_scenes_that_are_left_out(planted_run, table):
    """With fewer scenes than are resampled, blocks of tracks must not stand for scenes."""
    found = next(row for row in table.rows if (row.speed, row.motion) == (1, "sideways"))
    run = RunFolder(planted_run)
    mine = pl.col("scene").str.starts_with("sideways") & (pl.col("speed") == 1)
    sums = pl.concat(run.sequence_tables("noise_sums")).filter(mine)
    floors = pl.concat(run.sequence_tables("floors")).filter(mine)
    of_scenes = sums.with_columns(block=pl.lit(0, dtype=pl.UInt8))
    expected = fit_bias(of_scenes, floors, groups=NO_GROUPS, level=1 - 0.05 / len(table.rows))
    assert found.bias.reduction == expected.reduction


def test_some_trackers_and_speeds_may_be_chosen(planted_run):
    found = noise_table(RunFolder(planted_run), speeds=[2], window=5)
    assert {row.speed for row in found.rows} == {2}
    assert found.window == 5
    with pytest.raises(SettingsError, match="found no speed 3, expected one of 1, 2"):
        noise_table(RunFolder(planted_run), speeds=[3])
    with pytest.raises(SettingsError, match="windows of 2 frames, expected at least 3"):
        noise_table(RunFolder(planted_run), window=2)


def test_csv_names_the_estimand_of_each_row(table):
    rows = list(csv.DictReader(noise_table_csv(table).splitlines()))
    names = {row["estimand"] for row in rows}
    assert names == {
        "error about the first position",
        "change between observations",
        *(f"sigma: {purpose}" for purpose in Purpose),
    }
    sigma = next(row for row in rows if row["estimand"] == "sigma: innovations")
    assert float(sigma["sigma_px"]) == table.rows[0].sigma[Purpose.INNOVATIONS].value
    assert {row["motion"] for row in rows} == {"", "forward", "sideways"}


def test_json_holds_rows_reasons_and_gains(table):
    document = json.loads(noise_table_json(table))
    assert document["format"] == "tracknoise.noise-table/1"
    assert len(document["rows"]) == 6
    assert document["rows"][0]["bias"]["why"]
    assert document["rows"][0]["sigma"]["innovations"]["value"] > 0.2
    assert len(document["gains"]) == table.gains.height


def test_the_command_prints_the_answer_first_and_writes_both_files(capsys, planted_run, tmp_path):
    code = program.main([str(planted_run), "--out", str(tmp_path)])
    out, err = capsys.readouterr()
    assert (code, err) == (0, "")
    assert out.startswith("Separate noise by speed and motion is not shown to be better than one noise for all.")
    assert "Noise in px" in out
    assert "sideways" in out
    assert {path.name for path in tmp_path.iterdir()} == {"noise-table.csv", "noise-table.json"}
    assert program.main([str(planted_run), "--out", str(tmp_path), "--speed", "1"]) == 0
    assert {row["speed"] for row in json.loads((tmp_path / "noise-table.json").read_text())["rows"]} == {1}


def test_a_run_without_sums_is_an_error_of_one_line(capsys, tmp_path):
    code = program.main([str(tmp_path)])
    out, err = capsys.readouterr()
    assert code != 0
    assert out == ""
    assert err.count("\n") == 1
