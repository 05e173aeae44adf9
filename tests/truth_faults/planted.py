"""Mistakes planted in sequences, by code that shares nothing with what looks for them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.sequence import Sequence, camera_at
from tracknoise.sequences.views import View
from tracknoise.truth_faults.image_evidence import Flow

CV_FROM_NED = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]], dtype=float)
CV_FROM_BODY = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]], dtype=float)
CV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True, slots=True, eq=False)
class Planted(View):
    """A sequence with changed poses, camera or depths."""

    poses: Callable = lambda poses: poses
    intrinsics: Callable = lambda camera: camera
    depths: Callable = lambda depth_m, camera: depth_m

    @property
    def world_from_camera(self):
        return self.poses(self.sequence.world_from_camera)

    @property
    def camera(self):
        return self.intrinsics(self.sequence.camera)

    def camera_at(self, index):
        return self.intrinsics(camera_at(self.sequence, index))

    def depth(self, index):
        depth = self.sequence.depth(index)
        if depth is None:
            return None
        return DepthMap(self.depths(depth.depth_m.astype(float), self.sequence.camera), depth.valid, depth.radius_px)


def turned(matrix):
    def poses(world_from_camera):
        changed = world_from_camera.copy()
        changed[:, :3, :3] = world_from_camera[:, :3, :3] @ matrix
        return changed

    return poses


def quaternions(order):
    """The numbers x y z w are written in one order and read in another."""

    def poses(world_from_camera):
        changed = world_from_camera.copy()
        read = Rotation.from_matrix(world_from_camera[:, :3, :3]).as_quat()[:, order]
        changed[:, :3, :3] = Rotation.from_quat(read).as_matrix()
        return changed

    return poses


def scaled_positions(factor):
    def poses(world_from_camera):
        changed = world_from_camera.copy()
        changed[:, :3, 3] *= factor
        return changed

    return poses


def shifted(frames):
    """Poses of a moment that is later by some frames; the ends are held."""

    def poses(world_from_camera):
        n = len(world_from_camera)
        at = np.clip(np.arange(n) + frames, 0, n - 1)
        changed = world_from_camera.copy()
        changed[:, :3, :3] = Slerp(np.arange(n), Rotation.from_matrix(world_from_camera[:, :3, :3]))(at).as_matrix()
        for axis in range(3):
            changed[:, axis, 3] = np.interp(at, np.arange(n), world_from_camera[:, axis, 3])
        return changed

    return poses


def resized(factor):
    def intrinsics(camera: Camera):
        return replace(
            camera, fx=camera.fx * factor, fy=camera.fy * factor, cx=camera.cx * factor, cy=camera.cy * factor
        )

    return intrinsics


def without_depth(flow: Flow):
    steps, wide = (
        tuple(replace(pair, depth_first_m=np.full(len(pair.uv_first), np.nan)) for pair in pairs)
        for pairs in (flow.steps, flow.wide)
    )
    return Flow(steps, wide)


def along_ray(depth_m, camera: Camera):
    v, u = np.indices(depth_m.shape)
    return depth_m * np.sqrt(1 + ((u - camera.cx) / camera.fx) ** 2 + ((v - camera.cy) / camera.fy) ** 2)


MISTAKES: dict[str, tuple[Callable[[Sequence], Sequence], str, str]] = {
    "inverted": (lambda s: Planted(s, poses=np.linalg.inv), "inverted", "inverted"),
    "ned": (lambda s: Planted(s, poses=turned(CV_FROM_NED)), "axes", "have NED"),
    "opengl": (lambda s: Planted(s, poses=turned(CV_FROM_OPENGL)), "axes", "OpenGL"),
    "body": (lambda s: Planted(s, poses=turned(CV_FROM_BODY)), "axes", "have body axes"),
    "wxyz read as xyzw": (lambda s: Planted(s, poses=quaternions([3, 0, 1, 2])), "quaternion_order", "w x y z were"),
    "xyzw read as wxyz": (lambda s: Planted(s, poses=quaternions([1, 2, 3, 0])), "quaternion_order", "x y z w were"),
    "poses in mm": (lambda s: Planted(s, poses=scaled_positions(1000)), "scale", "positions are probably in millim"),
    "depth in mm": (lambda s: Planted(s, depths=lambda d, _: 1000 * d), "scale", "depths are probably in millimetres"),
    "depth / 1000 for 5000": (lambda s: Planted(s, depths=lambda d, _: 5 * d), "scale", "5 times too large"),
    "ray depth": (lambda s: Planted(s, depths=along_ray), "ray_depth", "along the ray"),
    "half the size": (lambda s: Planted(s, intrinsics=resized(0.5)), "intrinsics", "half the size"),
    "twice the size": (lambda s: Planted(s, intrinsics=resized(2.0)), "intrinsics", "twice the size"),
    "one frame late": (lambda s: Planted(s, poses=shifted(1)), "shift", "1 frame"),
    "one frame early": (lambda s: Planted(s, poses=shifted(-1)), "shift", "1 frame"),
    "two frames late": (lambda s: Planted(s, poses=shifted(2)), "shift", "2 frames"),
}
"""By name: what plants it, its kind, and words that name it."""
