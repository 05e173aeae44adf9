"""What a filter (MSCKF) with simulated inertial readings makes of noise assumptions (E3).

    python -m benchmarks.filter_trial                              # planted noise: 40 sequences of 60 frames
    python -m benchmarks.filter_trial --runs 8 --frames 30
    python -m benchmarks.filter_trial RUN [RUN ...] --tracker lucas-kanade

With runs of the reader `simulated`, kept with `keep = "observations"` and 20 frames per second, the filter is given the
tracks as they are, outliers included. Scenes are named `<motion>-NN`: noise models are fitted to those scenes of the
first run, or of `--models`, whose NN is even for scenes with an odd one, and the reverse. Each sequence is filtered
with several draws of inertial noise. A control has white noise of .5 px in place of the errors of the same tracks. With
`--cut`, what is set in a filter is also tried without the last observations of tracks that were lost or rejected. The
runs of docs/testing.md are those of `benchmarks/filter_trial_*.toml`.

Prints, for each assumed noise: the root mean square error of the newest position, its ratio to that of the first row
with a 95 % interval over sequences, NEES of the newest pose (mean and median over sequences), the share of its frames
within the 95 % region, the share of tracks that pass the gate, mean innovations, the share of their claimed variance
that predicted poses have, and how many runs diverged.
"""

import argparse
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import stats

from benchmarks.msckf import (
    CLONES,
    FRAME_RATE_HZ,
    LEAST_FRAMES,
    Assumed,
    EndedTracks,
    InertialProblem,
    planted_problem,
    run_filter,
    with_readings,
)
from benchmarks.noise.arms import PlantedNoise
from benchmarks.noise.windows import recorded_camera
from tracknoise.estimators.advice import GOOD, Gate
from tracknoise.estimators.linear_window import (
    CAMERA,
    Motion,
    TrackGates,
    consistent_sigma,
    linear_tracks,
    simulated_tracks,
    trajectory,
)
from tracknoise.estimators.model import Landmark, Purpose
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.exceptions import SettingsError
from tracknoise.experiments.measured_poses import recorded_poses
from tracknoise.geometry.cameras import Camera
from tracknoise.inference.track_noise import TrackNoise
from tracknoise.tables.schema import FAILURES
from tracknoise.tables.store import RunFolder

Arms = Mapping[str, tuple[Assumed, float]]
"""What a filter may assume: noise and factor of the gate, by name. All are compared with the first."""

PLANTED: Mapping[str, TrackNoise] = {
    "white": TrackNoise.isotropic(first=0.3, white=0.3),
    "walk": TrackNoise.isotropic(walk=0.1),
    "walk and white": TrackNoise.isotropic(white=0.3, walk=0.1),
}
SET = "what is set in a filter"
CONTROL_PX = 0.5
"""Standard deviation of the white noise of the control."""
_SETTLED_FRAMES = round(3.0 * FRAME_RATE_HZ)
"""Frames from the start on that do not count for NEES: until then the known start decides."""
_DIVERGED_M = 1.0
_COORDINATES = 6
_MEANS = ("log", "nees", "inside", "passed", "innovations", "predicted")


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
    triangulated, passed, innovations, predicted
        As of `benchmarks.msckf.Filtered`.
    diverged
        Whether a position erred by more than `_DIVERGED_M`, or the filter broke down.
    """

    scene: str
    arm: str
    error_m: float
    nees: float
    inside: float
    triangulated: float
    passed: float
    innovations: float
    predicted: float
    diverged: bool


def outcomes(scene: str, problem: InertialProblem, arms: Arms, *, seed: int) -> Iterator[Outcome]:
    """Filter a sequence under each assumption. `seed`: of the errors of the first state."""
    for arm, (assumed, gate) in arms.items():
        try:
            found = run_filter(problem, assumed, gate=gate, seed=seed)
        except np.linalg.LinAlgError:
            nothing = dict.fromkeys(("nees", "triangulated", "passed", "innovations", "predicted"), float("nan"))
            yield Outcome(scene=scene, arm=arm, error_m=_DIVERGED_M, inside=0.0, diverged=True, **nothing)
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
            triangulated=found.triangulated,
            passed=found.passed,
            innovations=found.innovations,
            predicted=found.predicted,
            diverged=not apart.max() < _DIVERGED_M,
        )


def table(found: Sequence[Outcome]) -> str:
    """Rows by arm."""
    rows = pl.DataFrame(found)
    lines = [
        f"{'assumed':44}{'error cm':>9}{'over the first':>20}{'NEES':>7}{'median':>8}"
        f"{'in 95 %':>9}{'passed':>8}{'innov.':>8}{'predicted':>10}{'diverged':>9}"
    ]
    means = rows.with_columns(log=pl.col("error_m").log()).group_by("arm", "scene", maintain_order=True)
    by_scene = means.agg(pl.col(*_MEANS).mean(), pl.col("diverged").sum())
    first = by_scene.filter(pl.col("arm") == rows["arm"][0])
    for (arm,), own in by_scene.group_by("arm", maintain_order=True):
        ratio = _interval((own["log"] - first["log"]).to_numpy())
        numbers = own.select(pl.col(*_MEANS).mean(), pl.col("diverged").sum())
        log, nees, inside, passed, innovations, predicted, diverged = numbers.row(0)
        lines.append(
            f"{arm:44}{100.0 * np.exp(log):9.2f}{ratio:>20}{nees:7.2f}{own['nees'].median():8.2f}"
            f"{100.0 * inside:9.0f}{passed:8.3f}{innovations:8.2f}{predicted:10.3f}{diverged:9d}"
        )
    return "\n".join(lines)


def _interval(logs: NDArray[np.float64]) -> str:
    """A ratio, from its logarithms of sequences, with a 95 % interval by Student's distribution."""
    half = stats.t.ppf(0.975, len(logs) - 1) * logs.std(ddof=1) / np.sqrt(len(logs)) if len(logs) > 1 else np.nan
    value, low, high = np.exp([logs.mean(), logs.mean() - half, logs.mean() + half])
    return f"{value:.2f} [{low:.2f}, {high:.2f}]"


