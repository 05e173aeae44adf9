"""Keypoints of networks, by small networks that are made here: bright dots, described by what is around them."""

import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracknoise.exceptions import DataError, SettingsError, TrackerError
from tracknoise.trackers.correspondence import Correspondence, Descriptor
from tracknoise.trackers.detection import Detection, Spacing, keypoints
from tracknoise.trackers.keypoint_network import NetworkUnits, find_keypoints
from tracknoise.trackers.lucas_kanade import LucasKanade
from tracknoise.trackers.rejection import Model, Rejection
from tracknoise.trackers.tracker import Frame
from tracknoise.trackers.tracker_registry import make_tracker

SIZE = (160, 120)
FREE = Rejection(model=Model.none)
COVARIANCE = np.float32([[4.0, 1.0], [1.0, 9.0]])
"""What networks with covariances predict, times the score."""


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    """Make a network: its channels, the size of its input if it has one, its outputs, and units of positions."""
    onnx = pytest.importorskip("onnx", reason="makes networks for these tests")
    pytest.importorskip("onnxruntime", reason="the extra `learned` is not installed")
    helper, numbers = onnx.helper, onnx.numpy_helper

    def make(
        *,
        channels: int = 1,
        size: tuple[int, int] | None = None,
        outputs: tuple[str, ...] = ("keypoints", "scores", "descriptors"),
        units: NetworkUnits = NetworkUnits.pixels,
        inputs: int = 1,
    ) -> Path:
        kernel = np.random.default_rng(0).normal(size=(16, channels, 9, 9)).astype(np.float32)
        half = np.array([(side - 1) / 2 for side in size or (1, 1)], dtype=np.float32)
        scale, shift = (1 / half, np.float32([-1, -1])) if units is NetworkUnits.minus_one_to_one else ([1, 1], [0, 0])
        constants = {
            "kernel": kernel, "least": np.float32([0.7]), "columns": np.int64([3, 2]), "rows": np.int64([0, 2, 3]),
            "scale": np.float32(scale), "shift": np.float32(shift), "zero": np.int64([0]), "one": np.int64([1]),
            "two": np.int64([2]), "inner": np.int64([1, 2]), "matrix": COVARIANCE,
        }  # fmt: skip
        nodes = [
            helper.make_node("ReduceMax", ["image", "one"], ["gray"], keepdims=1),
            helper.make_node("MaxPool", ["gray"], ["largest"], kernel_shape=[5, 5], pads=[2] * 4),
            helper.make_node("Equal", ["gray", "largest"], ["peak"]),
            helper.make_node("Greater", ["gray", "least"], ["bright"]),
            helper.make_node("And", ["peak", "bright"], ["dot"]),
            helper.make_node("NonZero", ["dot"], ["place"]),
            helper.make_node("Transpose", ["place"], ["places"], perm=[1, 0]),
            helper.make_node("Gather", ["places", "columns"], ["whole"], axis=1),
            helper.make_node("Cast", ["whole"], ["pixels"], to=onnx.TensorProto.FLOAT),
            helper.make_node("Mul", ["pixels", "scale"], ["scaled"]),
            helper.make_node("Add", ["scaled", "shift"], ["uv"]),
            helper.make_node("Unsqueeze", ["uv", "zero"], ["keypoints"]),
            helper.make_node("GatherND", ["gray", "places"], ["score"]),
            helper.make_node("Unsqueeze", ["score", "zero"], ["scores"]),
            helper.make_node("Unsqueeze", ["score", "inner"], ["weight"]),
            helper.make_node("Mul", ["weight", "matrix"], ["matrices"]),
            helper.make_node("Unsqueeze", ["matrices", "zero"], ["covariances"]),
            helper.make_node("Conv", ["image", "kernel"], ["around"], pads=[4] * 4),
            helper.make_node("Transpose", ["around"], ["vectors"], perm=[0, 2, 3, 1]),
            helper.make_node("Gather", ["places", "rows"], ["at"], axis=1),
            helper.make_node("GatherND", ["vectors", "at"], ["described"]),
            helper.make_node("LpNormalization", ["described"], ["unit"], axis=1, p=2),
            helper.make_node("Unsqueeze", ["unit", "zero"], ["descriptors"]),
        ]
        shape = [1, channels, *((None, None) if size is None else size[::-1])]
        given = [helper.make_tensor_value_info("image", onnx.TensorProto.FLOAT, shape)]
        given += [helper.make_tensor_value_info(f"more{k}", onnx.TensorProto.FLOAT, shape) for k in range(1, inputs)]
        shown = [helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, None) for name in outputs]
        initial = [numbers.from_array(np.asarray(value), name) for name, value in constants.items()]
        graph = helper.make_graph(nodes, "dots", given, shown, initial)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8)
        path = tmp_path_factory.mktemp("network") / "dots.onnx"
        onnx.save(model, path)
        return path

    return make


