"""Recordings whose intrinsics change from image to image, as COLMAP and nerfstudio may state them."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.truth_faults.check_recording import check_sequence
from tracknoise.truth_faults.check_report import Severity
from tracknoise.truth_faults.image_evidence import Evidence
from tracknoise.truth_faults.motion_checks import warping

N_FRAMES = 12


@pytest.fixture(scope="module")
def zoomed():
    """A simulated recording whose lens zooms by up to 10 % and back; poses, depths and each camera are right."""
    simulated = open_sequence("simulated", motions=["arvr"], frames=N_FRAMES, width=320, height=240, supersampling=1)
    camera = simulated.camera
    v, u = np.indices((camera.height, camera.width), dtype=np.float32)
    images, depths, cameras = [], [], []
    for index, zoom in enumerate(1.0 + 0.1 * np.sin(np.arange(N_FRAMES) / 3.0)):
        x, y = ((at - centre) / zoom + centre for at, centre in ((u, camera.cx), (v, camera.cy)))
        at = x.astype(np.float32), y.astype(np.float32)
        depth = simulated.depth(index)
        moved = cv2.remap(np.where(depth.valid, depth.depth_m, 0).astype(np.float32), *at, cv2.INTER_NEAREST)
        images.append(cv2.remap(simulated.image(index), *at, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT))
        depths.append(DepthMap(moved, moved > 0))
        cameras.append(replace(camera, fx=zoom * camera.fx, fy=zoom * camera.fy))
    return RecordedSequence(
        id=simulated.id,
        source="zoom",
        camera=cameras[0],
        world_from_camera=simulated.world_from_camera,
        images=images.__getitem__,
        depths=depths.__getitem__,
        cameras=tuple(cameras),
    )


def test_the_camera_of_each_image_is_used(zoomed):
    found = {item.topic: item.severity for item in check_sequence(zoomed).items}
    assert found["warping"] is Severity.ok
    found.pop("truth")  # what the verdict says of all topics together: errors of depths
    assert not {Severity.caveat, Severity.fatal} & {*found.values()}


def test_one_camera_for_all_images_is_noticed(zoomed):
    assert warping(Evidence.measured(replace(zoomed, cameras=None))).severity is Severity.fatal
