"""What the verdict on a truth is where a known fault of a known share is planted in simulated recordings.

    python -m benchmarks.validity.truth_verdicts [--seeds N] [--frames N] [--only WORD ...] [--alone] [--cache FILE]
        [--evidence]

Four scenes of each of the `--worlds` are filmed at 320 x 240 px and 30 Hz, and followed once by Lucas-Kanade and by
correspondence. Their stated truth is then degraded for each seed, and the same tracks are measured again, with replayed
trackers. The size of each fault is such that it makes about 5, 15 and 40 % of the second moment of the errors of
Lucas-Kanade at ages up to 10. Scenes take turns. Exact recordings have no seeds: each scene counts once.

Printed are for each cell, over seeds: the planted share, of errors without outliers as in (pose.share) and of all;
what an exact truth removes; how often each verdict is given where nothing is stated, and where the accuracy of the
truth is stated rightly; the upper bound of what the truth explains of the errors of Lucas-Kanade, and how often it
holds the planted share; and with `--evidence` also the pose share of each tracker with its quantiles and the part of
its lower bounds that are above 0, how often each fault is named and by how much it explains, and the gain of all
parameters together. With `--alone`, Lucas-Kanade is also taken alone.
"""

import argparse
import pickle
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.spatial.transform import Rotation

from benchmarks.validity.rigid import pose_noise
from tracknoise.experiments.geometry_tables import (
    audit_samples,
    cameras_table,
    depth_repeats_table,
    frame_geometry,
    poses_table,
)
from tracknoise.experiments.measure import Measurement, measure
from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import PosePath
from tracknoise.inference.robust_fits import scales
from tracknoise.inference.units import NO_GROUPS
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.sequence import Sequence as Recording
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.statistics.truth_errors import truth_floor
from tracknoise.tables.enumerations import Trust, TruthCause
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.trust import AssessedTruth, TruthVerdict
from tracknoise.tables.truth_audit import AuditTables
from tracknoise.trackers.tracker import Frame, SequenceContext, Step, Tracker, TrackerSettings
from tracknoise.trackers.tracker_registry import make_tracker
from tracknoise.truth.accuracies import AccuracyRule
from tracknoise.truth_faults.assessment import ErrorSize, TruthEvidence, assess
from tracknoise.truth_faults.audit_summary import usual_mistakes
from tracknoise.truth_faults.audit_tables import AuditedTables, read_samples, tables_of
from tracknoise.truth_faults.fault_parameters import FAULTS as PARAMETERS
from tracknoise.truth_faults.fault_parameters import Family
from tracknoise.truth_faults.pose_accuracy import pose_share
from tracknoise.truth_faults.pose_errors import CUT, rigid_tables

Array = NDArray[np.float64]

TRACKERS = ("lucas-kanade", "correspondence")
SHARES = (0.05, 0.15, 0.4)
LARGE = 0.1
"""Part of the squared errors from which on a fault is to be named."""
RATE_HZ = 30.0
_ROUNDS, _CLOSE = 12, 0.1
"""Most steps to the size of a fault, and how far its share may be from the one that is wanted, as a part of that."""
UNKNOWN = TruthAccuracy()
EXACT = TruthAccuracy(
    rotation_white_deg=0.0, translation_white_m=0.0, depth_m=0.0, depth_relative=0.0, clock_ms=0.0, focal_relative=0.0
)


@dataclass(eq=False)
class Recorded:
    """Settings of a tracker that keeps what another one reports."""

    settings: TrackerSettings
    steps: list[Step]
    kind = "recorded"

    def start(self, context: SequenceContext) -> Tracker:
        """Start the other tracker."""
        self._tracker = self.settings.start(context)
        return self

    def step(self, frame: Frame) -> Step:
        """Track, and keep the step."""
        self.steps.append(self._tracker.step(frame))
        return self.steps[-1]


@dataclass(frozen=True, eq=False)
class Replayed:
    """Settings of a tracker that reports what another one did."""

    steps: Sequence[Step]
    kind = "replayed"

    def start(self, context: SequenceContext) -> Tracker:
        """It needs nothing of the sequence."""
        return self

    def step(self, frame: Frame) -> Step:
        """The step of the frame."""
        return self.steps[frame.index]


