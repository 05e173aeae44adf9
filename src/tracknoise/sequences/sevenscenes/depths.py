"""Depth maps of the Kinect as the colour camera sees them."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera import Camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.depth_warp import reproject_depth
from tracknoise.sequences.frame_files import DepthFiles, depth_files
from tracknoise.sequences.images import read_depth_png16
from tracknoise.sequences.sevenscenes.calibration import Cameras

_read_depth = partial(read_depth_png16, metres_per_unit=0.001)


@dataclass(frozen=True, slots=True, eq=False)
class RegisteredDepths:
    """Reads the depth map of a frame, and moves it into the image of the colour camera.

    Parameters
    ----------
    files
        Depth maps of the depth camera.
    depth, colour
        Both cameras.
    colour_from_depth
        (4, 4) float64, metres.
    """

    files: DepthFiles
    depth: Camera
    colour: Camera
    colour_from_depth: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.files)

    def __call__(self, index: int) -> DepthMap | None:
        """Depth of one frame, or None where it has none: see `reproject_depth`.

        Raises
        ------
        DataError
            If the file is missing, damaged or of another size than the depth camera's.
        """
        depth = self.files(index)
        return None if depth is None else reproject_depth(depth, self.depth, self.colour, self.colour_from_depth)


def find_depths(paths: tuple[Path | None, ...], cameras: Cameras) -> DepthFiles | RegisteredDepths | None:
    """What reads the depths of a recording, as its images see them; None where no frame has any."""
    files = depth_files(paths, cameras.depth, _read_depth)
    if files is None or cameras.colour_from_depth is None:
        return files
    return RegisteredDepths(files, cameras.depth, cameras.colour, cameras.colour_from_depth)
