"""Scenes whose true positions have a closed form: planes, seen by a pinhole camera that moves and turns.

All formulas of projection are written out here. The self-test compares them with `tracknoise.geometry` and
`tracknoise.truth`, and uses neither.

A pixel (u, v) has its centre at whole numbers. In the frame of the camera its ray is r = ((u - cx) / fx,
(v - cy) / fy, 1). With the rotation R and the position t of the camera, it meets the plane a + alpha b + beta c at the
depth Z and the coordinates alpha, beta that solve

    Z R r - alpha b - beta c = a - t (ray)

so that Z = (a - t).n / (R r).n with the normal n = b x c. A panel is the part of a plane with 0 <= alpha, beta <= 1.
The panel with the least depth Z > 0 is seen. The image of the world point X is u = fx x / z + cx, v = fy y / z + cy
with (x, y, z) = R' (X - t) (image).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NOTHING = -1
"""In place of the number of a panel: the ray meets none."""


@dataclass(frozen=True, slots=True)
class Pinhole:
    """Focal lengths and principal point, px, and the size of the image."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def rays(self, uv: Array) -> Array:
        """Rays of pixels (..., 2), scaled to depth 1, (..., 3)."""
        x, y = (uv[..., 0] - self.cx) / self.fx, (uv[..., 1] - self.cy) / self.fy
        return np.stack([x, y, np.ones_like(x)], axis=-1)

    def image(self, points: Array) -> Array:
        """Pixels (..., 2) of points of the camera's frame (..., 3) in front of it."""
        x, y, z = np.moveaxis(points, -1, 0)
        return np.stack([self.fx * x / z + self.cx, self.fy * y / z + self.cy], axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Panels and a camera path.

    Attributes
    ----------
    camera
        Its intrinsics.
    panels : (panels, 3, 3)
        a, b and c of each panel, metres, world frame.
    quaternions : (frames, 4)
        Unit quaternions (x, y, z, w) that turn directions from the frame of the camera to the world.
    positions : (frames, 3)
        Of the camera, metres, world frame.
    """

    camera: Pinhole
    panels: Array
    quaternions: Array
    positions: Array

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.positions)

    @property
    def rotations(self) -> Array:
        """(frames, 3, 3) R of each frame."""
        return rotation_of(self.quaternions)

    def look(self, frame: NDArray[np.int64], uv: Array) -> tuple[Array, NDArray[np.int64]]:
        """Depth Z along the optical axis under pixels, and the panel that is seen, by (ray).

        Parameters
        ----------
        frame : (...)
            Of each pixel.
        uv : (..., 2)
            px.
        """
        rays = np.einsum("...ij,...j->...i", self.rotations[frame], self.camera.rays(uv))
        depth = np.stack([_met(each, self.positions[frame], rays) for each in self.panels])
        nearest = depth.min(axis=0)
        return nearest, np.where(np.isfinite(nearest), depth.argmin(axis=0), NOTHING)

    def world(self, frame: NDArray[np.int64], uv: Array, depth: Array) -> Array:
        """World points (..., 3) at depths under pixels."""
        points = depth[..., None] * self.camera.rays(uv)
        turned: Array = np.einsum("...ij,...j->...i", self.rotations[frame], points)
        return turned + self.positions[frame]

    def images(self, points: Array) -> tuple[Array, Array]:
        """Pixels (n, frames, 2) and depths (n, frames) of world points (n, 3) in all frames, by (image)."""
        apart = points[:, None, :] - self.positions
        seen = np.einsum("fji,nfj->nfi", self.rotations, apart)
        return self.camera.image(seen), seen[..., 2]


def _met(panel: Array, position: Array, rays: Array) -> Array:
    """Z of (ray) for rays (..., 3) in the world frame that start at positions (..., 3); infinite where they miss."""
    a, b, c = panel
    normal = np.cross(b, c)
    with np.errstate(divide="ignore"):
        z: Array = (a - position) @ normal / (rays @ normal)
    point = position + np.where(np.isfinite(z), z, 0.0)[..., None] * rays - a
    alpha, beta = (
        point @ side / (along @ side) for along, side in ((b, np.cross(c, normal)), (c, np.cross(b, normal)))
    )
    met = (z > 0) & (np.minimum(alpha, beta) >= 0) & (np.maximum(alpha, beta) <= 1)
    depth: Array = np.where(met, z, np.inf)
    return depth


def rotation_of(quaternions: Array) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4) (x, y, z, w)."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def about(axis: tuple[float, float, float], angle: Array) -> Array:
    """Unit quaternions (n, 4) of rotations by angles (n,), radians, about an axis."""
    unit = np.array(axis) / np.linalg.norm(axis)
    return np.concatenate([np.sin(angle / 2)[:, None] * unit, np.cos(angle / 2)[:, None]], axis=1)


def product(p: Array, q: Array) -> Array:
    """Products (n, 4) of quaternions: the rotation q, and then p."""
    (a, r), (b, s) = ((each[..., :3], each[..., 3:]) for each in (p, q))
    vector = r * b + s * a + np.cross(a, b)
    return np.concatenate([vector, r * s - (a * b).sum(axis=-1, keepdims=True)], axis=-1)


def panel(corner: tuple[float, ...], right: tuple[float, ...], down: tuple[float, ...]) -> Array:
    """a, b and c of a panel, (3, 3), from a corner and two sides."""
    return np.array([corner, right, down])


def occluded_scene(number: int, *, n_frames: int) -> Scene:
    """A slanted wall behind a slanted board; the camera moves to the side, forward, and turns.

    Neither the world axes nor the first camera are special: a rotation that is transposed, or a pose that is inverted,
    changes all positions.
    """
    step = np.arange(n_frames, dtype=np.float64)
    wall, board = _panels(number)
    turned = rotation_of(about((1.0, 2.0, -0.5), np.array([0.7 + 0.3 * number])))[0]
    start = np.array([0.8, -1.1, 0.4])
    moved = np.column_stack([0.06 * step, 0.008 * np.sin(0.4 * step), 0.02 * step])
    own = product(about((0.0, 1.0, 0.1), 0.004 * step), about((0.0, 0.0, 1.0), 0.003 * step))
    base = np.broadcast_to(about((1.0, 2.0, -0.5), np.array([0.7 + 0.3 * number])), own.shape)
    panels = np.stack([np.vstack([each[0] @ turned.T + start, each[1:] @ turned.T]) for each in (wall, board)])
    return Scene(
        camera=Pinhole(120, 90, fx=104.0, fy=97.0, cx=57.3, cy=46.2),
        panels=panels,
        quaternions=product(base, own),
        positions=moved @ turned.T + start,
    )


def plain_scene(number: int, *, n_frames: int) -> Scene:
    """One slanted wall; the camera moves so little that no feature leaves the image."""
    step = np.arange(n_frames, dtype=np.float64)
    wall = panel((-40.0, -40.0, 5.0 + 0.1 * number), (80.0, 0.0, 4.0), (0.0, 80.0, -3.0))
    return Scene(
        camera=Pinhole(48, 36, fx=40.0, fy=42.0, cx=22.7, cy=18.4),
        panels=wall[None],
        quaternions=about((0.2, 1.0, 0.0), 0.0004 * step),
        positions=np.column_stack([0.004 * step, -0.003 * step, 0.005 * step]),
    )


def _panels(number: int) -> tuple[Array, Array]:
    """A wall and a board, in the frame of the first camera."""
    slope = 12.0 + 4.0 * number
    wall = panel((-60.0, -60.0, -5.0 - slope / 2), (120.0, 0.0, 20.0), (0.0, 120.0, slope))
    board = panel((-0.15, -0.6, 2.3), (0.55, 0.05, 0.15), (-0.05, 0.9 + 0.1 * number, 0.1))
    return wall, board
