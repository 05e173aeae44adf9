"""Reference tracks of made-up points, without images: their true positions are known."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import invert, transform
from tracknoise.measurement.refined_poses import refined_by
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.manifest import PoseFit
from tracknoise.truth.pose_adjustment import PoseAdjustment, ReferenceTracks

WIDTH, HEIGHT, FOCAL_PX, RATE_HZ = 480, 360, 360.0, 30.0
CAMERA = Camera(WIDTH, HEIGHT, FOCAL_PX, FOCAL_PX, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
LONGEST = 24
Points = Callable[[np.random.Generator, int], np.ndarray]


def path(n_frames: int, *, turns: float = 1.0, moves: float = 1.0) -> np.ndarray:
    """Poses of a camera in a hand."""
    time = np.arange(n_frames) / RATE_HZ
    poses = np.tile(np.eye(4), (n_frames, 1, 1))
    angles = turns * np.column_stack([0.12 * np.sin(4.1 * time), 0.2 * np.sin(2.9 * time), 0.1 * np.cos(3.3 * time)])
    poses[:, :3, :3] = Rotation.from_rotvec(angles).as_matrix()
    poses[:, :3, 3] = moves * np.column_stack(
        [0.5 * np.sin(2.2 * time), 0.3 * np.cos(2.7 * time), 0.3 * np.sin(1.7 * time)]
    )
    return poses


def spoilt(poses: np.ndarray, *, degrees: float = 0.05, metres: float = 0.004, seed: int = 1) -> np.ndarray:
    """Poses with errors that every frame adds."""
    steps = np.random.default_rng(seed).standard_normal((len(poses), 6)) * np.repeat([metres, np.deg2rad(degrees)], 3)
    walked, errors = np.cumsum(steps, axis=0), np.tile(np.eye(4), (len(poses), 1, 1))
    errors[:, :3, :3], errors[:, :3, 3] = Rotation.from_rotvec(walked[:, 3:]).as_matrix(), walked[:, :3]
    return np.asarray(poses @ errors)


def room(rng: np.random.Generator, count: int) -> np.ndarray:
    """Points at depths from 1.5 to 8 m."""
    depth = rng.uniform(1.5, 8.0, count)
    return np.column_stack([rng.uniform(-1.0, 1.0, count) * depth, rng.uniform(-0.8, 0.8, count) * depth, depth])


def wall(rng: np.random.Generator, count: int) -> np.ndarray:
    """Points of a plane before the camera."""
    return np.column_stack([rng.uniform(-4.0, 4.0, count), rng.uniform(-3.0, 3.0, count), np.full(count, 3.0)])


@dataclass(frozen=True)
class Made:
    """A recording with exact tracks, and what is stated of it."""

    poses: np.ndarray  # (n, 4, 4): exact
    tracks: ReferenceTracks  # as observed
    true_uv: np.ndarray  # (rows, 2): where the points of the tracks really are, px
    camera: Camera = CAMERA  # as stated

    def refined(self, stated: np.ndarray, *, accuracy: TruthAccuracy = TruthAccuracy()) -> "Found":  # noqa: B008
        """By these stated poses, and what is stated of their errors."""
        sequence = RecordedSequence(
            id=SequenceId("made", "points"),
            source="made points",
            camera=self.camera,
            world_from_camera=stated,
            images=lambda _: np.zeros((HEIGHT, WIDTH), np.uint8),
            timestamps_s=np.arange(len(stated)) / RATE_HZ,
            truth_accuracy=accuracy,
        )
        found, fit = refined_by(sequence, self.tracks, accuracy, len(stated))
        predicted = self.tracks.uv - PoseAdjustment(sequence, self.tracks).residuals(
            found.world_from_camera, self.tracks.depth_m
        )
        return Found(fit, found, predicted - self.true_uv, self.tracks)


@dataclass(frozen=True)
class Found:
    """What was refined, and how wrong positions by it are."""

    fit: PoseFit
    sequence: object
    wrong_px: np.ndarray  # (rows, 2)
    tracks: ReferenceTracks

    def really_px(self, age: int | None = None) -> float:
        """RMS of both coordinates at an age, by default that of the fit."""
        rows = self.tracks.frame - self.tracks.birth[self.tracks.track] == (age or self.fit.age)
        return float(np.sqrt(np.nanmean(np.sum(self.wrong_px[rows] ** 2, axis=1))))


def made(
    poses: np.ndarray,
    points: Points = room,
    *,
    per_kind: int = 200,
    walk_px: float = 0.05,
    white_px: float = 0.3,
    readout_s: float = 0.0,
    moving: float = 0.0,
    drift_m: float = 0.02,
    depth_noise: float = 0.0,
    seed: int = 0,
) -> Made:
    """Two kinds of tracks of some points: followed ones walk, and matched ones scatter.

    `moving`: share of the image, from the left, in which points move on their own, by `drift_m` from frame to frame.
    """
    rng, n = np.random.default_rng(seed), len(poses)
    noise = (
        (lambda shape: np.cumsum(walk_px * rng.standard_normal(shape), axis=1)),
        (lambda shape: white_px * rng.standard_normal(shape)),
    )
    parts: list[tuple[np.ndarray, ...]] = []  # birth, birth_uv, depth_m, kind; then positions (tracks, ages, 2)
    ends = np.zeros((2, n + LONGEST + 2), int)
    alive = [0, 0]
    for frame, kind in product(range(n - 1), (0, 1)):
        alive[kind] -= ends[kind, frame]
        start = points(rng, 8 * per_kind)
        uv, depth_m = _seen(start, poses, np.full(len(start), frame), readout_s)
        chosen = np.flatnonzero(_inside(uv) & (depth_m > 0.2))[: per_kind - alive[kind]]
        start, uv, depth_m = start[chosen], uv[chosen], depth_m[chosen]
        ages = np.arange(1, min(LONGEST, n - 1 - frame) + 1)
        frames = np.broadcast_to(frame + ages, (len(chosen), len(ages)))
        still = np.repeat(start[:, None], len(ages), axis=1)
        gone = (
            np.where(uv[:, 0] < moving * WIDTH, 1.0, 0.0)[:, None, None]
            * ages[:, None]
            * np.array([drift_m, drift_m / 2.0, 0.0])
        )
        observed, true = (
            _seen(one.reshape(-1, 3), poses, frames.ravel(), readout_s)[0].reshape(*frames.shape, 2)
            for one in (still + gone, still)
        )
        lives = rng.integers(4, LONGEST + 1, len(chosen))[:, None]
        seen = np.cumprod(_inside(observed) & (ages <= lives), axis=1).astype(bool)
        last = seen.sum(axis=1)
        np.add.at(ends[kind], frame + last + 1, 1)
        alive[kind] += len(chosen)
        wrong = depth_m * (1.0 + depth_noise * rng.standard_normal(len(chosen)))
        parts.append(
            (
                np.full(len(chosen), frame),
                uv,
                wrong,
                np.full(len(chosen), kind),
                seen,
                observed + noise[kind](observed.shape),
                true,
            )
        )
    return _joined(poses, parts, max(0.01, depth_noise))


def _joined(poses: np.ndarray, parts: list[tuple[np.ndarray, ...]], depth_sigma: float) -> Made:
    birth, birth_uv, depth_m, kind = (np.concatenate([one[place] for one in parts]) for place in range(4))
    offsets = np.cumsum([0, *(len(one[0]) for one in parts)])
    rows = [np.nonzero(one[4]) for one in parts]
    track = np.concatenate([row + offset for (row, _), offset in zip(rows, offsets[:-1], strict=True)])
    frame = np.concatenate([one[0][row] + age + 1 for one, (row, age) in zip(parts, rows, strict=True)])
    uv, true = (np.concatenate([one[place][row] for one, row in zip(parts, rows, strict=True)]) for place in (5, 6))
    used = np.unique(track)
    tracks = ReferenceTracks(
        birth=birth[used],
        birth_uv=birth_uv[used],
        depth_m=depth_m[used],
        depth_sigma=np.full(len(used), depth_sigma),
        kind=kind[used],
        track=np.searchsorted(used, track),
        frame=frame,
        uv=uv,
    )
    return Made(poses, tracks, true)


def with_focal(recording: Made, factor: float) -> Made:
    """The same with another stated focal length."""
    camera = replace(CAMERA, fx=factor * FOCAL_PX, fy=factor * FOCAL_PX)
    return replace(recording, camera=camera)


def with_k1(recording: Made, k1: float) -> Made:
    """The same with another stated k1."""
    return replace(recording, camera=replace(CAMERA, distortion=(k1, 0.0, 0.0, 0.0)))


def _seen(points: np.ndarray, poses: np.ndarray, frames: np.ndarray, readout_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 2) and depths (n,) of points (n, 3) in frames (n,); each row sees with the pose of its time."""
    seen = transform(invert(poses[frames]), points)
    for _ in range(5 if readout_s else 0):
        time = readout_s * ((CAMERA.project(seen)[:, 1] + 0.5) / HEIGHT - 0.5) * RATE_HZ
        seen = transform(invert(_between(poses, frames + np.clip(np.nan_to_num(time), -1.0, 1.0))), points)
    return CAMERA.project(seen), seen[:, 2]


def _between(poses: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(n, 4, 4): poses at frames (n,) that are no whole numbers."""
    low = np.clip(np.floor(at), 0, len(poses) - 2).astype(int)
    part, moved = (at - low)[:, None], invert(poses[low]) @ poses[low + 1]
    step = np.tile(np.eye(4), (len(at), 1, 1))
    step[:, :3, :3] = Rotation.from_rotvec(part * Rotation.from_matrix(moved[:, :3, :3]).as_rotvec()).as_matrix()
    step[:, :3, 3] = part * moved[:, :3, 3]
    return np.asarray(poses[low] @ step)


def _inside(uv: np.ndarray) -> np.ndarray:
    return np.asarray(((uv >= 0.0) & (uv < (WIDTH, HEIGHT))).all(axis=-1))