@pytest.fixture(scope="module")
def dots() -> tuple[list[Frame], np.ndarray]:
    """Images of dots with different surroundings that move by (3, -2) px, and the places of the dots in the first."""
    rng = np.random.default_rng(0)
    texture = cv2.GaussianBlur(rng.uniform(0, 255, (200, 260)).astype(np.float32), (0, 0), 2.0) * 0.7
    places = np.array([(u, v) for u in range(40, 220, 18) for v in range(40, 170, 18)])
    places += rng.integers(-4, 5, places.shape)
    for u, v in places:
        texture[v - 1 : v + 2, u - 1 : u + 2] = 190
        texture[v, u] = 200 + rng.integers(0, 50)
    texture = np.clip(texture, 0, 255).astype(np.uint8)
    images = [texture[40 + 2 * k :, 60 - 3 * k :][: SIZE[1], : SIZE[0]].copy() for k in range(5)]
    inside = places - (60, 40)
    inside = inside[((inside >= 8) & (inside < np.array(SIZE) - 8)).all(axis=1)]
    return [Frame(k, image) for k, image in enumerate(images)], inside


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
    path = network(size=(3 * SIZE[0], 5 * SIZE[1]), units=units)
    found = find_keypoints(frames[0].image, path, units).uv
    nearest = np.hypot(*np.moveaxis(found[:, None] - places[None], 2, 0)).min(axis=0)
    assert nearest.max() < 0.001


def test_lucas_kanade_follows_keypoints_of_a_network(network, dots, setting):
    frames, places = dots
    detection = Detection(network=network(), spacing=Spacing.circles, distance_px=5)
    tracker = LucasKanade(detection=detection, rejection=FREE, min_features=1, max_features=200).start(setting(SIZE))
    first, *later = [tracker.step(frame) for frame in frames]
    assert places_of(places) <= places_of(first.uv)
    start = dict(zip(first.ids.tolist(), first.uv, strict=True))
    moved = [uv - start[i] for i, uv in zip(later[-1].ids.tolist(), later[-1].uv, strict=True)]
    assert len(moved) > 20
    assert np.abs(np.median(moved, axis=0) - (12, -8)).max() < 0.05


def test_keypoints_are_matched_by_descriptors_of_the_network(network, dots, setting):
    frames, _ = dots
    settings = Correspondence(detection=Detection(network=network()), descriptor=Descriptor.network, rejection=FREE)
    tracker = settings.start(setting(SIZE))
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
    path = network(size=(3 * SIZE[0], 5 * SIZE[1]), units=units, outputs=("keypoints", "scores", "covariances"))
    found = find_keypoints(frames[0].image, path, units)
    scaled = COVARIANCE * np.outer(stretch, stretch)
    expected = found.score[:, None] * scaled.ravel()[[0, 1, 3]]
    np.testing.assert_allclose(found.covariances, expected, rtol=1e-5)


def test_matched_keypoints_keep_the_covariances_of_the_network(network, dots, setting):
    frames, _ = dots
    detection = Detection(network=network(outputs=("keypoints", "scores", "descriptors", "covariances")))
    settings = Correspondence(detection=detection, descriptor=Descriptor.network, rejection=FREE)
    tracker = settings.start(setting(SIZE))
    for frame in frames[:3]:
        step, known = tracker.step(frame), keypoints(frame, detection)
        score = dict(zip(map(tuple, known.uv.tolist()), known.response.tolist(), strict=True))
        expected = [9.0 * score[place] for place in map(tuple, step.uv.tolist())]
        np.testing.assert_allclose(step.quality["cov_vv"], expected, rtol=1e-5)  # of new features too


def test_an_image_without_keypoints_does_no_harm(network, dots, setting):
    frames, _ = dots
    black = Frame(1, np.zeros(SIZE[::-1], np.uint8))
    for settings in (
        LucasKanade(detection=Detection(network=network())),
        Correspondence(detection=Detection(network=network()), descriptor=Descriptor.network, max_missed_frames=1),
    ):
        tracker = settings.start(setting(SIZE))
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
                settings(detection=Detection(network=path)).start(setting(SIZE))
            assert "\n" not in str(caught.value)
    plain = Correspondence(detection=Detection(network=network(outputs=("keypoints",))), descriptor=Descriptor.network)
    with pytest.raises(TrackerError, match=r"the network has no output descriptors"):
        plain.start(setting(SIZE)).step(dots[0][0])


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
        settings.start(setting(SIZE))
