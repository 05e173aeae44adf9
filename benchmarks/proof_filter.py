"""The proof on a filter (E3): a multi-state constraint Kalman filter with simulated inertial readings.

    python -m benchmarks.proof_filter              # full size: 40 sequences of 60 frames
    python -m benchmarks.proof_filter --runs 8 --frames 30

Prints NEES of the newest pose, errors of the last one, the share of tracks that pass the chi-square gate, and mean
innovations, for each assumed noise: the sigma that innovations suggest, with the usual gate and with a measured one,
the sigma that makes the newest pose of windows right, and whole tracks.
"""

import argparse
import os
from collections.abc import Callable, Mapping, Sequence

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

from benchmarks.msckf import Filtered, InertialProblem, inertial_problem, run_filter
from tracknoise.estimators.linear_window import (
    CAMERA,
    Motion,
    TrackGates,
    consistent_sigma,
    linear_tracks,
    simulated_tracks,
    trajectory,
)
from tracknoise.estimators.model import Purpose
from tracknoise.estimators.track_noise import TrackNoise
from tracknoise.estimators.trial import PlantedNoise, one_sigma, whole_tracks

CASES: Mapping[str, TrackNoise] = {
    "white": TrackNoise.isotropic(first=0.3, white=0.3),
    "walk": TrackNoise.isotropic(walk=0.1),
    "walk and white": TrackNoise.isotropic(white=0.3, walk=0.1),
}
Covariances = Callable[[InertialProblem], Sequence[NDArray[np.float64]]]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.proof_filter", description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=40, help="sequences")
    parser.add_argument("--frames", type=int, default=60, help="frames of a sequence")
    parser.add_argument("--tracks", type=int, default=8, help="tracks that begin in each frame")
    options = parser.parse_args()
    print(f"{'noise':16}{'assumed':28}{'NEES':>18}{'position mm':>13}{'passed':>8}{'innovations':>13}")
    for case, noise in CASES.items():
        problems = [
            inertial_problem(PlantedNoise(noise=noise), n_frames=options.frames, per_frame=options.tracks, seed=seed)
            for seed in range(options.runs)
        ]
        for name, (covariances, gate) in _assumptions(noise).items():
            found = [
                run_filter(problem, covariances(problem), gate=gate, seed=seed) for seed, problem in enumerate(problems)
            ]
            print(f"{case:16}{name:28}{_row(problems, found)}", flush=True)


def _assumptions(noise: TrackNoise) -> dict[str, tuple[Covariances, float]]:
    """Covariances and the factor of the gate, by name."""
    poses = trajectory(Motion.SIDEWAYS, 11)
    window = [linear_tracks(CAMERA, poses, tracks) for tracks in simulated_tracks(poses)]
    innovations = consistent_sigma(window, noise, purpose=Purpose.INNOVATIONS)
    newest = consistent_sigma(window, noise, purpose=Purpose.NEWEST_POSE)
    factor = TrackGates.of(window, noise).factors([0.95], sigma=innovations)[0]
    return {
        f"innovations, {innovations:.3f} px": (_scalar(innovations), 1.0),
        f"the same, gate x {factor:.2f}": (_scalar(innovations), factor),
        f"newest pose, {newest:.3f} px": (_scalar(newest), 1.0),
        "whole tracks": (lambda problem: whole_tracks(problem.vision, noise), 1.0),
    }


def _scalar(sigma: float) -> Covariances:
    return lambda problem: one_sigma(problem.vision, sigma)


def _row(problems: Sequence[InertialProblem], found: Sequence[Filtered]) -> str:
    nees = np.array([one.nees.mean() for one in found])
    spread = nees.std(ddof=1) / np.sqrt(len(nees))
    last = [
        np.linalg.norm(one.poses[-1, :3, 3] - problem.vision.world_from_camera[-1, :3, 3])
        for problem, one in zip(problems, found, strict=True)
    ]
    passed, innovations = (np.mean([getattr(one, name) for one in found]) for name in ("passed", "innovations"))
    error_mm = 1000.0 * np.sqrt(np.mean(np.square(last)))
    return f"{nees.mean():9.2f} +- {spread:5.2f}{error_mm:13.1f}{passed:8.3f}{innovations:13.3f}"


if __name__ == "__main__":
    main()
