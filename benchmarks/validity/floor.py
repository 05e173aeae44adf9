"""Does the truth floor predict what faults of the truth add to the errors of tracks?

Tracks of exact positions are followed through a simulated sequence, and their true positions are computed again from a
truth with faults of known size, many times. The displacements are what the faults add to the errors of any tracker.
Their second moment, and the spread of their mean, are compared with the floor, by age.

    python -m benchmarks.validity.floor
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.spatial.transform import Rotation

from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import PosePath, invert
from tracknoise.measurement.floors import TruthFloor
from tracknoise.measurement.recording import Recording
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.views import View
from tracknoise.tables.enumerations import FloorSource
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.accuracies import AccuracyRule
from tracknoise.truth.truth import TruePositions
from tracknoise.truth.truth_registry import make_truth

RATE_HZ = 30.0
LONGEST = 24
_EVERY = 2
"""A set of tracks begins in every second frame."""
_BLUR_PX = 3.0
"""Depth noise is correlated over a few pixels, as that of real sensors, so that interpolation does not reduce it."""


@dataclass(frozen=True, slots=True, eq=False)
class Stated(View):
    """A sequence with a stated truth that is kept in memory."""

    poses: NDArray[np.float64]
    depths: tuple[DepthMap, ...]
    lens: CameraModel

    @property
    def camera(self) -> CameraModel:
        return self.lens

    def camera_at(self, index: int) -> CameraModel:
        return self.lens

    @property
    def timestamps_s(self) -> NDArray[np.float64]:
        return np.arange(len(self.poses)) / RATE_HZ

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        return self.poses

    def depth(self, index: int) -> DepthMap:
        return self.depths[index]


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of the truth, and the accuracy that states its size."""

    accuracy: TruthAccuracy
    apply: Callable[[Stated, np.random.Generator], Stated]


def exact_world(*, motion: str = "arvr", frames: int = 60) -> Stated:
    sequence = open_sequence("simulated", motions=[motion], frames=frames, width=320, height=240)
    depths = tuple(sequence.depth(index) for index in range(frames))
    return Stated(sequence, sequence.world_from_camera, depths, sequence.camera)


def exact_tracks(world: Stated, *, per_frame: int = 24, seed: int = 0) -> Recording:
    """Tracks at exact positions, which live for 24 frames or until their point leaves the image or is occluded."""
    truth, rng = make_truth(world, "birth"), np.random.default_rng(seed)
    rows: list[tuple[int, NDArray[np.intp], NDArray[np.float64]]] = []
    births: list[int] = []
    for birth in range(0, len(world) - 1, _EVERY):
        uv = rng.uniform((0, 0), (world.camera.width - 1, world.camera.height - 1), (per_frame, 2))
        points, status = truth.anchor(birth, uv)
        alive = np.flatnonzero(status == TruthStatus.valid)
        numbers = np.full(per_frame, -1)
        numbers[alive] = len(births) + np.arange(len(alive))
        births += [birth] * len(alive)
        for index in range(birth, min(birth + LONGEST + 1, len(world))):
            seen, status = truth.locate(index, points[alive])
            alive, seen = alive[status == TruthStatus.valid], seen[status == TruthStatus.valid]
            rows.append((index, numbers[alive], seen))
    rows.sort(key=lambda row: row[0])
    return _recording(rows, births)


def _recording(rows: list[tuple[int, NDArray[np.intp], NDArray[np.float64]]], births: list[int]) -> Recording:
    count, nothing = len(births), np.zeros(len(births), np.float32)
    return Recording(
        track=np.concatenate([numbers for _, numbers, _ in rows]).astype(np.uint32),
        frame=np.repeat([index for index, *_ in rows], [len(numbers) for _, numbers, _ in rows]).astype(np.uint32),
        uv=np.concatenate([uv for *_, uv in rows]),
        quality={},
        first_frame=np.array(births, np.uint32),
        found=np.zeros(count, np.uint32),
        end=np.zeros(count, np.int8),
        response=nothing,
        gradient_rad=nothing,
        frames=np.zeros((0, 6), np.uint32),
    )


