"""Which sequences and conditions an experiment consists of, and its second truth."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import partial
from typing import cast

from tracknoise.exceptions import DataError, SettingsError, UnknownNameError
from tracknoise.experiments.settings import DatasetSettings, Experiment, SecondTruthSettings
from tracknoise.sequences.corrected import corrected
from tracknoise.sequences.estimated_poses import posed_by, with_trajectory
from tracknoise.sequences.reader_registry import make_reader, open_together
from tracknoise.sequences.sequence import FilteringReader, Reader, Sequence, SharingReader
from tracknoise.sequences.stereo import with_stereo_depth
from tracknoise.sequences.views import view
from tracknoise.tables.identity import Direction, SequenceId
from tracknoise.trackers.tracker import RepeatedTracker, TrackerSettings
from tracknoise.trackers.tracker_registry import make_tracker


@dataclass(frozen=True, slots=True)
class Task:
    """One sequence of an experiment: small enough to be sent to another machine."""

    experiment: Experiment  # everything that decides the numbers
    sequence: SequenceId  # which sequence to measure
    speeds: tuple[int, ...]  # at which speeds
    # frames of the parts in which it is measured; none if it is measured in one piece, or that is not known yet
    parts: tuple[range, ...] = ()
    part: int | None = None  # Which of these to measure. None: join all of them.
    shares: bool = False  # whether the sequence is read together with others of the experiment

    @property
    def key(self) -> str:
        """File name, without extension, of the sequence's tables."""
        return self.sequence.key

    @property
    def recorded(self) -> SequenceId:
        """The sequence as its reader names it: upright and forward."""
        return replace(self.sequence, rotation=0, direction=Direction.forward)

    @property
    def frames(self) -> range | None:
        """Frames of the part to measure; None for all."""
        return None if self.part is None else self.parts[self.part]


def plan(experiment: Experiment) -> list[Task]:
    """List the sequences of an experiment, from file names alone.

    Raises
    ------
    TracknoiseError
        If the reader, one of its options, a scene or a lighting is unknown, or the data's folder is wrong.
    """
    dataset = experiment.dataset
    listed = _reader(dataset).sequences()
    _check_selected("scene", dataset.scenes, {item.scene for item in listed})
    for lightings in (dataset.lightings, *(way.lightings for way in experiment.views)):
        _check_selected("lighting", lightings, {item.lighting for item in listed})
    _check_groups(dataset.groups or {}, {item.scene for item in listed})
    chosen = [item for item in listed if _is_selected(item, dataset)]
    if not chosen:
        raise SettingsError("no sequence has both a scene and a lighting that the experiment names")
    scenes = sorted({item.scene for item in chosen})[: dataset.max_scenes]
    tasks = _distinct(
        Task(
            experiment,
            replace(item, rotation=way.rotation, direction=way.direction),
            tuple(way.speeds or experiment.speeds),
        )
        for item in chosen
        if item.scene in scenes
        for way in experiment.views
        if way.lightings is None or item.lighting in way.lightings
    )
    shared = {task.key for batch in batches(tasks) if len(batch) > 1 for task in batch}
    return [replace(task, shares=task.key in shared) for task in tasks]


def _distinct(tasks: Iterable[Task]) -> list[Task]:
    """Tasks in a list, unless two would write the same files."""
    named: dict[str, Task] = {}
    for task in tasks:
        if task.key in named:
            both = f"{named[task.key].sequence} and {task.sequence}"
            raise DataError(task.key, f"the files of two sequences ({both})", "a name for each sequence")
        named[task.key] = task
    return list(named.values())


def excluded_scenes(experiment: Experiment) -> dict[str, str]:
    """Why the reader excludes scenes of the data set from the plan, by scene."""
    reader = _reader(experiment.dataset)
    return reader.excluded_scenes() if isinstance(reader, FilteringReader) else {}


def batches(tasks: list[Task]) -> list[list[Task]]:
    """Group the tasks whose sequences share what they read: those of one scene, camera and direction of play.

    Readers that share nothing get one batch per task, so that more batches run at the same time.
    """
    if not tasks or not isinstance(_reader(tasks[0].experiment.dataset), SharingReader):
        return [[task] for task in tasks]
    together: dict[tuple[str, str, str, tuple[int, ...]], list[Task]] = {}
    for task in tasks:
        name = task.sequence
        together.setdefault((name.scene, name.camera, name.direction, task.speeds), []).append(task)
    return list(together.values())


