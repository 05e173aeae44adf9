"""The proof with whole error tracks of a run on simulated geometry (S4).

    python -m benchmarks.proof_resampled RUN MODEL --per-sequence 15

Each track of a window keeps its frames and its errors, with their tails and correlations, and gets another point, seen
from a simulated trajectory. So what an estimator gains does not come from how errors and geometry of the run belong
together. Windows of training scenes and of the others are those of `benchmarks.noise.prove`.
"""

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

from benchmarks.noise.arms import try_arms
from benchmarks.noise.learning import learn
from benchmarks.noise.proof import RUN_ARMS, sentence, summarise, windows_for
from benchmarks.noise.windows import (
    Problem,
    TrackGroup,
    divided,
    errors_of,
    images,
    scenes_of,
    with_joined_scenes,
)
from benchmarks.proof import table
from tracknoise.estimators.linear_window import CAMERA, Motion, PointTracks, drawn_sight, trajectory
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.geometry.pose import transform
from tracknoise.tables.store import RunFolder

TRIES = 50


def main() -> None:
    options = _options()
    folder, model = RunFolder(options.run), NoiseModel.read(options.model)
    speed = round(model.training.speed)
    windows = windows_for(folder, model, length=options.window, per_sequence=options.per_sequence)
    parts = divided(folder, windows, model.training)
    for motion in options.motions:
        learned_from, tested = (moved(windows, motion) for windows in (parts.learned_from, parts.tested))
        tested = with_joined_scenes(folder, tested)
        beliefs = learn(learned_from, noise=model.components.per_frames(speed))
        summary = summarise(try_arms(tested, beliefs, arms=RUN_ARMS))
        tried = f"{len(tested)} of {len(scenes_of(tested))} scenes tried"
        print(f"\n{motion}: {len(learned_from)} windows to learn from, {tried}")
        print(sentence(summary, "6"))
        print(table(summary), flush=True)


def moved(windows: Sequence[Problem], motion: Motion) -> list[Problem]:
    """Windows with the same errors of the same tracks on simulated geometry."""
    return [_moved(window, motion, np.random.default_rng((seed, 4))) for seed, window in enumerate(windows)]


def _moved(window: Problem, motion: Motion, random: np.random.Generator) -> Problem:
    poses = trajectory(motion, len(window.world_from_camera))
    pairs = zip(window.groups, errors_of(window), strict=True)
    groups = tuple(_group(poses, group, errors, random) for group, errors in pairs)
    return Problem(window.scene, CAMERA, poses, groups, start=window.start)


def _group(
    poses: NDArray[np.float64], group: TrackGroup, errors: NDArray[np.float64], random: np.random.Generator
) -> TrackGroup:
    points = np.stack([_point(poses, frames, random) for frames in group.frames])
    uv = images(CAMERA, poses, PointTracks(group.frames, points)) + errors
    return TrackGroup(group.frames, uv, points, group.born, group.quality)


def _point(poses: NDArray[np.float64], frames: NDArray[np.int64], random: np.random.Generator) -> NDArray[np.float64]:
    """A point that is in the image in all of these frames."""
    for _ in range(TRIES):
        *uv, depth = drawn_sight(random)
        seen = CAMERA.unproject(np.asarray(uv), np.array(depth))
        point = transform(poses[frames[0]], seen[None])
        if CAMERA.contains(images(CAMERA, poses, PointTracks(frames[None], point))[0]).all():
            return np.asarray(point[0])
    raise ValueError(f"no point is in the image in frames {frames}")


def _options() -> argparse.Namespace:
    summary = __doc__.partition("\n")[0]
    parser = argparse.ArgumentParser(prog="python -m benchmarks.proof_resampled", description=summary)
    parser.add_argument("run", type=Path, help="run folder that keeps its observations")
    parser.add_argument("model", type=Path, help="noise model")
    parser.add_argument("--window", type=int, default=11, help="processed frames of a window")
    parser.add_argument("--per-sequence", type=int, default=8, help="most windows of a sequence")
    parser.add_argument("--motions", nargs="*", type=Motion, choices=list(Motion), default=list(Motion))
    return parser.parse_args()


if __name__ == "__main__":
    main()
