"""NEES with the gate that is set, and of one pose from known points: what a model says, and what poses do.

    python -m benchmarks.validity.pose_trials [--scenes N] [--poses N] [--worlds NAME ...]

A model is fitted to scenes of `benchmarks.validity.sigma_worlds`. Poses are of other scenes of that population, solved
for apart from `tracknoise.estimators`: windows by least squares of all poses and points with the tracks that pass the
gate, single poses by repeated weighting of at least 30 points that were first seen 1 to 10 frames ago.
"""

import argparse

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.stats import chi2

from benchmarks.validity.sigma_to_set import LENGTH
from benchmarks.validity.sigma_worlds import FOCAL, FRAMES, WORLDS, Scene, Track, World, eliminated, scene
from tracknoise.analysis.condition_units import units_of
from tracknoise.estimators.advice import track_gate
from tracknoise.estimators.components import COLUMNS, fit_components
from tracknoise.estimators.equivalents import equivalents, gates
from tracknoise.estimators.fit import fit_tails
from tracknoise.estimators.kernels import drawn_windows
from tracknoise.estimators.model import Equivalent, KnownPoints, Landmark, LossKind, Purpose, TriedGate
from tracknoise.estimators.pose_trials import known_points, tried_gate
from tracknoise.estimators.training import windows
from tracknoise.inference.units import NO_GROUPS
from tracknoise.tables.schema import WINDOW_NOISE, empty

Array = NDArray[np.float64]
AGES, LEAST_POINTS = 10, 30
EACH, DENSE = 4, 300
"""Poses of each scene, and its tracks."""


def fitted(
    world: World, n_scenes: int, random: np.random.Generator
) -> tuple[Equivalent, TriedGate | None, KnownPoints]:
    """Sigma and gate for windows, what the trial of the gate says, and sigma for known points with Cauchy's loss."""
    scenes = [scene(world, random) for _ in range(n_scenes)]
    names = [f"{place:02}" for place in range(n_scenes)]
    table = pl.concat([own.sums(name, random, world.nu) for own, name in zip(scenes, names, strict=True)])
    components = fit_components(
        units_of(table.drop("block"), table, points=["product", "age"], columns=COLUMNS), level=0.95
    )
    recordings = [own.recording(name) for own, name in zip(scenes, names, strict=True)]
    some = windows(recordings, speed=1, length=LENGTH, lifetimes=recordings[0].lifetimes)
    limits = gates(empty(WINDOW_NOISE), LENGTH, limit_px=99.0, window=some.each[0], noise=components.noise)
    found = equivalents(components, some, length=LENGTH, speed=1, gates=limits)
    (newest,) = (one for one in found if (one.landmark, one.purpose) == (Landmark.FREE, Purpose.NEWEST_POSE))
    tracks = pl.concat([own.tracks_table(name, random, world.nu) for own, name in zip(scenes, names, strict=True)])
    drawn = list(drawn_windows(tracks, some, 99.0))
    tried = tried_gate(drawn, newest, dataset="made", groups=NO_GROUPS, level=0.95)
    samples = tracks.filter(pl.col("age") > 0).with_columns(at=pl.col("age"))
    tails = fit_tails(samples, components.noise, last_age=FRAMES)
    points = known_points(
        tracks, components.noise, tails, lengths=[AGES], speed=1, most_px=99.0, groups=NO_GROUPS, level=0.95
    )
    return newest, tried, next(one for one in points if one.kernel is LossKind.CAUCHY)


def gated_nees(own: Scene, nu: float, sigma: float, factor: float, random: np.random.Generator) -> float | None:
    """NEES of the newest pose of one window, from the tracks that pass the gate."""
    start = int(random.integers(0, FRAMES - LENGTH + 1))
    parts = eliminated(own, start, LENGTH)
    if parts is None:
        return None
    size = 6 * LENGTH - 7
    information, gradient = np.zeros((size, size)), np.zeros(size)
    for track, at, left, span in parts:
        error = own.drawn(track, random, nu)[at].ravel()
        seen = error / sigma
        squares = np.square(seen - span @ (span.T @ seen)).sum()
        if squares <= factor * chi2.ppf(0.95, len(error) - 3):
            information += left.T @ left
            gradient += left.T @ error
    if np.linalg.cond(information) > 1e12:
        return None
    claimed = np.linalg.inv(information)
    error, newest = (claimed @ gradient)[-5:], claimed[-5:, -5:]
    return float(error @ np.linalg.solve(newest, error) / 5.0 / sigma**2)


def pose_nees(own: Scene, nu: float, points: KnownPoints, random: np.random.Generator) -> float | None:
    """NEES of one pose from points that were first seen 1 to 10 frames ago, under Cauchy's loss."""
    frame = int(random.integers(AGES, FRAMES))
    seen = [one for one in own.tracks if one.frames[0] < frame <= min(one.frames[-1], one.frames[0] + AGES)]
    if len(seen) < LEAST_POINTS:
        return None
    by_pose = np.stack([_of_pose(own.poses[frame], one) for one in seen])
    errors = np.stack([own.drawn(one, random, nu)[frame - one.frames[0]] for one in seen])
    move, information = np.zeros(6), np.eye(6)
    for _ in range(30):
        left = errors - by_pose @ move
        weights = 1.0 / (1.0 + np.square(left).sum(axis=1) / points.knee_px**2)
        information = np.einsum("nij,n,nik->jk", by_pose, weights, by_pose)
        move = move + np.linalg.solve(information, np.einsum("nij,n,ni->j", by_pose, weights, left))
    return float(move @ information @ move / 6.0 / points.sigma.value**2)


def _of_pose(world_from_camera: Array, track: Track) -> Array:
    """(2, 6): of the image by turns and moves of the camera."""
    x, y, z = world_from_camera[:3, :3].T @ (track.point - world_from_camera[:3, 3])
    by_point = FOCAL / z * np.array([[1.0, 0.0, -x / z], [0.0, 1.0, -y / z]])
    turned = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.hstack([by_point @ turned, -by_point @ world_from_camera[:3, :3].T])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=24)
    parser.add_argument("--poses", type=int, default=600)
    parser.add_argument("--worlds", nargs="+", choices=WORLDS, default=["white", "both", "Student's tracks"])
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    for name in given.worlds:
        random, world = np.random.default_rng([given.seed, list(WORLDS).index(name)]), WORLDS[name]
        newest, tried, points = fitted(world, given.scenes, random)
        factor, gated, single = track_gate(newest.gate_80, LENGTH), [], []
        for number in range(given.poses):
            if number % EACH == 0:
                own = scene(world, random, n_tracks=DENSE)
            gated.append(gated_nees(own, world.nu, newest.sigma.value, factor, random))
            single.append(pose_nees(own, world.nu, points, random))
        said = (
            "not tried" if tried is None else f"{tried.nees.value:.2f} ({tried.nees.low:.2f} to {tried.nees.high:.2f})"
        )
        shown = [np.array([one for one in values if one is not None]) for values in (gated, single)]
        means = [f"{one.mean():.3f} +- {one.std() / len(one) ** 0.5:.3f}" for one in shown]
        print(
            f"{name}: gate x {factor:.3f}, NEES said {said}, found {means[0]}; known points: NEES {means[1]}",
            flush=True,
        )


if __name__ == "__main__":
    main()
