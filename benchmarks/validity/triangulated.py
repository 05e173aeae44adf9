"""Whether the noise of tracks with triangulated truth is that which was injected, and what drift does to it.

Tracks of random points, seen by a camera that moves sideways and turns, have white noise of known size in every
position, the first included. Each is triangulated, and its noise estimated by (noise.triangulated) and
(noise.epipolar).

    python -m benchmarks.validity.triangulated [--tracks N] [--seed N]

prints the table for lengths 3 to 50, with and without drift along the epipolar line. With 2000 tracks of each length
and noise of 0.5 px, it lies between 0.493 and 0.508 px without drift, and between 0.495 and 0.513 px with 0.1 px per
frame. The plain root mean square is 0.351 px at length 3.
"""

import argparse
import sys
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.geometry.cameras import Camera, CameraModel
from tracknoise.geometry.pose import from_quaternion, invert, transform
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.tables.identity import SequenceId
from tracknoise.truth.triangulated import Triangulated
from tracknoise.truth.truth import TruePositions

CAMERA = Camera(640, 480, 500.0, 500.0, 319.5, 239.5)
LENGTHS = (3, 4, 5, 8, 12, 20, 35, 50)
NOISE_PX = 0.5


@dataclass(frozen=True, slots=True)
class Blank:
    """Images without content: truth does not look at them."""

    camera: CameraModel

    def __call__(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8 zeros."""
        return np.zeros((self.camera.height, self.camera.width), np.uint8)


def sideways(n_frames: int, camera: CameraModel = CAMERA) -> RecordedSequence:
    """A camera that moves 5 cm to the right and turns by 0.3 degrees in each frame; without depth."""
    index = np.arange(n_frames)
    half = np.deg2rad(-0.3) * index / 2
    xyzw = np.column_stack([np.zeros_like(half), np.sin(half), np.zeros_like(half), np.cos(half)])
    moved = np.column_stack([0.05 * index, 0.01 * np.sin(index), np.zeros(n_frames)])
    return RecordedSequence(
        id=SequenceId("made", "sideways"),
        source="made",
        camera=camera,
        world_from_camera=from_quaternion(moved, xyzw),
        images=Blank(camera),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Tracks of one length that begin in frame 0: exact and observed positions, (tracks, length, 2), px."""

    exact: NDArray[np.float64]
    observed: NDArray[np.float64]


def make_tracks(
    sequence: RecordedSequence,
    *,
    count: int,
    length: int,
    noise_px: float = NOISE_PX,
    drift_px: float = 0.0,
    rng: np.random.Generator,
) -> Tracks:
    """Tracks of random points 2 to 8 m before the first camera, with white noise and drift along u in every frame."""
    first = sequence.camera
    uv = rng.uniform((60.0, 60.0), (first.width - 60.0, first.height - 60.0), (count, 2))
    points = first.unproject(uv, rng.uniform(2.0, 8.0, count))
    inverse = invert(sequence.world_from_camera)
    exact = np.stack([first.project(transform(inverse[index], points)) for index in range(length)], axis=1)
    noise = rng.normal(0.0, noise_px, exact.shape)
    noise[:, :, 0] += drift_px * np.arange(length)
    return Tracks(exact, exact + noise)


def resolved(sequence: RecordedSequence, observed: NDArray[np.float64]) -> TruePositions:
    """Triangulated truth of tracks (tracks, length, 2) that begin in frame 0, frame by frame."""
    session = Triangulated().open(sequence).start()
    numbers = np.arange(len(observed), dtype=np.uint32)
    for index in range(observed.shape[1]):
        session.observe(index, numbers, observed[:, index], np.full(len(observed), index == 0))
    return session.resolve()


def noise_of(found: TruePositions, observed: NDArray[np.float64]) -> dict[str, float]:
    """Noise by (noise.triangulated), together and in u and v, and by (noise.epipolar), px; and the raw RMS."""
    assert found.leverage is not None, "triangulated truth has leverages"
    assert found.epipolar is not None, "and distances"
    error = np.swapaxes(observed, 0, 1).reshape(-1, 2) - found.uv
    known = ~np.isnan(error[:, 0])
    free = 1.0 - np.einsum("nii->ni", found.leverage)[known]
    squares = np.square(error[known])
    distance, variance = found.epipolar[~np.isnan(found.epipolar[:, 0])].T
    return {
        "share": float(known.mean()),
        "raw": float(np.sqrt(squares.mean())) if known.any() else np.nan,
        "u": float(np.sqrt(squares[:, 0].sum() / free[:, 0].sum())) if known.any() else np.nan,
        "v": float(np.sqrt(squares[:, 1].sum() / free[:, 1].sum())) if known.any() else np.nan,
        "triangulated": float(np.sqrt(squares.sum() / free.sum())) if known.any() else np.nan,
        "epipolar": float(np.sqrt(np.mean(np.square(distance) / variance))),
    }


def table(*, count: int, seed: int) -> pl.DataFrame:
    """One row per length and drift: what was estimated."""
    rng, rows = np.random.default_rng(seed), []
    for drift_px in (0.0, 0.1):
        for length in LENGTHS:
            sequence = sideways(max(length, 2))
            tracks = make_tracks(sequence, count=count, length=length, drift_px=drift_px, rng=rng)
            found = noise_of(resolved(sequence, tracks.observed), tracks.observed)
            rows.append({"drift_px": drift_px, "length": length, **found})
    return pl.DataFrame(rows)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--tracks", type=int, default=2000, help="tracks of each length")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    with pl.Config(tbl_rows=-1, tbl_hide_dataframe_shape=True, tbl_hide_column_data_types=True, float_precision=3):
        sys.stdout.write(f"{table(count=asked.tracks, seed=asked.seed)}\n")


if __name__ == "__main__":
    main()
