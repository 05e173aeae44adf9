"""How right errors are that are measured against poses refined by reference tracks, where stated poses are spoilt.

    python -m benchmarks.validity.refined_truth RESULTS --cache FOLDER [--seeds N] [--first N] [--scenes NAME ...]
        [--faults NAME ...] [--shares S ...] [--rotate] [--sigma]

Scenes of exact poses: simulated motions of 50 frames at 480 x 360 px and 30 Hz, and with `--tartanair FOLDER` the
sample of TartanAir v1 in it. Each is followed once by Lucas-Kanade, correspondence, dense flow, patches and a plain
OpenCV program, and by the reference tracks, and kept in `--cache`. With `--rotate`, each seed takes one of the scenes
and one of the shares, in turn. For each fault, share and seed, the truth is spoilt, as in
`benchmarks.validity.truth_verdicts`, so that it makes this share of the squared errors of Lucas-Kanade at ages up to
10. Nothing is stated of its accuracy. `nothing` spoils nothing. Where no size of a fault makes the share, there is no
run. Each scene, fault, share and seed is one line of RESULTS, a file of JSON, and is not made again.

Errors of each tracker are those of the visible observations that have a depth in all truths: by the exact truth, by the
stated one, by the refined one, and by poses from reference tracks of one kind alone. Core is 1.4826 times the median of
their absolute values, bias their median. Printed are the shares of values

- whose refined core (or RMS of errors up to 5 px) is within 10 % or .02 px of the exact truth's, and within 5 %;
- with `--sigma`, whose sigma to set in a filter (windows of 11 frames, newest pose right) is as near;
- whose refined core is further from the exact one than the stated core is, by more than .02 px;
- whose exact core (or RMS) is within the floor of the refined one, where refined poses lead;
- of pairs of trackers that references of one kind order as the exact truth does, leave undecided, or order wrongly.
"""

import argparse
import json
import pickle
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, product
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import cv2
import numpy as np
import polars as pl
from numpy.typing import NDArray

from benchmarks.validity.rigid import pose_noise
from benchmarks.validity.truth_verdicts import (
    FAULTS,
    RATE_HZ,
    Degrade,
    Followed,
    Recorded,
    Replayed,
    by_hand,
    noisy_depth,
)
from tracknoise.api.analyse import write_run
from tracknoise.estimators.advice import LEVEL
from tracknoise.estimators.fit import components_of, equivalents_of
from tracknoise.estimators.kernels import LENGTH
from tracknoise.estimators.model import Landmark, Purpose
from tracknoise.estimators.training import RunTruth, all_training_tables
from tracknoise.exceptions import TracknoiseError
from tracknoise.experiments.measure import Measurement, measure
from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.inference.robust_fits import scales
from tracknoise.measurement.reference_tracks import KINDS, reference_tracks, with_depths
from tracknoise.measurement.refined_poses import RefinedPoses, refined_by
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.sequence import Sequence as Recording
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import TruthStatus
from tracknoise.tables.store import RunFolder
from tracknoise.tables.trust import TruthVerdict
from tracknoise.trackers.features import Features, report
from tracknoise.trackers.tracker import Frame, SequenceContext, Step
from tracknoise.trackers.tracker_registry import make_tracker
from tracknoise.truth.accuracies import AccuracyRule
from tracknoise.truth.birth import BirthDepths
from tracknoise.truth.pose_adjustment import PoseAdjustment, ReferenceTracks
from tracknoise.truth.visibility import SequenceGeometry
from tracknoise.truth_faults.pose_errors import CUT

Array = NDArray[np.float64]

MOTIONS = ("arvr", "forward", "sideways", "shaken arvr")
WORLDS, FRAMES, WIDTH, HEIGHT = (1, 2), 50, 480, 360
AGES = (1, 10, 24)
SHARES = (0.15, 0.4, 0.9)
NOTHING, PROGRAM = "nothing", "opencv"
TRACKERS = ("lucas-kanade", "correspondence", "dense-flow", "patch")
EXACT, STATED, REFINED = "exact", "stated", "refined"
UNKNOWN = TruthAccuracy()
CLIP_PX, PER_MEDIAN = 5.0, 1.4826
NEAR, CLOSE_PX = 0.1, 0.02
_ROUNDS, _CLOSE, _FAR = 12, 0.05, 0.2


