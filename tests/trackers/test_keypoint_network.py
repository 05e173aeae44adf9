"""Keypoints of networks, by small networks that are made here: bright dots, described by what is around them."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.trackers.networks import COVARIANCE, DOTS_SIZE, keypoint_network, require_onnx

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