def _planted_arms(noise: TrackNoise) -> Arms:
    poses = trajectory(Motion.SIDEWAYS, CLONES)
    window = [linear_tracks(CAMERA, poses, tracks) for tracks in simulated_tracks(poses)]
    innovations = consistent_sigma(window, noise, purpose=Purpose.INNOVATIONS)
    newest = consistent_sigma(window, noise, purpose=Purpose.NEWEST_POSE)
    factor = TrackGates.of(window, noise).factors([0.95], sigma=innovations)[0]
    return {
        f"innovations, {innovations:.3f} px": (innovations, 1.0),
        f"the same, gate x {factor:.2f}": (innovations, factor),
        f"newest pose, {newest:.3f} px": (newest, 1.0),
        "whole tracks": (noise, 1.0),
    }


def model_arms(model: NoiseModel) -> Arms:
    """What an estimator may make of a noise model: sigma, gate and whole tracks."""

    def of(purpose: Purpose) -> tuple[float, float]:
        found = model.equivalent(landmark=Landmark.FREE, window=CLONES, purpose=purpose)
        return found.sigma.value, found.gate_95

    advised = model.advise("filter", window=CLONES)
    (sigma, gate), (innovations, gate_of_innovations) = of(Purpose.NEWEST_POSE), of(Purpose.INNOVATIONS)
    return {
        "1 px, gate 1": (1.0, 1.0),
        "1 px, gate .05": (1.0, 0.05),
        "newest pose, gate 1": (sigma, 1.0),
        "newest pose, gate of the model": (sigma, gate),
        "newest pose, gate of .8 of good tracks": (sigma, good_tracks_gate(model)),
        SET: (advised.sigma.value, advised.gates[Gate.TRACK]),
        **{f"newest pose, gate {value:g}": (sigma, value) for value in (0.25, 0.1, 0.05)},
        **{
            f"newest pose x {factor:g}, same gate in px": (factor * sigma, gate / factor**2)
            for factor in (1.5, 2.0, 3.0)
        },
        "innovations, gate 1": (innovations, 1.0),
        "innovations, gate of the model": (innovations, gate_of_innovations),
        "all poses, gate of the model": of(Purpose.ALL_POSES),
        "whole tracks, gate 1": (model.components, 1.0),
        "whole tracks, gate .25": (model.components, 0.25),
    }


def good_tracks_gate(model: NoiseModel) -> float:
    """Factor on the gate at .95, for the sigma of the newest pose, that .8 of good tracks pass at true poses."""
    found = model.equivalent(landmark=Landmark.FREE, window=CLONES, purpose=Purpose.NEWEST_POSE)
    own, usual = stats.chi2.ppf([GOOD, 0.95], 2 * CLONES - 3)
    return float((found.gate_80 or found.gate_95) * own / usual)


@dataclass(frozen=True, slots=True, eq=False)
class TrackedSequence:
    """A sequence of a run, without inertial readings.

    `observations` have a column `end`: why their track ended.
    """

    scene: str
    observations: pl.DataFrame
    tables: tuple[pl.DataFrame, pl.DataFrame]

    def problem(self, *, seed: int, control: bool = False, cut: int = 0) -> InertialProblem:
        """With readings of a sensor.

        `control`: with white noise in place of the errors. `cut`: without so many last observations of failed tracks.
        """
        cameras, poses = self.tables
        from_end = pl.col("frame").rank("ordinal", descending=True).over("track")
        seen = self.observations.filter(~pl.col("end").is_in(FAILURES) | (from_end > cut))
        if control:
            true = seen.drop_nulls("u_true_px").with_columns(u_px="u_true_px", v_px="v_true_px")
            noise = CONTROL_PX * np.random.default_rng((seed, 6)).standard_normal((2, true.height))
            seen = true.with_columns(pl.col("u_px") + pl.Series(noise[0]), pl.col("v_px") + pl.Series(noise[1]))
        camera = recorded_camera(cameras, self.scene)
        if not isinstance(camera, Camera) or camera.distortion:
            raise SettingsError(f"{self.scene}: found another camera, expected a pinhole camera without distortion")
        return with_readings(camera, recorded_poses(poses), ended_tracks(seen), seed=seed)


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


