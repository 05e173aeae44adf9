"""What estimators that assume one noise make of another, by motion and length of tracks; seconds, nothing is sampled.

    python -m benchmarks.linear_table

Windows of 11 frames with 80 tracks, or 240 short ones, means over four draws of points. Position and rotation are root
mean square errors of the newest pose, over those with one sigma.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tracknoise.estimators.linear_window import (
    CAMERA,
    Assumed,
    Covariances,
    LinearTracks,
    Motion,
    linear_tracks,
    of_full_rank,
    outcome,
    scalar_variances,
    simulated_tracks,
    trajectory,
    true_covariances,
)
from tracknoise.inference.track_noise import Reference, TrackNoise

Window = Sequence[LinearTracks]

_FRAMES, _SEEDS = 11, range(4)
_MEAN_LENGTH = 6
NOISES: Mapping[str, TrackNoise] = {
    "A = W": TrackNoise.isotropic(first=0.3, white=0.3),
    "white, first exact": TrackNoise.isotropic(white=0.3),
    "walk": TrackNoise.isotropic(walk=0.1),
    "walk + white": TrackNoise.isotropic(white=0.3, walk=0.1),
}


def by_age(window: Window, noise: TrackNoise) -> Covariances:
    """Independent errors about the first position, which is exact."""
    whole = [noise.covariance(tracks.magnification, reference=Reference.BIRTH) for tracks in window]
    return [of_full_rank(part * np.eye(part.shape[1])) for part in whole]


def whole_tracks(window: Window, noise: TrackNoise) -> Covariances:
    """The true covariances."""
    return [of_full_rank(part) for part in true_covariances(window, noise)]


ARMS: Mapping[str, Callable[[Window, TrackNoise], Assumed]] = {
    "one sigma, 0.3 px": lambda window, _: scalar_variances(window, 0.3),
    "by age": by_age,
    "whole tracks": whole_tracks,
}


def windows(motion: Motion, *, short: bool) -> list[Window]:
    """Windows with other points each; short tracks have geometrically distributed lengths and begin at any time."""
    poses = trajectory(motion, _FRAMES)
    lengths = np.clip(np.random.default_rng(9).geometric(1.0 / _MEAN_LENGTH, 1000), 3, _FRAMES) if short else None
    drawn = [simulated_tracks(poses, seed=seed, lengths=lengths, n_tracks=240 if short else 80) for seed in _SEEDS]
    return [[linear_tracks(CAMERA, poses, tracks) for tracks in groups] for groups in drawn]


def compared(drawn: Sequence[Window], noise: TrackNoise, arm: str) -> NDArray[np.float64]:
    """NEES of the newest pose, and ratios of position and rotation to one sigma."""
    rows = []
    for window in drawn:
        actual = whole_tracks(window, noise)
        one, other = (outcome(window, actual, ARMS[name](window, noise)) for name in ("one sigma, 0.3 px", arm))
        ratios = (other.position_m / one.position_m, other.rotation_rad / one.rotation_rad)
        rows.append((other.nees_newest, *ratios))
    return np.asarray(np.mean(rows, axis=0))


def main() -> None:
    """Print a row per motion, length of tracks, noise and assumption."""
    print(f"{'motion':9} {'tracks':7} {'noise':19} {'assumed':18} {'NEES':>6} {'position':>9} {'rotation':>9}")
    for motion in Motion:
        for short in (False, True):
            drawn = windows(motion, short=short)
            for name, noise in NOISES.items():
                for arm in ARMS:
                    nees, position, rotation = compared(drawn, noise, arm)
                    tracks = "short" if short else "full"
                    print(f"{motion:9} {tracks:7} {name:19} {arm:18} {nees:6.2f} {position:9.2f} {rotation:9.2f}")


if __name__ == "__main__":
    main()