def positions_of(world: Stated, tracks: Recording) -> TruePositions:
    """True positions of the tracks, which are anchored where they begin."""
    session = make_truth(world, "birth").start()
    for index in range(len(world)):
        rows = np.flatnonzero(tracks.frame == index)
        born = tracks.first_frame[tracks.track[rows]] == index
        session.observe(index, tracks.track[rows], tracks.uv[rows], born)
    return session.resolve()


def _moved(motions: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 4, 4) float64: rigid motions of (n, 6) translations (m) and rotations (deg)."""
    poses = np.tile(np.eye(4), (len(motions), 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(motions[:, 3:], degrees=True).as_matrix()
    poses[:, :3, 3] = motions[:, :3]
    return poses


def _motions(world: Stated, rng: np.random.Generator, metres: float, degrees: float) -> NDArray[np.float64]:
    return _moved(rng.standard_normal((len(world), 6)) * np.repeat([metres, degrees], 3))


def white_poses(metres: float, degrees: float) -> Fault:
    return Fault(
        TruthAccuracy(translation_white_m=metres, rotation_white_deg=degrees),
        lambda world, rng: replace(world, poses=world.poses @ _motions(world, rng, metres, degrees)),
    )


def walking_poses(metres: float, degrees: float) -> Fault:
    def apply(world: Stated, rng: np.random.Generator) -> Stated:
        steps = invert(world.poses[:-1]) @ world.poses[1:] @ _motions(world, rng, metres, degrees)[1:]
        poses = [world.poses[0]]
        for step in steps:
            poses.append(poses[-1] @ step)
        return replace(world, poses=np.stack(poses))

    return Fault(TruthAccuracy(translation_m_per_sqrt_frame=metres, rotation_deg_per_sqrt_frame=degrees), apply)


def steadily_drifting_poses(metres: float, degrees: float) -> Fault:
    def apply(world: Stated, rng: np.random.Generator) -> Stated:
        signs = rng.choice([-1.0, 1.0], 6)  # as in `_sign`
        drift = np.tile(signs * np.repeat([metres, degrees], 3), (len(world), 1))
        steps = invert(world.poses[:-1]) @ world.poses[1:] @ _moved(drift)[1:]
        poses = [world.poses[0]]
        for step in steps:
            poses.append(poses[-1] @ step)
        return replace(world, poses=np.stack(poses))

    return Fault(TruthAccuracy(translation_m_per_frame=metres, rotation_deg_per_frame=degrees), apply)


def noisy_depth(per_m: float) -> Fault:
    def noisy(depth: DepthMap, rng: np.random.Generator) -> DepthMap:
        noise = gaussian_filter(rng.standard_normal(depth.depth_m.shape), _BLUR_PX)
        return replace(depth, depth_m=depth.depth_m + per_m * depth.depth_m**2 * noise / noise.std())

    return Fault(
        TruthAccuracy(depth_per_m=per_m),
        lambda world, rng: replace(world, depths=tuple(noisy(depth, rng) for depth in world.depths)),
    )


def _sign(rng: np.random.Generator) -> float:
    """An error of one standard deviation that is the same in all frames, so that few seeds have its second moment."""
    return float(rng.choice([-1.0, 1.0]))


def wrong_clock(ms: float) -> Fault:
    def apply(world: Stated, rng: np.random.Generator) -> Stated:
        path = PosePath(world.timestamps_s, world.poses)
        return replace(world, poses=path.at(world.timestamps_s + 1e-3 * ms * _sign(rng)))

    return Fault(TruthAccuracy(clock_ms=ms), apply)


def wrong_focal(relative: float) -> Fault:
    def apply(world: Stated, rng: np.random.Generator) -> Stated:
        ratio = 1.0 + relative * _sign(rng)
        return replace(world, lens=replace(world.lens, fx=world.lens.fx * ratio, fy=world.lens.fy * ratio))

    return Fault(TruthAccuracy(focal_relative=relative), apply)


FAULTS = {
    "white poses, small": white_poses(0.002, 0.03),
    "white poses, large": white_poses(0.01, 0.2),
    "walking poses, small": walking_poses(0.0005, 0.01),
    "walking poses, large": walking_poses(0.003, 0.07),
    "steadily drifting poses": steadily_drifting_poses(0.001, 0.02),
    "depth, small": noisy_depth(0.0005),
    "depth, large": noisy_depth(0.002),
    "clock, small": wrong_clock(2.0),
    "clock, large": wrong_clock(10.0),
    "focal length, small": wrong_focal(0.002),
    "focal length, large": wrong_focal(0.01),
}


def compared(world: Stated, tracks: Recording, fault: Fault, *, seeds: int) -> pl.DataFrame:
    """By age: second moment of displacements (px^2), spread of their mean (px), and what the floor says of both."""
    exact, floors = positions_of(world, tracks), []
    shifts = []
    for seed in range(seeds):
        faulty = fault.apply(world, np.random.default_rng([seed, 1]))
        found = positions_of(faulty, tracks)
        known = found.status == TruthStatus.valid
        age = tracks.frame - tracks.first_frame[tracks.track]
        moved = pl.DataFrame(
            {"at": age[known], "u": (found.uv - exact.uv)[known, 0], "v": (found.uv - exact.uv)[known, 1]}
        )
        shifts.append(
            moved.group_by("at").agg(
                pl.col("u", "v").pow(2).mean().name.prefix("second_"), pl.col("u", "v").mean().name.prefix("mean_")
            )
        )
        rule = AccuracyRule(fault.accuracy, shipped=False)
        floors.append(TruthFloor.of(faulty, make_truth(faulty, "birth"), rule).add(tracks, found)[1])
    measured = (
        pl.concat(shifts)
        .group_by("at")
        .agg(pl.col("second_u", "second_v").mean(), pl.col("mean_u", "mean_v").pow(2).mean().sqrt())
    )
    return measured.join(_predicted(pl.concat(floors), seeds), on="at").filter(pl.col("at") > 0).sort("at")


def _predicted(floors: pl.DataFrame, seeds: int) -> pl.DataFrame:
    """Of the sources that are at fault; the accuracy of other parts is exact."""
    n = pl.col("n")
    single = floors.filter(pl.col("source") != FloorSource.all).with_columns(
        *((pl.col(f"sum_{axis}{axis}") / n).alias(f"floor_{axis}") for axis in "uv"),
        *(((pl.col(f"own_{axis}{axis}") + pl.col(f"shared_{axis}") ** 2) / n**2).alias(f"var_{axis}") for axis in "uv"),
    )
    total = single.group_by("at").agg(pl.col("floor_u", "floor_v", "var_u", "var_v").sum() / seeds)
    return total.select(
        "at", "floor_u", "floor_v", *(pl.col(f"var_{axis}").sqrt().alias(f"sd_{axis}") for axis in "uv")
    )


def rows(seeds: int, frames: int) -> Iterator[str]:
    world = exact_world(frames=frames)
    tracks = exact_tracks(world)
    for name, fault in FAULTS.items():
        table = compared(world, tracks, fault, seeds=seeds).filter(pl.col("at").is_in([1, 6, 12, 24]))
        for row in table.to_dicts():
            second = row["second_u"] + row["second_v"]
            floor = row["floor_u"] + row["floor_v"]
            mean, sd = (np.hypot(row[f"{of}_u"], row[f"{of}_v"]) for of in ("mean", "sd"))
            yield (
                f"{name:26} age {row['at']:2}  second moment {second:9.4f} px^2, floor / it {floor / second:5.2f}   "
                f"spread of the mean {mean:7.4f} px, floor / it {sd / mean:5.2f}"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--frames", type=int, default=60)
    asked = parser.parse_args()
    for row in rows(asked.seeds, asked.frames):
        print(row, flush=True)


if __name__ == "__main__":
    main()
