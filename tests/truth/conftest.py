"""A world that can be worked out by hand: a wall, and a board before it."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import invert
from tracknoise.sequences.sequence import Scan, TruthKind
from tracknoise.tables.identity import SequenceId

WALL_M = 4.0
BOARD_M = 2.0
BOARD_HALF_WIDTH_M = 0.3
CAMERA = Camera(64, 48, 40.0, 40.0, 31.5, 23.5)
ID = SequenceId("made", "room")


def pose(x: float = 0.0, z: float = 0.0, *, turned: bool = False) -> np.ndarray:
    made = np.eye(4)
    made[:3, 3] = x, 0.0, z
    if turned:  # looks back, away from the wall
        made[:3, :3] = np.diag([-1.0, 1.0, -1.0])
    return made


@dataclass(frozen=True, eq=False)
class Room:
    """A wall z = 4 m, and before it a board z = 2 m, |x| < 0.3 m; rays beyond |x| = 3 m of the wall hit nothing."""

    world_from_camera: np.ndarray
    camera: Camera = CAMERA
    truths: tuple[TruthKind, ...] = (TruthKind.raycast, TruthKind.birth)
    with_depth: bool = True
    scan: Scan | None = None
    id: SequenceId = ID
    source: str = "made room"
    notes: tuple[str, ...] = ()
    reads: list[int] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.world_from_camera)

    def image(self, index: int) -> np.ndarray:
        raise AssertionError("truth looks at no image")

    def depth(self, index: int) -> DepthMap | None:
        self.reads.append(index)
        if not self.with_depth:
            return None
        u, v = np.meshgrid(np.arange(64.0), np.arange(48.0))
        points, hit = self.cast(index, np.stack([u.ravel(), v.ravel()], axis=-1))
        back = invert(self.world_from_camera[index])
        depth = (points @ back[:3, :3].T + back[:3, 3])[:, 2]
        return DepthMap(depth.reshape(48, 64), hit.reshape(48, 64))

    @property
    def surface(self) -> "Room":
        return self

    def cast(self, index: int, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        here = self.world_from_camera[index]
        rays = self.camera.bearings(uv) @ here[:3, :3].T
        towards = rays[:, 2] > 0
        slope = np.where(towards, rays[:, 2], 1.0)
        on_wall, on_board = (here[:3, 3] + rays * ((z - here[2, 3]) / slope)[:, None] for z in (WALL_M, BOARD_M))
        board = np.abs(on_board[:, 0]) < BOARD_HALF_WIDTH_M
        points = np.where(board[:, None], on_board, on_wall)
        return points, towards & (np.abs(points[:, 0]) <= 3.0)


@pytest.fixture
def make_room():
    def make(*poses: np.ndarray, **changes: object) -> Room:
        return Room(np.stack(poses), **changes)

    return make


@pytest.fixture
def at():
    """Pose of a camera at x, z (metres), looking along z, or back if turned."""
    return pose


@pytest.fixture
def pixel_grid():
    """Positions all over an image, between pixels, and inside its outermost pixel centres."""

    def grid(camera: Camera, step: float) -> np.ndarray:
        u, v = np.meshgrid(np.arange(0.3, camera.width - 1, step), np.arange(0.6, camera.height - 1, step))
        return np.stack([u.ravel(), v.ravel()], axis=-1)

    return grid