def jitter_and_walk(scene: Followed, size: float, rng: np.random.Generator) -> tuple[Array, Sequence[Array]]:
    """Both noises of poses, of a size in degrees, and of 6 cm for each degree."""
    noise = (pose_noise(law, size, 0.06 * size, len(scene.poses), rng) for law in ("white", "walk"))
    return scene.poses @ next(noise) @ next(noise), scene.depths


def noisy_disparity(scene: Followed, size: float, rng: np.random.Generator) -> tuple[Array, Sequence[Array]]:
    """Noise of inverse depths of a size in 1/m: to first order that of `noisy_depth`; 0 where no depth is left."""
    ones = tuple(np.ones_like(one) for one in scene.depths)
    factors = noisy_depth(replace(scene, depths=ones), size, rng)[1]
    inverse = [1.0 / depth + one - 1.0 for depth, one in zip(scene.depths, factors, strict=True)]
    return scene.poses, [np.where(one > 1e-3, 1.0 / np.maximum(one, 1e-3), 0.0) for one in inverse]


SPOILT: Mapping[str, tuple[Degrade, float]] = {
    "jitter and walk": (jitter_and_walk, 0.01),
    **{name: (fault.degrade, fault.small) for name, fault in FAULTS.items()},
    "depth noise": (noisy_disparity, 0.001),
}
"""How each fault is planted, and the size at which the search begins."""


class Program:
    """What a short program does with OpenCV: corners of Shi and Tomasi, Lucas-Kanade, new ones when few are left."""

    kind = PROGRAM

    def start(self, context: SequenceContext) -> "Program":
        """Begin without features."""
        self._before: NDArray[np.uint8] | None = None
        self._features, self._next = Features.begin(0, np.empty((0, 2))), 0
        return self

    def step(self, frame: Frame) -> Step:
        """Follow into the next image."""
        old, ended = self._features, np.zeros(len(self._features), np.int8)
        found = old
        if self._before is not None and len(old):
            points = old.uv.astype(np.float32)[:, None]
            moved, ok, _ = cv2.calcOpticalFlowPyrLK(self._before, frame.image, points, None)  # type: ignore[call-overload]
            inside = ((moved[:, 0] >= 0) & (moved[:, 0] < frame.size)).all(axis=1)
            alive = (ok[:, 0] == 1) & inside
            ended = np.where(alive, -1, 0).astype(np.int8)
            found = old.chosen(alive, moved[alive, 0].astype(np.float64))
        new = np.empty((0, 2))
        if len(found) < 300:
            free = np.full(frame.image.shape, 255, np.uint8)
            for u, v in np.rint(found.uv).astype(int).tolist():
                cv2.circle(free, (u, v), 8, 0, -1)
            corners = cv2.goodFeaturesToTrack(frame.image, 500 - len(found), 0.01, 8, mask=free)
            new = np.empty((0, 2)) if corners is None else corners[:, 0].astype(np.float64)
        begun = Features.begin(self._next, new, frame.index)
        self._next += len(new)
        self._features, self._before = found.joined(begun), frame.image.copy()
        response = np.full(len(new), np.nan, np.float32)
        return report(offered=old.ids, end=ended, matched=len(found), found=found, new=begun, response=response)


@dataclass(frozen=True, eq=False)
class Scene(Followed):
    """A followed recording, with its reference tracks."""

    references: ReferenceTracks
    seen: Mapping[str, ReferenceTracks]  # visible observations of each tracker, with exact depths
    cpu_s: Mapping[str, float]  # of the trackers together, and of the reference tracks


