"""What errors that the features of a frame have in common do to NEES, and whether sigma for N features makes it 1.

    python -m benchmarks.common_errors [--draws N] [--windows N]

Errors of tracks of 11 frames are drawn, of which a share of the variance is common to a frame: a white shift, the steps
of a walk, or a white rotation of the image about the optical axis. Sigma is that of windows of 80 features for
independent errors, squared, and for each feature of a frame what `LinearEstimate` says for a shift or a
walk; for known points a third of the covariance of two features. It is tried on other windows, with 20, 80 and 300
features in a frame, with least squares, and with Cauchy's loss with a knee of one sigma of innovations, whose sigma is
that of independent errors on the same windows, beside how much smaller it makes errors. With known points, features
have ages 1 to 10. Prints what one feature adds for each unit of the variance in common, NEES if features count as
independent, and NEES with sigma for N features.
"""

import argparse
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

from tracknoise.estimators.kernels import NEWEST, weighted_step
from tracknoise.estimators.linear_window import (
    CAMERA,
    LinearEstimate,
    LinearTracks,
    Motion,
    PointTracks,
    drawn_sight,
    linear_tracks,
    scalar_variances,
    simulated_tracks,
    trajectory,
    without,
)
from tracknoise.estimators.losses import Loss, LossKind
from tracknoise.estimators.model import Purpose
from tracknoise.geometry.projection import image_derivatives
from tracknoise.inference.track_noise import COMPONENTS, TrackNoise

Array = NDArray[np.float64]

FEATURES, SHARES = (20, 80, 300), (0.0, 0.02, 0.05)
NOISES = {
    "white": TrackNoise.isotropic(first=0.3, white=0.3),
    "walk": TrackNoise.isotropic(white=0.1, walk=0.1),
    "roll": TrackNoise.isotropic(first=0.3, white=0.3),
}
"""Errors of tracks, by what is common to a frame: a part of A and W, or of Q."""
_FRAMES, _MEAN_LENGTH, _LEARNED = 11, 6, 80
_POSES = (Purpose.NEWEST_POSE, Purpose.ALL_POSES)
_AGES = 10
_ROUNDS, _KNEE_PX = 5, 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """Tracks of a window, and their derivatives."""

    points: tuple[PointTracks, ...]
    tracks: tuple[LinearTracks, ...]
    poses: Array

    @classmethod
    def of(cls, motion: Motion, features: int, seed: int) -> "Window":
        """With so many features in a frame, which live for six frames on average."""
        poses = trajectory(motion, _FRAMES)
        lengths = np.clip(np.random.default_rng(9).geometric(1.0 / _MEAN_LENGTH, 1000), 3, _FRAMES)
        mean = len_of(simulated_tracks(poses, n_tracks=1000, lengths=lengths, seed=seed)) / 1000
        count = round(features * _FRAMES / mean)
        points = simulated_tracks(poses, n_tracks=count, lengths=lengths, seed=seed)
        return cls(points, tuple(linear_tracks(CAMERA, poses, own) for own in points), poses)

    def errors(self, noise: TrackNoise, share: float, kind: str, draws: int, seed: int) -> list[Array]:
        """Errors with a part in common, (draws, tracks, 2 n) px of each group of tracks."""
        random = np.random.default_rng((seed, 7))
        frames = {name: random.standard_normal((draws, _FRAMES, 2)) for name in ("white", "walk")}
        return [self._errors(own, noise, share, kind, frames, random) for own in self.points]

    def _errors(
        self,
        tracks: PointTracks,
        noise: TrackNoise,
        share: float,
        kind: str,
        frames: dict[str, Array],
        random: np.random.Generator,
    ) -> Array:
        draws, size = len(frames["white"]), (len(frames["white"]), *tracks.frames.shape, 2)
        first, white, walk = (np.sqrt(np.trace(part) / 2.0) for part in (noise.first, noise.white, noise.walk))
        of_white, of_walk = (share if same else 0.0 for same in (kind != "walk", kind == "walk"))
        common = frames["white"][:, tracks.frames]
        if kind == "roll":
            common = _turned(self.images(tracks), common[..., 0])
        drawn = np.sqrt(1.0 - of_white) * random.standard_normal(size) + np.sqrt(of_white) * common
        sizes = np.full(tracks.frames.shape[1], white)
        sizes[0] = first
        shared_steps = frames["walk"][:, tracks.frames]
        steps = np.sqrt(1.0 - of_walk) * random.standard_normal(size) + np.sqrt(of_walk) * shared_steps
        steps[:, :, 0] = 0.0
        errors = sizes[:, None] * drawn + walk * np.cumsum(steps, axis=2)
        return np.asarray(errors.reshape(draws, len(tracks.frames), -1))

    def images(self, tracks: PointTracks) -> Array:
        """Positions, (tracks, n, 2) px from the principal point."""
        rotation, position = self.poses[tracks.frames, :3, :3], self.poses[tracks.frames, :3, 3]
        seen = np.einsum("tnji,tnj->tni", rotation, tracks.points[:, None] - position)
        return np.asarray(CAMERA.fx * seen[..., :2] / seen[..., 2:])


