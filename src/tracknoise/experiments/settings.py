"""The sections of an experiment file, and their checks."""

import ast
import hashlib
import inspect
import json
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import tomlkit
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import ErrorDetails
from pydantic_core.core_schema import ModelSchema

from tracknoise.checks import likeliest_problem
from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.geometry.corrections import UNCORRECTED, Corrections
from tracknoise.inference.conventions import KIND_OF_INTERVAL, LEVEL, IntervalKind
from tracknoise.options import options_schemas, parts_of
from tracknoise.plugins import Plugins
from tracknoise.sequences.frame_range import frames_of, require_range
from tracknoise.sequences.timed_poses import PosesOf
from tracknoise.tables import defaults
from tracknoise.tables.enumerations import Population, TrimAmong, Trimming
from tracknoise.tables.identity import Direction, SequenceId
from tracknoise.text import counted, dotted, is_printable, parse_toml
from tracknoise.trackers.tracker_registry import is_preset, load_preset, preset_names
from tracknoise.truth.accuracies import AccuracyRule
from tracknoise.truth.scan import ScanAnchoring

_Triple = Annotated[list[float], Field(min_length=3, max_length=3)]
SYNTHETIC = frozenset({"oracle", "scripted"})
"""Kinds of trackers whose positions do not come from images, but from the stated truth, whatever is wrong in it."""
SECOND_CAMERA = frozenset({"second-view"})
"""Kinds of trackers whose positions are those in the images of a second camera."""
FROM_FILES = frozenset({"imported"})
"""Kinds of trackers whose positions another program found."""
Keep = Literal["observations", "statistics"]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


def _frames_of_text(given: object) -> object:
    """First, last and step where frames are given as a text; anything else as it is."""
    if not isinstance(given, str):
        return given
    try:
        frames = frames_of("frames =", given)
    except SettingsError as error:
        raise ValueError(str(error)) from error
    return [0, frames - 1] if isinstance(frames, int) else frames


_Frames = Annotated[list[int] | None, BeforeValidator(_frames_of_text, json_schema_input_type=list[int] | str | None)]


def _with_known_placeholders(trajectory: str | None) -> str | None:
    if trajectory is not None:
        SequenceId("", "").expand(trajectory, speed=1)
    return trajectory


_Trajectory = Annotated[str | None, AfterValidator(_with_known_placeholders)]


class DatasetSettings(_Section):
    """Dataset and the part of it that is measured."""

    reader: str
    """Name of the format: see `tracknoise datasets`."""
    root: Annotated[Path | None, Field(strict=False)] = None
    """Folder of the data, relative to the experiment file; `--data` takes precedence."""
    scenes: list[str] | None = None
    """Measure only these scenes. Default: all."""
    lightings: list[str] | None = None
    """Measure only these lightings. Default: all."""
    frames: _Frames = None
    """Measure only these frames of each sequence: `[first, last, step]`, counted from 0, the last included. The step
    is optional. A text is read as `--frames` reads it: `"0:59"`, `"0:59:2"`, or `"60"` for the first 60. Frames are
    numbered from 0 again, and nothing is read of the others. Default: all."""
    max_frames: Annotated[int, Field(ge=2)] | None = None
    """Maximum number of frames of each sequence, from the first of `frames`. Default: all."""
    max_scenes: Annotated[int, Field(ge=1)] | None = None
    """Maximum number of scenes, sorted by name. Default: all."""
    groups: dict[str, Annotated[list[str], Field(min_length=1)]] | None = None
    """Scenes that are not independent of each other, such as pieces of one recording: patterns of their names, such as
    `chess/*`, by group. The first group that fits counts. Other scenes are independent; an empty table makes all of
    them so. Default: what the reader knows. It can be changed without measuring again."""
    trajectory: _Trajectory = None
    """File of poses that replace those of the recording, which may be missing: the trajectory of a SLAM, VIO or
    structure from motion in the format of TUM, EuRoC or KITTI, rows by the names of images, or a folder of COLMAP.
    Relative to the experiment file; `{scene}` and `{lighting}` are replaced. Nothing is taken as known of its errors.
    Default: the poses of the recording."""
    trajectory_of: Annotated[PosesOf, Field(strict=False)] = PosesOf.camera
    """What these poses are poses of: the `camera` of the images, or the `body` that the recording states it is on."""
    trajectory_time_shift_s: float = 0.0
    """Added to the times of the frames to get the clock of the trajectory, seconds; for poses of the body, beside what
    the recording states."""
    options: dict[str, Any] = {}
    """Options of the reader: see `tracknoise datasets NAME`."""

    @field_validator("frames")
    @classmethod
    def _frames_are_a_range(cls, frames: list[int] | None) -> list[int] | None:
        if frames is not None:
            try:
                require_range(frames)
            except SettingsError as error:
                raise ValueError(str(error)) from error
        return frames