def filmed(name: str, tartanair: Path | None) -> Recording:
    """The images and the exact truth of a scene, in memory, without a statement about its accuracy."""
    if tartanair is not None and name == "tartanair":
        sequence = open_sequence("tartanair", tartanair)
    else:
        motion, seed = name.removeprefix("shaken ").rsplit(" ", 1)
        options: dict[str, Any] = {"motions": [motion], "frames": FRAMES, "width": WIDTH, "height": HEIGHT}
        sequence = open_sequence("simulated", seed=int(seed), imaging={"rate_hz": RATE_HZ}, **options)
        if name.startswith("shaken "):
            sequence = replace(sequence, world_from_camera=by_hand(sequence.world_from_camera))
    images = [sequence.image(index) for index in range(len(sequence))]
    return RecordedSequence(
        id=SequenceId("made", name),
        source=name,
        camera=sequence.camera,
        world_from_camera=sequence.world_from_camera,
        images=images.__getitem__,
        depths=[sequence.depth(index) for index in range(len(sequence))].__getitem__,
        timestamps_s=np.arange(len(images)) / RATE_HZ,
    )


def made(name: str, tartanair: Path | None) -> Scene:
    """Film and follow one scene."""
    sequence = filmed(name, tartanair)
    recorded = {one: Recorded(make_tracker(one, {}), []) for one in TRACKERS}
    recorded[PROGRAM] = Recorded(Program(), [])
    begin = process_time()
    measured = measure(sequence, recorded, truth="birth")
    middle = process_time()
    references = reference_tracks(sequence, len(sequence))
    maps = [sequence.depth(index) for index in range(len(sequence))]
    return Scene(
        name=name,
        camera=sequence.camera,
        poses=sequence.world_from_camera,
        depths=tuple(np.asarray(one.depth_m, dtype=np.float32) for one in maps if one is not None),
        valid=tuple(np.asarray(one.valid) for one in maps if one is not None),
        steps={name: tuple(one.steps) for name, one in recorded.items()},
        references=references,
        seen={one: visible(measured, one, sequence) for one in recorded},
        cpu_s={"measured": middle - begin, "references": process_time() - middle},
    )


def visible(measured: Measurement, tracker: str, sequence: Recording) -> ReferenceTracks:
    """Observations of a tracker that the exact truth sees."""
    rows = measured.observations.filter(pl.col("truth").is_in(["valid"]) | (pl.col("age") == 0), tracker=tracker)
    track, frame, age = (rows[name].to_numpy().astype(np.intp) for name in ("track", "frame", "age"))
    uv = rows.select("u_px", "v_px").to_numpy()
    births, later = np.flatnonzero(age == 0), np.flatnonzero(age > 0)
    births = births[np.isin(track[births], track[later])]
    births = births[np.argsort(frame[births], kind="stable")]
    number = np.full(int(track.max()) + 1, -1)
    number[track[births]] = np.arange(len(births))
    later = later[np.lexsort((frame[later], number[track[later]]))]
    unknown = np.full(len(births), np.nan)
    found = ReferenceTracks(
        frame[births], uv[births], unknown, unknown, np.zeros(len(births), np.intp), number[track[later]],
        frame[later], uv[later],
    )  # fmt: skip
    return with_depths(sequence, found)


def scene_of(name: str, cache: Path, tartanair: Path | None) -> Scene:
    """A scene, from the cache where it is there."""
    file = cache / f"{name.replace(' ', '-')}.pickle"
    if not file.is_file():
        cache.mkdir(parents=True, exist_ok=True)
        file.write_bytes(pickle.dumps(made(name, tartanair)))
    return pickle.loads(file.read_bytes())


Errors = Mapping[str, Array]
"""Errors (n, 2) of the observations of each tracker, px."""


