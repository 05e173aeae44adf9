"""What a filter (MSCKF) with simulated inertial readings makes of noise assumptions (E3).

    python -m benchmarks.filter_trial                              # planted noise: 40 sequences of 60 frames
    python -m benchmarks.filter_trial --runs 8 --frames 30
    python -m benchmarks.filter_trial --features 50 --lifetime 60  # some of them features in the state
    python -m benchmarks.filter_trial --common .05 --tracks 24     # of errors, 5 % are common to a frame
    python -m benchmarks.filter_trial RUN [RUN ...] --tracker lucas-kanade --arms exports --starts 2

With runs of the reader `simulated`, kept with `keep = "observations"` and 20 frames per second, the filter is given the
tracks as they are, outliers included. Scenes are named `<motion>-NN`: noise models are fitted to those scenes of the
first run, or of `--models`, whose NN is even for scenes with an odd one, and the reverse. Each sequence is filtered
from several first frames on, to its end, with several draws of inertial noise. What the filter may assume is in
`benchmarks.filter_arms`. A control has white noise of .5 px in place of the errors of the same tracks. With
`--cut`, what is set in a filter is also tried without the last observations of tracks that were lost or rejected. The
runs of docs/testing.md are those of `benchmarks/filter_trial_*.toml`.

Prints, for each assumed noise: the root mean square error of the newest position, its ratio to that of the first row
with a 95 % interval over sequences, NEES of the newest pose (mean and median over sequences), the share of its frames
within the 95 % region, and how many runs diverged; of tracks and of features in the state, the share that passes the
gate, the same of those whose errors are small, mean innovations, and the share of their claimed variance that predicted
poses have.
"""

import argparse
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import stats

from benchmarks.filter_arms import ARMS, SET, Arms
from benchmarks.filter_tracks import CLONES, whole_tracks
from benchmarks.inertial_problem import FRAME_RATE_HZ, InertialProblem, planted_problem, with_readings
from benchmarks.msckf import MOST_FEATURES, PLAIN, Assumed, GateRule, Innovations, run_filter
from benchmarks.noise.arms import PlantedNoise
from benchmarks.noise.windows import recorded_camera
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
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.exceptions import SettingsError
from tracknoise.experiments.measured_poses import recorded_poses
from tracknoise.geometry.cameras import Camera
from tracknoise.inference.track_noise import TrackNoise
from tracknoise.tables.schema import FAILURES
from tracknoise.tables.store import RunFolder

PLANTED: Mapping[str, TrackNoise] = {
    "white": TrackNoise.isotropic(first=0.3, white=0.3),
    "walk": TrackNoise.isotropic(walk=0.1),
    "walk and white": TrackNoise.isotropic(white=0.3, walk=0.1),
}
CONTROL_PX = 0.5
"""Standard deviation of the white noise of the control."""
SMALL_PX = 1.0
"""Largest error of a good observation, about the true position."""
_SETTLED_FRAMES = round(3.0 * FRAME_RATE_HZ)
"""Frames from the start on that do not count for NEES: until then the known start decides."""
_DIVERGED_M = 1.0
_COORDINATES = 6
_GATED = tuple(field.name for field in fields(Innovations))


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What became of one sequence under one assumption.

    Parameters
    ----------
    scene, arm
        Names.
    error_m
        Root mean square error of the newest position; `_DIVERGED_M` at most.
    nees
        Normalised error squared of the newest pose over 6, mean of the frames after the start.
    inside
        Share of these frames whose pose is within the 95 % region.
    diverged
        Whether a position erred by more than `_DIVERGED_M`, or the filter broke down.
    gated
        Values of `benchmarks.msckf.Innovations` of tracks, then of features.
    """

    scene: str
    arm: str
    error_m: float
    nees: float
    inside: float
    diverged: bool
    gated: tuple[float, ...]


def outcomes(scene: str, problem: InertialProblem, arms: Arms, *, seed: int) -> Iterator[Outcome]:
    """Filter a sequence under each assumption. `seed`: of the errors of the first state."""
    for arm, assumed in arms.items():
        try:
            found = run_filter(problem, assumed, seed=seed)
        except np.linalg.LinAlgError:
            nothing = (float("nan"),) * (2 * len(_GATED))
            yield Outcome(
                scene=scene, arm=arm, error_m=_DIVERGED_M, nees=float("nan"), inside=0.0, diverged=True, gated=nothing
            )
            continue
        apart = np.linalg.norm((found.poses - problem.world_from_camera)[:, :3, 3], axis=1)
        settled = found.nees[min(_SETTLED_FRAMES, len(found.nees) // 2) :]
        limit = stats.chi2.ppf(0.95, _COORDINATES) / _COORDINATES
        yield Outcome(
            scene=scene,
            arm=arm,
            error_m=min(float(np.sqrt(np.mean(apart**2))), _DIVERGED_M),
            nees=float(settled.mean()),
            inside=float((settled <= limit).mean()),
            diverged=not apart.max() < _DIVERGED_M,
            gated=tuple(getattr(one, name) for one in (found.tracks, found.features) for name in _GATED),
        )


def table(found: Sequence[Outcome]) -> str:
    """Rows by arm."""
    rows = pl.DataFrame(found).with_columns(log=pl.col("error_m").log())
    gated = [f"{kind}_{name}" for kind in ("tracks", "features") for name in _GATED]
    rows = rows.with_columns(pl.col("gated").list.to_struct(fields=gated)).unnest("gated")
    names = " ".join(f"{name:>9}" for name in _GATED)
    lines = [
        f"{'':98}{'tracks':^40}{'features in the state':^40}",
        f"{'assumed':44}{'error cm':>9}{'over the first':>20}{'NEES':>7}{'median':>8}{'in 95 %':>9}{'diverged':>9}"
        f"{names:>40}{names:>40}",
    ]
    means = ["log", "nees", "inside", *gated]
    by_scene = rows.group_by("arm", "scene", maintain_order=True).agg(
        pl.col(means).fill_nan(None).mean(), pl.col("diverged").sum()
    )
    first = by_scene.filter(pl.col("arm") == rows["arm"][0])
    for (arm,), own in by_scene.group_by("arm", maintain_order=True):
        ratio = _interval((own["log"] - first["log"]).to_numpy())
        log, nees, inside, *others = own.select(pl.col(means).mean()).row(0)
        shares = "".join(f"{'':>10}" if value is None else f"{value:10.3f}" for value in others)
        lines.append(
            f"{arm:44}{100.0 * np.exp(log):9.2f}{ratio:>20}{nees:7.2f}{own['nees'].median():8.2f}"
            f"{100.0 * inside:9.0f}{own['diverged'].sum():9d}{shares}"
        )
    return "\n".join(lines)


def _interval(logs: NDArray[np.float64]) -> str:
    """A ratio, from its logarithms of sequences, with a 95 % interval by Student's distribution."""
    half = stats.t.ppf(0.975, len(logs) - 1) * logs.std(ddof=1) / np.sqrt(len(logs)) if len(logs) > 1 else np.nan
    value, low, high = np.exp([logs.mean(), logs.mean() - half, logs.mean() + half])
    return f"{value:.2f} [{low:.2f}, {high:.2f}]"


