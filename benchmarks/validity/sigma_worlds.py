"""Scenes whose motions, depths, track lengths and noise differ, and the sigma that is right for such scenes.

The right sigma is computed apart from `tracknoise.estimators`: derivatives are finite differences of a projection, all
poses and points of a window are solved for at once, and covariances of errors are counted from the birth of each track.
"""

from dataclasses import dataclass, field

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from tests.estimators.simulated_tracks import sums_of

from tracknoise.estimators.fit import lengths_of_tracks
from tracknoise.estimators.training import Recording
from tracknoise.statistics.noise_sums import ErrorTracks

Array = NDArray[np.float64]
WIDTH, HEIGHT, FOCAL = 640, 480, 460.0
FRAMES, LEAST = 60, 3


@dataclass(frozen=True)
class World:
    """How scenes of a population differ. Standard deviations are those of logarithms."""

    first: float = 0.0
    white: float = 0.3
    walk: float = 0.0
    level: float = 0.2  # of the noise of scenes
    geometry: float = 0.5  # of speed, depth and track lengths of scenes
    coupling: float = 0.0  # how much the logarithm of the noise grows with that of the speed
    nu: float = np.inf  # of a scale of each track; variances stay the same


WORLDS = {
    "white": World(),
    "detection": World(first=0.3, white=0.3),
    "walk": World(white=0.0, walk=0.1),
    "both": World(white=0.3, walk=0.1),
    "noise follows speed": World(white=0.1, walk=0.1, coupling=0.5),
    "Student's tracks": World(white=0.3, walk=0.1, nu=4.0),
    "differ much": World(white=0.3, walk=0.1, level=0.5, geometry=1.0),
}


@dataclass(frozen=True, eq=False)
class Track:
    """One track: its frames, its point in the world, and its depth in each frame."""

    frames: NDArray[np.int64]
    point: Array
    depth: Array
    age: NDArray[np.int64]  # of each of its frames
    ended: bool  # whether it ended in view, before the recording did

    @property
    def magnification(self) -> Array:
        """Z_0 / Z_k of its frames."""
        return self.depth[0] / self.depth


@dataclass(frozen=True, eq=False)
class Pair:
    """A second camera, and what errors there have in common with those in the first.

    Errors in both have the same covariances, but that a feature has white noise in the second image at birth.
    """

    place: Array  # (4, 4), metres: pose of the second camera in the first
    shared: float  # correlation of the errors in both cameras

    def covariance(self, of_one: Array, white: float, at: NDArray[np.intp]) -> Array:
        """(2 n, 2 n) px^2 of one coordinate at some ages, in the first camera and then in the second."""
        beside = of_one.copy()
        beside[0, 0] = white**2
        both = np.block([[of_one, self.shared * of_one], [self.shared * of_one, beside]])
        rows = np.concatenate([at, at + len(of_one)])
        return np.asarray(both[np.ix_(rows, rows)])

    def drawn(self, own: "Scene", track: "Track", random: np.random.Generator) -> Array:
        """(2, n, 2) px: errors of a track in both cameras."""
        n = len(track.frames)
        whole = self.covariance(own.covariance(track), own.sigmas["white"], np.arange(n))
        values, axes = np.linalg.eigh(whole)
        errors = axes * np.sqrt(np.maximum(values, 0.0)) @ random.standard_normal((2 * n, 2))
        return np.asarray(errors.reshape(2, n, 2))


