"""How often a wrong truth is trusted where tracks are few: imported tracks, one tracker, nothing stated.

    python -m benchmarks.validity.sparse_truth RESULTS [--seeds N] [--tracks N ...] [--scenes N ...] [--kinds WORD ...]
        [--shares S ...] [--whole]

Cameras move by hand through random points, another way in each scene. One tracker follows a number of features with
white noise, a walk and outliers. The stated truth then gets an error of one of seven kinds, which makes a share of the
squared errors at ages up to 10, without outliers. `exact` has none. Each verdict is one line of RESULTS, a file of
JSON, and is not made again. Seeds are the outermost loop, so that what is there is a sample of all cells. The verdict
rests on bounds alone: the search for named faults takes most of the time, and makes no truth trusted. With `--whole` it
takes part.

Printed are, for each kind and share and number of tracks and scenes: how often each verdict was given, the mean bound,
and how often it holds the planted share.
"""

import argparse
import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.validity.rigid import CAMERA, Seen, observed, pose_noise, prepared
from benchmarks.validity.truth_verdicts import smoothed_poses
from tracknoise.experiments.geometry_tables import audit_samples, cameras_table, poses_table
from tracknoise.geometry.pose import PosePath
from tracknoise.geometry.projection import FrameGeometry
from tracknoise.inference.robust_fits import scales
from tracknoise.inference.units import NO_GROUPS
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.statistics.prepared import PreparedSequence, prepare_sequence
from tracknoise.tables.enumerations import Trust
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import empty
from tracknoise.tables.trust import AssessedTruth
from tracknoise.tables.truth_audit import AUDIT, AUDIT_CURVES, AuditTables
from tracknoise.truth_faults.assessment import ErrorSize, TruthEvidence, assess
from tracknoise.truth_faults.audit_samples import AuditSamples
from tracknoise.truth_faults.audit_selection import available
from tracknoise.truth_faults.audit_summary import usual_mistakes
from tracknoise.truth_faults.audit_tables import AuditedTables, read_samples, tables_of
from tracknoise.truth_faults.explained import DEPTHS, EVERY_FAULT, explained
from tracknoise.truth_faults.fault_parameters import Family
from tracknoise.truth_faults.pose_accuracy import pose_share
from tracknoise.truth_faults.pose_errors import CUT, rigid_tables

Array = NDArray[np.float64]

FRAMES, RATE_HZ = 40, 30.0
TRACKER = "lucas-kanade"
TRACKS, SCENES, SHARES = (60, 110, 150, 200, 320), (3, 8), (0.15, 0.4)
NOISE_PX, WALK_PX = 0.3, 0.06
OUTLIERS, WRONG_PX = 0.02, 8.0
_ROUNDS, _CLOSE = 10, 0.03