def len_of(tracks: Sequence[PointTracks]) -> int:
    """Number of observations."""
    return sum(own.frames.size for own in tracks)


def _turned(images: Array, angles: Array) -> Array:
    """Shifts by a rotation of the image about its middle: of mean variance 1, for angles (draws, tracks, n)."""
    turned = np.stack([-images[..., 1], images[..., 0]], axis=-1)
    return np.asarray(angles[..., None] * turned / np.sqrt(np.square(turned).mean()))


def least_squares(window: Window, errors: Sequence[Array]) -> tuple[Array, Array]:
    """Errors of poses, (draws, p), and what is claimed of them with a sigma of 1 px."""
    rows = [without(own.by_pose, np.linalg.qr(own.by_point)[0]) for own in window.tracks]
    size = rows[0].shape[2]
    claimed = np.linalg.inv(sum(own.reshape(-1, size).T @ own.reshape(-1, size) for own in rows))
    pairs = zip(errors, rows, strict=True)
    return sum(own.reshape(len(own), -1) @ row.reshape(-1, size) for own, row in pairs) @ claimed, claimed


def with_loss(window: Window, errors: Sequence[Array]) -> tuple[Array, Array]:
    """The same with Cauchy's loss; what is claimed differs between draws, (draws, p, p)."""
    loss, residuals = Loss(LossKind.CAUCHY, _KNEE_PX), list(errors)
    for _ in range(_ROUNDS):
        weights = [loss.weights(own.reshape(-1, own.shape[2])).reshape(own.shape) for own in residuals]
        residuals, error, claimed = weighted_step(window.tracks, errors, weights)
    return error, claimed


def nees(error: Array, claimed: Array) -> Array:
    """Means over draws of the newest and of all poses."""
    return np.array([_nees(error[:, -NEWEST:], claimed[..., -NEWEST:, -NEWEST:]), _nees(error, claimed)])


def _nees(error: Array, claimed: Array) -> float:
    solved = np.linalg.solve(claimed, error[..., None])[..., 0]
    return float((error * solved).sum(axis=1).mean() / error.shape[1])


def learned(kind: str, windows: Sequence[Window]) -> tuple[Array, Array]:
    """For newest and all poses: sigma squared for independent errors, and what each feature adds at a share of 1."""
    noise, squares, added = NOISES[kind], [], []
    for window in windows:
        assumed = scalar_variances(window.tracks, 1.0)
        estimate = LinearEstimate.of(window.tracks, assumed)
        own, both = estimate.influences(), estimate.influences_in_common(noise)
        parts = np.stack([getattr(noise, one.name) for one in COMPONENTS])
        squares.append([(own[purpose] * parts).sum() for purpose in _POSES])
        added.append([both[purpose][int(kind == "walk")] for purpose in _POSES])
    return np.mean(squares, axis=0), np.mean(added, axis=0)