@dataclass(frozen=True, eq=False)
class Scene:
    """A recording and the tracks that a tracker has in it."""

    poses: Array  # (frames, 4, 4) world_from_camera
    tracks: list[Track]
    sigmas: dict[str, float] = field(default_factory=dict)  # of its noise, by component

    def recording(self, name: str) -> Recording:
        """As a run stores it."""
        quaternion = Rotation.from_matrix(self.poses[:, :3, :3]).as_quat()
        moved = np.hstack([self.poses[:, :3, 3], quaternion])
        table = pl.DataFrame(moved, schema=["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"])
        camera = {"width": WIDTH, "height": HEIGHT, "fx_px": FOCAL, "fy_px": FOCAL, "cx_px": 319.5, "cy_px": 239.5}
        sights = np.array([[*project(self.poses[one.frames[0]], one.point), one.depth[0]] for one in self.tracks])
        ended = np.array([one.ended for one in self.tracks], dtype=np.int64)
        ends = pl.DataFrame({"lifetime": self.lengths(), "n_ended": ended, "n_censored": 1 - ended})
        lifetimes = lengths_of_tracks(ends, longest=FRAMES)
        return Recording(name, table.with_row_index("frame"), pl.DataFrame([camera]), sights, lifetimes)

    def lengths(self) -> NDArray[np.int64]:
        """Lengths of its tracks."""
        return np.array([len(one.frames) for one in self.tracks])

    def sums(self, name: str, random: np.random.Generator, nu: float = np.inf) -> pl.DataFrame:
        """What a noise model is fitted to, of drawn errors."""
        return self.sums_of(name, np.concatenate([self.drawn(one, random, nu) for one in self.tracks]))

    def sums_of(self, name: str, errors: Array) -> pl.DataFrame:
        """The same of the errors of all tracks, (n, 2) px."""
        track = np.repeat(np.arange(len(self.tracks)), self.lengths())
        age = np.concatenate([one.age for one in self.tracks])
        magnification = np.concatenate([one.magnification for one in self.tracks])
        walked = np.concatenate([np.cumsum(np.where(one.age > 0, one.magnification**-2, 0.0)) for one in self.tracks])
        frame = np.concatenate([one.frames for one in self.tracks])
        made = ErrorTracks(
            rows=np.arange(len(track)),
            track=track,
            frame=frame,
            speed=np.ones_like(frame),
            age=age.astype(float),
            error_px=errors,
            outlier=np.zeros(len(track), dtype=bool),
            limit_px=np.array([np.inf]),
            magnification=magnification,
            walked=walked,
            motion_px=np.full((len(track), 2), np.nan),
        )
        return sums_of(name, made)

    def tracks_table(self, name: str, random: np.random.Generator, nu: float = np.inf) -> pl.DataFrame:
        """Sampled tracks as a run stores them, with errors that are drawn anew."""
        errors = np.concatenate([self.drawn(one, random, nu) for one in self.tracks])
        values = {
            "track": np.repeat(np.arange(len(self.tracks)), self.lengths()),
            "age": np.concatenate([one.age for one in self.tracks]),
            "du_px": errors[:, 0],
            "dv_px": errors[:, 1],
        }
        labels = {"dataset": "made", "scene": name, "lighting": "default", "camera": "", "stands_for": 1.0}
        return pl.DataFrame(values).with_columns(**{key: pl.lit(value) for key, value in labels.items()})

    def drawn(self, track: Track, random: np.random.Generator, nu: float) -> Array:
        """(n, 2) px: errors about the first position."""
        root = np.linalg.cholesky(self.covariance(track)[1:, 1:])
        errors = np.zeros((len(track.frames), 2))
        errors[1:] = root @ random.standard_normal((len(root), 2))
        return errors if np.isinf(nu) else errors * np.sqrt((nu - 2.0) / random.chisquare(nu))

    def covariance(self, track: Track) -> Array:
        """(n, n) px^2 of one coordinate, about the first position, which has none."""
        m, age = track.magnification, track.age
        walked = np.cumsum(np.where(age > 0, m**-2, 0.0))
        shared = np.minimum(walked[:, None], walked[None])
        carried = self.sigmas["first"] ** 2 * (age[:, None] > 0) * (age[None] > 0) + self.sigmas["walk"] ** 2 * shared
        return np.asarray(np.outer(m, m) * carried + self.sigmas["white"] ** 2 * np.diag(1.0 * (age > 0)))


def project(world_from_camera: Array, point: Array) -> Array:
    """Position in the image, px."""
    x, y, z = world_from_camera[:3, :3].T @ (point - world_from_camera[:3, 3])
    return np.array([FOCAL * x / z + 319.5, FOCAL * y / z + 239.5])


def scene(world: World, random: np.random.Generator, n_tracks: int = 150) -> Scene:
    """A scene of the population."""
    speed, depth, life = np.exp(world.geometry * random.standard_normal(3)) * (0.06, 5.0, 12.0)
    direction = random.standard_normal(3)
    velocity = speed * direction / np.linalg.norm(direction)
    turn = 0.006 * random.standard_normal(3)
    frame = np.arange(FRAMES)
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(frame[:, None] * turn).as_matrix()
    sway = 0.3 * speed * np.sin(frame[:, None] * random.uniform(0.2, 0.5, 3) + random.uniform(0, 6, 3)) * 3.0
    poses[:, :3, 3] = frame[:, None] * velocity + sway
    level = np.exp(world.level * random.standard_normal()) * (speed / 0.06) ** world.coupling
    tracks = []
    while len(tracks) < n_tracks:
        born, length = int(random.integers(0, FRAMES - 1)), 1 + int(random.geometric(1.0 / max(life, 2.0)))
        uv, z = random.uniform((20, 20), (WIDTH - 20, HEIGHT - 20)), depth * random.uniform(0.5, 2.0)
        ray = np.array([(uv[0] - 319.5) / FOCAL, (uv[1] - 239.5) / FOCAL, 1.0])
        point = poses[born, :3, :3] @ (z * ray) + poses[born, :3, 3]
        frames = np.arange(born, min(born + length, FRAMES))
        depths = np.array([(poses[k, :3, :3].T @ (point - poses[k, :3, 3]))[2] for k in frames])
        inside = [d > 0.2 and _is_seen(project(poses[k], point)) for k, d in zip(frames, depths, strict=True)]
        n = int(np.logical_and.accumulate(inside).sum())
        if n >= 2:
            tracks.append(Track(frames[:n], point, depths[:n], np.arange(n), n == length))
    return Scene(poses, tracks, {name: level * getattr(world, name) for name in ("first", "white", "walk")})


