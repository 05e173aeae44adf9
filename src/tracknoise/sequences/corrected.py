"""A recording whose stated camera, poses, depths or clock are corrected."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import Camera, CameraModel, Intrinsics
from tracknoise.geometry.corrections import Corrections
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import PosePath, from_rotation, invert, transform
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.row_poses import RowPoses
from tracknoise.sequences.sequence import Sequence, camera_at, path_of, shutter_of, times_of, z_depth_from
from tracknoise.sequences.views import View


def corrected(sequence: Sequence, corrections: Corrections) -> Sequence:
    """The sequence with corrections applied; itself where they change nothing.

    Raises
    ------
    DataError
        If the camera's model has no such parameter, the corrected lens cannot be inverted, a clock offset, its drift or
        a readout needs timestamps that the sequence lacks, or a clock offset in frames is given although it has them.
    """
    if corrections.are_neutral:
        return sequence
    _require_clock(sequence, corrections)
    for camera in {camera_at(sequence, index) for index in range(len(sequence))}:
        _require_invertible(camera, corrected_camera(camera, corrections, sequence.source), sequence.source)
    return CorrectedSequence(sequence, corrections)


def corrected_camera(camera: CameraModel, corrections: Corrections, source: str) -> CameraModel:
    """A camera with corrected focal lengths, principal point and distortion."""
    scale, (du, dv) = corrections.focal_scale, corrections.principal_point_px
    if scale == 1.0 and du == dv == corrections.k1 == 0.0:
        return camera
    if not isinstance(camera, Intrinsics):
        found = f"corrections of the focal length for a camera of the model {type(camera).__name__}"
        raise DataError(source, found, "a camera with focal lengths and a principal point")
    moved = replace(camera, fx=scale * camera.fx, fy=scale * camera.fy, cx=camera.cx + du, cy=camera.cy + dv)
    return _with_k1(moved, corrections.k1, source) if corrections.k1 else moved


@dataclass(frozen=True, eq=False)
class CorrectedSequence(View):
    """A sequence with corrections. Made by `corrected`.

    A depth map belongs to pixels: the depth under a pixel stays there, but for its factor, offsets and kind. Where an
    exact surface is known, its depth under each pixel is treated likewise.
    """

    corrections: Corrections  # what to change

    @property
    def camera(self) -> CameraModel:
        """The corrected camera."""
        return corrected_camera(self.sequence.camera, self.corrections, self.source)

    def camera_at(self, index: int) -> CameraModel:
        """The corrected camera of one frame."""
        return corrected_camera(camera_at(self.sequence, index), self.corrections, self.source)

    @cached_property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(n, 4, 4) float64: corrected poses; NaN for frames whose corrected time lies outside of the recorded ones."""
        offset = self.corrections.clock_offset_s or self.corrections.clock_offset_frames
        drift, times = self.corrections.clock_drift, self._times()
        recorded = self.sequence.world_from_camera
        if offset or drift:
            path = self._recorded_path()
            recorded = _inside(path, times + offset + drift * (times - _middle(path)))
        return recorded @ self._mounting

    @property
    def path(self) -> PosePath | None:
        """Corrected poses over time; None without timestamps."""
        recorded = path_of(self.sequence)
        if recorded is None:
            return None
        drift, times = self.corrections.clock_drift, recorded.times - self.corrections.clock_offset_s
        times = times - drift / (1.0 + drift) * (times - _middle(recorded))
        return PosePath(times, recorded.poses @ self._mounting)

    @property
    def shutter(self) -> RollingShutter | None:
        """The shutter with its corrected readout; None where all rows are exposed together."""
        stated = shutter_of(self.sequence)
        if stated is None:
            return RollingShutter(self.corrections.readout_s) if self.corrections.readout_s else None
        return replace(stated, readout_s=stated.readout_s + self.corrections.readout_s)

    @property
    def z_depth_from(self) -> str | None:
        """That of the sequence; None where its depths are taken as distances along the ray."""
        return None if self.corrections.depth_along_ray else z_depth_from(self.sequence)

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the sequence, and a sentence for each correction."""
        return (*self.sequence.notes, *self.corrections.sentences)

    def depth(self, index: int) -> DepthMap | None:
        """Corrected depth of one frame: see `Sequence.depth`."""
        depth = self.sequence.depth(index)
        if depth is None or not self.corrections.change_depths:
            return depth
        depth_m = self.corrections.depths_m(depth.depth_m.astype(np.float64))
        if self.corrections.depth_along_ray:
            depth_m = depth_m * _cosines_of_image(self.camera_at(index))
        return replace(depth, depth_m=depth_m, valid=depth.valid & (depth_m > 0.0))

    def cast(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Surface points under pixels: at their corrected depths, on the rays of the corrected camera."""
        points_world, hit = View.cast(self, index, uv)
        depth_m = self.corrections.depths_m(transform(invert(self._recorded_poses.at(index, uv)), points_world)[:, 2])
        if self.corrections.depth_along_ray:
            depth_m = depth_m * _cosines(self.camera_at(index), uv)
        usable = hit & (depth_m > 0.0)
        points = self.camera_at(index).unproject(uv, np.where(usable, depth_m, 1.0))
        return transform(self._poses.at(index, uv), points), usable

    @cached_property
    def _mounting(self) -> NDArray[np.float64]:
        """(4, 4) float64: pose of the camera in the frame that the recorded poses belong to."""
        turn = Rotation.from_rotvec(self.corrections.mounting_rotation_deg, degrees=True)
        return from_rotation(turn.as_matrix(), self.corrections.mounting_translation_m)

    @cached_property
    def _recorded_poses(self) -> RowPoses:
        return RowPoses(self.sequence)

    @cached_property
    def _poses(self) -> RowPoses:
        return RowPoses(self)

    def _times(self) -> NDArray[np.float64]:
        """(n,) float64: time of each frame; its number where there are no timestamps."""
        times = times_of(self.sequence)
        return np.arange(len(self), dtype=np.float64) if times is None else times

    def _recorded_path(self) -> PosePath:
        return path_of(self.sequence) or PosePath(self._times(), self.sequence.world_from_camera)


