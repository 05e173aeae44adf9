"""What a run folder says of itself: its manifest, and those of its settings that readers of it need.

The manifest carries a hash of its own content, so that damage is noticed when it is read.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from functools import cache
from math import sqrt
from statistics import fmean, median
from typing import TYPE_CHECKING, Any, Self

from tracknoise.checks import in_one_line
from tracknoise.exceptions import StoreError
from tracknoise.tables.enumerations import Population, Trimming
from tracknoise.tables.identity import Direction, SequenceId
from tracknoise.text import parse_toml

if TYPE_CHECKING:
    from pydantic import TypeAdapter


FORMAT = 13
_SEAL = "sha256"
_REMEDY = "measure again with --fresh"


LEADING = REFINED, STATED = "refined", "stated"
"""Poses that lead: refined by reference tracks, or those that the data state."""


@dataclass(frozen=True, slots=True)
class PoseFit:
    """Which poses of a sequence lead, and what its reference tracks say about them.

    Attributes
    ----------
    leads
        Whether poses lead that were refined by reference tracks.
    references
        Median number of reference tracks in a frame; None where they were not followed.
    left_px
        RMS of true positions by what is left of the errors of the refined poses, both coordinates together, px. It
        contains what constant faults may leave that reference tracks do not exclude.
    stated_px
        What the stated poses would add, likewise.
    age
        At which these hold, frames.
    next_px
        What the stated poses would add at age 1, px.
    stated_errors
        How the errors of relative stated poses grow, (pose.law), by the names of `TruthAccuracy`; None where they are
        not larger than reference tracks can tell.
    corrections
        Of the stated depths, by the names of `Corrections`: what reference tracks say beyond what other poses explain.
    joins_depths
        Whether depths of features are joined from the maps of neighbouring frames.
    reason
        Why stated poses lead, a sentence; empty where refined ones do.
    """

    leads: bool
    references: float | None = None
    left_px: float | None = None
    stated_px: float | None = None
    age: int | None = None
    next_px: float | None = None
    stated_errors: Mapping[str, float] | None = None
    corrections: Mapping[str, float] = field(default_factory=dict)
    joins_depths: bool = False
    reason: str = ""

    @property
    def of_depths(self) -> str:
        """What was done with depths, sentences; empty where they are as stated."""
        added = [_ADDED[name].format(f"{value:.3g}") for name, value in self.corrections.items()]
        joined = ["Depths were joined from the maps of neighbouring frames."] if self.joins_depths else []
        return " ".join([*added, *joined])


_ADDED = {
    "inverse_depth_offset_per_m": "{} 1/m was added to inverse depths, by reference tracks.",
    "depth_offset_m": "{} m was added to depths, by reference tracks.",
}


def joined_fit(fits: Sequence[PoseFit | None]) -> PoseFit | None:
    """Of several sequences or parts together: refined poses lead where they do in all.

    Numbers are medians, those of errors roots of means of squares, of those that have them. The reason is the first.
    """
    pose_fits = [fit for fit in fits if fit is not None]
    if not pose_fits:
        return None
    numbers = {name: [getattr(fit, name) for fit in pose_fits] for name in ("left_px", "stated_px", "next_px")}
    counts = [fit.references for fit in pose_fits if fit.references is not None]
    ages = [fit.age for fit in pose_fits if fit.age is not None]
    laws = [fit.stated_errors for fit in pose_fits if fit.stated_errors is not None]
    names = dict.fromkeys(name for law in laws for name in law)
    corrected = dict.fromkeys(name for fit in pose_fits for name in fit.corrections)
    return PoseFit(
        all(fit.leads for fit in pose_fits),
        references=median(counts) if counts else None,
        age=max(ages, default=None),
        stated_errors={name: _together([law.get(name) for law in laws]) or 0.0 for name in names} or None,
        corrections={name: median(fit.corrections.get(name, 0.0) for fit in pose_fits) for name in corrected},
        joins_depths=any(fit.joins_depths for fit in pose_fits),
        reason=next((fit.reason for fit in pose_fits if fit.reason), ""),
        **{name: _together(values) for name, values in numbers.items()},
    )


def _together(values: Sequence[float | None]) -> float | None:
    """Root of the mean of the squares of those that are known."""
    numbers = [value for value in values if value is not None]
    return sqrt(fmean(value * value for value in numbers)) if numbers else None


@dataclass(frozen=True, slots=True)
class SequenceEntry:
    """The manifest's entry for one measured sequence.

    Attributes
    ----------
    sequence
        Its identity.
    n_frames, width, height
        Number and size (px) of its images.
    truth
        Kind of truth used.
    snapshot_frame
        Frame whose image is in ``snapshots/``.
    seconds
        Wall time of the measurement. Sequences that were measured together have equal shares of it. It is the only
        value that the hash of the manifest does not cover, so that equal runs have equal hashes.
    notes
        What was corrected or assumed while reading, one sentence each.
    wrong_tracks
        Why tracks do not follow its images, and what mends it, by tracker; empty where all do, or it is not determined.
    confirmed_share
        Largest share of the squared differences between tracks and truth that its images confirm; None where this is
        not determined, or built-in trackers saw the images.
    doubts
        Why its data cannot be right, one or two sentences each; empty where nothing looks wrong.
    cautions
        What looks wrong in single parts of its data, likewise.
    depth_edges
        Share of the pixels with depth at which depths of neighbours differ, if features have the depth of dense maps.
    first_depth_m
        Median depth of the first frame, where features have the depth of maps; otherwise None.
    states_accuracy
        Whether the errors of its poses, and of its depths where they count, are stated.
    pose_fit
        Which of its poses lead; None where only stated ones were to.
    inputs
        Hash of the files that it was measured from: of their paths, from the folder of the data, and contents.
    key_frame
        If the truth is a scan, the frame in which features were associated with it.
    group
        What its scene has in common with others that are not independent of it, such as the place; None if unknown.
    z_depth_from
        What the program computed depths from, if they are along z by construction; otherwise None.
    kernels
        Machine code that numerical libraries used: see `tracknoise.experiments.machine`. Empty where unknown.
    image
        Hash of the pixels of the image in ``snapshots/``; empty where they are of one gray value.
    parts
        First frame of each part in which it was measured, and the frame after its last; none if in one piece.
    sha256
        Hash of each of its files, by the folder that holds it.
    """

    sequence: SequenceId
    n_frames: int
    width: int
    height: int
    truth: str
    snapshot_frame: int
    seconds: float
    notes: tuple[str, ...] = ()
    inputs: str = ""
    key_frame: int | None = None
    group: str | None = None
    z_depth_from: str | None = None
    kernels: str = ""
    wrong_tracks: tuple[tuple[str, str], ...] = ()
    confirmed_share: float | None = None
    doubts: tuple[str, ...] = ()
    cautions: tuple[str, ...] = ()
    depth_edges: float = 0.0
    first_depth_m: float | None = None
    states_accuracy: bool = False
    pose_fit: PoseFit | None = None
    image: str = ""
    parts: tuple[tuple[int, int], ...] = ()
    sha256: dict[str, str] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """File name, without extension, of this sequence's tables."""
        return self.sequence.key

    @property
    def truth_is_fitted(self) -> bool:
        """Whether true positions are fitted to the tracks that they are compared with."""
        return self.truth == "triangulated"

    @property
    def depth_is_from_images(self) -> bool:
        """Whether depths are computed from the images of other frames: not every track has one."""
        return self.truth == "swept"

    @property
    def leading_poses(self) -> str:
        """Which poses lead: one of `LEADING`."""
        return REFINED if self.pose_fit is not None and self.pose_fit.leads else STATED


