"""Matches of networks, by small networks that are made here: the most similar descriptor that is near enough."""

import sys
from pathlib import Path

import numpy as np
import pytest
from tests.trackers.networks import (
    DESCRIPTOR_LENGTH,
    DOTS_SIZE,
    KEYPOINTS_OF_TWO,
    constant_network,
    keypoint_network,
    match_network,
    require_onnx,
)

from tracknoise.exceptions import DataError, SettingsError, TrackerError
from tracknoise.trackers.correspondence import Correspondence, Descriptor
from tracknoise.trackers.detection import Detection
from tracknoise.trackers.match_network import network_matches
from tracknoise.trackers.rejection import Model, Rejection
from tracknoise.trackers.tracker import Frame
from tracknoise.trackers.tracker_registry import make_tracker

FREE = Rejection(model=Model.none)
SIZE = (200, 100)
FIVE = np.array([[10.0, 20], [50, 30], [90, 40], [130, 50], [170, 60]])
"""Positions of keypoints."""


def apart(count: int, length: int = DESCRIPTOR_LENGTH) -> np.ndarray:
    """Descriptors that are at right angles to each other."""
    return np.eye(length, dtype=np.float32)[:count]


@pytest.fixture
def constant(tmp_path):
    """Make a network that always gives the same pairs and scores."""
    require_onnx()

    def make(matches0: object, mscores0: object) -> Path:
        outputs = {"matches0": np.asarray(matches0), "mscores0": np.asarray(mscores0)}
        return constant_network(tmp_path / f"{len(list(tmp_path.iterdir()))}.onnx", outputs)

    return make


@pytest.fixture
def learned(tmp_path):
    """Settings of a tracker whose keypoints are found and matched by networks."""
    require_onnx()

    def make(path: Path | None = None, **options: object) -> Correspondence:
        found = keypoint_network(tmp_path / "dots.onnx")
        matcher = path or match_network(tmp_path / "matches.onnx")
        return Correspondence(
            detection=Detection(network=found),
            descriptor=Descriptor.network,
            rejection=FREE,
            matcher=matcher,
            **options,
        )

    return make


@pytest.mark.parametrize("pairs", [True, False])
def test_keypoints_are_matched_by_descriptor_and_position_in_ascending_order(tmp_path, pairs):
    require_onnx()
    path = match_network(tmp_path / "matches.onnx", pairs=pairs, reach=0.25)
    order = np.array([3, 0, 4, 1, 2])
    moved = FIVE[order] + (20, 0)  # 0.2 in units of half of the longer side
    moved[order == 2] += (0, 20)  # too far
    found = network_matches(path, (FIVE, apart(5)), (moved, apart(5)[order]), SIZE, 0.0)
    assert found.query_rows.tolist() == [0, 1, 3, 4]
    assert order[found.train_rows].tolist() == [0, 1, 3, 4]
    assert found.quality["match_score"].tolist() == [1.0] * 4
    assert {found.query_rows.dtype, found.train_rows.dtype} == {np.dtype(np.intp)}


def test_positions_are_relative_to_the_centre_in_units_of_half_of_the_longer_side(tmp_path):
    """The reach is between what a step of 10 px is in these units and in those of the shorter side."""
    require_onnx()
    path = match_network(tmp_path / "matches.onnx", reach=0.101)
    for step, expected in (((0, 10), 5), ((10, 0), 5), ((0, 11), 0), ((11, 0), 0)):
        found = network_matches(path, (FIVE, apart(5)), (FIVE + step, apart(5)), SIZE, 0.0)
        assert len(found.query_rows) == expected


def test_pairs_with_a_lower_score_are_left_out(constant):
    path = constant([[0, 1], [1, 0], [2, 2]], np.float32([0.2, 0.5, 0.8]))
    found = network_matches(path, (FIVE, apart(5)), (FIVE, apart(5)), SIZE, 0.5)
    assert found.query_rows.tolist() == [1, 2]
    assert found.train_rows.tolist() == [0, 2]
    np.testing.assert_allclose(found.quality["match_score"], [0.5, 0.8])


def test_no_keypoint_is_in_two_pairs(constant):
    """Row 4 of the second image is given twice, row 3 of the first too; of equal scores the first counts."""
    pairs = [[3, 4], [0, 4], [3, 2], [1, 1], [1, 0]]
    path = constant(pairs, np.float32([0.6, 0.9, 0.5, 0.7, 0.7]))
    found = network_matches(path, (FIVE, apart(5)), (FIVE, apart(5)), SIZE, 0.0)
    assert list(zip(found.query_rows.tolist(), found.train_rows.tolist(), strict=True)) == [(0, 4), (1, 1)]


