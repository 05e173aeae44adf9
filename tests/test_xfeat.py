"""XFeat as an ONNX file: what its keypoints are, whatever the weights say."""

from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.trackers.networks import require_onnx

WIDTHS = {
    "block1": (1, 4, 8, 8, 24),
    "block2": (24, 24, 24),
    "block3": (24, 64, 64, 64),
    "block4": (64, 64, 64, 64),
    "block5": (64, 128, 128, 128, 64),
    "block_fusion": (64, 64, 64),
    "heatmap_head": (64, 64, 64),
    "keypoint_head": (64, 64, 64, 64),
}
"""Channels of each block, of the paper."""
LAST = {"skip1.1": (1, 24), "block_fusion.2": (64, 64), "heatmap_head.2": (64, 1), "keypoint_head.3": (64, 65)}
"""Convolutions that are not normalised."""
POINTWISE = ("heatmap_head", "keypoint_head", "block3.2", "block5.3")


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A network with weights of chance."""
    require_onnx()
    from benchmarks.xfeat import network

    rng, weights = np.random.default_rng(3), {}

    def add(name: str, before: int, after: int, side: int) -> None:
        spread = 1.6 / np.sqrt(before * side**2)
        weights[f"{name}.weight"] = rng.normal(0, spread, (after, before, side, side)).astype(np.float32)

    for block, channels in WIDTHS.items():
        for place, (before, after) in enumerate(pairwise(channels)):
            layer = f"{block}.{place}.layer"
            add(f"{layer}.0", before, after, 1 if f"{block}.{place}".startswith(POINTWISE) else 3)
            weights[f"{layer}.1.running_mean"] = rng.normal(0, 0.1, after).astype(np.float32)
            weights[f"{layer}.1.running_var"] = rng.uniform(0.5, 2.0, after).astype(np.float32)
    for name, (before, after) in LAST.items():
        add(name, before, after, 1)
        weights[f"{name}.bias"] = rng.normal(0, 0.1, after).astype(np.float32)
    made = tmp_path_factory.mktemp("xfeat") / "xfeat.onnx"
    made.write_bytes(network(weights).SerializeToString())
    return made


@pytest.mark.parametrize("size", [(160, 128), (155, 131)])
def test_keypoints_are_strongest_first_apart_and_described(path: Path, size: tuple[int, int]) -> None:
    from tracknoise.trackers.keypoint_network import NetworkUnits, find_keypoints

    noise = np.random.default_rng(0).uniform(0, 255, size[::-1]).astype(np.uint8)
    found = find_keypoints(cv2.GaussianBlur(noise, (0, 0), 2.0), path, NetworkUnits.pixels)
    assert len(found.uv) > 20
    assert (np.diff(found.score) <= 0).all()
    assert found.score.min() > 0
    assert found.descriptors is not None
    np.testing.assert_allclose(np.linalg.norm(found.descriptors, axis=1), 1.0, atol=1e-5)
    inner = np.array(size) // 32 * 32 / np.array(size)
    pixels = (found.uv + 0.5) * inner - 0.5  # of the image that the network sees
    np.testing.assert_allclose(pixels, np.rint(pixels), atol=1e-3)
    distance = np.abs(pixels[:, None] - pixels[None]).max(axis=2) + 9.0 * np.eye(len(pixels))
    assert distance.min() > 2.0