def make_trackers(experiment: Experiment, *, repeat: int = 0) -> dict[str, TrackerSettings]:
    """The settings of each tracker of an experiment, by name; with other random seeds in each repetition."""
    trackers = {choice.label: make_tracker(choice.kind, choice.options) for choice in experiment.trackers}
    return {name: RepeatedTracker(settings, repeat) if repeat else settings for name, settings in trackers.items()}


def open_batch(
    tasks: list[Task], *, change: Callable[[Sequence], Sequence] = lambda sequence: sequence
) -> list[Sequence]:
    """Open the sequences of a batch, as the experiment wants to see them."""
    experiment = tasks[0].experiment
    dataset = experiment.dataset
    once = list(dict.fromkeys(task.recorded for task in tasks))
    sequences = [change(sequence) for sequence in open_together(_reader(dataset), once)]
    if experiment.truth.depth == "stereo":
        sequences = [with_stereo_depth(sequence) for sequence in sequences]
    corrections = experiment.truth.corrections.as_corrections()
    opened = {name: corrected(sequence, corrections) for name, sequence in zip(once, sequences, strict=True)}
    return [
        view(
            opened[task.recorded],
            frames=dataset.frames,
            n_frames=dataset.max_frames,
            direction=task.sequence.direction,
            rotation=task.sequence.rotation,
            part=task.frames,
        )
        for task in tasks
    ]


def planned(experiment: Experiment) -> Reader:
    """A reader of the sequences of an experiment as it wants to see them, forward and upright.

    Raises
    ------
    TracknoiseError
        As `plan`.
    """
    of_sequences = {task.recorded: replace(task, sequence=task.recorded) for task in plan(experiment)}
    return cast(Reader, _Planned(_reader(experiment.dataset).name, of_sequences))  # whose name is not that of a class


@dataclass(frozen=True, slots=True)
class _Planned:
    name: str
    tasks: Mapping[SequenceId, Task]

    def sequences(self) -> list[SequenceId]:
        """Those of the plan."""
        return list(self.tasks)

    def open(self, sequence: SequenceId) -> Sequence:
        """With the frames, poses, depth and corrections of the experiment."""
        return open_batch([self.tasks[sequence]])[0]


def _reader(dataset: DatasetSettings) -> Reader:
    reader = make_reader(dataset.reader, dataset.root, dataset.options)
    if dataset.trajectory is None:
        return reader
    return posed_by(reader, dataset.trajectory, dataset.trajectory_of, dataset.trajectory_time_shift_s)


def _check_selected(kind: str, names: list[str] | None, existing: set[str]) -> None:
    for name in names or []:
        if name not in existing:
            raise UnknownNameError(kind, name, existing)


def _check_groups(groups: dict[str, list[str]], existing: set[str]) -> None:
    for group, patterns in groups.items():
        for pattern in patterns:
            if not any(fnmatchcase(scene, pattern) for scene in existing):
                problem = f"dataset.groups.{group}: no scene is called {pattern!r}"
                raise SettingsError(f"{problem}, expected a pattern of scenes such as {min(existing)}")


def _is_selected(sequence: SequenceId, dataset: DatasetSettings) -> bool:
    wanted_scene = dataset.scenes is None or sequence.scene in dataset.scenes
    return wanted_scene and (dataset.lightings is None or sequence.lighting in dataset.lightings)


def open_second(tasks: list[Task]) -> list[Sequence]:
    """The sequences of a batch with their second truth; none if the experiment has no second truth."""
    second = tasks[0].experiment.truth.second
    if second is None:
        return []
    if second.trajectory is not None:
        return open_batch(tasks, change=partial(_with_trajectory, second, second.trajectory))
    experiment = tasks[0].experiment
    recorded = experiment.dataset.model_copy(update={"trajectory": None})
    experiment = experiment.model_copy(update={"dataset": recorded})
    for name, value in second.options.items():
        experiment = experiment.with_option(name, value)
    return open_batch([replace(task, experiment=experiment) for task in tasks])


def _with_trajectory(second: SecondTruthSettings, template: str, sequence: Sequence) -> Sequence:
    path = sequence.id.expand(template, speed=1)
    return with_trajectory(sequence, path, poses_of=second.trajectory_of, time_shift_s=second.time_shift_s)