def test_one_row_per_keypoint_is_a_pair_unless_it_is_minus_one(constant):
    path = constant([[-1, 3, -1, 0, -1]], np.float32([[0, 0.9, 0, 0.4, 0]]))
    found = network_matches(path, (FIVE, apart(5)), (FIVE[:4], apart(4)), SIZE, 0.0)
    assert list(zip(found.query_rows.tolist(), found.train_rows.tolist(), strict=True)) == [(1, 3), (3, 0)]


@pytest.mark.parametrize("counts", [(0, 5), (5, 0), (0, 0)])
def test_without_keypoints_the_network_is_not_asked(constant, counts):
    path = constant([[9, 9]], np.float32([0.5]))
    ends = [(FIVE[:count], apart(count)) for count in counts]
    assert len(network_matches(path, *ends, SIZE, 0.0).query_rows) == 0


@pytest.mark.parametrize(
    ("matches0", "mscores0", "message"),
    [
        ([[0, 1], [2, 5]], np.float32([0.5, 0.5]), r"returned matches0 \(2, 5\), expected rows below 5 and 4$"),
        ([[0, 1], [-1, 2]], np.float32([0.5, 0.5]), r"returned matches0 \(-1, 2\), expected rows below 5 and 4$"),
        ([[-1, 0, -2, 1, 2]], np.float32([[0.5] * 5]), r"returned matches0 \(2, -2\), expected rows below 5 and 4$"),
        ([[0, 1]], np.float32([np.nan]), r"returned mscores0 nan, expected finite scores$"),
        ([[0, 1]], np.float32([np.inf]), r"returned mscores0 inf, expected finite scores$"),
        ([[0, 1]], np.float32([0.5, 0.5]), r"matches0 \(1, 2\) and mscores0 \(2,\), expected \(k, 2\) and \(k,\)"),
        ([[0, 1, 2]], np.float32([0.5]), r"matches0 \(1, 3\) and mscores0 \(1,\), expected .*, or \(1, 5\) of both$"),
        ([0, 1], np.float32([0.5, 0.5]), r"matches0 \(2,\) and mscores0 \(2,\), expected \(k, 2\)"),
        (1, np.float32(0.5), r"matches0 \(\) and mscores0 \(\), expected \(k, 2\)"),
        (np.float32([[0, 1]]), np.float32([0.5]), r"matches0 float32 and mscores0 float32, expected int64 and float32"),
    ],
)
def test_outputs_that_do_not_fit_are_refused_in_one_line(constant, matches0, mscores0, message):
    path = constant(matches0, mscores0)
    with pytest.raises(TrackerError, match=message) as caught:
        network_matches(path, (FIVE, apart(5)), (FIVE[:4], apart(4)), SIZE, 0.0)
    assert str(caught.value).startswith(f"{path}: the network returned ")
    assert "\n" not in str(caught.value)


def test_descriptors_of_another_length_are_refused_in_one_line(constant):
    path = constant([[0, 1]], np.float32([0.5]))
    with pytest.raises(TrackerError, match=r"onnx: descriptors of 8 numbers, expected 16 for desc0$"):
        network_matches(path, (FIVE, apart(5, 8)), (FIVE, apart(5, 8)), SIZE, 0.0)


def test_files_that_cannot_be_used_are_refused_in_one_line(learned, setting, tmp_path):
    require_onnx()
    (tmp_path / "no.onnx").write_bytes(b"no network")
    good = {"matches0": np.int64([[0, 1]]), "mscores0": np.float32([0.5])}
    image = [1, 1, None, None]
    fused = constant_network(
        tmp_path / "fused.onnx", {"kpts0": np.zeros(2), **good}, {"image0": image, "image1": image}
    )
    batch = constant_network(tmp_path / "batch.onnx", {"matches": good["matches0"]}, {"images": [2, 1, None, None]})
    sized = constant_network(tmp_path / "sized.onnx", good, {**KEYPOINTS_OF_TWO, "image_size0": [1, 2]})
    named = constant_network(tmp_path / "named.onnx", {"matches0": good["matches0"], "scores": good["mscores0"]})
    expected = "inputs kpts0, kpts1, desc0, desc1 of floats, and outputs matches0 and mscores0$"
    for path, message in (
        (
            tmp_path / "none.onnx",
            r"none.onnx: no such file, expected an ONNX network of matches, such as LightGlue expo",
        ),
        (tmp_path / "no.onnx", r"no.onnx: cannot be opened \(.*\), expected an ONNX network of matches$"),
        (fused, rf"a pipeline from images to matches \(inputs image0 .*\), expected the network .* itself: {expected}"),
        (batch, rf"a pipeline from images to matches \(inputs images .*\), expected the network .* itself: {expected}"),
        (sized, rf"sized.onnx: inputs kpts0 .*, image_size0 .*, expected {expected}"),
        (named, rf"named.onnx: outputs matches0 .*, scores .*, expected {expected}"),
    ):
        with pytest.raises(DataError, match=message) as caught:
            learned(path).start(setting(DOTS_SIZE))
        assert "\n" not in str(caught.value)