class ViewSettings(_Section):
    """One view of every scene: rotation and direction."""

    rotation: Literal[0, 90, 180, 270] = 0
    """Rotation of the images and the camera, degrees counter-clockwise."""
    direction: Annotated[Direction, Field(strict=False)] = Direction.forward
    """Whether frames are played in the order of their recording, or in reverse."""
    lightings: list[str] | None = None
    """Measure only these lightings. Default: all lightings of the experiment."""
    speeds: Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=1)] | None = None
    """Measure only these speeds. Default: all speeds of the experiment."""


class TrackerChoice(_Section):
    """One tracker to measure."""

    kind: str
    """Kind of tracker: see `tracknoise trackers`. A preset knows it."""
    preset: str | None = None
    """Instead of a kind: settings of a system, such as `openvins`. The record of a run has the kind and all options."""
    name: Annotated[str, Field(min_length=1)] | None = None
    """Name of the tracker in tables and figures. Default: its preset or kind."""
    options: dict[str, Any] = {}
    """Options of the tracker that differ from the defaults: see `tracknoise trackers KIND`."""

    @model_validator(mode="before")
    @classmethod
    def _preset_is_written_out(cls, given: object) -> object:
        """Write the kind and the options of a preset instead of it; its name stays that of the tracker."""
        if not isinstance(given, dict):
            return given
        if isinstance(kind := given.get("kind"), str) and is_preset(kind):
            raise ValueError(f"kind = {kind!r} is a preset, expected preset = {kind!r}")
        if not isinstance(given.get("preset"), str):
            return given
        if "kind" in given:
            raise ValueError("found a kind and a preset, expected one of them")
        options = given.get("options", {})
        if not isinstance(options, dict):
            return {**given, "kind": ""}
        try:
            preset = load_preset(given["preset"])
        except UnknownNameError as error:
            raise ValueError(str(error)) from error
        others = {key: value for key, value in given.items() if key != "preset"}
        return {"name": preset.name, **others, "kind": preset.tracker, "options": preset.merged(options)}

    @property
    def label(self) -> str:
        """Its name in tables and figures."""
        return self.name or self.kind


