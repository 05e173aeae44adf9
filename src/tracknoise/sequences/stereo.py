"""Depth from a second camera: semi-global matching on a rectified pair.

Only the copies that are matched are rectified. Images that trackers see stay as they are, and depth belongs to their
pixels.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, first_line
from tracknoise.geometry.accuracy import DepthAccuracy
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import PosePath
from tracknoise.geometry.projection import Rectification, origins, rectify, rectifying_maps
from tracknoise.sequences.second_camera import second_image
from tracknoise.sequences.sequence import SecondCamera, Sequence, TruthKind, path_of, second_of
from tracknoise.sequences.views import View

DISPARITY_SIGMA_PX = 0.25
"""Stated standard deviation of a disparity, px: see docs/data.md."""

_LEAST_DISPARITY_PX = 4.0
"""Smaller disparities give depths whose error exceeds 6 %."""

_LARGEST_SHARE = 0.2
"""Largest disparity that is searched, relative to the width of the image."""

_BLOCK_PX, _FRACTION, _STEP = 5, 16.0, 16


def with_stereo_depth(sequence: Sequence) -> "StereoDepth":
    """The sequence with depth from its second camera in place of recorded depth.

    Raises
    ------
    DataError
        If it has no second camera, or that is not beside the first.
    """
    second = second_of(sequence)
    if second is None:
        raise DataError(sequence.source, "no second camera", 'one, as truth.depth = "stereo" is set')
    try:
        return StereoDepth(sequence, second, rectify(sequence.camera, second.first_from_second))
    except ValueError as error:
        raise DataError(sequence.source, f"no stereo pair ({first_line(error)})", "two cameras side by side") from error


@dataclass(frozen=True, eq=False)
class StereoDepth(View):
    """A sequence with depth from its second camera. Made by `with_stereo_depth`."""

    beside: SecondCamera  # its second camera
    pair: Rectification  # the rectified pair

    @property
    def path(self) -> PosePath | None:
        """Poses over time: those of the sequence shown."""
        return path_of(self.sequence)

    @property
    def truths(self) -> tuple[str, ...]:
        """Birth first: it uses this depth."""
        return (TruthKind.birth, *(kind for kind in self.sequence.truths if kind != TruthKind.birth))

    @property
    def depth_accuracy(self) -> DepthAccuracy:
        """The error of a depth Z is that of a disparity times Z^2 / (focal length * baseline)."""
        return DepthAccuracy(0.0, 0.0, DISPARITY_SIGMA_PX / self._scale)

    @property
    def z_depth_from(self) -> str:
        """Depths are along z, whatever the sequence states: a disparity gives the distance from the baseline."""
        return "stereo matching of two cameras"

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the sequence, and where its depth comes from."""
        note = (
            f"depth is from semi-global matching with a second camera {self.pair.baseline_m:.4g} m away; "
            f"a disparity is taken to have a standard deviation of {DISPARITY_SIGMA_PX:g} px"
        )
        return (*self.sequence.notes, note)

    def depth(self, index: int) -> DepthMap | None:
        """Depth of the pixels for which a disparity was found; None where the second camera has no image."""
        second = second_image(self.beside, index, self.source)
        if second is None:
            return None
        columns, rows, inside, depth_per_z = self._back
        disparity = self._disparity(self.sequence.image(index), second)[rows, columns]
        valid = inside & (disparity >= _LEAST_DISPARITY_PX) & self._is_shown(columns - disparity, rows)
        depth_m = self._scale / np.where(valid, disparity, 1.0) * depth_per_z
        return DepthMap(np.where(valid, depth_m, 0.0), valid, accuracy=self.depth_accuracy)

    def _is_shown(self, columns: NDArray[np.float64], rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Whether the second image shows anything at positions of the rectified one: elsewhere nothing can match."""
        nearest = np.rint(columns).astype(np.intp)
        return (nearest >= 0) & self._shown[rows, np.clip(nearest, 0, self.pair.camera.width - 1)]

    @property
    def _scale(self) -> float:
        """Depth at disparity 1, metres px."""
        return self.pair.camera.fx * self.pair.baseline_m

    def _disparity(self, first: NDArray[np.uint8], second: NDArray[np.uint8]) -> NDArray[np.float64]:
        """(height, width) float64 of the rectified image, px; below 0 where none was found."""
        images, padding = (first, second), self._most_disparity
        rectified = [
            cv2.copyMakeBorder(cv2.remap(image, *maps, cv2.INTER_LINEAR), 0, 0, padding, 0, cv2.BORDER_CONSTANT)
            for image, maps in zip(images, self._maps, strict=True)
        ]
        disparity = _matcher(padding).compute(*rectified)[:, padding:]
        return np.asarray(disparity, np.float64) / _FRACTION

    @property
    def _most_disparity(self) -> int:
        return _STEP * int(np.ceil(_LARGEST_SHARE * self.pair.camera.width / _STEP))

    @cached_property
    def _maps(self) -> tuple[tuple[NDArray[np.float32], NDArray[np.float32]], ...]:
        return rectifying_maps(self.pair, self.sequence.camera, self.beside.camera)

    @cached_property
    def _shown(self) -> NDArray[np.bool_]:
        """(height, width) bool of the rectified image: the second image has this position."""
        camera = self.beside.camera
        return camera.contains(origins(self.pair.camera, camera, self.pair.second_from_rectified))

    @cached_property
    def _back(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_], NDArray[np.float64]]:
        """Of each pixel of the first image: the nearest rectified pixel, if there is one, and depth there to here."""
        camera, pair = self.sequence.camera, self.pair
        v, u = np.indices((camera.height, camera.width), dtype=np.float64)
        rays = camera.bearings(np.stack([u, v], axis=-1)) @ pair.first_from_rectified
        uv = pair.camera.project(rays)
        inside = pair.camera.contains(uv)
        columns, rows = np.moveaxis(np.rint(np.where(inside[..., None], uv, 0.0)).astype(np.intp), -1, 0)
        return columns, rows, inside, np.where(inside, 1.0 / np.where(inside, rays[..., 2], 1.0), 1.0)


def _matcher(disparities: int) -> cv2.StereoSGBM:
    area = _BLOCK_PX * _BLOCK_PX
    return cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=disparities,
        blockSize=_BLOCK_PX,
        P1=8 * area,
        P2=32 * area,
        disp12MaxDiff=1,
        uniquenessRatio=10,
        speckleWindowSize=100,
        speckleRange=2,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