@dataclass(frozen=True, slots=True)
class FailureEntry:
    """The entry in ``failures.jsonl`` for one sequence that could not be measured.

    Attributes
    ----------
    cause
        One line.
    place
        The file, line of the program, or worker where it happened; None if unknown.
    attempts
        Number of attempts.
    """

    cause: str
    place: str | None
    attempts: int


@dataclass(slots=True)
class Manifest:
    """State of a run, and the software and machine that measured it.

    Attributes
    ----------
    settings_hash
        Hash of all settings of the experiment except the folder of its data.
    versions
        Of tracknoise, Python, the libraries that affect results, and the packages of plug-ins.
    machine
        System, processor and number of cores.
    seed
        Random seed of the experiment.
    sequences
        Measured sequences, by key.
    failures
        Cause of each failure, by key of the sequence.
    excluded_scenes
        Reasons why scenes of the data set are not measured, by scene.
    statistics
        Hash of each table of the whole run, by its name, and of ``findings.json``.
    experiment_sha256
        Hashes that ``experiment.toml`` may have: one, or both the old and the new while the file is replaced.
    """

    settings_hash: str
    versions: dict[str, str]
    machine: dict[str, str]
    seed: int
    sequences: dict[str, SequenceEntry] = field(default_factory=dict)
    failures: dict[str, str] = field(default_factory=dict)
    excluded_scenes: dict[str, str] = field(default_factory=dict)
    statistics: dict[str, str] = field(default_factory=dict)
    experiment_sha256: list[str] = field(default_factory=list)

    def to_json(self) -> str:
        """The manifest as JSON, with the sequences in the order of their keys, and with its own hash."""
        entries = {key: _as_object(entry) for key, entry in sorted(self.sequences.items())}
        document = {"format": FORMAT, **_fields_of(self), "sequences": entries}
        return json.dumps({**document, _SEAL: _digest(document)}, indent=2) + "\n"

    @classmethod
    def empty(cls) -> Self:
        """A manifest without any sequence, to replace one of any format."""
        return cls(settings_hash="", versions={}, machine={}, seed=0)

    @classmethod
    def from_json(cls, text: str, *, place: str) -> Self:
        """Read the text that `to_json` returned; `place` is its name in errors."""
        try:
            raw: dict[str, Any] = json.loads(text)
            file_format = raw.pop("format")
            if isinstance(file_format, int) and file_format != FORMAT:
                remedy = f"{_REMEDY}, or read it with the version that wrote it"
                raise StoreError(f"{place}: format {file_format}, expected {FORMAT}: {remedy}")
            if raw.pop(_SEAL) != _digest({"format": file_format, **raw}):
                raise StoreError(damaged(place, "checksum mismatch"))
            _require_types(raw)
            raw["sequences"] = {key: _entry(**entry) for key, entry in raw["sequences"].items()}
            return cls(**raw)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise StoreError(damaged(place, str(error))) from error


