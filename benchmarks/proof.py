"""The proof on simulated tracks (S1): every noise assumption, what linear algebra expects, and null controls.

    python -m benchmarks.proof                                  # full size: 40 scenes of 15 windows each, hours
    python -m benchmarks.proof --scenes 6 --windows 4 --cases walk

Prints a table for each case and writes all of them as JSON with --out. Windows of even scenes train, of odd ones test.
"""

import argparse
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import polars as pl

from benchmarks.noise.arms import ALL_ARMS, Beliefs, PlantedNoise, try_arms, whole_tracks
from benchmarks.noise.learning import learn
from benchmarks.noise.proof import sentence, summarise
from benchmarks.noise.windows import Problem
from benchmarks.planted_windows import (
    simulated_problem,
    with_drift_reversed,
    with_noise_of,
    with_permuted_covariates,
    with_permuted_errors,
)
from tracknoise.estimators.linear_window import Motion, Outcome, PointTracks, linear_tracks, outcome, scalar_variances
from tracknoise.inference.track_noise import TrackNoise

_NOISE = TrackNoise.isotropic
CASES: Mapping[str, PlantedNoise] = {
    "white": PlantedNoise(noise=_NOISE(first=0.3, white=0.3)),
    "walk": PlantedNoise(noise=_NOISE(walk=0.1)),
    "walk and white": PlantedNoise(noise=_NOISE(white=0.3, walk=0.1)),
    "mixed": PlantedNoise(noise=_NOISE(first=0.2, white=0.2, walk=0.08)),
    "drift": PlantedNoise(noise=_NOISE(first=0.1, white=0.2), bias_px_per_frame=(0.05, 0.0)),
    "texture": PlantedNoise(noise=_NOISE(first=0.2, white=0.3), texture_exponent=1.0),
    "student": PlantedNoise(noise=_NOISE(first=0.3, white=0.3), student_nu=4.0),
    "scales": PlantedNoise(noise=_NOISE(white=0.1, walk=0.05), track_nu=3.0),
    "common": PlantedNoise(noise=_NOISE(first=0.3, white=0.3), common_share=0.1),
}
Control = Callable[[Sequence[Problem], Beliefs], tuple[Sequence[Problem], Beliefs]]
CONTROLS: Mapping[str, tuple[str, tuple[str, ...], Control]] = {
    "N2": ("texture", ("1", "5", "6b"), lambda windows, beliefs: (with_permuted_covariates(windows), beliefs)),
    "N3": ("walk", ("1", "6"), lambda windows, beliefs: (with_permuted_errors(windows), beliefs)),
    "N5": ("drift", ("1", "7b"), lambda windows, beliefs: (windows, with_drift_reversed(beliefs))),
}


def main() -> None:
    options = _options()
    found: dict[str, dict[str, object]] = {}
    learned: dict[tuple[Motion, str], Beliefs] = {}
    for motion in Motion:
        for case in options.cases or CASES:
            training, tested = _windows(motion, CASES[case], options)
            beliefs = learned[motion, case] = learn(training, planted=CASES[case])
            summary = summarise(try_arms(tested, beliefs, arms=options.arms))
            found[f"{motion}, {case}"] = {
                "poses": summary.to_dicts(),
                "linear": _linear(tested, CASES[case].noise),
                "controls": _controls(case, tested, beliefs),
            }
            _print(motion, case, summary, found[f"{motion}, {case}"])
    if {"walk", "white"} <= set(options.cases or CASES):
        _print_other_tracker(options, learned)
    if options.out:
        options.out.write_text(json.dumps(found, indent=1))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.proof", description=__doc__.partition("\n")[0])
    parser.add_argument("--scenes", type=int, default=40, help="scenes; every second one trains")
    parser.add_argument("--windows", type=int, default=15, help="windows of each scene")
    parser.add_argument("--frames", type=int, default=11, help="frames of a window")
    parser.add_argument("--tracks", type=int, default=80, help="tracks of a window")
    parser.add_argument("--seed", type=int, default=0, help="of the first window; far apart for other windows")
    parser.add_argument("--cases", nargs="*", choices=list(CASES), help="by default all")
    parser.add_argument("--arms", nargs="*", choices=ALL_ARMS, default=list(ALL_ARMS), help="by default all")
    parser.add_argument("--out", type=Path, help="JSON file")
    return parser.parse_args()