def _planted_arms(noise: TrackNoise, features: int) -> Arms:
    poses = trajectory(Motion.SIDEWAYS, CLONES)
    window = [linear_tracks(CAMERA, poses, tracks) for tracks in simulated_tracks(poses)]
    innovations = consistent_sigma(window, noise, purpose=Purpose.INNOVATIONS)
    newest = consistent_sigma(window, noise, purpose=Purpose.NEWEST_POSE)
    factor = GateRule(TrackGates.of(window, noise).factors([0.95], sigma=innovations)[0])

    def arm(tracks: float | TrackNoise, sigma: float, gate: GateRule = PLAIN) -> Assumed:
        return Assumed(tracks=tracks, gate=gate, features=sigma, features_gate=gate, most_features=features)

    return {
        f"innovations, {innovations:.3f} px": arm(innovations, innovations),
        f"the same, gate x {factor.factor:.2f}": arm(innovations, innovations, factor),
        f"newest pose, {newest:.3f} px": arm(newest, newest),
        "whole tracks": arm(noise, newest),
    }


@dataclass(frozen=True, slots=True, eq=False)
class TrackedSequence:
    """A sequence of a run, without inertial readings.

    `observations` have a column `end`: why their track ended.
    """

    scene: str
    observations: pl.DataFrame
    tables: tuple[pl.DataFrame, pl.DataFrame]

    def problem(self, *, start: int = 0, seed: int, control: bool = False, cut: int = 0) -> InertialProblem:
        """With readings of a sensor, from a frame on.

        `control`: with white noise in place of the errors. `cut`: without so many last observations of failed tracks.
        """
        cameras, poses = self.tables
        frame = pl.col("frame").cast(pl.Int64)
        from_end = frame.rank("ordinal", descending=True).over("track")
        seen = self.observations.filter(~pl.col("end").is_in(FAILURES) | (from_end > cut), frame >= start)
        square = (pl.col("u_px") - pl.col("u_true_px")) ** 2 + (pl.col("v_px") - pl.col("v_true_px")) ** 2
        seen = seen.with_columns(frame=frame - start, good=(square <= SMALL_PX**2).fill_null(value=False))
        if control:
            true = seen.drop_nulls("u_true_px").with_columns(u_px="u_true_px", v_px="v_true_px")
            noise = CONTROL_PX * np.random.default_rng((seed, 6)).standard_normal((2, true.height))
            seen = true.with_columns(pl.col("u_px") + pl.Series(noise[0]), pl.col("v_px") + pl.Series(noise[1]))
        camera = recorded_camera(cameras, self.scene)
        if not isinstance(camera, Camera) or camera.distortion:
            raise SettingsError(f"{self.scene}: found another camera, expected a pinhole camera without distortion")
        return with_readings(camera, recorded_poses(poses)[start:], whole_tracks(seen), seed=seed)

    def starts(self, count: int) -> range:
        """So many first frames, evenly through the sequence."""
        frames = self.tables[1].height
        return range(0, frames, -(-frames // count))


def tracked_sequences(run: Path, tracker: str) -> Iterator[TrackedSequence]:
    """All sequences of a run at speed 1."""
    folder = RunFolder(run)
    for key, entry in sorted(folder.manifest().sequences.items()):
        observations = folder.sequence_table("observations", key)
        mine = observations.filter(pl.col("tracker") == tracker, pl.col("speed") == 1)
        ends = folder.sequence_table("tracks", key).filter(tracker=tracker, speed=1)
        ended = mine.join(ends.select("track", pl.col("end").cast(pl.String)), on="track", maintain_order="left")
        tables = folder.sequence_table("cameras", key), folder.sequence_table("poses", key)
        yield TrackedSequence(entry.sequence.scene, ended, tables)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """How sequences of runs are filtered.

    Parameters
    ----------
    arms
        Which of `ARMS`.
    starts, seeds
        First frames for each sequence, and draws of inertial noise for each of these.
    cuts
        Last observations of failed tracks to leave out.
    """

    arms: str
    starts: int
    seeds: int
    cuts: Sequence[int] = ()


def of_runs(runs: Sequence[Path], tracker: str, *, models: Path, plan: Plan) -> Iterator[Outcome]:
    """The outcomes of all sequences of some runs, with arms of models fitted to scenes of the other half of a run."""
    folder = RunFolder(models)
    scenes = [entry.sequence.scene for entry in folder.manifest().sequences.values()]
    learned = [[name for name in scenes if _half(name) != half] for half in (0, 1)]
    arms = [ARMS[plan.arms](NoiseModel.fit(folder.path, tracker=tracker, scenes=names)) for names in learned]
    control = {
        f"control: {CONTROL_PX:g} px planted, gate {gate:g}": Assumed(tracks=CONTROL_PX, gate=GateRule(gate))
        for gate in (1.0, 0.5)
    }
    control[f"control: {CONTROL_PX:g} px planted, features"] = Assumed(
        tracks=CONTROL_PX, features=CONTROL_PX, most_features=MOST_FEATURES
    )
    for number, run in enumerate(runs):
        for place, sequence in enumerate(tracked_sequences(run, tracker)):
            scene = f"{run.name} {sequence.scene}"
            draws = [(start, draw) for start in sequence.starts(plan.starts) for draw in range(plan.seeds)]
            for own, (start, _) in enumerate(draws):
                seed = 1000 * number + len(draws) * place + own
                yield from outcomes(
                    scene, sequence.problem(start=start, seed=seed), arms[_half(sequence.scene)], seed=seed
                )
                yield from outcomes(scene, sequence.problem(start=start, seed=seed, control=True), control, seed=seed)
                for cut in plan.cuts:
                    shorter = {f"what is set, last {cut} of failed tracks cut": arms[_half(sequence.scene)][SET]}
                    yield from outcomes(scene, sequence.problem(start=start, seed=seed, cut=cut), shorter, seed=seed)


def _half(scene: str) -> int:
    return int(scene.rpartition("-")[2]) % 2


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.filter_trial", description=__doc__.partition("\n")[0])
    parser.add_argument("run", type=Path, nargs="*", help="run folders; without any, noise is planted")
    parser.add_argument("--models", type=Path, help="run folder that models are fitted to (default: the first)")
    parser.add_argument("--tracker", default="lucas-kanade", help="of the runs")
    parser.add_argument("--arms", choices=ARMS, default="sigmas", help="what the filter may assume")
    parser.add_argument("--starts", type=int, default=1, help="first frames for each sequence of a run")
    parser.add_argument("--seeds", type=int, default=2, help="draws of inertial noise for each of them")
    parser.add_argument(
        "--cut", type=int, nargs="*", default=[], help="last observations of failed tracks to leave out, of sigmas"
    )
    parser.add_argument("--runs", type=int, default=40, help="sequences with planted noise")
    parser.add_argument("--frames", type=int, default=60, help="frames of a sequence with planted noise")
    parser.add_argument("--tracks", type=int, default=8, help="tracks that begin in each of its frames")
    parser.add_argument("--lifetime", type=int, default=CLONES, help="most frames of these tracks")
    parser.add_argument("--features", type=int, default=0, help="features in the state, with planted noise")
    parser.add_argument("--common", type=float, default=0.0, help="share of planted noise that features have in common")
    options = parser.parse_args()
    if options.run:
        plan = Plan(arms=options.arms, starts=options.starts, seeds=options.seeds, cuts=options.cut)
        print(table(list(of_runs(options.run, options.tracker, models=options.models or options.run[0], plan=plan))))
        return
    for case, noise in PLANTED.items():
        arms, found = _planted_arms(noise, options.features), []
        for seed in range(options.runs):
            problem = planted_problem(
                PlantedNoise(noise=noise, common_share=options.common),
                n_frames=options.frames,
                per_frame=options.tracks,
                lifetime=options.lifetime,
                seed=seed,
            )
            found += outcomes(f"{seed}", problem, arms, seed=seed)
        print(f"{case}\n{table(found)}", flush=True)


if __name__ == "__main__":
    main()
