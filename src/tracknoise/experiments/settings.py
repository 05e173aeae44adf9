"""What to run: the sections of an experiment file, and their checks."""

import hashlib
import json
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import tomlkit
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.sequences.sequence import TruthKind

Population = Literal["visible", "projected"]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, use_attribute_docstrings=True)


class DatasetSettings(_Section):
    """Which images."""

    reader: str
    """Name of the format: see `tracknoise datasets`."""
    root: Annotated[Path | None, Field(strict=False)] = None
    """Folder of the data, relative to the experiment file; `--data` takes precedence."""
    scenes: list[str] | None = None
    """Only these scenes; by default all."""
    lightings: list[str] | None = None
    """Only these lightings; by default all."""
    max_frames: Annotated[int, Field(ge=2)] | None = None
    """Only so many frames of each sequence, from the first; by default all."""
    options: dict[str, Any] = {}
    """The reader's own settings."""


class TrackerChoice(_Section):
    """One tracker to measure."""

    kind: str
    """Which tracker: see `tracknoise trackers`."""
    name: Annotated[str, Field(min_length=1)] | None = None
    """What to call it in tables and figures; by default its kind."""
    options: dict[str, Any] = {}
    """Its own settings, where they are not the defaults."""

    @property
    def label(self) -> str:
        """Its name in tables and figures."""
        return self.name or self.kind

    @property
    def path(self) -> str | None:
        """The option `path`, by which trackers name a file that they read; None where there is none."""
        path = self.options.get("path")
        return path if isinstance(path, str) else None

    def with_path_from(self, folder: Path) -> "TrackerChoice":
        """Return the same choice with the option `path`, where it has one, taken from a folder."""
        if self.path is None:
            return self
        return self.model_copy(update={"options": {**self.options, "path": str((folder / self.path).resolve())}})


class TruthSettings(_Section):
    """Where each feature really was."""

    kind: Annotated[TruthKind | None, Field(strict=False)] = None
    """How a feature is fixed in the world; by default the best that the data offer."""
    population: Population = "visible"
    """Which observations trimming looks at: `visible`, or all that can be `projected`, the occluded too."""


class StatisticsSettings(_Section):
    """How errors are summarised."""

    trim_percentile: Annotated[float, Field(gt=0, le=100)] = 90.0
    """Drop tracks whose largest error is above this percentile of their scene and condition; 100 drops none."""
    min_features: Annotated[int, Field(ge=2)] = 100
    """Cut curves where fewer features than this remain."""


class Experiment(_Section):
    """Everything that decides an experiment's numbers."""

    name: Annotated[str, Field(pattern=r"^[^/\\]*[^/\\.][^/\\]*$")]
    """What to call it in the report, and its run folder: a file name."""
    dataset: DatasetSettings
    trackers: Annotated[list[TrackerChoice], Field(min_length=1)]
    speeds: Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=1)] = [1]
    """Every how many frames a tracker sees one."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Of trackers that are random by nature, such as the oracle. Simulations and outlier rejection have their own."""
    truth: TruthSettings = TruthSettings()
    statistics: StatisticsSettings = StatisticsSettings()

    @model_validator(mode="after")
    def _names_and_speeds_differ(self) -> Self:
        labels = [tracker.label for tracker in self.trackers]
        if len(set(labels)) < len(labels):
            raise ValueError(f"trackers need different names, found {', '.join(labels)}")
        if len(set(self.speeds)) < len(self.speeds):
            raise ValueError(f"speeds must differ, found {self.speeds}")
        return self

    def with_root(self, root: Path | None) -> "Experiment":
        """Return the same experiment on data in another folder."""
        return self.model_copy(update={"dataset": self.dataset.model_copy(update={"root": root})})

    def with_paths_from(self, folder: Path) -> "Experiment":
        """Return the same experiment with `dataset.root` and trackers' option `path` taken from a folder."""
        root = self.dataset.root
        based = self.with_root(None if root is None else (folder / root).resolve())
        return based.model_copy(update={"trackers": [tracker.with_path_from(folder) for tracker in self.trackers]})

    def to_toml(self) -> str:
        """Every setting, defaults included, as the text of an experiment file."""
        return tomlkit.dumps(self.model_dump(mode="json", exclude_none=True))

    def digest(self) -> str:
        """Hash of every setting but the place of the data, which may move. Hexadecimal SHA-256."""
        return hashlib.sha256(self.with_root(None).to_toml().encode()).hexdigest()


def parse_experiment(text: str, *, place: str) -> Experiment:
    """Check the text of an experiment file.

    Parameters
    ----------
    text
        TOML.
    place
        What to call it in errors.

    Raises
    ------
    SettingsError
        Naming place, key, what was found and what was expected.
    """
    try:
        return Experiment.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise SettingsError(f"{place}: {error}, expected TOML") from error
    except ValidationError as error:
        raise SettingsError(f"{place}: {_first_problem(error)}") from error


def experiment_schema() -> str:
    """JSON Schema of experiment files, as text; editors check and complete with it."""
    return json.dumps(Experiment.model_json_schema(), indent=2) + "\n"


def _first_problem(error: ValidationError) -> str:
    """The first of pydantic's findings as one line: key, found, expected."""
    problem = error.errors()[0]
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in problem["loc"]).lstrip(".")
    if problem["type"] == "extra_forbidden":
        return str(UnknownNameError("key", key.split(".")[-1], _known_keys(problem["loc"]))) + f" (in {_parent(key)})"
    if problem["type"] == "missing":
        return f"{key}: missing, expected a value"
    if problem["type"] == "value_error":
        return f"{key}: {problem['ctx']['error']}" if key else str(problem["ctx"]["error"])
    expected = problem["msg"].removeprefix("Input should be ")
    return f"{key}: found {problem['input']!r}, expected {expected}"


def _parent(key: str) -> str:
    return f"section {key.rpartition('.')[0]!r}" if "." in key else "the top level"


def _known_keys(location: tuple[int | str, ...]) -> list[str]:
    sections: dict[str, type[BaseModel]] = {
        "dataset": DatasetSettings,
        "trackers": TrackerChoice,
        "truth": TruthSettings,
        "statistics": StatisticsSettings,
    }
    section = sections.get(str(location[0]), Experiment) if len(location) > 1 else Experiment
    return list(section.model_fields)