def _is_seen(uv: Array) -> bool:
    return bool(0 <= uv[0] <= WIDTH - 1 and 0 <= uv[1] <= HEIGHT - 1)


def squared_sigma(own: Scene, start: int, length: int, pair: Pair | None = None) -> float | None:
    """NEES of the newest pose of one window with a sigma of 1 px; None where tracks do not determine its poses."""
    parts = eliminated(own, start, length, pair)
    if parts is None:
        return None
    p = 6 * length - 7
    information, middle = np.zeros((p, p)), np.zeros((p, p))
    for one, at, left, _ in parts:
        of_one = own.covariance(one)
        every = of_one[np.ix_(at, at)] if pair is None else pair.covariance(of_one, own.sigmas["white"], at)
        true = np.kron(every, np.eye(2))
        information += left.T @ left
        middle += left.T @ true @ left
    if np.linalg.cond(information) > 1e12:
        return None
    claimed = np.linalg.inv(information)
    actual = (claimed @ middle @ claimed)[-5:, -5:]
    return float(np.trace(np.linalg.solve(claimed[-5:, -5:], actual)) / 5.0)


def eliminated(
    own: Scene, start: int, length: int, pair: Pair | None = None
) -> list[tuple[Track, NDArray[np.intp], Array, Array]] | None:
    """Tracks of a window, and of each: places of its frames there, derivatives by poses (2 n, p) without what its point
    absorbs, and a basis (2 n, 3) of that; None where there are too few. With a pair, rows of both cameras, (4 n, ...).
    """
    last = start + length - 1
    seen = [one for one in own.tracks if _within(one, start, last).sum() >= LEAST]
    if len(seen) < 15:
        return None
    across = np.linalg.svd(own.poses[last : last + 1, :3, 3] - own.poses[start : start + 1, :3, 3])[2][1:]
    poses, points = own.poses[start : last + 1], np.array([one.point for one in seen])
    places = [np.eye(4)] if pair is None else [np.eye(4), pair.place]
    of_cameras = [_derivatives(poses, points, place) for place in places]
    found = []
    for number, one in enumerate(seen):
        at = np.flatnonzero(_within(one, start, last))
        frames = one.frames[at] - start
        flat, by_point = [], []
        for of_pose, of_point in of_cameras:
            every = np.zeros((len(at), 2, length, 6))
            every[np.arange(len(at)), :, frames] = of_pose[number, frames]
            flat.append(every.reshape(2 * len(at), 6 * length))
            by_point.append(of_point[number, frames].reshape(-1, 3))
        whole = np.concatenate(flat)
        rows = np.hstack([whole[:, 6:-3], whole[:, -3:] @ across.T])
        span = np.linalg.qr(np.concatenate(by_point))[0]
        found.append((one, at, rows - span @ (span.T @ rows), span))
    return found


def _within(track: Track, first: int, last: int) -> NDArray[np.bool_]:
    return np.asarray((track.frames >= first) & (track.frames <= last))


def _derivatives(poses: Array, points: Array, place: Array) -> tuple[Array, Array]:
    """By each pose, (points, frames, 2, 6), and by the point, (points, frames, 2, 3): central differences.

    `place`: (4, 4), pose of the camera in that whose poses these are.
    """
    step = 1e-5

    def images(rotations: Array, positions: Array, moved: Array) -> Array:
        local = np.einsum("fji,pfj->pfi", rotations, moved[:, None] - positions)
        local = (local - place[:3, 3]) @ place[:3, :3]
        return FOCAL * local[..., :2] / local[..., 2:]

    rotations, positions = poses[:, :3, :3], poses[:, :3, 3]
    by_pose, by_point = [], []
    for axis in np.eye(3):
        turns = [rotations @ Rotation.from_rotvec(sign * step * axis).as_matrix() for sign in (1, -1)]
        by_pose.append(images(turns[0], positions, points) - images(turns[1], positions, points))
    for axis in np.eye(3):
        ends = [images(rotations, positions + sign * step * axis, points) for sign in (1, -1)]
        by_pose.append(ends[0] - ends[1])
        ends = [images(rotations, positions, points + sign * step * axis) for sign in (1, -1)]
        by_point.append(ends[0] - ends[1])
    return np.stack(by_pose, axis=-1) / (2 * step), np.stack(by_point, axis=-1) / (2 * step)
