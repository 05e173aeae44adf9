"""The manifest of a run: versions and settings, the sequences that were measured, and those that failed."""

import json
from dataclasses import asdict, dataclass, field
from typing import Any, Self

from tracknoise.exceptions import StoreError
from tracknoise.tables.identity import Direction, SequenceId

FORMAT = 6


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
        Wall time of the measurement. Sequences that were measured together have equal shares of it.
    notes
        What was corrected or assumed while reading, one sentence each.
    inputs
        Hash of the files, other than images, on which the results depend.
    key_frame
        If the truth is a scan, the frame in which features were associated with it.
    group
        What its scene has in common with others that are not independent of it, such as the place; None if unknown.
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
    sha256: dict[str, str] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """File name, without extension, of this sequence's tables."""
        return self.sequence.key


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
        Hash of each table of the whole run, by its name.
    """

    settings_hash: str
    versions: dict[str, str]
    machine: dict[str, str]
    seed: int
    sequences: dict[str, SequenceEntry] = field(default_factory=dict)
    failures: dict[str, str] = field(default_factory=dict)
    excluded_scenes: dict[str, str] = field(default_factory=dict)
    statistics: dict[str, str] = field(default_factory=dict)

    def to_json(self) -> str:
        """The manifest as JSON, with the sequences in the order of their keys."""
        document = {"format": FORMAT, **asdict(self)}
        document["sequences"] = dict(sorted(document["sequences"].items()))
        return json.dumps(document, indent=2) + "\n"

    @classmethod
    def emptied(cls, text: str, *, place: str) -> Self:
        """A manifest of this format without any sequence, to replace one of any format.

        Raises
        ------
        StoreError
            If `text` is not a manifest.
        """
        try:
            is_manifest = isinstance(json.loads(text)["format"], int)
        except (ValueError, KeyError, TypeError) as error:
            raise StoreError(f"{place}: damaged ({error}), expected a run's manifest") from error
        if not is_manifest:
            raise StoreError(f"{place}: damaged, expected a run's manifest")
        return cls(settings_hash="", versions={}, machine={}, seed=0)

    @classmethod
    def from_json(cls, text: str, *, place: str) -> Self:
        """Read the text that `to_json` returned; `place` is its name in errors.

        Raises
        ------
        StoreError
            If it is damaged or of another format.
        """
        try:
            raw: dict[str, Any] = json.loads(text)
            found = raw.pop("format")
            if found != FORMAT:
                remedy = "measure again with --fresh, or read it with the version that wrote it"
                raise StoreError(f"{place}: format {found}, expected {FORMAT}: {remedy}")
            raw["sequences"] = {key: _entry(**entry) for key, entry in raw["sequences"].items()}
            return cls(**raw)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise StoreError(f"{place}: damaged ({error}), expected a run's manifest") from error


def _entry(*, sequence: dict[str, Any], notes: list[str], **rest: Any) -> SequenceEntry:
    """What `Manifest.to_json` wrote of one sequence."""
    direction = Direction(sequence.pop("direction"))
    return SequenceEntry(SequenceId(**sequence, direction=direction), notes=tuple(notes), **rest)