class CorrectionSettings(_Section):
    """Corrections of what the recordings state. Each changes nothing by default. See docs/truth.md."""

    focal_scale: float = UNCORRECTED.focal_scale
    """Factor of both focal lengths."""
    principal_point_px: Annotated[list[float], Field(min_length=2, max_length=2)] = [*UNCORRECTED.principal_point_px]
    """Added to cx and cy, px."""
    k1: float = UNCORRECTED.k1
    """Added to the first coefficient of radial-tangential distortion."""
    depth_scale: float = UNCORRECTED.depth_scale
    """Factor of depths."""
    depth_offset_m: float = UNCORRECTED.depth_offset_m
    """Added to depths, after the factor, metres."""
    inverse_depth_offset_per_m: float = UNCORRECTED.inverse_depth_offset_per_m
    """Added to the inverse of depths, after factor and offset, 1/m. Where it is not positive, there is no depth."""
    depth_along_ray: bool | None = None
    """Whether depths, with their factor and offsets, are distances along the ray. By default they are not."""
    clock_offset_s: float = UNCORRECTED.clock_offset_s
    """The pose at the time of an image plus this fits the image, seconds. For recordings with timestamps."""
    clock_offset_frames: float = UNCORRECTED.clock_offset_frames
    """The same in frames. For recordings without timestamps."""
    clock_drift: float = UNCORRECTED.clock_drift
    """Growth of this offset with time, seconds per second. It is 0 in the middle of the recorded poses. For recordings
    with timestamps."""
    readout_s: float = UNCORRECTED.readout_s
    """Added to the readout of the rolling shutter, seconds. The readout of a recording that states none is 0."""
    mounting_rotation_deg: _Triple = [*UNCORRECTED.mounting_rotation_deg]
    """Rotation of the camera in the frame that the stated poses belong to: axis times angle, degrees."""
    mounting_translation_m: _Triple = [*UNCORRECTED.mounting_translation_m]
    """Position of the camera in that frame, metres."""

    @model_validator(mode="after")
    def _values_are_possible(self) -> Self:
        self.as_corrections()
        return self

    def as_corrections(self) -> Corrections:
        """What the settings stand for."""
        return Corrections(**self.model_dump(exclude_none=True))


class SecondTruthSettings(_Section):
    """A second truth of the same images. Trackers run once, and their errors are computed by both truths."""

    trajectory: _Trajectory = None
    """File of poses, in any format of `dataset.trajectory`, and with the same placeholders."""
    trajectory_of: Annotated[PosesOf, Field(strict=False)] = PosesOf.camera
    """As `dataset.trajectory_of`."""
    time_shift_s: float = 0.0
    """As `dataset.trajectory_time_shift_s`."""
    options: dict[str, Any] = {}
    """Options of the reader that differ for the second truth, such as `poses`."""

    @model_validator(mode="after")
    def _names_one_source(self) -> Self:
        if (self.trajectory is None) == (not self.options):
            raise ValueError("expected either trajectory or options")
        return self


_Figure = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class AccuracySettings(_Section):
    """Standard deviations of the errors of the truth, which make the truth floor. See docs/truth-errors.md.

    Where a figure is given, it counts before what the data state and before the figures that come with tracknoise.
    Frames are those of the recording. Rotations and translations are per axis, between two frames.
    """

    shipped: bool = True
    """Whether the figures that come with tracknoise count where neither this section nor the data state any."""
    rotation_white_deg: _Figure | None = None
    """Error of the rotation of each pose, independent from frame to frame."""
    rotation_deg_per_sqrt_frame: _Figure | None = None
    """Error of the relative rotation of successive frames that grows as a random walk."""
    rotation_deg_per_frame: _Figure | None = None
    """Error of the relative rotation of successive frames that is the same from frame to frame."""
    translation_white_m: _Figure | None = None
    """Error of the position of each pose, independent from frame to frame."""
    translation_m_per_sqrt_frame: _Figure | None = None
    """Error of the relative position of successive frames that grows as a random walk."""
    translation_m_per_frame: _Figure | None = None
    """Error of the relative position of successive frames that is the same from frame to frame."""
    depth_m: _Figure | None = None
    """Error of a depth Z: the root of depth_m² + (depth_relative Z)² + (depth_per_m Z²)²."""
    depth_relative: _Figure | None = None
    """Part of the error of a depth that is proportional to it."""
    depth_per_m: _Figure | None = None
    """Part of the error of a depth that is proportional to its square, per metre."""
    clock_ms: _Figure | None = None
    """Offset between the clocks of images and poses."""
    readout_ms: _Figure | None = None
    """Readout time of a rolling shutter that the truth does not account for."""
    focal_relative: _Figure | None = None
    """Error of the focal length, as a share of it."""

    def rule(self) -> AccuracyRule:
        """The same for `tracknoise.measure`."""
        figures = self.model_dump(exclude={"shipped"})
        return AccuracyRule(TruthAccuracy(**figures, source="this experiment"), shipped=self.shipped)


