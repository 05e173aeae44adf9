"""What to run: the sections of an experiment file, and their checks."""

import hashlib
import json
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import tomlkit
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.findings.sampling.resampling import LEVEL
from tracknoise.sequences.sequence import TruthKind
from tracknoise.statistics.effects import MARGIN
from tracknoise.tables.identity import Direction
from tracknoise.truth.scan import ScanAnchoring

Population = Literal["visible", "projected"]
TrimAmong = Literal["all", "followed"]
Keep = Literal["observations", "statistics"]


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
    max_scenes: Annotated[int, Field(ge=1)] | None = None
    """Only so many scenes, the first by name; by default all."""
    options: dict[str, Any] = {}
    """The reader's own settings."""


class ViewSettings(_Section):
    """One way to see every scene."""

    rotation: Literal[0, 90, 180, 270] = 0
    """By how many degrees images are turned counter-clockwise, and the camera with them."""
    direction: Annotated[Direction, Field(strict=False)] = Direction.forward
    """Whether frames come in the order of their recording, or the last first."""
    lightings: list[str] | None = None
    """Only under these lightings; by default all of the experiment."""
    speeds: Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=1)] | None = None
    """Only at these speeds; by default all of the experiment."""


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


class TruthSettings(_Section):
    """Where each feature really was."""

    kind: Annotated[TruthKind | None, Field(strict=False)] = None
    """How a feature is fixed in the world; by default the best that the data offer."""
    population: Population = "visible"
    """Which observations trimming looks at: `visible`, or all that can be `projected`, the occluded too."""
    scan_radius_px: Annotated[float, Field(gt=0)] = 0.25
    """How near the projection of a scan point must lie to a feature in the key frame to be associated with it."""
    scan_anchoring: Annotated[ScanAnchoring, Field(strict=False)] = ScanAnchoring.ray
    """What a feature takes of its scan point: the depth along its own `ray`, or the `point` itself."""


class StatisticsSettings(_Section):
    """How errors are summarised."""

    trim_percentile: Annotated[float, Field(gt=0, le=100)] = 90.0
    """Drop tracks whose largest error is above this percentile of their scene and condition; 100 drops none."""
    trim_among: TrimAmong = "all"
    """Of which tracks that percentile is taken: of `all` that have an error, as in the paper, or of those `followed`,
    which have one away from the frame that fixes their true position, where it is zero by construction."""
    min_features: Annotated[int, Field(ge=2)] = 100
    """Cut curves where fewer features than this remain."""


class FindingsSettings(_Section):
    """What is asked of the statistics, and how surely; may change from one start of a run to the next."""

    margin: Annotated[float, Field(gt=0, allow_inf_nan=False)] = MARGIN
    """Largest relative effect of a factor that does not matter."""
    level: Annotated[float, Field(ge=0.5, le=0.99)] = LEVEL
    """Share of intervals that hold the true value."""
    intervals: Literal["student", "percentile", "bca"] = "student"
    """How intervals of curves, lifetimes and outlier ratios are made: see docs/findings.md."""


class Experiment(_Section):
    """Everything that decides an experiment's numbers."""

    name: Annotated[str, Field(pattern=r"^[^/\\]*[^/\\.][^/\\]*$")]
    """What to call it in the report, and its run folder: a file name."""
    dataset: DatasetSettings
    trackers: Annotated[list[TrackerChoice], Field(min_length=1)]
    speeds: Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=1)] = [1]
    """Every how many frames a tracker sees one."""
    views: Annotated[list[ViewSettings], Field(min_length=1)] = [ViewSettings()]
    """In which ways scenes are seen: by default as they were recorded."""
    paper: str | None = None
    """Which experiment of the paper this repeats: the report sets the paper's findings beside its own."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Of trackers that are random by nature, such as the oracle. Simulations and outlier rejection have their own."""
    keep: Keep = "observations"
    """What the run folder keeps of a sequence: all `observations` and tracks, or `statistics` alone, which is smaller,
    and enough for every table of the run and all figures but those of single errors. Numbers are the same."""
    truth: TruthSettings = TruthSettings()
    statistics: StatisticsSettings = StatisticsSettings()
    findings: FindingsSettings = FindingsSettings()

    @model_validator(mode="after")
    def _values_differ(self) -> Self:
        labels = [tracker.label for tracker in self.trackers]
        if len(set(labels)) < len(labels):
            raise ValueError(f"trackers need different names, found {', '.join(labels)}")
        for speeds in (self.speeds, *(view.speeds or [] for view in self.views)):
            if len(set(speeds)) < len(speeds):
                raise ValueError(f"speeds must differ, found {speeds}")
        ways = [(view.rotation, str(view.direction)) for view in self.views]
        if len(set(ways)) < len(ways):
            raise ValueError(f"views must differ in rotation or direction, found {ways}")
        return self

    def with_limits(self, *, scenes: int | None, frames: int | None) -> "Experiment":
        """Return the same experiment on so many scenes, and frames of each; None leaves it as it is."""
        limits = {"max_scenes": scenes, "max_frames": frames}
        return self._with_dataset({name: value for name, value in limits.items() if value is not None})

    def with_scenes(self, most: int | None) -> "Experiment":
        """Return the same experiment on at most so many scenes; None is for all."""
        return self._with_dataset({"max_scenes": most})

    def with_findings(self, settings: FindingsSettings) -> "Experiment":
        """Return the same experiment of which other things are asked."""
        return self.model_copy(update={"findings": settings})

    def with_option(self, name: str, value: object) -> "Experiment":
        """Return the same experiment with another value of an option of its reader."""
        return self._with_dataset({"options": {**self.dataset.options, name: value}})

    def with_root(self, root: Path | None) -> "Experiment":
        """Return the same experiment on data in another folder."""
        return self._with_dataset({"root": root})

    def _with_dataset(self, changes: dict[str, Any]) -> "Experiment":
        return self.model_copy(update={"dataset": self.dataset.model_copy(update=changes)})

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
        "views": ViewSettings,
        "trackers": TrackerChoice,
        "truth": TruthSettings,
        "statistics": StatisticsSettings,
        "findings": FindingsSettings,
    }
    section = sections.get(str(location[0]), Experiment) if len(location) > 1 else Experiment
    return list(section.model_fields)
