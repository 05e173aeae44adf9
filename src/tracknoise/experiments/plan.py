"""Which sequences and conditions an experiment consists of."""

from dataclasses import dataclass
from pathlib import Path

from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.experiments.settings import DatasetSettings, Experiment
from tracknoise.sequences.registry import make_reader
from tracknoise.sequences.sequence import Sequence, SequenceId
from tracknoise.tables.store import sequence_key
from tracknoise.trackers.registry import make_tracker
from tracknoise.trackers.tracker import TrackerSettings


@dataclass(frozen=True, slots=True)
class Task:
    """One sequence of an experiment: small enough to be sent to another machine.

    Parameters
    ----------
    experiment
        Everything that decides the numbers.
    sequence
        Which sequence to measure.
    """

    experiment: Experiment
    sequence: SequenceId

    @property
    def key(self) -> str:
        """File name, without extension, of the sequence's tables."""
        return sequence_key(self.sequence.scene, self.sequence.lighting, self.sequence.rotation)


def plan(experiment: Experiment) -> list[Task]:
    """List the sequences of an experiment, from file names alone.

    Raises
    ------
    TracknoiseError
        If the reader, one of its options, a scene or a lighting is unknown, or the data's folder is wrong.
    """
    listed = make_reader(*_reader_arguments(experiment.dataset)).sequences()
    _check_selected("scene", experiment.dataset.scenes, {item.scene for item in listed})
    _check_selected("lighting", experiment.dataset.lightings, {item.lighting for item in listed})
    chosen = [item for item in listed if _is_selected(item, experiment.dataset)]
    if not chosen:
        raise SettingsError("no sequence has both a scene and a lighting that the experiment names")
    return [Task(experiment, item) for item in chosen]


def make_trackers(experiment: Experiment) -> dict[str, TrackerSettings]:
    """The settings of each tracker of an experiment, by name.

    Raises
    ------
    UnknownNameError, SettingsError
        If a tracker or an option is unknown, or a value is wrong.
    """
    return {choice.label: make_tracker(choice.kind, choice.options) for choice in experiment.trackers}


def open_task(task: Task) -> Sequence:
    """Open the sequence of a task.

    Raises
    ------
    TracknoiseError
        If its data cannot be used.
    """
    return make_reader(*_reader_arguments(task.experiment.dataset)).open(task.sequence)


def _reader_arguments(dataset: DatasetSettings) -> tuple[str, Path | None, dict[str, object]]:
    return dataset.reader, dataset.root, dataset.options


def _check_selected(kind: str, names: list[str] | None, known: set[str]) -> None:
    for name in names or []:
        if name not in known:
            raise UnknownNameError(kind, name, known)


def _is_selected(sequence: SequenceId, dataset: DatasetSettings) -> bool:
    wanted_scene = dataset.scenes is None or sequence.scene in dataset.scenes
    return wanted_scene and (dataset.lightings is None or sequence.lighting in dataset.lightings)