class TruthSettings(_Section):
    """How true positions of features are computed."""

    kind: str | None = None
    """Kind of truth: `birth`, `raycast`, `scan`, `swept` (depth from other images), `triangulated`, or one of
    another package. Default: the best that the data allow."""
    poses: Literal["refined", "stated"] = "refined"
    """Poses that lead: refined by reference tracks, unless the stated ones are exact or stated to be better, or
    reference tracks do not determine them (`refined`); or the `stated` ones in any case. See docs/truth.md."""
    depth: Literal["recorded", "stereo"] = "recorded"
    """Depth for the truth `birth`: as `recorded`, or by semi-global matching with a second camera (`stereo`)."""
    population: Annotated[Population, Field(strict=False)] = defaults.POPULATION
    """Observations whose errors are used: only `visible` ones, or all with a true position (`projected`)."""
    scan_radius_px: Annotated[float, Field(gt=0)] = defaults.SCAN_RADIUS_PX
    """Largest distance in the key frame between a feature and the projection of its scan point, px."""
    scan_anchoring: Annotated[ScanAnchoring, Field(strict=False)] = ScanAnchoring.ray
    """World point of a feature: on its own `ray` at the depth of the scan point, or the scan `point` itself."""
    corrections: CorrectionSettings = CorrectionSettings()
    """What is to be changed in the stated geometry of the recordings."""
    second: SecondTruthSettings | None = None
    """A second truth of the same images, such as other poses. Default: none."""
    accuracy: AccuracySettings = AccuracySettings()


class StatisticsSettings(_Section):
    """How errors are summarised."""

    trim_percentile: Annotated[float, Field(gt=0, le=100)] = defaults.TRIM_PERCENTILE
    """Drop tracks whose largest error is above this percentile of their scene and condition; 100 drops none."""
    trim_among: Annotated[TrimAmong, Field(strict=False)] = defaults.TRIM_AMONG
    """Tracks from which the percentile is computed: `all` that have an error, as in the paper, or those that were
    `followed` beyond their anchor, where the error is zero by construction."""
    min_features: Annotated[int, Field(ge=2)] = defaults.MIN_FEATURES
    """Curves are cut where fewer features than this remain."""
    tap_vid: bool = False
    """Compute the metrics of TAP-Vid and the expected feature age too. They need truth from depth or an exact surface,
    and the depth of every frame is read once more."""


class FindingsSettings(_Section):
    """Margin, level and intervals of findings. They can be changed without measuring again."""

    trimming: Annotated[Trimming, Field(strict=False)] = defaults.TRIMMING
    """Errors that headlines and verdicts are about: of all tracks (`untrimmed`), or of those that trimming kept
    (`trimmed`), as in the paper. Trimmed errors depend on how many tracks are lost, and on the length of sequences."""
    margin: Annotated[float, Field(gt=0, allow_inf_nan=False)] = defaults.MARGIN
    """Largest relative effect of a factor that counts as no effect."""
    level: Annotated[float, Field(ge=0.5, le=0.99)] = LEVEL
    """Probability that an interval contains the true value."""
    intervals: Annotated[IntervalKind, Field(strict=False)] = KIND_OF_INTERVAL
    """Method of intervals. docs/findings.md names the findings that use another method."""


def _estimator(name: str) -> str:
    """The name of an estimator that takes one sigma."""
    from tracknoise.estimators.exports import estimator, estimator_name

    try:
        resolved = estimator_name(name)
    except (SettingsError, UnknownNameError) as error:
        raise ValueError(str(error)) from error
    if estimator(resolved).purpose is None:
        raise ValueError("an estimator with one sigma: this one takes the components of a noise model")
    return resolved


class EstimatorSettings(_Section):
    """The estimator that findings say what to set in. It can be changed without measuring again."""

    name: Annotated[str, AfterValidator(_estimator)] = "filter"
    """Its name, see `tracknoise export`; or a kind of estimators: `filter` with a gate, `sliding_window`
    with a robust loss, `mapping`, or `pnp` from known points."""
    window: Annotated[int, Field(ge=2)] | None = None
    """Length of its window, processed frames. Default: as shipped."""
    features: Annotated[int, Field(ge=1)] | None = None
    """Features that it uses in a frame: where these have errors in common, sigma grows with them. Default: 200, or with
    an inertial sensor, features that are independent."""