def _windows(motion: Motion, planted: PlantedNoise, options: argparse.Namespace) -> tuple[list[Problem], list[Problem]]:
    """Windows of training scenes and of the others."""
    made = [
        simulated_problem(
            motion,
            planted,
            scene=f"scene {scene}",
            n_frames=options.frames,
            n_tracks=options.tracks,
            seed=options.seed + 1000 * scene + window,
        )
        for scene in range(options.scenes)
        for window in range(options.windows)
    ]
    cut = options.windows
    scenes = [made[start : start + cut] for start in range(0, len(made), cut)]
    training, tested = ([problem for scene in scenes[parity::2] for problem in scene] for parity in (0, 1))
    return training, tested


def _linear(windows: Sequence[Problem], noise: TrackNoise) -> dict[str, float]:
    """What linear algebra says of whole tracks and of one sigma on the same windows: ratios, and NEES without M_k."""
    one, whole, flat = (
        [_outcome(problem, noise, assumed) for problem in windows] for assumed in ("one", "whole", "flat")
    )
    return {
        "position_ratio": _ratio(whole, one, "position_m"),
        "rotation_ratio": _ratio(whole, one, "rotation_rad"),
        "nees_without_magnification": float(np.mean([found.nees_newest for found in flat])),
    }


def _outcome(problem: Problem, noise: TrackNoise, assumed: str) -> Outcome:
    window = [
        linear_tracks(problem.camera, problem.world_from_camera, PointTracks(group.frames, group.points))
        for group in problem.groups
    ]
    actual = whole_tracks(problem, noise)
    flat = [replace(part, magnification=np.ones_like(part.magnification)) for part in window]
    covariances = {
        "one": lambda: scalar_variances(window, 1.0),
        "whole": lambda: actual,
        "flat": lambda: [
            noise.covariance(part.magnification) + 1e-10 * np.eye(2 * part.magnification.shape[1]) for part in flat
        ],
    }
    return outcome(window, actual, covariances[assumed]())


def _ratio(those: Sequence[Outcome], others: Sequence[Outcome], name: str) -> float:
    logs = [np.log(getattr(a, name) / getattr(b, name)) for a, b in zip(those, others, strict=True)]
    return float(np.exp(np.mean(logs)))


def _controls(case: str, tested: Sequence[Problem], beliefs: Beliefs) -> dict[str, list[dict[str, object]]]:
    found = {}
    for name, (of, arms, change) in CONTROLS.items():
        if of == case:
            found[name] = summarise(try_arms(*change(tested, beliefs), arms=arms)).to_dicts()
    return found


def _print(motion: Motion, case: str, summary: pl.DataFrame, found: Mapping[str, object]) -> None:
    print(f"\n{motion}, {case}")
    for arm in ("6", "U"):
        print(sentence(summary, arm))
    print(table(summary))
    print("linear algebra:", found["linear"])
    for name, rows in found["controls"].items():
        print(f"control {name}")
        print(table(pl.DataFrame(rows)))


def table(summary: pl.DataFrame) -> str:
    rows = [f"{'arm':4} {'position':>22} {'rotation':>22} {'NEES newest':>22} {'NEES all':>22}"]
    for arm in summary["arm"].unique(maintain_order=True):
        of = {row["quantity"]: row for row in summary.filter(arm=arm).to_dicts()}
        names = ("position_ratio", "rotation_ratio", "nees_newest", "nees_all")
        rows.append(f"{arm:4} " + " ".join(f"{_interval(of[name]):>22}" for name in names))
    return "\n".join(rows)


def _interval(row: Mapping[str, float | None]) -> str:
    if row["low"] is None or row["high"] is None:
        return f"{row['value']:.3f}"
    return f"{row['value']:.3f} [{row['low']:.3f}, {row['high']:.3f}]"


def _print_other_tracker(options: argparse.Namespace, learned: Mapping[tuple[Motion, str], Beliefs]) -> None:
    """Control N4: the model of independent noise on tracks that walk."""
    for motion in Motion:
        _, tested = _windows(motion, CASES["walk"], options)
        beliefs = with_noise_of(learned[motion, "walk"], learned[motion, "white"])
        print(f"\n{motion}, control N4")
        print(table(summarise(try_arms(tested, beliefs, arms=("1", "6")))))


if __name__ == "__main__":
    main()
