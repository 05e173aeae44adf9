"""Views of scenes: turned and backward, as conditions of their own, and sequences that are measured together."""

import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.experiments.execute import execute
from tracknoise.experiments.load import resolve
from tracknoise.experiments.plan import batches, plan
from tracknoise.experiments.settings import parse_experiment
from tracknoise.tables.findings_schema import CURVES
from tracknoise.tables.store import RunFolder

TEXT = """
name = "x"
speeds = [1, 2]
[dataset]
reader = "simulated"
max_frames = 4
[dataset.options]
motions = ["sideways", "fixating"]
lightings = ["default", "east"]
frames = 6
width = 96
height = 64
supersampling = 1
[[views]]
[[views]]
rotation = 90
lightings = ["east"]
speeds = [1]
[[views]]
direction = "backward"
speeds = [1]
[[trackers]]
kind = "oracle"
options = { n_features = 20, covariance_px2 = [[0.0, 0.0], [0.0, 0.0]], bias_px = [0.5, 0.25], margin_px = 2 }
"""


def experiment(**changes: str):
    text = TEXT
    for old, new in changes.items():
        text = text.replace(old, new)
    return resolve(parse_experiment(text, place="x.toml"))


def test_every_view_of_every_scene_is_planned_under_its_lightings_and_at_its_speeds() -> None:
    found = [(task.key, task.speeds) for task in plan(experiment().with_limits(scenes=1, frames=None))]
    assert sorted(found) == [
        ("fixating-00@default", (1, 2)),
        ("fixating-00@default@backward", (1,)),
        ("fixating-00@east", (1, 2)),
        ("fixating-00@east@backward", (1,)),
        ("fixating-00@east@r90", (1,)),
    ]


def test_a_reader_that_shares_nothing_has_a_batch_a_task() -> None:
    tasks = plan(experiment())
    assert batches(tasks) == [[task] for task in tasks]
    assert batches([]) == []


class Silent:
    def planned(self, keys, done): ...
    def frame(self, key, done, total, first): ...
    def measured(self, key, entry): ...
    def remark(self, text): ...
    def failed(self, keys, cause):
        raise AssertionError(cause)


def test_views_are_conditions_of_their_own(tmp_path) -> None:
    """The oracle's bias is in the axes of each image, and so in every view the same."""
    run = RunFolder(tmp_path / "run")
    execute(experiment().with_limits(scenes=1, frames=4), run, listener=Silent())
    curves = run.statistics(CURVES).filter(statistic="nu", weighting="features", population="visible")
    at_one = curves.filter(pl.col("trimming") == "untrimmed", pl.col("at") == 1)
    views = at_one.select("lighting", "rotation", "direction").rows()
    assert sorted(views) == sorted(
        [("default", 0, "forward"), ("east", 0, "forward"), ("east", 90, "forward")]
        + [(lighting, 0, "backward") for lighting in ("default", "east")]
    )
    np.testing.assert_allclose(at_one.select("u", "v").to_numpy(), [(0.5, 0.25)] * 5, atol=1e-9)
    assert {entry.n_frames for entry in run.manifest().sequences.values()} == {4}
    sizes = {(entry.sequence.rotation, entry.width, entry.height) for entry in run.manifest().sequences.values()}
    assert sizes == {(0, 96, 64), (90, 64, 96)}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("rotation = 90", "rotation = 45", r"views\[1\].rotation: found 45, expected 0, 90, 180 or 270"),
        ('"backward"', '"sideways"', r"views\[2\].direction: found 'sideways', expected 'forward' or 'backward'"),
        ("rotation = 90", "rotation = 0", "views must differ in rotation or direction"),
        ("speeds = [1]", "speeds = [1, 1]", r"speeds must differ, found \[1, 1\]"),
    ],
)
def test_mistakes_in_views_are_named(old, new, message) -> None:
    with pytest.raises(SettingsError, match=message):
        experiment(**{old: new})


def test_an_unknown_lighting_of_a_view_is_named() -> None:
    with pytest.raises(UnknownNameError, match="lighting 'south'"):
        plan(experiment(**{'lightings = ["east"]\nspeeds': 'lightings = ["south"]\nspeeds'}))
