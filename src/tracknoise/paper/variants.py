"""The paper's experiments: which of them can be repeated with the available data, and variants of their trackers."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from tracknoise.exceptions import DataError, TracknoiseError
from tracknoise.experiments.load import load_experiment, resolve
from tracknoise.experiments.plan import plan
from tracknoise.experiments.run_statistics import first_lighting
from tracknoise.experiments.settings import Experiment, TrackerChoice, ViewSettings, parse_experiment
from tracknoise.sequences.reader_registry import make_reader
from tracknoise.sequences.sequence import require_directory
from tracknoise.simulation.sdf_files import model_names
from tracknoise.tables.enumerations import Reading, TrimAmong, Trimming
from tracknoise.tables.store import RunFolder
from tracknoise.text import counted
from tracknoise.trackers.rejection import Consensus, ReferencePosition

RECORDED, SIMULATED = ("dtu", "kitti"), ("gazebo-linear", "gazebo-arvr")
"""Presets that repeat experiments of the paper: those that need data, and those that are simulated."""
_CONSENSUS = (Consensus.hypothesis, Consensus.refined)
_VARIED: dict[str, dict[str, tuple[str, ...]]] = {
    "correspondence": {
        "reference": (ReferencePosition.first, ReferencePosition.previous),
        "consensus": _CONSENSUS,
    },
    "lucas-kanade": {"consensus": _CONSENSUS},
}
"""Outlier rejections that are compared, for each kind of tracker."""
_AMONG: dict[Reading, dict[str, TrimAmong]] = {
    Reading.none: {},
    Reading.all: {"trim_among": TrimAmong.all},
    Reading.followed: {"trim_among": TrimAmong.followed},
}
_TRIMMING = {
    Reading.none: Trimming.untrimmed,
    Reading.all: Trimming.trimmed,
    Reading.followed: Trimming.trimmed,
}


@dataclass(frozen=True, slots=True)
class Candidate:
    """An experiment of the paper, and whether it can be repeated."""

    preset: str  # name of the preset
    root: Path | None  # folder of its data, or of models for its worlds; None if there is none
    possible: bool  # whether it can be repeated
    found: str  # one sentence: which data were found, or why there are none


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of each experiment."""

    # scenes, frames: maximum number of scenes, and of frames per scene, or first, last and step of the frames; None for
    # all
    scenes: int | None = None
    frames: int | list[int] | None = None


def candidates(folders: Iterable[Path]) -> list[Candidate]:
    """Search for the data of the paper's experiments in some folders and their direct subfolders.

    Each preset uses the first folder in which its reader finds a sequence. Simulated worlds are made of the models of
    the first folder that has some in Gazebo's format.

    Raises
    ------
    DataError
        If one of the folders does not exist.
    """
    places = [require_directory(folder) for folder in folders]
    models = next((place for place in _within(places) if _holds_models(place)), None)
    found = "Simulated; no data are needed." if models is None else f"Simulated, of the Gazebo models in {models}."
    simulated = [Candidate(preset, models, True, found) for preset in SIMULATED]
    return [*(_look(preset, places) for preset in RECORDED), *simulated]


def load_candidate(candidate: Candidate, limits: Limits) -> Experiment:
    """Load the experiment of a possible candidate.

    Raises
    ------
    SettingsError
        If the folder of models cannot be used.
    """
    is_simulated = candidate.preset in SIMULATED
    root = None if is_simulated else candidate.root
    experiment = load_experiment(candidate.preset, root=root, scenes=limits.scenes, frames=limits.frames)
    if candidate.root is None or not is_simulated:
        return experiment
    return resolve(experiment.with_option("models", str(candidate.root.resolve())))


def as_read(run: RunFolder, reading: Reading) -> Experiment:
    """The experiment of a run with one reading of the paper's trimming, whose run keeps statistics alone.

    Raises
    ------
    StoreError, SettingsError
        If the settings of the run are damaged.
    """
    experiment = parse_experiment(run.experiment_toml(), place=str(run.path))
    sections: dict[str, object] = {
        "statistics": experiment.statistics.model_copy(update=_AMONG[reading]),
        "findings": experiment.findings.model_copy(update={"trimming": _TRIMMING[reading]}),
    }
    return experiment.model_copy(update={**sections, "keep": "statistics"})


def variants(experiment: Experiment) -> Experiment:
    """Experiment that runs each tracker with every outlier rejection, on the first scene at the lowest speed.

    Raises
    ------
    TracknoiseError
        If the experiment cannot be planned.
    """
    lighting = first_lighting({task.sequence.lighting for task in plan(experiment)}, experiment)
    return experiment.model_copy(
        update={
            "name": f"{experiment.name}-differences",
            "paper": None,
            "speeds": [min(experiment.speeds)],
            "views": [ViewSettings(lightings=[lighting])],
            "dataset": experiment.dataset.model_copy(update={"max_scenes": 1}),
            "trackers": [variant for choice in resolve(experiment).trackers for variant in _variants(choice)],
        }
    )


def _variants(choice: TrackerChoice) -> Iterator[TrackerChoice]:
    varied = _VARIED.get(choice.kind, {})
    for values in product(*varied.values()):
        name = ", ".join([choice.label, *map(str, values)])
        rejection: dict[str, Any] = {**choice.options.get("rejection", {}), **dict(zip(varied, values, strict=True))}
        yield TrackerChoice(
            kind=choice.kind,
            name=name,
            options={**choice.options, "rejection": {key: _plain(value) for key, value in rejection.items()}},
        )


def _plain(value: Any) -> Any:
    return str(value) if isinstance(value, str) else value


def _within(folders: Iterable[Path]) -> Iterator[Path]:
    """Folders, each with its direct subfolders behind it."""
    for folder in folders:
        yield folder
        yield from sorted(path for path in folder.iterdir() if path.is_dir())


def _holds_models(folder: Path) -> bool:
    try:
        return bool(model_names(folder))
    except DataError:
        return False


def _look(preset: str, folders: list[Path]) -> Candidate:
    if not folders:
        return Candidate(preset, None, False, "No data folder was given (--data).")
    causes = []
    for place in _within(folders):
        try:
            n_scenes = _count_scenes(preset, place)
        except TracknoiseError as error:
            causes.append(" ".join(str(error).split()))
        else:
            return Candidate(preset, place, True, f"{counted(n_scenes, 'scene')} in {place}.")
    return Candidate(preset, None, False, f"No data: {causes[0]}.")


def _count_scenes(preset: str, folder: Path) -> int:
    dataset = load_experiment(preset, root=folder).dataset
    return len({item.scene for item in make_reader(dataset.reader, folder, dataset.options).sequences()})
