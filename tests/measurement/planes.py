"""Sequences of a textured plane, rendered by homographies: poses, depth and images are exact."""

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import invert
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.tables.identity import SequenceId

WIDTH, HEIGHT, FOCAL_PX, PLANE_M, FRAMES = 200, 150, 160.0, 3.0, 8
CAMERA = Camera(WIDTH, HEIGHT, FOCAL_PX, FOCAL_PX, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
K = np.array([[FOCAL_PX, 0.0, (WIDTH - 1) / 2], [0.0, FOCAL_PX, (HEIGHT - 1) / 2], [0.0, 0.0, 1.0]])


def texture() -> np.ndarray:
    """Gray values of the plane, of several scales."""
    rng = np.random.default_rng(0)
    size = 3 * WIDTH, 3 * HEIGHT
    layers = [
        cv2.resize(rng.uniform(-1.0, 1.0, (size[1] // one, size[0] // one)), size, interpolation=cv2.INTER_CUBIC)
        for one in (3, 6, 15)
    ]
    return np.clip(128.0 + 60.0 * sum(layers), 0.0, 255.0).astype(np.uint8)


def moving(*, moves: bool = True) -> np.ndarray:
    """Poses of a camera that turns, and moves before the plane."""
    time = np.arange(FRAMES) / 4.0
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    turned = np.column_stack([0.02 * np.sin(time), 0.04 * np.sin(0.7 * time), 0.03 * np.cos(time)])
    poses[:, :3, :3] = Rotation.from_rotvec(turned).as_matrix()
    if moves:
        poses[:, :3, 3] = np.column_stack([0.4 * np.sin(0.9 * time), 0.2 * np.cos(time), 0.1 * time])
    return poses


def walked(poses: np.ndarray, degrees: float = 0.1, metres: float = 0.01) -> np.ndarray:
    """Poses with errors that every frame adds."""
    steps = np.random.default_rng(1).standard_normal((len(poses), 6)) * np.repeat([metres, np.deg2rad(degrees)], 3)
    moved, errors = np.cumsum(steps, axis=0), np.tile(np.eye(4), (len(poses), 1, 1))
    errors[:, :3, :3], errors[:, :3, 3] = Rotation.from_rotvec(moved[:, 3:]).as_matrix(), moved[:, :3]
    return np.asarray(poses @ errors)


def images_of(poses: np.ndarray, of_plane: np.ndarray | None = None) -> list[np.ndarray]:
    """What the camera sees."""
    seen = texture() if of_plane is None else of_plane
    plane = np.array([[FOCAL_PX, 0.0, 1.5 * WIDTH], [0.0, FOCAL_PX, 1.5 * HEIGHT], [0.0, 0.0, 1.0]])
    found = []
    for pose in invert(poses):
        moved = K @ (pose[:3, :3] + np.outer(pose[:3, 3], [0.0, 0.0, 1.0]) / PLANE_M) @ np.linalg.inv(plane)
        found.append(cv2.warpPerspective(seen, moved, (WIDTH, HEIGHT), flags=cv2.INTER_AREA))
    return found


def depths_of(poses: np.ndarray) -> list[DepthMap]:
    """Its depth maps."""
    u, v = np.meshgrid(np.arange(float(WIDTH)), np.arange(float(HEIGHT)))
    rays = CAMERA.bearings(np.stack([u.ravel(), v.ravel()], axis=1))
    found = []
    for pose in poses:
        depth = (PLANE_M - pose[2, 3]) / (rays @ pose[2, :3])
        found.append(DepthMap(depth.reshape(HEIGHT, WIDTH), np.ones((HEIGHT, WIDTH), np.bool_)))
    return found


def recorded(
    poses: np.ndarray, images: list[np.ndarray], depths: list[DepthMap] | None, camera: Camera = CAMERA
) -> RecordedSequence:
    """A sequence that states nothing of its accuracy."""
    return RecordedSequence(
        id=SequenceId("made", "plane"),
        source="made plane",
        camera=camera,
        world_from_camera=poses,
        images=images.__getitem__,
        depths=None if depths is None else depths.__getitem__,
        timestamps_s=np.arange(len(poses)) / 30.0,
    )