def by_hand(rng: np.random.Generator) -> Array:
    """Poses (n, 4, 4) of a hand that turns by up to a degree and moves by up to 5 cm per frame."""
    time = np.arange(FRAMES)[:, None] / RATE_HZ
    speed, phase = rng.uniform(1.5, 6.0, (2, 6)), rng.uniform(0.0, 2.0 * np.pi, (2, 6))
    size = np.repeat([0.25, 0.08], 3) * rng.uniform(0.5, 1.5, (2, 6))
    moved = sum(size[one] * np.sin(speed[one] * time + phase[one]) for one in (0, 1))
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(moved[:, 3:]).as_matrix()
    poses[:, :3, 3] = moved[:, :3]
    return poses


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Exact poses, and tracks with the noise of a tracker."""

    poses: Array
    seen: Seen

    @classmethod
    def of(cls, tracks: int, rng: np.random.Generator) -> "Scene":
        """A scene with so many features in each frame."""
        poses = by_hand(rng)
        seen = observed(poses, rng, features=tracks, noise_px=NOISE_PX)
        age = (seen.frame - seen.first)[:, None]
        steps = rng.normal(0.0, WALK_PX, (int(seen.track.max()) + 1, FRAMES, 2))
        walk = np.cumsum(steps, axis=1)[seen.track, age[:, 0]] - steps[seen.track, 0]
        wrong = (rng.random(len(age)) < OUTLIERS)[:, None] * rng.normal(0.0, WRONG_PX, seen.uv.shape)
        return cls(poses, replace(seen, uv=seen.uv + np.where(age > 0, walk + wrong, 0.0)))

    def shift(self, stated: "Stated") -> Array:
        """How far an error of the truth moves true positions, (n, 2), px."""
        wrong = replace(self.seen, depth_m=stated.depth_m).true_uv(stated.poses)
        return np.asarray(wrong - self.seen.true_uv(self.poses))


@dataclass(frozen=True, slots=True, eq=False)
class Stated:
    """Stated poses, and the stated depth of each row."""

    poses: Array
    depth_m: Array


Degrade = Callable[[Scene, float, np.random.Generator], Stated]


def moved(law: str) -> Degrade:
    """Noise of poses of a size in degrees, and of 6 cm for each degree."""

    def degrade(scene: Scene, size: float, rng: np.random.Generator) -> Stated:
        noise = pose_noise(law, size, 0.06 * size, FRAMES, rng)
        return Stated(scene.poses @ noise, scene.seen.depth_m)

    return degrade


def late(scene: Scene, size: float, rng: np.random.Generator) -> Stated:
    """Poses that are late by a number of frames."""
    frames = np.arange(FRAMES, dtype=np.float64)
    return Stated(PosePath(frames, scene.poses).at(frames - size), scene.seen.depth_m)


def stretched(scene: Scene, size: float, rng: np.random.Generator) -> Stated:
    """Positions times 1 + size about the first."""
    poses = scene.poses.copy()
    poses[:, :3, 3] = poses[0, :3, 3] + (1.0 + size) * (poses[:, :3, 3] - poses[0, :3, 3])
    return Stated(poses, scene.seen.depth_m)


def disparity(scene: Scene, size: float, rng: np.random.Generator) -> Stated:
    """Inverse depths plus size, 1/m."""
    return Stated(scene.poses, 1.0 / (1.0 / scene.seen.depth_m + size))


def noisy_depth(power: int) -> Degrade:
    """Errors of depths of size Z^power, of each point by itself, which no comparison of depth maps shows."""

    def degrade(scene: Scene, size: float, rng: np.random.Generator) -> Stated:
        depth, track = scene.seen.depth_m, scene.seen.track
        noise = rng.standard_normal(int(track.max()) + 1)[track]
        return Stated(scene.poses, np.maximum(depth + size * depth**power * noise, 0.05 * depth))

    return degrade


def smoothed(scene: Scene, size: float, rng: np.random.Generator) -> Stated:
    """With smoothed poses."""
    return Stated(smoothed_poses(scene.poses, size), scene.seen.depth_m)


EXACT = "exact"
KINDS: Mapping[str, tuple[Degrade, float]] = {
    "pose walk": (moved("walk"), 0.01),
    "pose jitter": (moved("white"), 0.01),
    "late poses": (late, 0.05),
    "positions scaled": (stretched, 0.01),
    "disparity": (disparity, 0.002),
    "depth noise": (noisy_depth(2), 0.005),
    "smoothed poses": (smoothed, 0.1),
}
"""How each is planted, and the size at which the search begins."""


def truths(kind: str, scenes: Sequence[Scene], size: float, seed: int) -> list[Stated]:
    """The stated truth of each scene."""
    if kind == EXACT:
        return [Stated(scene.poses, scene.seen.depth_m) for scene in scenes]
    rngs = [np.random.default_rng([seed, number, 1]) for number in range(len(scenes))]
    return [KINDS[kind][0](scene, size, rng) for scene, rng in zip(scenes, rngs, strict=True)]


def planted(scenes: Sequence[Scene], stated: Sequence[Stated]) -> float:
    """Share of the squared errors, without outliers as in (pose.share), that the stated truth makes."""
    parts = []
    for scene, one in zip(scenes, stated, strict=True):
        age = scene.seen.frame - scene.seen.first
        near = (age > 0) & (age <= REFERENCE_AGE)
        own = (scene.seen.uv - scene.seen.true_uv(scene.poses))[near]
        shift = scene.shift(one)[near]
        known = np.isfinite(shift).all(axis=1)
        parts.append((age[near][known], shift[known], own[known] - shift[known]))
    age, shift, error = (np.concatenate(column) for column in zip(*parts, strict=True))
    scale = scales(age.astype(np.intp), error)
    weight = (np.hypot(*error.T) <= CUT * scale) / scale**2
    return float((weight * np.sum(shift**2, axis=1)).sum() / (weight * np.sum(error**2, axis=1)).sum())


def degraded(kind: str, scenes: Sequence[Scene], share: float, seed: int) -> tuple[list[Stated], float]:
    """The stated truths whose errors are about this share of all, and what they are."""
    if kind == EXACT:
        return truths(kind, scenes, 0.0, seed), 0.0
    size, low, high = KINDS[kind][1], 0.0, np.inf
    for _ in range(_ROUNDS):
        stated = truths(kind, scenes, size, seed)
        found = planted(scenes, stated)
        if abs(found - share) <= _CLOSE * share:
            break
        low, high = (size, high) if found < share else (low, size)
        part = min(max(found, 1e-6), 0.95)
        size *= float(np.clip(np.sqrt(share / (1.0 - share) * (1.0 - part) / part), 0.05, 20.0))
        if not low < size < high:
            size = float(np.sqrt(low * high))
    return stated, found


def prepared_scene(name: str, scene: Scene, stated: Stated) -> PreparedSequence:
    """The tables of a scene under its name."""
    made = prepared([replace(scene.seen, depth_m=stated.depth_m)], stated.poses)
    named = (
        table.with_columns(scene=pl.lit(name, table.schema["scene"])) for table in (made.observations, made.tracks)
    )
    return prepare_sequence(*named)


def recording(name: str, poses: Array) -> RecordedSequence:
    """A scene without images."""
    blank = np.zeros((CAMERA.height, CAMERA.width), np.uint8)
    return RecordedSequence(
        id=SequenceId("made", name),
        source=name,
        camera=CAMERA,
        world_from_camera=poses,
        images=lambda index: blank,
        timestamps_s=np.arange(len(poses)) / RATE_HZ,
    )


def audited(samples: AuditSamples | str, *, whole: bool) -> AuditTables:
    """The audit of the tracks, or of it only what the truth can explain at most."""
    if whole or isinstance(samples, str):
        return tables_of(samples, "made")
    found = explained(samples, available(samples))
    shares = {EVERY_FAULT: found.faults, DEPTHS: found.depths}
    rows = [
        {"dataset": "made", "family": str(Family.at_most), "parameter": name, "component": TRACKER, "unit": ""}
        | {"gain": share.value, "gain_low": share.low, "gain_high": share.high}
        for name, share in shares.items()
        if share is not None
    ]
    return AuditTables(pl.DataFrame(rows, schema=dict(AUDIT)), empty(AUDIT_CURVES))


def verdict(scenes: Sequence[Scene], stated: Sequence[Stated], *, whole: bool) -> dict[str, Any]:
    """The verdict on these truths, its bound, and the shares that it rests on."""
    rigid, seen, errors = [], [], []
    for number, (scene, one) in enumerate(zip(scenes, stated, strict=True)):
        name = f"scene {number}"
        sequence, tables = recording(name, one.poses), prepared_scene(name, scene, one)
        geometry = FrameGeometry(one.poses, (CAMERA,), np.zeros(FRAMES, np.intp))
        rigid.append(rigid_tables(tables, geometry, witnesses=[TRACKER])["rigid"])
        samples = audit_samples(sequence, tables, "birth")
        seen.append(AuditedTables(samples, cameras_table(sequence, FRAMES), poses_table(sequence, FRAMES)))
        errors.append(tables.observations.filter(pl.col("age") == REFERENCE_AGE, truth="valid"))
    found = audited(read_samples(seen, NO_GROUPS), whole=whole)
    oldest = pl.concat(errors)
    size = ErrorSize(REFERENCE_AGE, float(np.sqrt((oldest["du_px"] ** 2 + oldest["dv_px"] ** 2).mean())))
    evidence = TruthEvidence(
        audit=found.audit,
        pose_shares=pose_share(rigid),
        sizes={TRACKER: size},
        curves=found.audit_curves,
        mistakes=usual_mistakes(found.audit),
    )
    table = assess(evidence, "made")
    causes = table.filter(pl.col("tracker") == TRACKER).drop_nulls("share")
    shares = {row["cause"]: [round(row[name], 4) for name in ("share", "low", "high")] for row in causes.to_dicts()}
    truth = AssessedTruth(table)
    return {"verdict": str(truth.verdict.verdict), "bound": truth.explained_share(TRACKER), **shares}


KEYS = ("seed", "tracks", "scenes", "kind", "share")
Key = tuple[int, int, int, str, float]


def results(
    cells: Sequence[tuple[int, int]], faults: Sequence[tuple[str, float]], seeds: range, done: set[Key], *, whole: bool
) -> Iterator[dict[str, Any]]:
    """One verdict after the other that is not there yet. `cells`: tracks and scenes. `faults`: with their shares."""
    for seed, (n_tracks, n_scenes) in product(seeds, cells):
        left = [fault for fault in faults if (seed, n_tracks, n_scenes, *fault) not in done]
        rngs = [np.random.default_rng([seed, n_tracks, number]) for number in range(n_scenes if left else 0)]
        made = [Scene.of(n_tracks, rng) for rng in rngs]
        for kind, share in left:
            stated, found = degraded(kind, made, share, seed)
            key = dict(zip(KEYS, (seed, n_tracks, n_scenes, kind, share), strict=True))
            yield {**key, "planted": round(found, 4), **verdict(made, stated, whole=whole)}


def summary(found: pl.DataFrame) -> Iterator[str]:
    """A line for each cell."""
    for keys, part in found.group_by("kind", "share", "tracks", "scenes", maintain_order=True):
        counts = Counter(part["verdict"])
        told = ", ".join(f"{name} {counts[name]}" for name in Trust if counts[name])
        bound = part["bound"].fill_null(1.0)
        held = int((bound >= part["planted"]).sum())
        yield (
            f"{keys[0]} {keys[1]:.0%}, {keys[2]} x {keys[3]}: planted {part['planted'].mean():.3f}; {told};"
            f" bound {bound.mean():.3f}, holds it in {held} of {len(part)}"
        )


def main() -> None:
    """Measure what is missing, and print the cells."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--tracks", type=int, nargs="*", default=TRACKS)
    parser.add_argument("--scenes", type=int, nargs="*", default=SCENES)
    parser.add_argument("--kinds", nargs="*", default=list(KINDS))
    parser.add_argument("--shares", type=float, nargs="*", default=SHARES)
    parser.add_argument("--whole", action="store_true", help="search for named faults too")
    given = parser.parse_args()
    lines = given.results.read_text().splitlines() if given.results.exists() else []
    rows = [json.loads(line) for line in lines]
    done = {tuple(row[name] for name in KEYS) for row in rows}
    faults = [(kind, share) for kind in given.kinds for share in (given.shares if kind != EXACT else [0.0])]
    cells = [*product(given.tracks, given.scenes)]
    with given.results.open("a") as file:
        for row in results(cells, faults, range(given.first, given.first + given.seeds), done, whole=given.whole):
            print(json.dumps(row), file=file, flush=True)
            rows.append(row)
    for line in summary(pl.DataFrame(rows, infer_schema_length=None).sort("kind", "share", "tracks", "scenes")):
        print(line)


if __name__ == "__main__":
    main()
