"""Positions of imported tracks on the normalised image plane: x/z and y/z of the ray, without distortion."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.jacobians import projection_jacobian
from tracknoise.printable import significant
from tracknoise.trackers.imports.pixels import inside
from tracknoise.trackers.imports.rows import Rows
from tracknoise.trackers.quality import covariances
from tracknoise.trackers.tracker import SequenceContext

_INSIDE_IF_PIXELS, _INSIDE_IF_SWAPPED, _INSIDE_AS_STATED = 0.9, 0.99, 0.9


@dataclass(frozen=True, slots=True)
class Normalised:
    """Coordinates x/z and y/z in the frame of the camera: x to the right, y down, (0, 0) on the optical axis.

    Positions become pixels by the camera of the sequence with its distortion: that of their frame, where it changes.
    """

    def check(self, rows: Rows, context: SequenceContext) -> None:
        """Refuse positions that are pixels, whose columns are swapped, or of which none is in the image.

        Raises
        ------
        DataError
            Naming the mistake and what to do.
        SettingsError
            If the camera is unknown.
        """
        camera, size = _camera_at(context, 0), context.size
        stated = inside(_projected(camera, rows.uv), size).mean()
        if stated >= _INSIDE_AS_STATED:
            return
        low, high = significant(rows.uv.min(), 3), significant(rows.uv.max(), 3)
        found = f"positions from {low} to {high}, of which {stated:.0%} are inside images of {size[0]} x {size[1]} px"
        if inside(rows.uv, size).mean() > max(_INSIDE_IF_PIXELS, stated):
            expected = "x/z and y/z, and these look like pixels: leave out units, or divide by the intrinsics"
            raise DataError(rows.path, found, expected)
        if inside(_projected(camera, rows.uv[:, ::-1]), size).mean() > _INSIDE_IF_SWAPPED:
            raise DataError(rows.path, found, "x/z to the right and y/z down: the columns are swapped")
        if stated == 0:
            raise DataError(rows.path, found, "x/z and y/z of the camera of this sequence, without its distortion")

    def to_pixels(
        self, uv: NDArray[np.float64], frame: NDArray[np.int64], context: SequenceContext
    ) -> NDArray[np.float64]:
        """Positions (n, 2), px; an integer is the centre of a pixel. NaN where the camera has no image of a ray."""
        pixels = np.full(uv.shape, np.nan)
        for camera, rows in _by_camera(frame, context):
            pixels[rows] = _projected(camera, uv[rows])
        return pixels

    def covariances_to_pixels(
        self,
        quality: Mapping[str, NDArray[np.float32]],
        uv: NDArray[np.float64],
        frame: NDArray[np.int64],
        context: SequenceContext,
    ) -> dict[str, NDArray[np.float32]]:
        """Quality with the covariances among it in px^2, to first order. All other quality stays as it is."""
        found = dict(quality)
        names = list(covariances(quality))
        if not names:
            return found
        jacobian = np.full((len(uv), 2, 2), np.nan)
        for camera, rows in _by_camera(frame, context):
            jacobian[rows] = projection_jacobian(camera, _rays(uv[rows]))[..., :2]
        for uu, uv_name, vv in names:
            stated = np.stack([quality[name] for name in (uu, uv_name, uv_name, vv)], axis=-1).reshape(-1, 2, 2)
            in_px = jacobian @ stated.astype(np.float64) @ np.swapaxes(jacobian, 1, 2)
            entries = {uu: in_px[:, 0, 0], uv_name: in_px[:, 0, 1], vv: in_px[:, 1, 1]}
            found |= {name: values.astype(np.float32) for name, values in entries.items()}
        return found


def _rays(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) float64: points of the camera frame at depth 1."""
    return np.column_stack([xy, np.ones(len(xy))])


def _projected(camera: CameraModel, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    return camera.project(_rays(xy))


def _camera_at(context: SequenceContext, index: int) -> CameraModel:
    if context.camera_at is None:
        raise SettingsError("imported: units = normalised, but the camera is unknown, expected units = pixels")
    return context.camera_at(index)


def _by_camera(frame: NDArray[np.int64], context: SequenceContext) -> Iterator[tuple[CameraModel, NDArray[np.bool_]]]:
    """Each camera, and which rows are of its frames."""
    frames, place = np.unique(frame, return_inverse=True)
    cameras = [_camera_at(context, index) for index in frames.tolist()]
    for camera in dict.fromkeys(cameras):
        yield camera, np.array([other == camera for other in cameras], dtype=np.bool_)[place]