class Bench:
    """A scene, and the errors of its trackers by any truth."""

    def __init__(self, scene: Scene, *, with_sigma: bool = False) -> None:
        self.scene, self._with_sigma = scene, with_sigma
        self._frames = {name: PoseAdjustment(self.stated(scene.poses, scene.depths), one) for name, one in self.seen}
        self.exact = self.errors(scene.poses, None)
        self.age = {name: one.frame - one.birth[one.track] for name, one in self.seen}
        self._sizes: dict[tuple[str, float], float | None] = {}

    @property
    def seen(self) -> Sequence[tuple[str, ReferenceTracks]]:
        """Observations of the trackers."""
        return [*self.scene.seen.items()]

    def stated(self, poses: Array, depths: Sequence[Array]) -> Recording:
        """The recording with another truth; depths of 0 are none."""
        known = tuple(valid & (depth > 0.0) for depth, valid in zip(depths, self.scene.valid, strict=True))
        return replace(self.scene, valid=known).stated(poses, depths)

    def errors(self, poses: Array, spoilt: Recording | None, trackers: Sequence[str] = (*TRACKERS, PROGRAM)) -> Errors:
        """Errors by these poses, and by the depths of a recording, or the exact ones."""
        seen = {name: self.scene.seen[name] for name in trackers}
        depths = {name: one.depth_m if spoilt is None else depth_at(spoilt, one) for name, one in seen.items()}
        return {name: self._frames[name].residuals(poses, depths[name]) for name in seen}

    def spoilt(self, fault: str, size: float, seed: int) -> tuple[Array, Recording, bool]:
        """Poses and recording with a fault, and whether its depths are other ones."""
        if fault == NOTHING:
            return self.scene.poses, self.stated(self.scene.poses, self.scene.depths), False
        poses, depths = SPOILT[fault][0](self.scene, size, np.random.default_rng(seed))
        return poses, self.stated(poses, depths), depths is not self.scene.depths

    def size(self, fault: str, share: float) -> float | None:
        """Size of a fault that makes this share of the squared errors, within a fifth; None where none does."""
        if fault == NOTHING:
            return 0.0
        key = fault, share
        if key not in self._sizes:
            self._sizes[key] = self._searched(fault, share)
        return self._sizes[key]

    def _searched(self, fault: str, share: float) -> float | None:
        size, low, high, near = SPOILT[fault][1], 0.0, np.inf, min(share, 1.0 - share)
        for _ in range(_ROUNDS):
            poses, recording, other = self.spoilt(fault, size, 0)
            found = self.planted(self.errors(poses, recording if other else None, TRACKERS[:1]))
            if abs(found - share) <= _CLOSE * near:
                return size
            low, high = (size, high) if found < share else (low, size)
            apart, found = abs(found - share), min(max(found, 1e-6), 0.98)
            last, size = size, size * float(np.clip(np.sqrt(share / (1.0 - share) * (1.0 - found) / found), 0.05, 20.0))
            if not low < size < high:
                size = float(np.sqrt(low * high))
        return last if apart <= _FAR * near else None

    def planted(self, errors: Errors) -> float:
        """Share of the squared errors of the first tracker, without outliers as in (pose.share)."""
        near = self.age[TRACKERS[0]] <= REFERENCE_AGE
        own, every = (one[TRACKERS[0]][near] for one in (self.exact, errors))
        known = np.isfinite(every).all(axis=1) & np.isfinite(own).all(axis=1)
        own, every, age = own[known], every[known], self.age[TRACKERS[0]][near][known]
        scale = scales(age, every)
        weight = (np.hypot(*every.T) <= CUT * scale) / scale**2
        shift = np.sum((every - own) ** 2, axis=1)
        return float((weight * shift).sum() / (weight * np.sum(every**2, axis=1)).sum())

    def run(self, fault: str, share: float, seed: int) -> dict[str, Any] | None:
        """One line of the results; None where no size of the fault makes the share."""
        size = self.size(fault, share)
        if size is None:
            return None
        poses, recording, other = self.spoilt(fault, size, seed)
        depths = recording if other else None
        given = self.errors(poses, depths)
        begin = process_time()
        references = with_depths(recording, self.scene.references) if other else self.scene.references
        found, fit = refined_by(recording, references, UNKNOWN, len(poses))
        used_s = process_time() - begin
        row = {"leads": fit.leads, "reason": fit.reason, "references": fit.references, "left_px": fit.left_px}
        row |= {"stated_px": fit.stated_px, "cpu_s": round(used_s, 2), "planted": round(self.planted(given), 4)}
        truths = {EXACT: self.exact, STATED: given, REFINED: given}
        floors = {name: np.zeros_like(errors) for name, errors in given.items()}
        row |= {"corrections": dict(fit.corrections), "joins_depths": fit.joins_depths}
        if isinstance(found, RefinedPoses):
            changed = found if other or fit.corrections or fit.joins_depths else None
            truths[REFINED] = self.errors(found.poses, changed)
            truths |= {kind: self.errors(one, changed) for kind, one in found.by_kind.items()}
            halves = [self.errors(one, changed) for one in found.pose_halves]
            floors = {name: (halves[0][name] - halves[1][name]) / 2.0 for name, _ in self.seen}
            row |= self.left(references, found, recording)
        if self._with_sigma:
            row["sigma"] = {EXACT: self._exact_sigmas, STATED: self.sigmas(recording), REFINED: self.sigmas(found)}
        return {**row, "size": size, "values": self.values(truths, floors)}

    @cached_property
    def _exact_sigmas(self) -> dict[str, float]:
        return self.sigmas(self.stated(self.scene.poses, self.scene.depths))

    def sigmas(self, sequence: Recording) -> dict[str, float]:
        """The sigma to set of each tracker by the truth of a sequence; none where it has none."""
        trackers = {name: Replayed(steps) for name, steps in self.scene.steps.items()}
        rule = AccuracyRule(UNKNOWN, shipped=False)
        return sigmas(measure(sequence, trackers, truth="birth", accuracy=rule))

    def left(self, references: ReferenceTracks, found: RefinedPoses, recording: Recording) -> dict[str, float]:
        """RMS of what refined and stated poses really leave of the reference tracks, at `REFERENCE_AGE`, px."""
        frames = PoseAdjustment(recording, references)
        rows = references.frame - references.birth[references.track] == REFERENCE_AGE
        exact, best, given = (
            frames.residuals(one, references.depth_m)[rows]
            for one in (self.scene.poses, found.poses, recording.world_from_camera)
        )
        left, stated = (float(np.sqrt(np.nanmean(np.sum((one - exact) ** 2, axis=1)))) for one in (best, given))
        return {"left_true_px": left, "stated_true_px": stated}

    def values(self, truths: Mapping[str, Errors], floors: Errors) -> dict[str, Any]:
        """Core, RMS and bias by tracker, age and truth, and the floor of refined poses."""
        found: dict[str, Any] = {}
        for name, age in product(self.scene.seen, AGES):
            rows = self.age[name] == age
            if rows.sum() < 50:
                continue
            known = np.all([np.isfinite(errors[name][rows]).all(axis=1) for errors in truths.values()], axis=0)
            one = {truth: sizes(errors[name][rows][known]) for truth, errors in truths.items()}
            one["floor"] = np.sqrt(np.nanmean(floors[name][rows] ** 2, axis=0)).round(5).tolist()
            found.setdefault(name, {})[str(age)] = {**one, "n": int(rows.sum())}
        return found


