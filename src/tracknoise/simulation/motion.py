"""Camera paths through procedural worlds, one pose per frame.

World frame: x east, y north, z up, metres. All paths except those of the quadrotor and of AR/VR have no roll. They
stay in the free space that `tracknoise.simulation.built_worlds` leaves; its `PLACES` states which motion suits which
world. Image motion is typically 1 to 5 px per frame at 640x480 and 60 degrees.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from tracknoise.geometry.pose import from_rotation

EYE_HEIGHT_M = 1.6
ORBIT_M = 6.0
"""Distance of the fixating camera from its target, which is above the origin."""
LANE_X_M, LANE_SOUTH_M, LANE_NORTH_M = 10.0, -14.0, 160.0
"""Lane of the forward camera."""
TRACK_HALF_M = 3.5
"""The sideways camera keeps within this distance of the plane x = 0."""

LINEAR_HALF_M = 12.0
"""The quadrotor keeps within this distance of the plane x = 0."""

_SIDEWAYS_STEP_M = 0.03
_LINEAR_STEP_M = 0.04
_HOVER_HEIGHT_M = 2.5
_HOVER_SWAY_M, _HOVER_SWAY_DEG = 0.05, 0.8
_HOVER_PERIODS = np.array([67.0, 109.0, 181.0])  # frames; no simple ratios, so that the motion does not repeat
_ORBIT_STEP_DEG = 0.4
_FORWARD_STEP_M = 0.1
_HOME = np.array([0.0, -ORBIT_M, EYE_HEIGHT_M])
_FRAMES_A_LEG = 70

Motion = Callable[[int, np.random.Generator], NDArray[np.float64]]
"""Takes a number of frames and a random generator; returns (n, 4, 4) float64, world_from_camera."""


def sideways(frames: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Translate to the right at constant speed, looking north; turn back at the end of the track.

    `frames`: number of frames; `rng`: random generator of the small differences in position and speed. Returns (n, 4,
    4) float64: world_from_camera.
    """
    step = _SIDEWAYS_STEP_M * rng.uniform(0.9, 1.1)
    x = _back_and_forth(step, frames, 2.0 * TRACK_HALF_M) - TRACK_HALF_M
    shift = rng.uniform(-0.3, 0.3, 2)
    centres = np.stack([x, np.full(frames, _HOME[1] + shift[0]), np.full(frames, EYE_HEIGHT_M + shift[1])], axis=-1)
    return looking(centres, np.broadcast_to([0.0, 1.0, 0.0], centres.shape))


def sideways_left(frames: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """As `sideways`, but to the left: the mirror image of the path about the plane x = 0."""
    poses = sideways(frames, rng)
    poses[:, 0, 3] *= -1.0
    return poses


def linear(frames: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Fly a quadrotor to the right at constant speed past large objects, looking north; turn back at the end.

    Like a hovering quadrotor, it sways: across its path by up to 5 cm, and about each axis by up to 0.8 degrees. The
    sway is the sum of three slow oscillations.
    """
    return _flight(frames, rng, swaying=1.0)


def linear_straight(frames: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """The same flight as `linear` without sway: pure translation."""
    return _flight(frames, rng, swaying=0.0)


def _flight(frames: int, rng: np.random.Generator, *, swaying: float) -> NDArray[np.float64]:
    """The flight of `linear` with this share of its sway."""
    step = _LINEAR_STEP_M * rng.uniform(0.9, 1.1)
    x = _back_and_forth(step, frames, 2.0 * LINEAR_HALF_M) - LINEAR_HALF_M
    sway = swaying * _sway(frames, rng)
    across = (_HOME[1], _HOVER_HEIGHT_M) + rng.uniform(-0.3, 0.3, 2) + _HOVER_SWAY_M * sway[:, :2]
    poses = looking(np.column_stack([x, across]), np.broadcast_to([0.0, 1.0, 0.0], (frames, 3)))
    poses[:, :3, :3] @= Rotation.from_rotvec(_HOVER_SWAY_DEG * sway[:, 2:], degrees=True).as_matrix()
    return poses


def fixating(frames: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Circle a target above the origin counter-clockwise at constant speed, always looking at it."""
    start, radius = rng.uniform(-0.5, 0.5), ORBIT_M * rng.uniform(0.95, 1.05)
    angle = start - np.pi / 2 + np.deg2rad(_ORBIT_STEP_DEG) * np.arange(frames)
    centres = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(frames, EYE_HEIGHT_M)], axis=-1)
    return looking(centres, np.array([0.0, 0.0, 1.0]) - centres)