def rows(kind: str, motion: Motion, *, draws: int, count: int) -> Iterator[str]:
    """A row for each loss, share and number of features."""
    noise = NOISES[kind]
    square, added = learned(kind, [Window.of(motion, _LEARNED, 100 + seed) for seed in range(count)])
    unit = np.trace(noise.walk if kind == "walk" else noise.white) / 2.0
    yield f"{kind}, {motion}: a feature adds {added[0] / unit:.3f} (newest pose), {added[1] / unit:.3f} (all poses)"
    for features in FEATURES:
        windows = [Window.of(motion, features, seed) for seed in range(count)]
        for name, solve, times in (("least squares", least_squares, draws), ("Cauchy", with_loss, draws // 25)):
            found = [_tried(solve, windows, noise, share, kind, times) for share in SHARES]
            gain = found[0][1] / _tried(least_squares, windows, noise, 0.0, kind, times)[1]
            own = square if solve is least_squares else found[0][0]
            for share, (values, _) in zip(SHARES, found, strict=True):
                together = own * (1.0 + features * share * added / (square * gain))
                yield _row(name, share, features, values / own, values / together)


def _tried(
    solve: Callable[[Window, Sequence[Array]], tuple[Array, Array]],
    windows: Sequence[Window],
    noise: TrackNoise,
    share: float,
    kind: str,
    draws: int,
) -> tuple[Array, float]:
    """Means over windows: NEES with a sigma of 1 px, and the square error of the newest position."""
    answers = [solve(one, one.errors(noise, share, kind, draws, seed)) for seed, one in enumerate(windows)]
    squares = [np.square(error[:, -2:]).sum(axis=1).mean() for error, _ in answers]
    return np.mean([nees(*answer) for answer in answers], axis=0), float(np.mean(squares))


def _row(name: str, share: float, features: int, alone: Array, together: Array) -> str:
    values = [value for pair in zip(alone, together, strict=True) for value in pair]
    return f"  {name:14}{100 * share:4.0f} %{features:5d}" + "".join(f"{value:9.2f}" for value in values)


def known_points(kind: str, *, draws: int) -> Iterator[str]:
    """The same of one pose from points that are known."""
    noise, random = NOISES[kind], np.random.default_rng(5)
    first, white, walk = (np.sqrt(np.trace(part) / 2.0) for part in (noise.first, noise.white, noise.walk))
    ages = np.arange(1, _AGES + 1)
    square = first**2 + white**2 + walk**2 * ages.mean()
    least = np.minimum.outer(ages, ages).mean()
    added = (walk**2 * least if kind == "walk" else white**2 + first**2 / _AGES) / 3.0
    for features in FEATURES:
        points = np.array([drawn_sight(random) for _ in range(features)])
        world = CAMERA.unproject(points[:, :2], points[:, 2])
        by_pose = image_derivatives(CAMERA, np.tile(np.eye(4), (features, 1, 1)), world)[0].reshape(-1, 6)
        claimed = np.linalg.inv(by_pose.T @ by_pose)
        age = random.integers(1, _AGES + 1, features)
        for share in SHARES:
            frames = random.standard_normal((2, draws, _AGES + 1, 2))
            common = frames[0]
            now, born = np.repeat(common[:, :1], features, axis=1), common[:, age]
            if kind == "roll":
                at = points[:, :2] - (CAMERA.cx, CAMERA.cy)
                now, born = (_turned(at, one[..., 0]) for one in (now, born))
            of_white, of_walk = (share if same else 0.0 for same in (kind != "walk", kind == "walk"))
            own = random.standard_normal((3, draws, features, 2))
            errors = white * (np.sqrt(1.0 - of_white) * own[0] + np.sqrt(of_white) * now)
            errors -= first * (np.sqrt(1.0 - of_white) * own[1] + np.sqrt(of_white) * born)
            walked = np.cumsum(frames[1], axis=1)[:, age - 1]
            errors += walk * (np.sqrt((1.0 - of_walk) * age)[:, None] * own[2] + np.sqrt(of_walk) * walked)
            error = errors.reshape(draws, -1) @ by_pose @ claimed
            found = np.einsum("di,ij,dj->d", error, np.linalg.inv(claimed), error).mean() / 6.0
            together = square + features * share * added
            yield f"  {'known points':14}{100 * share:4.0f} %{features:5d}{found / square:9.2f}{found / together:9.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.common_errors", description=__doc__.partition("\n")[0])
    parser.add_argument("--draws", type=int, default=1000, help="draws of errors for each window; a 25th with the loss")
    parser.add_argument("--windows", type=int, default=4, help="windows that are tried, and that are learned from")
    options = parser.parse_args()
    print(f"  {'':14}{'share':>6}{'N':>5}" + "".join(f"{name:>9}" for name in ("newest", "with N", "all", "with N")))
    for kind in NOISES:
        for motion in Motion:
            for row in rows(kind, motion, draws=options.draws, count=options.windows):
                print(row, flush=True)
        for row in known_points(kind, draws=1000):
            print(row, flush=True)


if __name__ == "__main__":
    main()
