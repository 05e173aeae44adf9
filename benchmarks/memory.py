"""Peak memory of one process: against the length of a scene, of which only recorded observations may remain; of poses
that are refined by reference tracks, against the length of a recording in one piece; of a run of imported tracks, with
its report, against the length of a recording; and of a scene of the light stage, whose lightings are measured together.

Each is measured by a process of its own, which says how large it was at its peak.
"""

import io
import json
import sys
import tempfile
from contextlib import redirect_stdout, suppress
from pathlib import Path

from benchmarks.harness import Row, elapsed_ms, in_new_process, peak_mib, program, write_scene
from tracknoise.tables.findings_schema import COUNTS

LENGTHS = (100, 1000)
REFINED_LENGTHS = (120, 480, 1920)
BORN, LONGEST = 26, 48
"""Reference tracks that begin in a frame, and frames of one at most: 76,000 observations in 120 frames."""
IMPORTED_LENGTHS = (300, 900)
IMPORTED = """
name = "memory"
[dataset]
reader = "folder"
root = "data"
[[trackers]]
name = "program"
kind = "imported"
[trackers.options]
path = "tracks.csv"
"""
STAGE_SMALL, STAGE_FULL = (240, 180), (1600, 1200)
STAGE = """
name = "memory"
speeds = [1, 2, 4, 8, 12]
[dataset]
reader = "dtu"
root = "data"
[[trackers]]
kind = "lucas-kanade"
[[trackers]]
kind = "correspondence"
[truth]
kind = "scan"
population = "projected"
"""


class Silent:
    """Listens to a run, and says nothing."""

    def __getattr__(self, name: str) -> object:
        return lambda *arguments: None


def rows() -> list[Row]:
    """Of a simulated sequence of two lengths, and of a stage of small images."""
    return [*_by_length(), *_refined(), *_stage(STAGE_SMALL)]


def full_rows() -> list[Row]:
    """The same with a stage of the images that DTU Point Features have."""
    return [*_by_length(), *_refined(), *_imported(), *_stage(STAGE_FULL)]


def _by_length() -> list[Row]:
    measured = {length: in_new_process("benchmarks.memory", "sweep", length) for length in LENGTHS}
    table = [
        Row(f"memory: {name}, {length} frames", value, "MiB")
        for length, values in measured.items()
        for name, value in values.items()
    ]
    short, long = (measured[length] for length in LENGTHS)
    growth = long["peak"] - short["peak"]
    recorded = long["recorded observations"] - short["recorded observations"]
    return [*table, Row("memory: growth beyond the recorded observations", growth - recorded, "MiB")]


def _refined() -> list[Row]:
    measured = {length: in_new_process("benchmarks.memory", "refined", length) for length in REFINED_LENGTHS}
    table = [
        Row(f"memory: peak of poses refined in one piece, {length} frames", values["peak"], "MiB",
            f"{values['observations'] / 1e3:.0f} thousand observations, {values['seconds']:.1f} s")
        for length, values in measured.items()
    ]  # fmt: skip
    short, long = (measured[length] for length in REFINED_LENGTHS[1:])
    each = (long["peak"] - short["peak"]) * 2**20 / (long["observations"] - short["observations"])
    return [*table, Row("memory: growth of refined poses", each, "bytes an observation")]


def _imported() -> list[Row]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_scene(folder / "data", frames=max(IMPORTED_LENGTHS), width=640, height=480)
        (folder / "x.toml").write_text(IMPORTED)
        _write_tracks(folder)
        peaks = {n: in_new_process("benchmarks.memory", "imported", folder, n)["peak"] for n in IMPORTED_LENGTHS}
    return [Row(f"memory: peak of a run of imported tracks, {n} frames", peak, "MiB") for n, peak in peaks.items()]


def _write_tracks(folder: Path) -> None:
    """Tracks of a short program that uses OpenCV, as a table."""
    from benchmarks.validity.refined_truth import Program
    from tracknoise.sequences.reader_registry import open_sequence
    from tracknoise.trackers.tracker import Frame, SequenceContext

    sequence, lines = open_sequence("folder", folder / "data"), ["track,frame,u_px,v_px"]
    camera = sequence.camera
    program = Program().start(
        SequenceContext(sequence.id, (camera.width, camera.height), len(sequence), speed=1, seed=0, truth=None)
    )
    for index in range(len(sequence)):
        step = program.step(Frame(index, sequence.image(index)))
        lines += [f"{track},{index},{u:.4f},{v:.4f}" for track, (u, v) in zip(step.ids, step.uv, strict=True)]
    (folder / "tracks.csv").write_text("\n".join(lines))


def _stage(size: tuple[int, int]) -> list[Row]:
    width, height = size
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        options = [
            "--option",
            f"width={width}",
            "--option",
            f"height={height}",
            "--option",
            "image_format=bmp",
            "--quiet",
        ]
        program("simulate", "--layout", "dtu", "--out", folder / "data", *options)
        (folder / "x.toml").write_text(STAGE)
        measured = in_new_process("benchmarks.memory", "stage", folder)
    what = f"49 frames in {measured['sequences']} lightings at {width // 2}x{height // 2}"
    note = f"10 conditions, {measured['observations'] / 1e6:.1f} million observations"
    return [
        Row(f"memory: peak of a scene of the light stage, {what}", measured["peak"], "MiB", note),
        Row(f"a scene of the light stage, {what}", measured["seconds"], "s", note),
    ]


