"""Worlds in which every number has an exact expected value.

- `files`: recordings in the plain layout, with dense depth. Features are occluded and leave the image. Frames are
  played in both orders and at two speeds, and images are turned.
- `ray cast`: exact surfaces.
- `scan`: features are associated with scan points in a key frame.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import polars as pl

from benchmarks.selfcheck.comparison import compare_aspects, compare_statistics, compare_tracks
from benchmarks.selfcheck.known_worlds import (
    UNKNOWN,
    Lives,
    Scene,
    Script,
    Scripted,
    Shown,
    WithSurface,
    in_memory,
    occluded_scene,
    scripted_tracks,
    write_recording,
)
from benchmarks.selfcheck.reference import Trim
from tracknoise.experiments.measure import Measurement, measure
from tracknoise.experiments.run_statistics import compute_statistics
from tracknoise.experiments.settings import (
    DatasetSettings,
    Experiment,
    StatisticsSettings,
    TrackerChoice,
    TruthSettings,
)
from tracknoise.experiments.task import write_measurement, write_settings
from tracknoise.options import PathTemplate
from tracknoise.sequences.folder import Folder
from tracknoise.sequences.sequence import Scan, TruthKind
from tracknoise.sequences.sequence import Sequence as Recording
from tracknoise.sequences.views import view
from tracknoise.tables.enumerations import Axis, Population, TrimAmong
from tracknoise.tables.identity import Direction, SequenceId
from tracknoise.tables.store import RunFolder
from tracknoise.topics.catalogue import by_table
from tracknoise.trackers.imported import Imported
from tracknoise.trackers.tracker import TrackerSettings

FOLDERS = ("files", "tracks", "files-run", "raycast-run", "scan-run")
"""What `exact_checks` writes."""
N_FRAMES = 25
KEY_FRAME = 10
_LIVES: Mapping[str, Lives] = {"scripted": Lives(260, 0.06, 0.4), "imported": Lives(120, 0.1, 0.0)}
"""By tracker. Imported tracks are read from a file, which cannot tell outliers from losses."""
_TRACK_FILE = "{scene}-{lighting}-{rotation}-{direction}-{speed}.parquet"
_WAYS: Mapping[tuple[bool, int], tuple[int, ...]] = {
    (False, 0): (1, 2),
    (True, 0): (1,),
    (False, 1): (1,),
    (True, 3): (2,),
}
"""Speeds of each way to show a scene: whether backward, and quarter turns."""
_SCENES = ("a", "b")


@dataclass(frozen=True, slots=True, eq=False)
class _World:
    """How a world is measured."""

    name: str  # in `benchmarks.selfcheck.comparison.CHECKS`
    folder: Path  # run folder
    truth: str  # kind of truth
    trim: Trim  # how scenes are trimmed
    speeds: Sequence[int]  # of every way to show a scene


@dataclass(frozen=True, slots=True, eq=False)
class _Take:
    """One way to show one scene, and the tracks through it."""

    sequence: Recording  # the recording, in this view
    trackers: Mapping[str, TrackerSettings]  # by name
    scripts: Mapping[tuple[str, int], Script]  # what each of them reports at each speed


def exact_checks(folder: Path, *, seed: int) -> Iterator[pl.DataFrame]:
    """Measure the exact worlds and compare every number. Yields schema `CHECKS`."""
    rng = np.random.default_rng([seed, 0])
    followed = Trim(90.0, TrimAmong.followed, Population.visible)
    paper = Trim(90.0, TrimAmong.all, Population.projected)
    files = _World("files", folder / "files-run", TruthKind.birth, followed, (1, 2))
    yield from _checked(files, _file_takes(folder / "files", rng))
    cast = _World("ray cast", folder / "raycast-run", TruthKind.raycast, followed, (1,))
    yield from _checked(cast, _cast_takes(rng))
    scan = _World("scan", folder / "scan-run", TruthKind.scan, paper, (1,))
    yield from _checked(scan, _scan_takes(rng))


def _file_takes(folder: Path, rng: np.random.Generator) -> Iterator[_Take]:
    """Scenes that are read from files, in every view."""
    for number, name in enumerate(_SCENES):
        scene = occluded_scene(number, n_frames=N_FRAMES)
        write_recording(scene, folder / name)
        recording = Folder(folder).open(SequenceId(Folder.name, name))
        for (backward, quarters), speeds in _WAYS.items():
            shown = [Shown(backward, quarters, speed) for speed in speeds]
            yield _take(_view(recording, shown[0]), scene, shown, rng, imported=folder.parent / "tracks")


def _cast_takes(rng: np.random.Generator) -> Iterator[_Take]:
    """A scene with an exact surface, as recorded and in another view."""
    scene = occluded_scene(2, n_frames=N_FRAMES)
    recording = WithSurface(in_memory(scene, SequenceId("surface", _SCENES[0])), scene)
    for shown in (Shown(), Shown(backward=True, quarters=1)):
        yield _take(_view(recording, shown), scene, [shown], rng)


def _scan_takes(rng: np.random.Generator) -> Iterator[_Take]:
    """Scenes with a scan, whose points lie on the rays of the features in the key frame."""
    for number, name in enumerate(_SCENES):
        scene = occluded_scene(number, n_frames=N_FRAMES)
        script = scripted_tracks(scene, Shown(), _LIVES["scripted"], rng, key_frame=KEY_FRAME)
        key = np.flatnonzero(script.alive[:, KEY_FRAME])
        frame, uv = np.full(len(key), KEY_FRAME), script.true_px[key, KEY_FRAME]
        points = scene.world(frame, uv, scene.look(frame, uv)[0])
        recording = in_memory(scene, SequenceId("scan", name))
        sequence = WithSurface(recording, scene, Scan(points, KEY_FRAME))
        yield _Take(sequence, {"scripted": Scripted({(recording.id.key, 1): script})}, {("scripted", 1): script})


def _view(recording: Recording, shown: Shown) -> Recording:
    direction = Direction.backward if shown.backward else Direction.forward
    return view(recording, n_frames=None, direction=direction, rotation=90 * shown.quarters)


def _take(
    sequence: Recording,
    scene: Scene,
    shown: Sequence[Shown],
    rng: np.random.Generator,
    *,
    imported: Path | None = None,
) -> _Take:
    """Scripts of both trackers, or of one if there is no folder for tracks that are imported."""
    names = list(_LIVES) if imported else ["scripted"]
    scripts = {(name, one.speed): scripted_tracks(scene, one, _LIVES[name], rng) for name in names for one in shown}
    for one in shown if imported else ():
        scripts["imported", one.speed] = _without_causes(scripts["imported", one.speed])
    trackers: dict[str, TrackerSettings] = {
        "scripted": Scripted({(sequence.id.key, one.speed): scripts["scripted", one.speed] for one in shown})
    }
    if imported:
        for one in shown:
            path = sequence.id.expand(f"{imported}/{_TRACK_FILE}", speed=one.speed)
            _write_tracks(scripts["imported", one.speed], path)
        trackers["imported"] = Imported(PathTemplate(f"{imported}/{_TRACK_FILE}"))
    return _Take(sequence, trackers, scripts)


def _without_causes(script: Script) -> Script:
    """What is known of the same tracks when they are imported."""
    return replace(script, end=np.where(script.end == "sequence_end", script.end, UNKNOWN))


def _write_tracks(script: Script, file: Path) -> None:
    file.parent.mkdir(exist_ok=True)
    track, step = np.nonzero(script.alive)
    u, v = script.observed_px[track, step].T
    pl.DataFrame({"track": track, "frame": script.frames[step], "u_px": u, "v_px": v}).write_parquet(file)


def _checked(world: _World, takes: Iterator[_Take]) -> Iterator[pl.DataFrame]:
    """Checks of all observations, then of the statistics of each condition."""
    run, experiment, entries = RunFolder(world.folder), _experiment(world), []
    conditions: dict[tuple[object, ...], list[Script]] = {}
    for take in takes:
        measured = _measure(world, take)
        entries.append(write_measurement(run, experiment, measured))
        for (tracker, speed), script in take.scripts.items():
            yield from compare_tracks(world.name, measured, script, world.trim, tracker=tracker, speed=speed)
            name = take.sequence.id
            conditions.setdefault((name.direction, name.rotation, tracker, speed), []).append(script)
    write_settings(run, experiment, entries)
    run.write_statistics(by_table(compute_statistics(run, experiment)))
    axis = Axis.frame if world.truth == TruthKind.scan else Axis.age
    for key, scripts in conditions.items():
        condition = dict(zip(("direction", "rotation", "tracker", "speed"), key, strict=True))
        yield from compare_statistics(world.name, run, scripts, world.trim, condition, axis=axis)
        if axis == Axis.age:
            yield from compare_aspects(world.name, run, scripts, condition)


def _measure(world: _World, take: _Take) -> Measurement:
    return measure(
        take.sequence,
        take.trackers,
        speeds=sorted({speed for _, speed in take.scripts}),
        truth=world.truth,
        population=world.trim.population,
        trim_percentile=world.trim.percentile,
        trim_among=world.trim.among,
    )


def _experiment(world: _World) -> Experiment:
    """Settings of the run."""
    return Experiment(
        name=f"selfcheck {world.name}",
        dataset=DatasetSettings(reader=Folder.name),
        trackers=[TrackerChoice(kind=name) for name in _LIVES],
        speeds=list(world.speeds),
        truth=TruthSettings(kind=world.truth, population=Population(world.trim.population)),
        statistics=StatisticsSettings(
            trim_percentile=world.trim.percentile, trim_among=TrimAmong(world.trim.among), min_features=2
        ),
    )