def has_format(text: str) -> bool:
    """Whether a text is JSON with the format of a manifest, whatever its value."""
    try:
        return isinstance(json.loads(text)["format"], int)
    except (ValueError, KeyError, TypeError, RecursionError):
        return False


def damaged(place: str, why: str) -> str:
    """Message about a manifest that cannot be read."""
    return f"{place}: damaged ({why}), expected a run's manifest; {_REMEDY}"


def _require_types(raw: dict[str, Any]) -> None:
    """Check the types of all values."""
    from pydantic import ValidationError

    try:
        _manifest_adapter().validate_python(raw)
    except ValidationError as error:
        raise ValueError(in_one_line(error.errors())) from error


@cache
def _manifest_adapter() -> "TypeAdapter[Manifest]":
    from pydantic import TypeAdapter

    return TypeAdapter(Manifest)


def _digest(document: Mapping[str, Any]) -> str:
    """Hexadecimal SHA-256 of a manifest without the times that its sequences took."""
    timeless = {key: {**entry, "seconds": None} for key, entry in document["sequences"].items()}
    return hashlib.sha256(json.dumps({**document, "sequences": timeless}).encode()).hexdigest()


def _as_object(entry: SequenceEntry) -> dict[str, Any]:
    """What is written of one sequence."""
    fit = None if entry.pose_fit is None else asdict(entry.pose_fit)
    return {**_fields_of(entry), "sequence": asdict(entry.sequence), "pose_fit": fit}


def _fields_of(record: Manifest | SequenceEntry) -> dict[str, Any]:
    """Values of the fields, by name; unlike those of `asdict`, no copies, which take long in a large run."""
    return {field.name: getattr(record, field.name) for field in fields(record)}


_LISTS = ("notes", "doubts", "cautions")


def _entry(*, sequence: dict[str, Any], **rest: Any) -> SequenceEntry:
    """What `Manifest.to_json` wrote of one sequence."""
    direction = Direction(sequence.pop("direction"))
    rest |= {name: tuple(rest.get(name) or ()) for name in _LISTS}
    rest["wrong_tracks"] = tuple((text, step) for text, step in rest.get("wrong_tracks") or ())
    rest["pose_fit"] = None if rest.get("pose_fit") is None else PoseFit(**rest["pose_fit"])
    rest["parts"] = tuple((first, stop) for first, stop in rest.get("parts") or ())
    return SequenceEntry(SequenceId(**sequence, direction=direction), **rest)


@dataclass(frozen=True, slots=True)
class _Dataset:
    lightings: list[str] | None = None
    frames: tuple[int, int] | tuple[int, int, int] | None = None
    groups: dict[str, list[str]] | None = None


@dataclass(frozen=True, slots=True)
class _Tracker:
    kind: str
    name: str | None = None
    options: dict[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class _Truth:
    population: Population
    corrections: dict[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class _Statistics:
    min_features: int


@dataclass(frozen=True, slots=True)
class _Findings:
    trimming: Trimming


@dataclass(frozen=True, slots=True)
class _Settings:
    """Settings without a default are those that every experiment has. There may be others."""

    name: str
    keep: str
    dataset: _Dataset
    trackers: list[_Tracker]
    truth: _Truth
    statistics: _Statistics
    findings: _Findings
    paper: str | None = None


def parse_run_settings(text: str) -> dict[str, Any]:
    """What the resolved settings of a run are, by their keys."""
    from pydantic import ValidationError

    settings = parse_toml(text)
    try:
        _setting_adapter().validate_python(settings)
    except ValidationError as error:
        raise ValueError(in_one_line(error.errors())) from error
    return settings


@cache
def _setting_adapter() -> "TypeAdapter[_Settings]":
    from pydantic import TypeAdapter

    return TypeAdapter(_Settings)