def test_a_tracker_follows_what_a_network_matches(learned, dots, setting):
    frames, _ = dots
    tracker = learned().start(setting(DOTS_SIZE))
    steps = [tracker.step(frame) for frame in frames]
    start = dict(zip(steps[0].ids.tolist(), steps[0].uv, strict=True))
    moved = np.array([uv - start[i] for i, uv in zip(steps[-1].ids.tolist(), steps[-1].uv, strict=True) if i in start])
    assert len(moved) > 20
    assert np.mean((moved == (12, -8)).all(axis=1)) > 0.9
    for step in steps[1:]:
        assert set(step.quality) == {"match_score"}
        assert (step.quality["match_score"][~step.born] > 0).all()
        assert np.isnan(step.quality["match_score"][step.born]).all()


def test_a_least_score_leaves_fewer_matches(learned, dots, setting):
    frames, _ = dots
    matched = []
    for least in (0.0, 0.999):
        tracker = learned(match_score=least).start(setting(DOTS_SIZE))
        steps = [tracker.step(frame) for frame in frames[:2]]
        matched.append(steps[1].matched)
        assert np.nanmin(steps[1].quality["match_score"]) >= least
    assert 0 < matched[1] < matched[0]


def test_a_feature_is_compared_by_its_latest_descriptor(learned, setting):
    """The dot's surroundings turn by a little in each frame: the first and the last are no longer similar."""
    angles = np.linspace(0, np.pi, 9)
    shade = np.arange(-12, 13)
    frames = []
    for k, angle in enumerate(angles):
        image = np.zeros(DOTS_SIZE[::-1])
        image[48:73, 68:93] = 90 + 5 * (np.cos(angle) * shade[None] + np.sin(angle) * shade[:, None])
        image[60, 80] = 180
        frames.append(Frame(k, image.astype(np.uint8)))
    tracker = learned(match_score=0.99).start(setting(DOTS_SIZE))
    steps = [tracker.step(frame) for frame in frames]
    assert [step.ids.tolist() for step in steps] == [[0]] * len(frames)
    other = learned(match_score=0.99).start(setting(DOTS_SIZE))
    assert [step.new for step in (other.step(frames[0]), other.step(frames[-1]))] == [1, 1]


def test_frames_without_keypoints_do_no_harm(learned, dots, setting):
    frames, _ = dots
    black = np.zeros(DOTS_SIZE[::-1], np.uint8)
    tracker = learned(max_missed_frames=1).start(setting(DOTS_SIZE))
    steps = [tracker.step(frame) for frame in (Frame(0, black), frames[0], Frame(2, black), Frame(3, frames[0].image))]
    assert [step.new for step in steps[::2]] == [0, 0]
    assert steps[3].matched == steps[1].new > 20


def test_options_that_do_not_fit_are_refused():
    keypoints = {"network": "dots.onnx"}
    by_network = {"descriptor": "network", "matcher": "m.onnx", "detection": keypoints}
    made = make_tracker("correspondence", by_network | {"match_score": 0.2})
    assert (made.matcher, made.match_score) == (Path("m.onnx"), 0.2)
    for options, message in (
        ({"matcher": "m.onnx", "detection": keypoints}, "descriptor is 'sift', expected network with a matcher"),
        ({**by_network, "max_ratio": 0.8}, "max_ratio is 0.8, expected none with a matcher, whose matches have scores"),
        ({**by_network, "max_distance": 9.0}, "max_distance is 9.0, expected none with a matcher"),
        ({**by_network, "match_score": 1.5}, "match_score is 1.5, expected a number from 0 to 1"),
    ):
        with pytest.raises(SettingsError, match=message):
            make_tracker("correspondence", options)


def test_without_onnxruntime_the_extra_is_named(learned, setting, monkeypatch):
    settings = learned()
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(SettingsError, match=r"needs the extra `learned`: pip install 'tracknoise\[learned\]'"):
        settings.start(setting(DOTS_SIZE))
