"""Two truths of the same tracks: planted differences of poses come back as a floor, with intervals."""

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation
from tests.lean import only_topics, without_audit, without_geometry

import tracknoise
from tracknoise.sequences.other_poses import OtherPoses

SCENES, FRAMES, FOCAL_PX, SIGMA_RAD, NOISE_PX = 6, 120, 300.0, 0.002, 0.5


def wall(scene: str) -> tracknoise.Sequence:
    """A camera that stands before a wall: all errors of true positions come from the poses."""
    images = np.zeros((FRAMES, 48, 64), np.uint8)
    K = np.array([[FOCAL_PX, 0, 31.5], [0, FOCAL_PX, 23.5], [0, 0, 1]])
    depths = [np.full((48, 64), 2.0)] * FRAMES
    return tracknoise.Sequence.from_arrays(images, np.tile(np.eye(4), (FRAMES, 1, 1)), K, depths, scene=scene)


def turned(seed: int) -> np.ndarray:
    """Poses turned about the vertical axis by independent angles."""
    noise, poses = np.zeros((FRAMES, 3)), np.tile(np.eye(4), (FRAMES, 1, 1))
    noise[:, 1] = np.random.default_rng(seed).normal(0.0, SIGMA_RAD, FRAMES)
    poses[:, :3, :3] = Rotation.from_rotvec(noise).as_matrix()
    return poses


def measured(number: int) -> tracknoise.Measurement:
    sequence = wall(f"scene-{number}")
    tracker = tracknoise.Oracle(
        n_features=30, loss_rate=0.1, margin_px=4, covariance_px2=((NOISE_PX**2, 0.0), (0.0, NOISE_PX**2)), seed=number
    )
    return tracknoise.measure(sequence, tracker, second_truth=OtherPoses(sequence, turned(number), "made"))


@pytest.fixture(scope="module", autouse=True)
def unaudited():
    """Runs have neither an audit nor tables by which errors are compared with the first poses alone."""
    with without_audit(), only_topics(), without_geometry():
        yield


@pytest.fixture(scope="module")
def run():
    return tracknoise.analyse([measured(number) for number in range(SCENES)])


def test_the_floor_is_that_of_the_planted_rotations(run):
    """A relative rotation of sqrt(2) sigma moves points by sqrt(2) f sigma in u, at every age above 0."""
    table = run.table("two_truths", trimming="untrimmed", quantity="disagreement", statistic="second")
    horizontal = table.filter(pl.col("coordinate") == "u", pl.col("age").is_between(1, 15))
    planted = 2 * (FOCAL_PX * SIGMA_RAD) ** 2
    assert horizontal["value"].to_numpy() == pytest.approx(planted, rel=0.25)
    assert horizontal["value"].mean() == pytest.approx(planted, rel=0.1)
    covered = (horizontal["low"] < planted) & (planted < horizontal["high"])
    assert covered.mean() > 0.75
    assert table.filter(age=0)["value"].to_list() == pytest.approx([0.0, 0.0, 0.0], abs=1e-20)
    assert table.filter(coordinate="v", age=5)["value"].item() < 0.01 * planted
    assert horizontal["n_scenes"].unique().to_list() == [SCENES]


def test_errors_by_each_truth_have_the_same_observations(run):
    """The tracker was made with the first truth: by the second, its error has the floor on top."""
    table = run.table("two_truths", trimming="untrimmed", statistic="second", coordinate="u").filter(age=5)
    value = dict(table.select("quantity", "value").rows())
    assert table["n"].n_unique() == 1
    assert value["first"] == pytest.approx(NOISE_PX**2, rel=0.1)
    assert value["second"] == pytest.approx(value["first"] + value["disagreement"], rel=0.05)


def test_the_disagreement_of_poses_is_that_of_the_planted_rotations(run):
    """Per axis: a rotation about one axis only is a third of its square."""
    table = run.table("pose_disagreement")
    rotation = table.filter(quantity="rotation", lag=8)
    planted = np.degrees(SIGMA_RAD * np.sqrt(2.0 / 3.0))
    assert rotation["value"].item() == pytest.approx(planted, rel=0.05)
    assert rotation["low"].item() < planted < rotation["high"].item()
    assert rotation.select("unit", "n", "n_scenes").rows() == [("deg", SCENES * (FRAMES - 8), SCENES)]
    assert table.filter(quantity="translation")["value"].max() < 1e-9


def test_one_scene_has_intervals_from_blocks():
    one = tracknoise.analyse([measured(0)])
    table = one.table("two_truths", trimming="untrimmed", statistic="second", coordinate="u", quantity="disagreement")
    at_5 = table.filter(age=5)
    assert at_5["resampled"].to_list() == ["blocks"]
    assert at_5["low"].item() < 2 * (FOCAL_PX * SIGMA_RAD) ** 2 < at_5["high"].item()
    assert one.table("pose_disagreement")["resampled"].unique().to_list() == ["blocks"]


def test_without_a_second_truth_the_tables_have_no_rows():
    sequence = wall("scene")
    run = tracknoise.analyse([tracknoise.measure(sequence, tracknoise.Oracle(n_features=30, margin_px=4))])
    assert run.table("two_truths").is_empty()
    assert run.table("pose_disagreement").is_empty()
