"""Surfaces of revolution: bottles, cups and cones."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.simulation.world import World

_SEGMENTS = 72


def revolved(
    profile_m: NDArray[np.float64],
    foot: NDArray[np.float64],
    *,
    texture: int,
    textures: tuple[NDArray[np.float32], ...],
    repeat_m: float,
) -> World:
    """Revolve a profile about the vertical through a point.

    Parameters
    ----------
    profile_m
        (n, 2) float64, radius and height above the foot, metres, from the top down; radius 0 closes the surface.
    foot
        (3,) float64, metres, world frame.
    texture
        Index of its texture, which is upright.
    textures
        As in `tracknoise.simulation.world.World`.
    repeat_m
        Size of one repeat of the texture, metres. Around the surface it is adjusted, so that a whole number of repeats
        fits around the widest place.
    """
    turn = np.linspace(0.0, 1.0, _SEGMENTS + 1)
    radius, height = profile_m.T[:, :, None]
    angle = 2.0 * np.pi * turn
    vertices = np.stack(np.broadcast_arrays(radius * np.cos(angle), radius * np.sin(angle), height), axis=-1)
    repeats = max(round(2.0 * np.pi * radius.max() / repeat_m), 1)
    down = np.cumsum(np.linalg.norm(np.diff(profile_m, axis=0, prepend=profile_m[:1]), axis=1)) / repeat_m
    uv = np.stack(np.meshgrid(repeats * turn, down), axis=-1)
    faces = _faces(len(profile_m), _SEGMENTS + 1)
    corners = vertices.reshape(-1, 3)[faces]
    faces = faces[np.linalg.norm(np.cross(*np.moveaxis(np.diff(corners, axis=1), 1, 0)), axis=1) > 0.0]
    return World(
        vertices=vertices.reshape(-1, 3) + foot,
        faces=faces,
        corner_uv=uv.reshape(-1, 2)[faces],
        texture=np.full(len(faces), texture),
        textures=textures,
        blocks_light=np.ones(len(faces), np.bool_),
    )


def _faces(rows: int, columns: int) -> NDArray[np.int64]:
    """Two triangles for each cell of a grid of vertices, counter-clockwise seen from outside."""
    start = np.add.outer(np.arange(rows - 1) * columns, np.arange(columns - 1)).ravel()
    upper_left, lower_left = start, start + columns  # left is the lower angle
    halves = [
        np.stack([upper_left, lower_left, lower_left + 1], axis=-1),
        np.stack([upper_left, lower_left + 1, upper_left + 1], axis=-1),
    ]
    return np.stack(halves, axis=1).reshape(-1, 3)