OF_NO_RESULT = ("verify", "check")
"""Settings that no number of a run depends on."""
QUICK_CLIPS, QUICK_FRAMES = 5, 60
"""Clips that are measured for a quick answer, and their frames."""


class Experiment(_Section):
    """All settings of an experiment that affect its results."""

    name: Annotated[str, Field(pattern=r"^[^/\\]*[^/\\.][^/\\]*$")]
    """Name of the experiment in the report, and of its run folder."""
    dataset: DatasetSettings
    trackers: Annotated[list[TrackerChoice], Field(min_length=1)]
    speeds: Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=1)] = [1]
    """At speed s, a tracker sees every s-th frame."""
    views: Annotated[list[ViewSettings], Field(min_length=1)] = [ViewSettings()]
    """Views of the scenes. Default: as recorded."""
    paper: str | None = None
    """Experiment of the paper that this one repeats. The report compares both."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Random seed of trackers such as the oracle. Simulation and outlier rejection have their own seeds."""
    seeds: Annotated[int, Field(ge=1)] = 1
    """Number of random seeds. With more than 1, the measurement is repeated to show how much results depend on the
    seeds of outlier rejection and oracle. All results are those of the first seed."""
    keep: Keep = "observations"
    """What the run folder keeps: all `observations` and tracks, or only `statistics`, which need less space. Figures of
    single errors require observations. All other figures and tables are the same."""
    part_frames: Annotated[int, Field(ge=2)] | None = None
    """Frames of the parts in which a longer sequence is measured. Tracks end at the end of a part. Default: as many as
    500 processed frames, of all trackers and speeds together (fewer above 640x480), at least 120, and an even number of
    parts."""
    clips: Annotated[int, Field(ge=1)] | None = None
    """Measure this many parts only, spread evenly over each sequence. Default: all of it."""
    verify: bool = False
    """When a run resumes, compare images and depth maps by content with those that were measured, not only by size and
    time of modification."""
    check: Annotated[Path | None, Field(strict=False)] = None
    """What `tracknoise check -o FILE.json` wrote, relative to the experiment file: the run says what it changed in that
    verdict. It can be changed without measuring again."""
    truth: TruthSettings = TruthSettings()
    statistics: StatisticsSettings = StatisticsSettings()
    findings: FindingsSettings = FindingsSettings()
    estimator: EstimatorSettings = EstimatorSettings()

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

    @model_validator(mode="after")
    def _texts_are_printable(self) -> Self:
        self.require_printable()
        return self

    def require_printable(self) -> None:
        """Refuse control characters in any text: a name, a path or an option."""
        for key, value in dotted(self.model_dump()):
            texts = [str(item) for item in (value if isinstance(value, list) else [value])]
            if not all(map(is_printable, (key, *texts))):
                raise ValueError(f"{key}: found {value!r}, expected UTF-8 without control characters")

    def with_limits(self, *, scenes: int | None, frames: int | None) -> "Experiment":
        """Return a copy with a maximum number of scenes, and of frames per scene; None changes nothing."""
        limits = {"max_scenes": scenes, "max_frames": frames}
        return self._with_dataset({name: value for name, value in limits.items() if value is not None})

    def with_frames(self, frames: list[int] | None) -> "Experiment":
        """Return a copy with other frames: first, last and step; None for all."""
        return self._with_dataset({"frames": frames})

    def with_speeds(self, speeds: list[int]) -> "Experiment":
        """Return a copy with other speeds, of all views."""
        if min(speeds, default=0) < 1 or len(set(speeds)) < len(speeds):
            raise SettingsError(f"speeds = {speeds}, expected different whole numbers from 1")
        views = [view.model_copy(update={"speeds": None}) for view in self.views]
        return self.model_copy(update={"speeds": speeds, "views": views})

    def with_trackers(self, names: list[str]) -> "Experiment":
        """Return a copy with other trackers: those of the experiment by name, others by kind with default options."""
        if not names or len(set(names)) < len(names):
            raise SettingsError(f"trackers = {', '.join(names)}, expected different names")
        by_label = {tracker.label: tracker for tracker in self.trackers}
        chosen = [by_label.get(name) or _choice(name) for name in names]
        return self.model_copy(update={"trackers": chosen})

    def with_scenes(self, most: int | None) -> "Experiment":
        """Return a copy with a maximum number of scenes; None means all."""
        return self._with_dataset({"max_scenes": most})

    def quick(self, n_scenes: int) -> "Experiment":
        """Return a copy that measures a few clips of a few scenes, of how many there are, at the slowest speed."""
        changes = {
            "name": f"{self.name}-quick",
            "part_frames": QUICK_FRAMES,
            "clips": max(1, round(QUICK_CLIPS / max(1, min(n_scenes, QUICK_CLIPS)))),
        }
        few = self.with_speeds([min(self.speeds)]).with_scenes(min(self.dataset.max_scenes or n_scenes, QUICK_CLIPS))
        return few.model_copy(update=changes)

    def with_findings_of(self, other: "Experiment") -> "Experiment":
        """Return a copy with the settings of another experiment that change no measurement."""
        return self.model_copy(update={name: getattr(other, name) for name in ("findings", "estimator", *OF_NO_RESULT)})

    def with_groups(self, groups: dict[str, list[str]] | None) -> "Experiment":
        """Return a copy with other groups of scenes; None for those that the reader knows."""
        return self._with_dataset({"groups": groups})

    def with_option(self, name: str, value: object) -> "Experiment":
        """Return a copy with another value of one option of the reader."""
        return self._with_dataset({"options": {**self.dataset.options, name: value}})

    def with_root(self, root: Path | None) -> "Experiment":
        """Return a copy with another data folder."""
        return self._with_dataset({"root": root})

    def _with_dataset(self, changes: dict[str, Any]) -> "Experiment":
        return self.model_copy(update={"dataset": self.dataset.model_copy(update=changes)})

    def to_toml(self) -> str:
        """Every setting, defaults included, as the text of an experiment file."""
        return tomlkit.dumps(self.model_dump(mode="json", exclude_none=True))

    def digest(self) -> str:
        """Hexadecimal SHA-256 of all settings that a measurement depends on. The folder of the data may move."""
        settings = self.with_root(None).model_dump(mode="json", exclude_none=True, exclude=set(OF_NO_RESULT))
        return hashlib.sha256(tomlkit.dumps(settings).encode()).hexdigest()