def sigmas(measured: Measurement) -> dict[str, float]:
    """What `tracknoise.analyse(measured).sigma("openvins")` says, without the rest of the analysis."""
    found = {}
    with TemporaryDirectory() as name:
        folder = RunFolder(Path(name))
        write_run(folder, [measured])
        conditions = [(tracker, 1) for tracker in measured.tracks["tracker"].unique(maintain_order=True)]
        for read in all_training_tables(folder, conditions, truth=RunTruth(TruthVerdict(), pl.DataFrame())):
            try:
                known = equivalents_of(read, components_of(read, level=LEVEL), [LENGTH])
            except TracknoiseError as error:
                print(f"{read.tracker}: {error}")
                continue
            of_pose = [one for one in known if (one.landmark, one.purpose) == (Landmark.FREE, Purpose.NEWEST_POSE)]
            found[read.tracker] = of_pose[0].sigma.value
    return found


def depth_at(recording: Recording, tracks: ReferenceTracks) -> Array:
    """Depths of a recording at births, metres; NaN where it has none."""
    births, depth_m = BirthDepths(SequenceGeometry(recording)), np.full(len(tracks.birth), np.nan)
    for index in np.unique(tracks.birth).tolist():
        rows = np.flatnonzero(tracks.birth == index)
        found, status = births.of(index, tracks.birth_uv[rows])
        depth_m[rows] = np.where(status == TruthStatus.valid, found, np.nan)
    return depth_m