def forward(frames: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Drive north along the street at constant speed, looking ahead; reverse at its end."""
    step = _FORWARD_STEP_M * rng.uniform(0.9, 1.1)
    y = LANE_SOUTH_M + _back_and_forth(step, frames, LANE_NORTH_M - LANE_SOUTH_M)
    x = LANE_X_M + rng.uniform(-0.5, 0.5)
    centres = np.stack([np.full(frames, x), y, np.full(frames, EYE_HEIGHT_M)], axis=-1)
    return looking(centres, np.broadcast_to([0.0, 1.0, 0.0], centres.shape))


def arvr(frames: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Look around a scene from nearly one place, as a headset does, and stop at each of many waypoints.

    Between waypoints the position is eased by the haversine function, hav(a) = sin^2(a / 2), and the rotation follows
    by spherical linear interpolation at the same pace.
    """
    legs = max(-(-(frames - 1) // _FRAMES_A_LEG), 1)
    chance = rng.uniform(-1.0, 1.0, (legs + 1, 6))
    centres = _HOME + chance[:, :3] * (0.8, 0.5, 0.3)
    rotations = Rotation.from_matrix(looking(centres, _glances(chance[:, 3:5]))[:, :3, :3])
    rotations *= Rotation.from_rotvec(chance[:, 5:] * (0.0, 0.0, 6.0), degrees=True)
    leg, way = np.divmod(np.arange(frames) / _FRAMES_A_LEG, 1.0)
    pace = leg + np.sin(np.pi * way / 2.0) ** 2
    leg = np.minimum(pace.astype(np.intp), legs - 1)
    positions = centres[leg] + (pace - leg)[:, None] * (centres[leg + 1] - centres[leg])
    return from_rotation(Slerp(np.arange(legs + 1), rotations)(pace).as_matrix(), positions)


def _glances(chance: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) directions that alternate between the right and the left of north, so that every leg turns."""
    side = np.where(np.arange(len(chance)) % 2, 1.0, -1.0)
    azimuth, elevation = np.deg2rad([side * (8.0 + 4.0 * chance[:, 0]), 8.0 * chance[:, 1] - 4.0])
    level = np.cos(elevation)
    return np.stack([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(elevation)], axis=-1)


def looking(centres: NDArray[np.float64], forwards: NDArray[np.float64]) -> NDArray[np.float64]:
    """Poses of upright cameras at given positions, with given viewing directions.

    Parameters
    ----------
    centres
        (n, 3) float64, metres.
    forwards
        (n, 3) float64, of any length, not vertical.

    Returns
    -------
    (n, 4, 4) float64
        world_from_camera.
    """
    z = forwards / np.linalg.norm(forwards, axis=1, keepdims=True)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return from_rotation(np.stack([x, np.cross(z, x), z], axis=-1), centres)


def _sway(frames: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """(frames, 5) smooth signals within -1 and 1, independent of each other."""
    phase = rng.uniform(0.0, 2.0 * np.pi, (5, len(_HOVER_PERIODS)))
    turns = 2.0 * np.pi * np.arange(frames)[:, None, None] / _HOVER_PERIODS
    signals: NDArray[np.float64] = np.sin(turns + phase).mean(axis=2)
    return signals


def _back_and_forth(step: float, frames: int, span: float) -> NDArray[np.float64]:
    """Position of each frame along a path of given length, with reversal at both ends."""
    travelled = step * np.arange(frames, dtype=np.float64)
    return span - np.abs(travelled % (2.0 * span) - span)


MOTIONS: Mapping[str, Motion] = MappingProxyType(
    {
        "sideways": sideways,
        "sideways-left": sideways_left,
        "linear": linear,
        "linear-straight": linear_straight,
        "fixating": fixating,
        "forward": forward,
        "arvr": arvr,
    }
)
"""Motions by name."""
