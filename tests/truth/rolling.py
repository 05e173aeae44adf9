"""A room of two planes seen through a rolling shutter, worked out by search over the times of rows."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation, Slerp

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.sequence import Scan, TruthKind
from tracknoise.tables.identity import SequenceId

CAMERA = Camera(160, 120, 130.0, 130.0, 79.5, 59.5, (-0.15, 0.03, 0.001, -0.002))
WALL_M, BOARD_M, BOARD_HALF_WIDTH_M = 4.0, 2.0, 0.4
READOUT_S, RATE_HZ = 0.025, 30.0
SHUTTER, ID = RollingShutter(READOUT_S), SequenceId("made", "rolling")


def path(frames: int = 9, seed: int = 3) -> np.ndarray:
    """(n, 4, 4): a hand-held camera that looks along z, turns by up to 2 rad/s and moves by up to 1 m/s."""
    random = np.random.default_rng(seed)
    times = np.arange(frames) / RATE_HZ
    phase, amplitude = random.uniform(0, 2 * np.pi, (2, 3)), np.array([[0.12, 0.12, 0.15], [0.1, 0.1, 0.05]])
    angles, positions = (
        size * np.sin(2 * np.pi * 2.0 * times[:, None] + begin) for size, begin in zip(amplitude, phase, strict=True)
    )
    poses = np.broadcast_to(np.eye(4), (frames, 4, 4)).copy()
    poses[:, :3, :3] = Rotation.from_rotvec(angles).as_matrix()
    poses[:, :3, 3] = positions
    return poses


@dataclass(frozen=True, eq=False)
class RollingRoom:
    """A wall at z = 4 m, and before it a board at z = 2 m, |x| < 0.4 m. Depth is that in the camera of each row."""

    world_from_camera: np.ndarray
    timestamps_s: np.ndarray | None
    shutter: RollingShutter | None
    camera: Camera = CAMERA
    truths: tuple[str, ...] = (TruthKind.raycast, TruthKind.birth)
    scan: Scan | None = None
    id: SequenceId = ID
    source: str = "made rolling room"
    notes: tuple[str, ...] = ()
    pose_accuracy = depth_accuracy = None

    @classmethod
    def of(cls, poses: np.ndarray, shutter: RollingShutter | None = SHUTTER, **more) -> "RollingRoom":
        return cls(poses, 5.0 + np.arange(len(poses)) / RATE_HZ, shutter, **more)

    def __len__(self) -> int:
        return len(self.world_from_camera)

    def image(self, index: int) -> np.ndarray:
        return np.zeros((self.camera.height, self.camera.width), np.uint8)

    def row_time(self, index: int, uv: np.ndarray) -> np.ndarray:
        delay = 0.0
        if self.shutter is not None:
            side = (self.camera.width, self.camera.height)[self.shutter.axis]
            delay = self.shutter.readout_s * ((uv[:, self.shutter.axis] + 0.5) / side - 0.5)
        return self.timestamps_s[index] + delay + np.zeros(len(uv))

    def pose_after(self, time_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Rotation and position: between two frames at constant velocity, which goes on beyond the first and last."""
        times = self.timestamps_s
        before = int(np.clip(np.searchsorted(times, time_s, side="right") - 1, 0, len(times) - 2))
        share = (time_s - times[before]) / (times[before + 1] - times[before])
        one, two = self.world_from_camera[before : before + 2]
        if 0 <= share <= 1:
            turn = Slerp([0, 1], Rotation.from_matrix([one[:3, :3], two[:3, :3]]))(share).as_matrix()
        else:
            turn = (
                one[:3, :3]
                @ Rotation.from_rotvec(
                    share * Rotation.from_matrix(one[:3, :3].T @ two[:3, :3]).as_rotvec()
                ).as_matrix()
            )
        return turn, (1 - share) * one[:3, 3] + share * two[:3, 3]

    def depth(self, index: int) -> DepthMap:
        u, v = np.meshgrid(np.arange(float(self.camera.width)), np.arange(float(self.camera.height)))
        uv = np.stack([u.ravel(), v.ravel()], axis=-1)
        points, hit = self.cast(index, uv)
        turns, positions = self.poses_of(index, uv)
        depth = np.einsum("nji,nj->ni", turns, points - positions)[:, 2]
        return DepthMap(depth.reshape(v.shape), hit.reshape(v.shape))

    def poses_of(self, index: int, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rotations (n, 3, 3) and positions (n, 3) when pixels were exposed."""
        times, place = np.unique(self.row_time(index, uv), return_inverse=True)
        poses = [self.pose_after(time_s) for time_s in times]
        turns, positions = np.array([turn for turn, _ in poses]), np.array([position for _, position in poses])
        return turns.reshape(-1, 3, 3)[place], positions.reshape(-1, 3)[place]

    @property
    def surface(self) -> "RollingRoom":
        return self

    def cast(self, index: int, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Each ray by the pose of its own row."""
        turns, positions = self.poses_of(index, uv)
        rays = np.einsum("nij,nj->ni", turns, self.camera.bearings(uv))
        board, wall = (positions + rays * ((z - positions[:, 2]) / rays[:, 2])[:, None] for z in (BOARD_M, WALL_M))
        on_board = np.abs(board[:, :1]) < BOARD_HALF_WIDTH_M
        return np.where(on_board, board, wall), np.ones(len(uv), np.bool_)

    def seen(self, index: int, point: np.ndarray) -> np.ndarray:
        """Position of a world point: the root of row(time) - time, found by bisection."""
        axis = self.shutter.axis
        side = (self.camera.width, self.camera.height)[axis]

        def project(time_s: float) -> np.ndarray:
            turn, position = self.pose_after(time_s)
            return self.camera.project((turn.T @ (point - position))[None])[0]

        def ahead(time_s: float) -> float:
            row_delay = self.shutter.readout_s * ((project(time_s)[axis] + 0.5) / side - 0.5)
            return self.timestamps_s[index] + row_delay - time_s

        reach = abs(self.shutter.readout_s)
        return project(brentq(ahead, self.timestamps_s[index] - reach, self.timestamps_s[index] + reach, xtol=1e-15))