def ended_tracks(observations: pl.DataFrame) -> EndedTracks:
    """Tracks cut where a frame is missing, and after each `CLONES` observations.

    The first part is shorter, by the number of the track, so that tracks that began together are not cut together.
    """
    step = pl.col("frame").cast(pl.Int64).diff().over("track").fill_null(0)
    placed = (
        observations.sort("track", "frame")
        .with_columns(stretch=(step != 1).cast(pl.Int64).cum_sum())
        .with_columns(place=pl.int_range(pl.len()).over("stretch"))
        .with_columns(late=pl.col("track").cast(pl.Int64) % (CLONES - LEAST_FRAMES + 1))
        .with_columns(piece=(pl.col("place") + pl.col("late")) // CLONES, last=pl.len().over("stretch") - 1)
    )
    pieces = (
        placed.group_by("stretch", "piece", maintain_order=True)
        .agg(
            pl.col("frame").cast(pl.Int64).first(),
            pl.len().cast(pl.Int64),
            (pl.col("place") == pl.col("last")).any().alias("lost"),
            pl.col("u_px", "v_px"),
        )
        .filter(pl.col("len") >= LEAST_FRAMES)
    )
    uv = np.zeros((pieces.height, CLONES, 2))
    for place, (u, v) in enumerate(pieces.select("u_px", "v_px").iter_rows()):
        uv[place, : len(u)] = np.column_stack([u, v])
    first, length, lost = (pieces[name].to_numpy() for name in ("frame", "len", "lost"))
    return EndedTracks(first, length, uv, first + length - (~lost | (length == CLONES)))


def of_runs(
    runs: Sequence[Path], tracker: str, *, models: Path, seeds: int, cuts: Sequence[int] = ()
) -> Iterator[Outcome]:
    """The outcomes of all sequences of some runs, with arms of models fitted to scenes of the other half of a run."""
    folder = RunFolder(models)
    scenes = [entry.sequence.scene for entry in folder.manifest().sequences.values()]
    learned = [[name for name in scenes if _half(name) != half] for half in (0, 1)]
    arms = [model_arms(NoiseModel.fit(folder.path, tracker=tracker, scenes=names)) for names in learned]
    control = {f"control: {CONTROL_PX:g} px planted, gate {gate:g}": (CONTROL_PX, gate) for gate in (1.0, 0.5)}
    for number, run in enumerate(runs):
        for place, sequence in enumerate(tracked_sequences(run, tracker)):
            scene = f"{run.name} {sequence.scene}"
            for seed in (1000 * number + seeds * place + draw for draw in range(seeds)):
                yield from outcomes(scene, sequence.problem(seed=seed), arms[_half(sequence.scene)], seed=seed)
                yield from outcomes(scene, sequence.problem(seed=seed, control=True), control, seed=seed)
                for cut in cuts:
                    shorter = {f"what is set, last {cut} of failed tracks cut": arms[_half(sequence.scene)][SET]}
                    yield from outcomes(scene, sequence.problem(seed=seed, cut=cut), shorter, seed=seed)


def _half(scene: str) -> int:
    return int(scene.rpartition("-")[2]) % 2


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.filter_trial", description=__doc__.partition("\n")[0])
    parser.add_argument("run", type=Path, nargs="*", help="run folders; without any, noise is planted")
    parser.add_argument("--models", type=Path, help="run folder that models are fitted to (default: the first)")
    parser.add_argument("--tracker", default="lucas-kanade", help="of the runs")
    parser.add_argument("--seeds", type=int, default=2, help="draws of inertial noise for each sequence of a run")
    parser.add_argument(
        "--cut", type=int, nargs="*", default=[], help="last observations of failed tracks to leave out"
    )
    parser.add_argument("--runs", type=int, default=40, help="sequences with planted noise")
    parser.add_argument("--frames", type=int, default=60, help="frames of a sequence with planted noise")
    parser.add_argument("--tracks", type=int, default=8, help="tracks that begin in each of its frames")
    options = parser.parse_args()
    if options.run:
        models = options.models or options.run[0]
        found = of_runs(options.run, options.tracker, models=models, seeds=options.seeds, cuts=options.cut)
        print(table(list(found)))
        return
    for case, noise in PLANTED.items():
        arms, found = _planted_arms(noise), []
        for seed in range(options.runs):
            problem = planted_problem(
                PlantedNoise(noise=noise), n_frames=options.frames, per_frame=options.tracks, seed=seed
            )
            found += outcomes(f"{seed}", problem, arms, seed=seed)
        print(f"{case}\n{table(found)}", flush=True)


if __name__ == "__main__":
    main()
