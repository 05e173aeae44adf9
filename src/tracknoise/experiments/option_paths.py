"""The files and folders that an experiment's options name, found from the types of the options."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tracknoise.experiments.settings import Experiment, SecondTruthSettings
from tracknoise.foreign.files import absolute
from tracknoise.options import PathTemplate
from tracknoise.plugins import Plugins
from tracknoise.sequences.registry import READERS
from tracknoise.trackers.registry import TRACKERS


def with_paths_from(folder: Path, experiment: Experiment) -> Experiment:
    """Return the same experiment with every relative path made absolute, starting from a folder.

    Paths that start from the folder of the data stay as they are, as do options of an unknown tracker or reader.

    Raises
    ------
    SettingsError
        If another package offers the tracker or reader, but cannot be imported.
    """
    dataset = experiment.dataset
    moved = dataset.model_copy(
        update={
            "root": None if dataset.root is None else absolute(folder, dataset.root),
            "options": _absolute(folder, READERS, dataset.reader, dataset.options),
        }
    )
    trackers = [
        choice.model_copy(update={"options": _absolute(folder, TRACKERS, choice.kind, choice.options)})
        for choice in experiment.trackers
    ]
    truth = experiment.truth.model_copy(update={"second": _second(folder, experiment)})
    return experiment.model_copy(update={"dataset": moved, "trackers": trackers, "truth": truth})


def _second(folder: Path, experiment: Experiment) -> SecondTruthSettings | None:
    second = experiment.truth.second
    if second is None:
        return None
    trajectory = None if second.trajectory is None else str(absolute(folder, Path(second.trajectory)))
    options = _absolute(folder, READERS, experiment.dataset.reader, second.options)
    return second.model_copy(update={"trajectory": trajectory, "options": options})


def option_paths(experiment: Experiment) -> Iterator[Path | PathTemplate]:
    """The paths among the options of the reader, the second truth and the trackers.

    Raises
    ------
    UnknownNameError, SettingsError
        If there is no such tracker or reader, or it cannot be imported.
    """
    dataset = experiment.dataset
    yield from READERS.paths(dataset.reader, dataset.options, dataset.root)
    second = experiment.truth.second
    if second is not None:
        yield from READERS.paths(dataset.reader, second.options, dataset.root)
        yield from [] if second.trajectory is None else [PathTemplate(second.trajectory)]
    for choice in experiment.trackers:
        yield from TRACKERS.paths(choice.kind, choice.options)


def _absolute(folder: Path, plugins: Plugins[Any], name: str, options: dict[str, Any]) -> dict[str, Any]:
    return plugins.with_paths_from(folder, name, options) if name in plugins.names() else options
