"""What noise models are fitted to."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import polars as pl
import pytest
from benchmarks.noise.calibration import check_model
from polars.testing import assert_frame_equal
from tests.lean import measured_by_command, without_findings

from tracknoise.estimators.fit import fitted_fields
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.estimators.training import all_training_tables, chosen_conditions
from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.tables.store import RunFolder

TEXT = """
name = "views"
speeds = [1]
[dataset]
reader = "simulated"
[dataset.options]
motions = ["sideways"]
worlds = 2
frames = 6
width = 120
height = 90
supersampling = 1
[[views]]
[[views]]
direction = "backward"
speeds = [1, 2]
[[views]]
rotation = 90
[[trackers]]
kind = "oracle"
options = { n_features = 40 }
[statistics]
min_features = 2
"""

VIEWS = ("[[views]]", 'direction = "backward"', "speeds = [1, 2]", "rotation = 90")


def measured(text: str, folder: Path, tracknoise: Callable[..., tuple[int, str, str]]) -> Path:
    """The run of an experiment, without its analysis."""
    (folder / "x.toml").write_text(text)
    command = ("run", folder / "x.toml", "--out", folder / "run", "--workers", 1, "--no-report", "--quiet")
    with measured_by_command(), without_findings():
        assert tracknoise(*command)[0] == 0
    return folder / "run"


def test_one_view_of_each_scene_is_read(tmp_path: Path, tracknoise: Callable[..., tuple[int, str, str]]) -> None:
    """Speed 2 has no other than the one that is played backward."""
    run = measured(TEXT, tmp_path, tracknoise)
    read = all_training_tables(RunFolder(run), [("oracle", 1), ("oracle", 2)])
    for tables, direction in zip(read, ("forward", "backward"), strict=True):
        for table in tables.tables.values():
            assert set(table.select("rotation", "direction").unique().rows()) <= {(0, direction)}
        entries = tables.folder.manifest().sequences
        assert [entries[key].sequence.direction for key in tables.keys] == [direction] * 2
        assert tables.scenes == ("sideways-00", "sideways-01")
        assert tables["noise_sums"].height
    model = NoiseModel(**fitted_fields(read[0]))
    compared = check_model(model, RunFolder(run))
    ages = pl.col("at").is_between(*model.training.ages)
    assert compared.n + compared.outlier_share * compared.n == pytest.approx(read[0]["samples"].filter(ages).height)


def test_blocks_are_added_up_where_scenes_are_resampled(
    tmp_path: Path, tracknoise: Callable[..., tuple[int, str, str]]
) -> None:
    """Six scenes are; a model of a few of them would need the blocks."""
    text = TEXT.replace("worlds = 2", "worlds = 6").replace("frames = 8", "frames = 5")
    run = measured("\n".join(line for line in text.splitlines() if line not in VIEWS), tmp_path, tracknoise)
    keys, numbers = ["scene", "product", "age"], ["n", "uu", "uv", "vv", "first", "white", "walk", "drift"]

    def added(sums: pl.DataFrame) -> pl.DataFrame:
        return sums.group_by(keys).agg(pl.col(numbers).sum()).sort(keys)

    stored = pl.concat(RunFolder(run).stored_tables("noise_sums"))
    read = all_training_tables(RunFolder(run), [("oracle", 1)])[0]["noise_sums"]
    assert stored["block"].n_unique() > 1
    assert read["block"].unique().to_list() == [0]
    assert_frame_equal(added(read), added(stored))
    few = all_training_tables(RunFolder(run), [("oracle", 1)], scenes=["sideways-00", "sideways-01"])[0]
    assert few["noise_sums"]["block"].n_unique() > 1


def test_no_wanted_tracker_or_speed_is_left_out_without_a_word() -> None:
    table = pl.DataFrame({"tracker": ["lk", "lk", "sift"], "speed": [1, 2, 1]})
    folder = SimpleNamespace(path="run", stored_tables=lambda name, only: [table])
    assert chosen_conditions(folder) == [("lk", 1), ("lk", 2), ("sift", 1)]
    assert chosen_conditions(folder, trackers=["lk", "sift"], speeds=[2]) == [("lk", 2)]
    with pytest.raises(SettingsError, match="run: found no speed 7, expected one of 1, 2"):
        chosen_conditions(folder, speeds=[1, 7])
    with pytest.raises(UnknownNameError, match="unknown tracker 'orb'"):
        chosen_conditions(folder, trackers=["lk", "orb"])
    with pytest.raises(SettingsError, match="expected some of lk@1, lk@2, sift@1"):
        chosen_conditions(folder, trackers=["sift"], speeds=[2])