def _cosines(camera: CameraModel, uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) float64: of the angles between the rays of pixels (n, 2) and the optical axis; NaN where there is no ray."""
    return np.asarray(1.0 / np.linalg.norm(camera.bearings(uv), axis=1))


@lru_cache(maxsize=4)
def _cosines_of_image(camera: CameraModel) -> NDArray[np.float64]:
    """(height, width) float64: `_cosines` of all pixels. It is kept, because the rays of a distorted lens are slow."""
    v, u = np.indices((camera.height, camera.width), dtype=np.float64)
    return _cosines(camera, np.stack([u.ravel(), v.ravel()], axis=-1)).reshape(u.shape)


def _with_k1(camera: Intrinsics, k1: float, source: str) -> Camera:
    if not isinstance(camera, Camera):
        raise DataError(source, f"k1 for a camera of the model {type(camera).__name__}", "radial-tangential distortion")
    first, *rest = camera.distortion or (0.0, 0.0, 0.0, 0.0)
    return replace(camera, distortion=(first + k1, *rest))


def _middle(path: PosePath) -> float:
    """Middle between the times of the first and the last known pose."""
    posed_times = path.times[has_pose(path.poses)]
    return 0.5 * float(posed_times[0] + posed_times[-1]) if len(posed_times) else 0.0


def _inside(path: PosePath, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 4, 4) float64: poses at times; NaN before the first known pose and after the last."""
    posed_times = path.times[has_pose(path.poses)]
    poses = path.at(times)
    poses[(times < posed_times.min(initial=np.inf)) | (times > posed_times.max(initial=-np.inf))] = np.nan
    return poses


def _require_invertible(stated: CameraModel, changed: CameraModel, source: str) -> None:
    if stated.is_invertible and not changed.is_invertible:
        raise DataError(source, "corrections that leave pixels without a ray", "a lens that can be inverted")


def _require_clock(sequence: Sequence, corrections: Corrections) -> None:
    timed = times_of(sequence) is not None
    if corrections.clock_offset_frames and timed:
        raise DataError(sequence.source, "clock_offset_frames and timestamps", "clock_offset_s")
    if (corrections.clock_offset_s or corrections.clock_offset_frames or corrections.clock_drift) and len(sequence) < 2:
        raise DataError(sequence.source, "a clock offset for a single frame", "at least 2 frames")
    for name in ("clock_offset_s", "clock_drift", "readout_s"):
        if getattr(corrections, name) and not timed:
            expected = "clock_offset_frames" if name == "clock_offset_s" else "timestamps"
            raise DataError(sequence.source, f"{name} and no timestamps", expected)