def sizes(errors: Array) -> list[float]:
    """Core, clipped RMS and median of both coordinates."""
    core = PER_MEDIAN * np.nanmedian(np.abs(errors), axis=0)
    rms = np.sqrt(np.nanmean(np.clip(errors, -CLIP_PX, CLIP_PX) ** 2, axis=0))
    return np.concatenate([core, rms, np.nanmedian(errors, axis=0)]).round(5).tolist()


def table(rows: Sequence[Mapping[str, Any]]) -> pl.DataFrame:
    """One row for each line of the results, tracker, age and coordinate."""
    found = []
    for row, tracker in product(rows, (*TRACKERS, PROGRAM)):
        for age, values in row["values"].get(tracker, {}).items():
            for axis in (0, 1):
                one = {"tracker": tracker, "age": int(age), "n": values["n"], "floor": values["floor"][axis]}
                for truth in (EXACT, STATED, REFINED, *KINDS):
                    known = values.get(truth, values[STATED])
                    one |= {
                        f"{what}_{truth}": known[place + axis] for place, what in ((0, "core"), (2, "rms"), (4, "bias"))
                    }
                found.append({name: row[name] for name in ("scene", "fault", "share", "seed", "leads")} | one)
    return pl.DataFrame(found)


def judged(what: str) -> dict[str, pl.Expr]:
    """Shares of values."""
    exact, stated, given = (pl.col(f"{what}_{truth}") for truth in (EXACT, STATED, REFINED))
    wrong = (given - exact).abs()
    return {
        "near": (wrong <= pl.max_horizontal(NEAR * exact, pl.lit(CLOSE_PX))).mean(),
        "within 5 %": (wrong <= 0.05 * exact).mean(),
        "stated near": ((stated - exact).abs() <= pl.max_horizontal(NEAR * exact, pl.lit(CLOSE_PX))).mean(),
        "worse": (wrong > (stated - exact).abs() + CLOSE_PX).mean(),
    }