def _measure_sweep(length: int) -> dict[str, float]:
    from tracknoise.measurement.tracking import TrackerSetup, run_trackers
    from tracknoise.sequences.reader_registry import open_sequence
    from tracknoise.trackers.lucas_kanade import LucasKanade
    from tracknoise.truth.truth_registry import make_truth

    sequence = open_sequence("simulated", motions=["arvr"], frames=length, width=320, height=240, supersampling=1)
    conditions = [TrackerSetup("lucas-kanade", LucasKanade(), 1)]
    swept = run_trackers([sequence], conditions, [make_truth(sequence, None)], n_frames=length, seed=0)
    recording = swept[0].recordings[0]
    arrays = [getattr(recording, name) for name in recording.__slots__ if name != "quality"]
    size = sum(array.nbytes for array in [*arrays, *recording.quality.values()])
    return {"peak": peak_mib(), "recorded observations": size / 2**20}


def _measure_refined(length: int) -> dict[str, float]:
    import numpy as np

    from tracknoise.geometry.accuracy import TruthAccuracy
    from tracknoise.geometry.cameras import Camera
    from tracknoise.measurement.refined_poses import refined_by
    from tracknoise.sequences.recorded import RecordedSequence
    from tracknoise.tables.identity import SequenceId
    from tracknoise.truth.pose_adjustment import ReferenceTracks, exponential

    rng, camera = np.random.default_rng(0), Camera(640, 480, 500.0, 500.0, 320.0, 240.0)
    poses = np.tile(np.eye(4), (length, 1, 1))
    poses[:, :3, 3] = np.cumsum(rng.normal(0.0, 0.01, (length, 3)), axis=0)
    birth = np.repeat(np.arange(length - 1), BORN)
    count = np.minimum(rng.integers(1, LONGEST + 1, len(birth)), length - 1 - birth)
    track = np.repeat(np.arange(len(birth)), count)
    frame = birth[track] + 1 + np.arange(len(track)) - np.repeat(np.cumsum(count) - count, count)
    birth_uv, depth_m = rng.uniform((80, 80), (560, 400), (len(birth), 2)), rng.uniform(1.0, 4.0, len(birth))
    points = camera.unproject(birth_uv, depth_m) + poses[birth, :3, 3]
    uv = rng.normal(0.0, 0.2, (len(track), 2))
    for rows in (slice(start, start + 4096) for start in range(0, len(track), 4096)):
        uv[rows] += camera.project(points[track[rows]] - poses[frame[rows], :3, 3])
    sigma, kind = np.full(len(birth), 0.01), rng.integers(0, 2, len(birth))
    births = {"birth": birth, "birth_uv": birth_uv, "depth_m": depth_m, "depth_sigma": sigma, "kind": kind}
    tracks = ReferenceTracks(**births, track=track.astype(np.int32), frame=frame.astype(np.int32), uv=uv)
    del points, track, frame
    spoilt = poses @ exponential(rng.normal(0.0, (0.01, 0.01, 0.01, 2e-3, 2e-3, 2e-3), (length, 6)))
    sequence = RecordedSequence(
        id=SequenceId("made", "up"),
        source="made up",
        camera=camera,
        world_from_camera=spoilt,
        images=lambda index: np.zeros((480, 640), np.uint8),
        depths=lambda index: None,
        timestamps_s=np.arange(length) / 30.0,
    )
    seconds = elapsed_ms(lambda: refined_by(sequence, tracks, TruthAccuracy(), length)) / 1e3
    return {"peak": peak_mib(), "observations": len(tracks.frame), "seconds": seconds}


def _measure_imported(folder: Path, length: int) -> dict[str, float]:
    from tracknoise.cli.app import main

    out = folder / f"run-{length}"
    with redirect_stdout(io.StringIO()), suppress(SystemExit):
        main(["run", str(folder / "x.toml"), "--workers", "1", "--frames", str(length), "--out", str(out), "--quiet"])
    assert (out / "report" / "index.html").exists(), "the run ended early"
    return {"peak": peak_mib()}


def _measure_stage(folder: Path) -> dict[str, float]:
    from tracknoise.experiments.execute import execute
    from tracknoise.experiments.load import load_experiment
    from tracknoise.tables.store import RunFolder

    experiment, run = load_experiment(folder / "x.toml"), RunFolder(folder / "run")
    seconds = elapsed_ms(lambda: execute(experiment, run, listener=Silent(), debug=True)) / 1e3
    observations = int(run.statistics(COUNTS).filter(kind="truth")["n"].sum())
    n_sequences = len(run.manifest().sequences)
    return {"peak": peak_mib(), "sequences": n_sequences, "observations": observations, "seconds": seconds}


if __name__ == "__main__":
    kind, argument, *more = sys.argv[1:]
    measures = {"sweep": _measure_sweep, "refined": _measure_refined}
    if kind in measures:
        measured = measures[kind](int(argument))
    elif more:
        measured = _measure_imported(Path(argument), int(more[0]))
    else:
        measured = _measure_stage(Path(argument))
    json.dump(measured, sys.stdout)