def parse_experiment(text: str, *, place: str) -> Experiment:
    """Check the text of an experiment file.

    Parameters
    ----------
    text
        TOML.
    place
        Its name in errors.

    Raises
    ------
    SettingsError
        Naming place, key, what was found and what was expected.
    """
    try:
        return Experiment.model_validate(parse_toml(text))
    except ValidationError as error:
        raise SettingsError(f"{place}: {_first_problem(error)}") from error
    except ValueError as error:
        raise SettingsError(f"{place}: {error}") from error


def _choice(name: str) -> TrackerChoice:
    """A tracker by the name of its preset or kind, with default options."""
    return TrackerChoice.model_validate({"preset" if is_preset(name) else "kind": name})


class _Described(GenerateJsonSchema):
    """Settings are described by the texts below them in this file. Pydantic would read it whenever it is imported."""

    def model_schema(self, schema: ModelSchema) -> dict[str, Any]:
        made = super().model_schema(schema)
        for name, text in _texts_below(schema["cls"]).items():
            made["properties"][name]["description"] = text
        return made


def _texts_below(model: type) -> dict[str, str]:
    """The text below each setting of a section, by name."""
    (section,) = ast.parse(inspect.getsource(model)).body
    assert isinstance(section, ast.ClassDef)
    return {
        setting.target.id: inspect.cleandoc(str(below.value.value))
        for setting, below in pairwise(section.body)
        if isinstance(setting, ast.AnnAssign) and isinstance(setting.target, ast.Name)
        if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
    }


