"""Depth of a frame: a map of KITTI's depth completion, or a Velodyne scan that is projected into the image."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.cloud import cloud_depth
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import transform
from tracknoise.sequences.images import read_depth_png16
from tracknoise.sequences.kitti.velodyne import SCAN_SUFFIX, read_scan

UNITS_PER_METRE = 256
"""What a depth-completion map holds for a depth of 1 m; it holds 0 where there is none."""

NEAREST_M = 0.5
"""Points with less depth are not part of the scene: the scanner measures from 0.9 m on."""


@dataclass(frozen=True, slots=True, eq=False)
class KittiDepth:
    """Reads depth files of either kind: a `tracknoise.sequences.frame_files.DepthReader`.

    Parameters
    ----------
    radius_px
        See `tracknoise.geometry.depth.DepthMap`.
    camera_from_velodyne
        (4, 4) float64; None where no frame needs its scan.
    """

    radius_px: float
    camera_from_velodyne: NDArray[np.float64] | None

    def __call__(self, path: Path, camera: CameraModel) -> DepthMap:
        """Sparse depth of one frame.

        Raises
        ------
        DataError
            If the file is missing or damaged, or of another size than the camera's.
        """
        if path.suffix != SCAN_SUFFIX:
            depth = read_depth_png16(path, camera, metres_per_unit=1.0 / UNITS_PER_METRE)
            return replace(depth, radius_px=self.radius_px)
        assert self.camera_from_velodyne is not None, "given wherever there is a scan"
        points = transform(self.camera_from_velodyne, read_scan(path))
        return cloud_depth(camera, points, nearest_m=NEAREST_M, radius_px=self.radius_px)


def z_depth_from(paths: tuple[Path | None, ...]) -> str | None:
    """What depths of a drive were computed from, along z; None where any is read from a map, or there are none."""
    present = [path for path in paths if path is not None]
    return "projected Velodyne scans" if present and all(path.suffix == SCAN_SUFFIX for path in present) else None


def source_note(paths: tuple[Path | None, ...]) -> str:
    """A sentence on what the depth of a drive comes from."""
    scans = sum(path is not None and path.suffix == SCAN_SUFFIX for path in paths)
    maps = len(paths) - scans - paths.count(None)
    return f"frames with depth from depth-completion maps: {maps}, from projected Velodyne scans: {scans}"