def sigmas_judged(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Shares of the sigmas to set that are near those of the exact truth."""
    known = [row["sigma"] for row in rows if "sigma" in row]
    pairs = [(one[EXACT][name], one[STATED].get(name), one[REFINED].get(name)) for one in known for name in one[EXACT]]
    for what, place in ((STATED, 1), (REFINED, 2)):
        near = [abs((pair[place] or np.inf) - pair[0]) <= max(NEAR * pair[0], CLOSE_PX) for pair in pairs]
        yield f"{what} {np.mean(near):.3f} of {len(near)}" if near else f"{what} not measured"


def held(what: str) -> pl.Expr:
    """Share of the refined values by whose floor the exact one is held, of runs where refined poses lead."""
    wrong = (pl.col(f"{what}_{REFINED}") - pl.col(f"{what}_{EXACT}")).abs()
    return (wrong <= pl.col("floor")).filter(pl.col("leads")).mean()


def orders(values: pl.DataFrame) -> dict[str, int]:
    """Pairs of trackers by the larger of both cores, by references of each kind."""
    counts = {"same": 0, "undecided": 0, "wrong": 0}
    names = [f"core_{truth}" for truth in (EXACT, *KINDS)] + ["floor"]
    squares = values.group_by("scene", "fault", "share", "seed", "age", "tracker").agg(pl.col(names).pow(2).mean())
    for _, part in squares.group_by("scene", "fault", "share", "seed", "age"):
        for one, other in combinations(part.select(names).rows(), 2):
            exact, *apart = (a - b for a, b in zip(one[:-1], other[:-1], strict=True))
            unclear = min(map(abs, apart)) <= one[-1] + other[-1] or apart[0] * apart[1] <= 0.0
            counts["undecided" if unclear else "same" if apart[0] * exact > 0.0 else "wrong"] += 1
    return counts


def shown(value: float | None) -> str:
    """A number, or a dash where there is none."""
    return "-" if value is None else f"{value:.3f}"


def summary(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """A line for each fault and share, and for all."""
    every = table(rows)
    sizes_px = ("left_px", "left_true_px", "stated_true_px")
    kinds: dict[str, Any] = {"fault": pl.String, "share": pl.Float64, "leads": pl.Boolean}
    schema = kinds | dict.fromkeys(sizes_px, pl.Float64)
    runs = pl.DataFrame([{name: row.get(name) for name in schema} for row in rows], schema=schema)
    for keys, part in [*every.group_by("fault", "share", maintain_order=True), (("all", 0.0), every)]:
        own = runs if keys[0] == "all" else runs.filter(fault=keys[0], share=keys[1])
        known = own.filter(pl.col("leads"))
        left = known.select(pl.col(sizes_px).pow(2).mean().sqrt()).row(0)
        px = ", ".join(f"{name} {shown(one)}" for name, one in zip(("left", "really", "stated"), left, strict=True))
        yield f"{keys[0]} {keys[1]:.0%}: {own.height} runs, {known.height} refined; {px} px"
        for what in ("core", "rms"):
            found = part.select(**judged(what), held=held(what)).row(0, named=True)
            yield f"    {what}: " + ", ".join(f"{name} {shown(share)}" for name, share in found.items())
        bias = part.select((pl.col(f"bias_{REFINED}") - pl.col(f"bias_{EXACT}")).abs() <= 0.03).to_series().mean()
        told = ", ".join(f"{name} {count}" for name, count in orders(part).items())
        of_part = [row for row in rows if keys[0] in ("all", row["fault"]) and keys[1] in (0.0, row["share"])]
        yield "    sigma to set near: " + ", ".join(sigmas_judged(of_part))
        yield f"    bias within .03 px {bias:.3f}; pairs: {told}"


def main() -> None:
    """Measure what is missing, and print the shares."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("--cache", type=Path, required=True, help="folder of the followed scenes")
    parser.add_argument("--tartanair", type=Path, help="folder of TartanAir v1")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--scenes", nargs="*", help="by default all")
    parser.add_argument("--faults", nargs="*", default=[NOTHING, *SPOILT])
    parser.add_argument("--shares", type=float, nargs="*", default=SHARES)
    parser.add_argument("--rotate", action="store_true", help="one scene and one share for each seed, in turn")
    parser.add_argument("--sigma", action="store_true", help="also the sigma to set")
    given = parser.parse_args()
    names = given.scenes or [f"{motion} {world}" for world, motion in product(WORLDS, MOTIONS)]
    names += ["tartanair"] if given.tartanair and not given.scenes else []
    rows = [json.loads(line) for line in given.results.read_text().splitlines()] if given.results.exists() else []
    done = {(row["scene"], row["fault"], row["share"], row["seed"]) for row in rows}
    benches: dict[str, Bench] = {}
    with given.results.open("a") as file:
        for seed, place in product(range(given.first, given.first + given.seeds), range(len(names))):
            if given.rotate and place != seed % len(names):
                continue
            name, turn = names[place], (seed + seed // len(names)) % len(given.shares)
            shares = given.shares[turn : turn + 1] if given.rotate else given.shares
            cells = [(fault, share if fault != NOTHING else 0.0) for fault, share in product(given.faults, shares)]
            for fault, share in dict.fromkeys(cells):
                key = {"scene": name, "fault": fault, "share": share, "seed": seed if fault != NOTHING else 0}
                if tuple(key.values()) in done:
                    continue
                done.add(tuple(key.values()))
                if name not in benches:
                    benches[name] = Bench(scene_of(name, given.cache, given.tartanair), with_sigma=given.sigma)
                found = benches[name].run(fault, share, seed)
                if found is not None:
                    rows.append(key | found)
                    print(json.dumps(rows[-1]), file=file, flush=True)
    for line in summary(rows):
        print(line)


if __name__ == "__main__":
    main()
