"""Keypoints of networks, by small networks that are made here: bright dots, described by what is around them."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.trackers.networks import (
    ATTACKS,
    COVARIANCE,
    DOTS_SIZE,
    constant_network,
    hostile_network,
    keypoint_network,
    require_onnx,
    with_external_data,
)

from tracknoise.exceptions import DataError, SettingsError, TrackerError
from tracknoise.trackers.correspondence import Correspondence, Descriptor
from tracknoise.trackers.detection import Detection, Spacing, keypoints
from tracknoise.trackers.keypoint_network import NetworkUnits, find_keypoints
from tracknoise.trackers.lucas_kanade import LucasKanade
from tracknoise.trackers.rejection import Model, Rejection
from tracknoise.trackers.tracker import Frame
from tracknoise.trackers.tracker_registry import make_tracker

FREE = Rejection(model=Model.none)


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    """Make a network in a folder of its own: see `keypoint_network`."""
    require_onnx()
    return lambda **options: keypoint_network(tmp_path_factory.mktemp("network") / "dots.onnx", **options)


def places_of(uv: np.ndarray) -> set[tuple[int, int]]:
    return set(map(tuple, np.rint(uv).astype(int).tolist()))


@pytest.mark.parametrize("channels", [1, 3])
def test_a_network_finds_its_keypoints_strongest_first(network, dots, channels):
    frames, places = dots
    found = keypoints(frames[0], Detection(network=network(channels=channels)))
    assert places_of(places) <= places_of(found.uv)
    assert (np.diff(found.response) <= 0).all()
    assert (found.uv == np.rint(found.uv)).all()


@pytest.mark.parametrize("units", NetworkUnits)
def test_an_image_is_stretched_to_the_size_of_the_input_and_positions_are_brought_back(network, dots, units):
    """Each pixel of the input covers a third of a pixel of the image in u, and a fifth in v."""
    frames, places = dots
    path = network(size=(3 * DOTS_SIZE[0], 5 * DOTS_SIZE[1]), units=units)
    found = find_keypoints(frames[0].image, path, units).uv
    nearest = np.hypot(*np.moveaxis(found[:, None] - places[None], 2, 0)).min(axis=0)
    assert nearest.max() < 0.001


def test_lucas_kanade_follows_keypoints_of_a_network(network, dots, setting):
    frames, places = dots
    detection = Detection(network=network(), spacing=Spacing.circles, distance_px=5)
    tracker = LucasKanade(detection=detection, rejection=FREE, min_features=1, max_features=200).start(
        setting(DOTS_SIZE)
    )
    first, *later = [tracker.step(frame) for frame in frames]
    assert places_of(places) <= places_of(first.uv)
    start = dict(zip(first.ids.tolist(), first.uv, strict=True))
    moved = [uv - start[i] for i, uv in zip(later[-1].ids.tolist(), later[-1].uv, strict=True)]
    assert len(moved) > 20
    assert np.abs(np.median(moved, axis=0) - (12, -8)).max() < 0.05


def test_keypoints_are_matched_by_descriptors_of_the_network(network, dots, setting):
    frames, _ = dots
    settings = Correspondence(detection=Detection(network=network()), descriptor=Descriptor.network, rejection=FREE)
    tracker = settings.start(setting(DOTS_SIZE))
    first, second = tracker.step(frames[0]), tracker.step(frames[1])
    start = dict(zip(first.ids.tolist(), first.uv, strict=True))
    moved = np.array([uv - start[i] for i, uv in zip(second.ids.tolist(), second.uv, strict=True) if i in start])
    assert len(moved) > 30
    assert np.mean((moved == (3, -2)).all(axis=1)) > 0.9
    assert np.nanmax(second.quality["descriptor_distance"]) <= 2


@pytest.mark.parametrize(
    ("units", "stretch"),
    [(NetworkUnits.pixels, (1 / 3, 1 / 5)), (NetworkUnits.minus_one_to_one, (479 / 6, 599 / 10))],
)
def test_covariances_of_a_network_are_in_pixels_of_the_image(network, dots, units, stretch):
    frames, _ = dots
    path = network(
        size=(3 * DOTS_SIZE[0], 5 * DOTS_SIZE[1]), units=units, outputs=("keypoints", "scores", "covariances")
    )
    found = find_keypoints(frames[0].image, path, units)
    scaled = COVARIANCE * np.outer(stretch, stretch)
    expected = found.score[:, None] * scaled.ravel()[[0, 1, 3]]
    np.testing.assert_allclose(found.covariances, expected, rtol=1e-5)


def test_matched_keypoints_keep_the_covariances_of_the_network(network, dots, setting):
    frames, _ = dots
    detection = Detection(network=network(outputs=("keypoints", "scores", "descriptors", "covariances")))
    settings = Correspondence(detection=detection, descriptor=Descriptor.network, rejection=FREE)
    tracker = settings.start(setting(DOTS_SIZE))
    for frame in frames[:3]:
        step, known = tracker.step(frame), keypoints(frame, detection)
        score = dict(zip(map(tuple, known.uv.tolist()), known.response.tolist(), strict=True))
        expected = [9.0 * score[place] for place in map(tuple, step.uv.tolist())]
        np.testing.assert_allclose(step.quality["cov_vv"], expected, rtol=1e-5)  # of new features too


def test_an_image_without_keypoints_does_no_harm(network, dots, setting):
    frames, _ = dots
    black = Frame(1, np.zeros(DOTS_SIZE[::-1], np.uint8))
    for settings in (
        LucasKanade(detection=Detection(network=network())),
        Correspondence(detection=Detection(network=network()), descriptor=Descriptor.network, max_missed_frames=1),
    ):
        tracker = settings.start(setting(DOTS_SIZE))
        steps = [tracker.step(frame) for frame in (frames[0], black, Frame(2, frames[0].image))]
        assert steps[1].new == 0
        assert steps[0].new > 20


def test_weak_keypoints_are_left_out(network, dots):
    frames, _ = dots
    path = network()
    every, strong = (keypoints(frames[0], Detection(network=path, network_score=least)) for least in (0.0, 0.9))
    assert 0 < len(strong.uv) < len(every.uv)
    assert strong.response.min() >= 0.9


def test_networks_that_cannot_be_used_are_refused_in_one_line(network, dots, setting, tmp_path):
    (tmp_path / "no.onnx").write_bytes(b"no network")
    for path, message in (
        (tmp_path / "none.onnx", r"none.onnx: no such file, expected an ONNX network of keypoints, such as SuperPoint"),
        (tmp_path / "no.onnx", r"no.onnx: cannot be opened \(.*\), expected an ONNX network of keypoints$"),
        (network(outputs=("scores",)), r"outputs scores, expected one whose name contains keypoints$"),
        (network(inputs=2), r"inputs image tensor\(float\) .*, more1 .*, expected one input of floats"),
    ):
        for settings in (LucasKanade, Correspondence):
            with pytest.raises(DataError, match=message) as caught:
                settings(detection=Detection(network=path)).start(setting(DOTS_SIZE))
            assert "\n" not in str(caught.value)
    plain = Correspondence(detection=Detection(network=network(outputs=("keypoints",))), descriptor=Descriptor.network)
    with pytest.raises(TrackerError, match=r"the network has no output descriptors"):
        plain.start(setting(DOTS_SIZE)).step(dots[0][0])


MESSAGES = {
    "loop": r"fails on images of 48 x 32 px \(it takes too long\), expected keypoints within \d+ s of processor time",
    "memory": r"fails on images of 48 x 32 px \(.*allocate.*\), expected keypoints$",
    "size": r"returned keypoints \(1, 70000000, 2\), 560000000 bytes, on images .*, expected keypoints of at most 5",
}


@pytest.mark.parametrize("attack", ATTACKS)
def test_a_network_has_limits_of_time_and_memory(tmp_path, attack):
    require_onnx()
    path = hostile_network(tmp_path / "x.onnx", attack)
    with pytest.raises(TrackerError, match=rf"x.onnx: the network {MESSAGES[attack]}") as caught:
        find_keypoints(np.zeros((32, 48), np.uint8), path, NetworkUnits.pixels)
    assert "\n" not in str(caught.value)


GOOD = {
    "keypoints": np.float32([[[3, 4], [5, 6], [7, 8]]]),
    "scores": np.float32([[0.5, 0.7, 0.6]]),
    "descriptors": np.ones((1, 3, 8), np.float32),
    "covariances": np.float32(np.tile(np.eye(2), (1, 3, 1, 1))),
}


@pytest.fixture
def found_with(tmp_path):
    """What a network finds that returns some arrays in place of good ones."""
    require_onnx()

    def find(**arrays):
        path = constant_network(tmp_path / "x.onnx", {**GOOD, **arrays}, {"image": [1, 1, None, None]})
        return find_keypoints(np.zeros((32, 48), np.uint8), path, NetworkUnits.pixels)

    return find


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        *(("keypoints", shape) for shape in ((), (0,), (6,), (2, 3), (3, 1, 2), (3, 2, 1), (2, 3, 2))),
        *(("scores", shape) for shape in ((), (0,), (2,), (3, 2), (2, 3))),
        *(("descriptors", shape) for shape in ((), (3,), (0,), (1, 3, 0), (8, 3), (3, 1, 8), (2, 3, 8))),
        *(("covariances", shape) for shape in ((), (0,), (3, 4), (3, 2, 1), (2, 3, 2, 2))),
    ],
)
def test_arrays_of_other_shapes_are_refused_in_one_line(found_with, name, shape):
    with pytest.raises(
        TrackerError, match=rf"the network returned .*{name} {re.escape(str(shape))}.*, expected one el"
    ):
        found_with(**{name: np.ones(shape, np.float32)})


def test_text_is_refused_in_one_line(found_with):
    for name in GOOD:
        with pytest.raises(
            TrackerError, match=rf"the network returned {name} of object values, expected an array of n"
        ):
            found_with(**{name: np.array([["a", "b"]], dtype=object)})


@pytest.mark.parametrize("shape", [(0, 2), (1, 0, 2)])
def test_no_keypoints_are_no_error(found_with, shape):
    outer = shape[:-1]
    empty = {"keypoints": shape, "scores": outer, "descriptors": (*outer, 8), "covariances": (*outer, 2, 2)}
    found = found_with(**{name: np.ones(of, np.float32) for name, of in empty.items()})
    assert [one.shape for one in (found.uv, found.score, found.descriptors, found.covariances)] == [
        (0, 2),
        (0,),
        (0, 8),
        (0, 3),
    ]


@pytest.mark.parametrize(
    ("name", "at", "value", "message"),
    [
        ("descriptors", (0, 1, 2), np.nan, "of 1 keypoint, expected finite numbers$"),
        ("descriptors", (0, 1, 2), np.inf, "of 1 keypoint, expected finite numbers$"),
        ("descriptors", (0, 1, 2), 1e300, "of 1 keypoint, expected finite numbers$"),
        ("covariances", (0, 1, 0, 1), 0.3, "of 1 keypoint, expected symmetric matrices$"),
        ("covariances", (0, 1), [[1, 2], [2, 1]], "of 1 keypoint, expected no negative eigenvalue$"),
        ("covariances", (0, slice(2), 0, 0), -1.0, "of 2 keypoints, expected no negative eigenvalue$"),
        ("covariances", (0, 1, 0, 0), np.inf, "of 1 keypoint, expected finite numbers; NaN where"),
    ],
)
def test_values_that_none_has_are_refused_in_one_line(found_with, name, at, value, message):
    values = GOOD[name].astype(np.float64)
    values[at] = value
    with pytest.raises(TrackerError, match=rf"the network returned {name} \[.*\] {message}"):
        found_with(**{name: values})


def test_what_belongs_to_no_keypoint_of_the_image_does_not_matter(found_with):
    """Networks with a fixed number of keypoints fill the rest up."""
    uv, descriptors, covariances = (GOOD[name].copy() for name in ("keypoints", "descriptors", "covariances"))
    uv[0, 1] = -1
    descriptors[0, 1], covariances[0, 2] = np.nan, np.nan
    found = found_with(keypoints=uv, descriptors=descriptors, covariances=covariances)
    assert found.uv.tolist() == [[7, 8], [3, 4]]
    assert np.isnan(found.covariances).tolist() == [[True] * 3, [False] * 3]


def test_a_network_is_opened_again_when_its_external_data_change(tmp_path):
    require_onnx()
    path = keypoint_network(tmp_path / "x.onnx")
    image = np.zeros((32, 48), np.uint8)
    image[8::8, 8::8] = 255
    inside = find_keypoints(image, path, NetworkUnits.pixels)
    data = with_external_data(path, "x.data")
    before = find_keypoints(image, path, NetworkUnits.pixels)
    assert (before.descriptors == inside.descriptors).all()
    kernel = np.frombuffer(data.read_bytes(), np.float32)
    data.write_bytes((kernel[::-1]).tobytes())
    after = find_keypoints(image, path, NetworkUnits.pixels)
    assert (after.uv == before.uv).all()
    assert not np.allclose(after.descriptors, before.descriptors, atol=0.1)


def test_options_that_do_not_fit_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"grid is \(2, 2\), expected none with a network"):
        Detection(network=tmp_path / "x.onnx", grid=(2, 2))
    with pytest.raises(ValueError, match=r"descriptor is 'network', expected another one, or detection.network"):
        Correspondence(descriptor="network")
    made = make_tracker("lucas-kanade", {"detection": {"network": "x.onnx", "network_units": "minus-one-to-one"}})
    assert made == LucasKanade(detection=Detection(network=Path("x.onnx"), network_units=NetworkUnits.minus_one_to_one))


def test_without_onnxruntime_the_extra_is_named(tmp_path, setting, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    (tmp_path / "x.onnx").write_bytes(b"x")
    settings = LucasKanade(detection=replace(Detection(), network=tmp_path / "x.onnx"))
    with pytest.raises(SettingsError, match=r"needs the extra `learned`: pip install 'tracknoise\[learned\]'"):
        settings.start(setting(DOTS_SIZE))