@dataclass(frozen=True, eq=False)
class Followed:
    """A recording that was followed: its exact truth, and the steps of the trackers."""

    name: str
    camera: CameraModel
    poses: Array
    depths: tuple[Array, ...]
    valid: tuple[NDArray[np.bool_], ...]
    steps: Mapping[str, tuple[Step, ...]]

    def stated(self, poses: Array, depths: Sequence[Array]) -> Recording:
        """The recording with another truth, and without its images."""
        maps = [DepthMap(np.where(valid, depth, 1.0), valid) for depth, valid in zip(depths, self.valid, strict=True)]
        blank = np.zeros((self.camera.height, self.camera.width), np.uint8)
        return RecordedSequence(
            id=SequenceId("simulated", self.name),
            source=self.name,
            camera=self.camera,
            world_from_camera=poses,
            images=lambda index: blank,
            depths=maps.__getitem__,
            timestamps_s=np.arange(len(poses)) / RATE_HZ,
        )

    def measured(self, poses: Array, depths: Sequence[Array], accuracy: TruthAccuracy) -> Measurement:
        """The tracks against this truth."""
        trackers = {name: Replayed(steps) for name, steps in self.steps.items()}
        rule = AccuracyRule(accuracy, shipped=False)
        return measure(self.stated(poses, depths), trackers, truth="birth", accuracy=rule)