def experiment_schema() -> str:
    """JSON Schema of experiment files, as text; editors check and complete with it.

    It has the options of the built-in readers and trackers. Those of plug-ins are not checked.
    """
    from tracknoise.sequences.reader_registry import READERS
    from tracknoise.trackers.tracker_registry import TRACKERS

    schema = Experiment.model_json_schema(schema_generator=_Described)
    _add_options(schema["$defs"], "DatasetSettings", "reader", READERS)
    _add_options(schema["$defs"], "TrackerChoice", "kind", TRACKERS)
    _offer_presets(schema["$defs"]["TrackerChoice"])
    return json.dumps(schema, indent=2) + "\n"


def _add_options(definitions: dict[str, Any], section: str, key: str, plugins: Plugins[Any]) -> None:
    """Say in a section of the schema which options there are for each value of a key."""
    schemas, more = options_schemas({name: plugins.load(name) for name in plugins.built_in}, plugins.given)
    taken = definitions.keys() & more.keys()
    assert not any(definitions[name] != more[name] for name in taken), f"two meanings of {taken}"
    definitions |= more
    definitions[section]["allOf"] = [
        {"if": {"properties": {key: {"const": name}}}, "then": _with_options(schema, more)}
        for name, schema in schemas.items()
    ]


def _offer_presets(choice: dict[str, Any]) -> None:
    """Say in the section of a tracker that it has a kind or a preset, and which presets there are."""
    choice["required"].remove("kind")
    choice["oneOf"] = [{"required": ["kind"]}, {"required": ["preset"]}]
    choice["properties"]["preset"] = {
        "description": choice["properties"]["preset"]["description"],
        "enum": preset_names(),
        "type": "string",
    }


def _with_options(schema: dict[str, Any], definitions: dict[str, Any]) -> dict[str, Any]:
    """A section with the options of a reference; they may be missing where none of them is required."""
    section: dict[str, Any] = {"properties": {"options": schema}}
    required = definitions[schema["$ref"].rpartition("/")[2]]["required"]
    return {**section, "required": ["options"]} if required else section


def _first_problem(error: ValidationError) -> str:
    """The first of pydantic's findings as one line: key, found, expected."""
    problem = likeliest_problem(error.errors())
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in problem["loc"]).lstrip(".")
    if problem["type"] == "extra_forbidden":
        return str(UnknownNameError("key", str(problem["loc"][-1]), _known_keys(problem["loc"]))) + f" ({_parent(key)})"
    if problem["type"] == "missing":
        return f"{key}: missing, expected a value"
    if problem["type"] == "value_error":
        return f"{key}: {problem['ctx']['error']}" if key else str(problem["ctx"]["error"])
    return f"{key}: found {problem['input']!r}, expected {_expected(problem)}"


def _expected(problem: ErrorDetails) -> str:
    """What was expected, in other words than pydantic's where those are about its own work."""
    limits = problem.get("ctx", {})
    if problem["type"] == "too_short":
        return f"at least {counted(limits['min_length'], 'value')}"
    if problem["type"] == "too_long":
        return f"at most {counted(limits['max_length'], 'value')}"
    if problem["type"] == "string_too_short":
        return "a text that is not empty"
    if problem["type"] == "path_type":
        return "a path"
    if problem["type"] == "string_pattern_mismatch":
        return "a name without / and \\ that is not all dots, because a folder is called like it"
    return problem["msg"].removeprefix("Input should be ")


def _parent(key: str) -> str:
    return f"in section {key.rpartition('.')[0]!r}" if "." in key else "at the top level"


def _known_keys(location: tuple[int | str, ...]) -> list[str]:
    """Keys of the section in which the last part of a location stands."""
    section: type[BaseModel] = Experiment
    for part in location[:-1]:
        if isinstance(part, str):
            section = next(filter(_is_section, parts_of(section.model_fields[part].annotation)))
    return list(section.model_fields)


def _is_section(kind: object) -> bool:
    return isinstance(kind, type) and issubclass(kind, BaseModel)