def by_hand(poses: Array) -> Array:
    """Poses with rotations of a hand that shakes, up to 1.5 degrees per frame."""
    time = np.arange(len(poses))
    turned = np.column_stack([0.06 * np.sin(time / 3.0), 0.09 * np.sin(time / 4.5 + 1.0), 0.04 * np.cos(time / 5.0)])
    shaken = poses.copy()
    shaken[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_rotvec(turned).as_matrix()
    return shaken


def followed(motion: str, frames: int, seed: int) -> Followed:
    """Film and follow one scene."""
    options = {"motions": [motion.removeprefix("shaken ")], "frames": frames, "width": 320, "height": 240, "seed": seed}
    sequence = open_sequence("simulated", imaging={"rate_hz": RATE_HZ}, **options)
    if motion.startswith("shaken "):
        sequence = replace(sequence, world_from_camera=by_hand(sequence.world_from_camera))
    trackers = {name: Recorded(make_tracker(name, {}), []) for name in TRACKERS}
    measure(sequence, trackers, truth="birth")
    maps = [sequence.depth(index) for index in range(frames)]
    return Followed(
        motion,
        sequence.camera,
        sequence.world_from_camera,
        tuple(np.asarray(one.depth_m, dtype=np.float64) for one in maps),
        tuple(np.asarray(one.valid) for one in maps),
        {name: tuple(one.steps) for name, one in trackers.items()},
    )


TOGETHER, ALONE = "both trackers", f"{TRACKERS[0]} alone"
MOTIONS = ("arvr", "shaken arvr", "forward", "sideways")


def scenes(frames: int, worlds: int, cache: Path | None) -> list[Followed]:
    """The scenes, from the cache where it has them."""
    if cache is not None and cache.is_file():
        return pickle.loads(cache.read_bytes())
    made = [followed(motion, frames, seed) for seed in range(worlds) for motion in MOTIONS]
    if cache is not None:
        cache.write_bytes(pickle.dumps(made))
    return made


Truth = tuple[Array, Sequence[Array]]
Degrade = Callable[[Followed, float, np.random.Generator], Truth]


def moved(law: str) -> Degrade:
    """Noise of poses of a size in degrees, and of 6 cm for each degree."""

    def degrade(scene: Followed, size: float, rng: np.random.Generator) -> Truth:
        return scene.poses @ pose_noise(law, size, 0.06 * size, len(scene.poses), rng), scene.depths

    return degrade


def late(scene: Followed, size: float, rng: np.random.Generator) -> Truth:
    """Poses that are late by a number of frames."""
    frames = np.arange(len(scene.poses), dtype=np.float64)
    return PosePath(frames, scene.poses).at(frames - size), scene.depths


def stretched(scene: Followed, size: float, rng: np.random.Generator) -> Truth:
    """Positions times 1 + size about the first."""
    poses = scene.poses.copy()
    poses[:, :3, 3] = poses[0, :3, 3] + (1.0 + size) * (poses[:, :3, 3] - poses[0, :3, 3])
    return poses, scene.depths


def disparity(scene: Followed, size: float, rng: np.random.Generator) -> Truth:
    """Inverse depths plus size, 1/m."""
    return scene.poses, [1.0 / (1.0 / depth + size) for depth in scene.depths]


def noisy_depth(scene: Followed, size: float, rng: np.random.Generator) -> Truth:
    """Depth noise of size Z^2, correlated over a few pixels, independent from frame to frame."""
    noise = gaussian_filter(rng.standard_normal((len(scene.depths), *scene.depths[0].shape)), (0.0, 2.0, 2.0))
    noise /= noise.std()
    return scene.poses, [
        np.maximum(depth + size * depth**2 * one, 0.05) for depth, one in zip(scene.depths, noise, strict=True)
    ]


def smoothed_poses(poses: Array, size: float) -> Array:
    """Poses, (n, 4, 4), plus size times their second difference, in steps of at most 1/4."""
    passes = max(1, int(np.ceil(size / 0.25)))
    for _ in range(passes):
        before, after = (poses[np.clip(np.arange(len(poses)) + step, 0, len(poses) - 1)] for step in (-1, 1))
        turned = sum(
            Rotation.from_matrix(np.swapaxes(poses[:, :3, :3], 1, 2) @ other[:, :3, :3]).as_rotvec()
            for other in (before, after)
        )
        changed = poses.copy()
        changed[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_rotvec(size / passes * turned).as_matrix()
        changed[:, :3, 3] += size / passes * (before[:, :3, 3] + after[:, :3, 3] - 2.0 * poses[:, :3, 3])
        poses = changed
    return poses


def smoothed(scene: Followed, size: float, rng: np.random.Generator) -> Truth:
    """With `smoothed_poses`."""
    return smoothed_poses(scene.poses, size), scene.depths


def per_frame_m(scene: Followed) -> float:
    """Distance from frame to frame along an axis."""
    return float(np.sqrt(np.mean(np.diff(scene.poses[:, :3, 3], axis=0) ** 2)))


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of the truth: how a size of it is planted, the size at which it begins, and what states it rightly."""

    degrade: Degrade
    small: float
    accuracy: Callable[[Followed, float], TruthAccuracy] = lambda scene, size: UNKNOWN


FAULTS: Mapping[str, Fault] = {
    "pose walk": Fault(
        moved("walk"),
        0.01,
        lambda scene, size: TruthAccuracy(
            rotation_deg_per_sqrt_frame=size, translation_m_per_sqrt_frame=0.06 * size, depth_m=0.0
        ),
    ),
    "pose jitter": Fault(
        moved("white"),
        0.01,
        lambda scene, size: TruthAccuracy(rotation_white_deg=size, translation_white_m=0.06 * size, depth_m=0.0),
    ),
    "late poses": Fault(late, 0.05, lambda scene, size: replace(EXACT, clock_ms=1000.0 * size / RATE_HZ)),
    "positions scaled": Fault(
        stretched, 0.01, lambda scene, size: replace(EXACT, translation_m_per_frame=size * per_frame_m(scene))
    ),
    "disparity": Fault(disparity, 0.001, lambda scene, size: replace(EXACT, depth_per_m=size)),
    "depth noise": Fault(noisy_depth, 0.001, lambda scene, size: replace(EXACT, depth_per_m=size)),
    "smoothed poses": Fault(smoothed, 0.1),
}


def near_errors(measured: Measurement, tracker: str) -> pl.DataFrame:
    """Visible observations of a tracker at ages up to `REFERENCE_AGE`."""
    rows = measured.observations.filter(
        pl.col("age").is_between(1, REFERENCE_AGE), pl.col("truth") == "valid", tracker=tracker
    )
    return rows.select("track", "frame", "age", "u_true_px", "v_true_px", "du_px", "dv_px")


def planted(exact: Measurement, stated: Measurement, tracker: str = TRACKERS[0]) -> tuple[float, float, float]:
    """Shares of the second moment that are due to the stated truth.

    Of errors without outliers as in (pose.share), of all errors, and the share of the first that goes if the truth is
    made exact. The last is smaller, or negative, where the tracker's own errors are opposite to those of the truth.
    """
    both = near_errors(stated, tracker).join(near_errors(exact, tracker), on=["track", "frame"], suffix="_exact")
    error = both.select("du_px", "dv_px").to_numpy()
    shift = both.select(
        pl.col("u_true_px") - pl.col("u_true_px_exact"), pl.col("v_true_px") - pl.col("v_true_px_exact")
    ).to_numpy()
    scale = scales(both["age"].to_numpy().astype(np.intp), error)
    inside = np.hypot(*error.T) <= CUT * scale
    weight = inside / scale**2
    own = both.select("du_px_exact", "dv_px_exact").to_numpy()
    of_truth, of_tracker, every = ((weight * np.sum(part**2, axis=1)).sum() for part in (shift, own, error))
    return float(of_truth / every), float(np.sum(shift**2) / np.sum(error**2)), float(1.0 - of_tracker / every)


def size_for(scene: Followed, exact: Measurement, fault: Fault, share: float) -> float:
    """Size of a fault that is about this share of the second moment.

    Displacements are nearly proportional to it, but where depths are wrong by more than themselves: then by halving.
    """
    size, low, high = fault.small, 0.0, np.inf
    for _ in range(_ROUNDS):
        found = planted(exact, scene.measured(*fault.degrade(scene, size, np.random.default_rng(0)), UNKNOWN))[0]
        if abs(found - share) <= _CLOSE * share:
            break
        low, high = (size, high) if found < share else (low, size)
        found = min(max(found, 1e-6), 0.95)
        size *= float(np.clip(np.sqrt(share / (1.0 - share) * (1.0 - found) / found), 0.05, 20.0))
        if not low < size < high:
            size = float(np.sqrt(low * high))
    return size


@dataclass(frozen=True, slots=True)
class Raw:
    """Verdicts by what is stated, the bound where nothing is, and what they are made of.

    Of the evidence: named faults and gains, pose shares, and what the stated accuracy explains.
    """

    verdicts: dict[str, TruthVerdict]
    bound: float | None
    named: dict[str, tuple[float, float, float]]
    shares: dict[tuple[str, str], tuple[float, float, float]]
    floor: float | None


def verdict_of(found: AuditTables, shares: pl.DataFrame, sizes: Mapping[str, ErrorSize]) -> Raw:
    """The verdict on the evidence, and the evidence as it is."""
    audit = found.audit
    bounds = ("gain", "gain_low", "gain_high")
    named = audit.filter(pl.col("rank").is_not_null(), family=str(Family.alone))
    tables = {}
    for name, is_stated in (("unstated", False), ("stated", True)):
        tables[name] = assess(
            TruthEvidence(
                audit=audit,
                pose_shares=shares,
                sizes={one: size if is_stated else replace(size, stated_px=None) for one, size in sizes.items()},
                curves=found.audit_curves,
                mistakes=usual_mistakes(audit),
            ),
            "simulated",
        )
    return Raw(
        {name: TruthVerdict.of(table) for name, table in tables.items()},
        AssessedTruth(tables["unstated"]).explained_share(TRACKERS[0]),
        {str(row["parameter"]): tuple(row[name] for name in bounds) for row in named.iter_rows(named=True)},
        {
            (row["tracker"], str(row["fitted_to"])): (row["share"], row["low"], row["high"])
            for row in shares.iter_rows(named=True)
        },
        _only(tables["stated"].filter(cause=str(TruthCause.stated), tracker=TRACKERS[0])["share"]),
    )


def _only(values: pl.Series) -> float | None:
    """The value of a series of at most one."""
    return None if values.is_empty() else float(values[0])


def size_of(measured: Measurement, tracker: str) -> ErrorSize:
    """Size of the errors of a tracker at `REFERENCE_AGE`, and of what the stated accuracy makes up to there."""
    error = near_errors(measured, tracker).filter(age=REFERENCE_AGE)
    floor = truth_floor(measured.floors).filter(
        pl.col("at") <= REFERENCE_AGE, tracker=tracker, source="all", axis="age"
    )
    stated = {age: np.sqrt(uu + vv) for age, uu, vv in floor.select("at", "floor_uu", "floor_vv").iter_rows()}
    error_px = float(np.sqrt((error["du_px"] ** 2 + error["dv_px"] ** 2).mean()))
    return ErrorSize(REFERENCE_AGE, error_px, stated or None)


def evidence(measured: Measurement, trackers: Sequence[str]) -> Raw:
    """Audit, pose share and floor of one measured recording, with some of its trackers."""
    sequence, n = measured.sequence, measured.n_frames
    prepared = measured.prepared
    rigid = rigid_tables(prepared, frame_geometry(sequence, n), witnesses=trackers)["rigid"]
    samples = audit_samples(sequence, prepared, "birth").filter(pl.col("tracker").is_in(trackers))
    repeats = depth_repeats_table(sequence, prepared)
    tables = AuditedTables(samples, cameras_table(sequence, n), poses_table(sequence, n), depth_repeats=repeats)
    found = tables_of(read_samples([tables], NO_GROUPS), "simulated")
    shares = pose_share([rigid.filter(pl.col("tracker").is_in(trackers))])
    if len(trackers) == 1:
        shares = shares.filter(fitted_to="own")
    return verdict_of(found, shares, {name: size_of(measured, name) for name in trackers})


@dataclass(frozen=True, slots=True)
class Cell:
    """A situation; without a fault the truth is exact."""

    fault: str | None
    share: float = 0.0

    @property
    def name(self) -> str:
        """Of the cell, from which `--only` chooses."""
        return "exact" if self.fault is None else f"{self.fault} {self.share:.0%}"


def cells() -> Iterator[Cell]:
    """All situations."""
    yield Cell(None)
    for share in SHARES:
        for fault in FAULTS:
            yield Cell(fault, share)


class Bench:
    """The scenes with their exact measurements, and the sizes of faults that were found for them."""

    def __init__(self, made: Sequence[Followed], used: Mapping[str, Sequence[str]]) -> None:
        self.made, self.used = made, used
        self.exact = [scene.measured(scene.poses, scene.depths, EXACT) for scene in made]
        self._sizes: dict[tuple[str, float, int], float] = {}

    def size(self, cell: Cell, place: int) -> float:
        """Size of the fault of a cell in a scene."""
        key = (str(cell.fault), cell.share, place)
        if key not in self._sizes:
            self._sizes[key] = size_for(self.made[place], self.exact[place], FAULTS[key[0]], cell.share)
        return self._sizes[key]

    def run(self, cell: Cell, seed: int) -> dict[str, Any]:
        """One recording of a cell: planted shares and evidence, of both trackers and of one."""
        place = seed % len(self.made)
        scene, exact = self.made[place], self.exact[place]
        measured, size, shares = exact, 0.0, (0.0, 0.0, 0.0)
        if cell.fault is not None:
            fault, size = FAULTS[cell.fault], self.size(cell, place)
            truth = fault.degrade(scene, size, np.random.default_rng(seed))
            measured = scene.measured(*truth, fault.accuracy(scene, size))
            shares = planted(exact, measured)
        return {
            "scene": scene.name,
            "size": size,
            "planted": shares,
            **{name: evidence(measured, trackers) for name, trackers in self.used.items()},
        }


def causes_in(text: str) -> Iterator[str]:
    """Causes that a sentence names, and those that it cannot distinguish from a bias of the trackers."""
    text, _, unclear = text.lower().partition(" an error of the ")
    known = {"motions of the poses": "poses lack", "constant faults": "constant faults", "depths": "errors of depths"}
    known |= {about.name: about.name for about in PARAMETERS.values()}
    known |= {"inverse depths": "inverse depths are off", "smoothing": "poses are smoothed", "jitter": "poses jitter"}
    known |= {"clock": "the clock of the poses"}
    yield from (name for name, part in known.items() if part in text)
    yield from (f"perhaps {name}" for name, part in known.items() if part in unclear)


def lines(cell: Cell, found: Sequence[Mapping[str, Any]], *, evidence: bool) -> Iterator[str]:
    """What is printed of a cell."""
    cut, of_all, undone = np.array([one["planted"] for one in found]).T
    among = f"{cut.min():.3f} to {cut.max():.3f}"
    yield f"{cell.name}: planted {cut.mean():.3f} ({among}), of all errors {of_all.mean():.3f}"
    yield f"    an exact truth removes {undone.mean():.3f} ({undone.min():.3f} to {undone.max():.3f})"
    floors = [one[TOGETHER].floor for one in found if one[TOGETHER].floor is not None]
    if floors:
        yield f"    stated accuracy: explains {np.mean(floors):.3f} up to age {REFERENCE_AGE}"
    for name in (TOGETHER, *({ALONE} & found[0].keys())):
        every = [one[name] for one in found]
        for stated in ("unstated", "stated"):
            counts = Counter(str(one.verdicts[stated].verdict) for one in every)
            told = ", ".join(f"{verdict} {counts[verdict]}" for verdict in Trust if counts[verdict])
            yield f"    {name}, {stated}: {told}"
        causes = [[*causes_in(one.verdicts["unstated"].text)] for one in every]
        named = ", ".join(f"{cause} {n}" for cause, n in Counter(chain.from_iterable(causes)).most_common())
        yield f"    {name}, unstated, names: {named or 'nothing'}"
        removed = [causes for causes, share in zip(causes, undone, strict=True) if share > LARGE]
        yield f"    {name}, unstated, names a cause in {sum(map(bool, causes))} of {len(causes)}; where an exact truth "
        yield f"        removes more than {LARGE:.0%}, in {sum(map(bool, removed))} of {len(removed)}"
        bounds = np.array([np.nan if one.bound is None else one.bound for one in every])
        yield f"    {name}, bound {np.nanmean(bounds):.3f}, holds the planted share in {(bounds >= cut).sum()}"
        if not evidence:
            continue
        for source in sorted({source for one in every for source in one.shares}):
            yield f"    {name}, share of {' by '.join(source)}: {_spread([one.shares.get(source) for one in every])}"
        faults = Counter(fault for one in every for fault in one.named)
        for fault, count in faults.most_common():
            gains = [one.named[fault] for one in every if fault in one.named]
            yield f"    {name}, {fault} named in {count} of {len(every)}: gain {_spread(gains)}"


def _spread(values: Sequence[tuple[float | None, ...] | None]) -> str:
    """Mean and quantiles of values, means of their bounds, and how often the lower bound is above 0."""
    known = np.array([one for one in values if one is not None], dtype=np.float64)
    if not len(known):
        return "unknown"
    low, median, high = np.quantile(known[:, 0], (0.1, 0.5, 0.9))
    bounds = f"bounds {np.nanmean(known[:, 1]):.3f}, {np.nanmean(known[:, 2]):.3f}"
    above = f"above 0 in {int((known[:, 1] > 0.0).sum())} of {len(known)}"
    return f"{known[:, 0].mean():.3f} (10, 50, 90 %: {low:.3f}, {median:.3f}, {high:.3f}), {bounds}, {above}"


def main() -> None:
    """Print the cells."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--frames", type=int, default=45)
    parser.add_argument("--worlds", type=int, default=1, help="scenes of each motion")
    parser.add_argument("--only", nargs="*", default=[""], help="cells whose names begin like this")
    parser.add_argument("--alone", action="store_true", help="take Lucas-Kanade alone as well")
    parser.add_argument("--cache", type=Path, help="where tracks are kept, of the same frames")
    parser.add_argument("--evidence", action="store_true", help="print what the verdicts are made of")
    given = parser.parse_args()
    used = {TOGETHER: TRACKERS, **({ALONE: TRACKERS[:1]} if given.alone else {})}
    bench = Bench(scenes(given.frames, given.worlds, given.cache), used)
    for cell in cells():
        if cell.name.startswith(tuple(given.only)):
            seeds = len(bench.made) if cell.fault is None else given.seeds
            for line in lines(cell, [bench.run(cell, seed) for seed in range(seeds)], evidence=given.evidence):
                print(line, flush=True)


if __name__ == "__main__":
    main()
