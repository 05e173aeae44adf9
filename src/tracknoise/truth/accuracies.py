"""What is known of the errors of a truth: from the user, the reader, and the figures shipped for data sets."""

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import cache
from importlib import resources
from typing import Any

from tracknoise.geometry.accuracy import TOPICS, AccuracyKind, TruthAccuracy
from tracknoise.sequences.other_poses import has_other_poses
from tracknoise.sequences.sequence import (
    SWEPT,
    Sequence,
    TruthKind,
    accuracy_of,
    fault_bounds_of,
    fault_shares_of,
    halves_of,
    shutter_of,
    times_of,
)
from tracknoise.tables.identity import SequenceId
from tracknoise.text import significant

_FILE = "truth_accuracy.toml"
_UNITS = {
    "rotation_white_deg": "{} deg in each pose",
    "rotation_deg_per_sqrt_frame": "{} deg per sqrt(frame)",
    "rotation_deg_per_frame": "{} deg per frame",
    "translation_white_m": "{} m in each pose",
    "translation_m_per_sqrt_frame": "{} m per sqrt(frame)",
    "translation_m_per_frame": "{} m per frame",
    "depth_m": "{} m",
    "depth_relative": "{} Z",
    "depth_per_m": "{} Z^2 per m",
    "clock_ms": "{} ms",
    "readout_ms": "{} ms",
    "focal_relative": "{} of the focal length",
}


@dataclass(frozen=True, slots=True)
class AccuracyRule:
    """What a user says about the accuracy of truths.

    Parameters
    ----------
    stated
        Figures that count before all others.
    shipped
        Whether the figures that come with this package count where neither the user nor the data state any.
    """

    stated: TruthAccuracy = TruthAccuracy()  # noqa: RUF009
    shipped: bool = True


DEFAULT_RULE = AccuracyRule()
POSE_TOPICS = frozenset({"rotation", "translation", "clock"})
"""What is stated of these belongs to the stated poses, and to no others."""


@dataclass(frozen=True, slots=True)
class _Row:
    """A row of the file: the scenes for which it holds."""

    dataset: str
    scenes: tuple[str, ...]
    accuracy: TruthAccuracy

    def is_about(self, sequence: SequenceId) -> bool:
        return sequence.dataset == self.dataset and any(fnmatchcase(sequence.scene, pattern) for pattern in self.scenes)


@dataclass(frozen=True, slots=True)
class KnownAccuracy:
    """Accuracy of the truth of one sequence."""

    figures: TruthAccuracy  # what counts
    notes: tuple[str, ...]  # one sentence for each topic whose error is above 0: its size, and where the figure is from
    # whether something is known of poses and, where it counts, of depth: only then are errors of 0 an exact truth
    is_complete: bool


@cache
def shipped_rows() -> tuple[_Row, ...]:
    """The figures that come with this package."""
    source = resources.files("tracknoise.truth") / _FILE
    return tuple(_row(entry) for entry in tomllib.loads(source.read_text(encoding="utf-8"))["row"])


def _row(entry: dict[str, Any]) -> _Row:
    figures = {name: entry[name] for names in TOPICS.values() for name in names if name in entry}
    accuracy = TruthAccuracy(**figures, source=entry["source"], kind=AccuracyKind(entry["kind"]))
    return _Row(entry["dataset"], tuple(entry.get("scenes", ["*"])), accuracy)


def known_accuracy(sequence: Sequence, kind: str, rule: AccuracyRule = DEFAULT_RULE) -> KnownAccuracy:
    """What is known of the errors of a sequence's truth. On each topic the first counts: user, data, shipped figures.

    What reference tracks show of faults counts before these.

    Depth does not count where points lie on an exact surface, nor where the truth measures the errors of its own.
    Clock and readout do not count without times of frames, nor does a shipped readout where the truth accounts for a
    rolling shutter, nor shipped figures of poses and clock where the poses are not those of the reader.

    Parameters
    ----------
    sequence
        The sequence.
    kind
        Of its truth.
    rule
        What the user says.
    """
    useless = {"depth"} if kind in (TruthKind.raycast, SWEPT) else set()
    if times_of(sequence) is None:
        useless |= {"clock", "readout"}
    if halves_of(sequence) is not None:
        useless |= POSE_TOPICS
    figures, notes = TruthAccuracy(), []
    for statement in _statements(sequence, rule):
        new = statement.without(useless | figures.topics)
        notes += list(_notes(new))
        figures = figures.over(new)
    shares = fault_shares_of(sequence)
    left: dict[str, Any] = {name: shares[name] * value for name, value in figures.figures(tuple(shares)).items()}
    figures = replace(figures, **left)
    return KnownAccuracy(figures, tuple(notes), {"rotation", "translation", "depth"} - useless <= figures.topics)


def _statements(sequence: Sequence, rule: AccuracyRule) -> Iterator[TruthAccuracy]:
    """The most important first."""
    yield fault_bounds_of(sequence)
    yield rule.stated
    yield accuracy_of(sequence)
    left_out = {"readout"} if shutter_of(sequence) is not None else set()
    if has_other_poses(sequence):
        left_out |= POSE_TOPICS
    for row in shipped_rows() if rule.shipped else ():
        if row.is_about(sequence.id):
            yield row.accuracy.without(left_out)


def _notes(accuracy: TruthAccuracy) -> Iterator[str]:
    for topic, names in TOPICS.items():
        if sizes := sizes_of(accuracy.figures(names), digits=3):
            source = f": {accuracy.source}" if accuracy.source else ""
            yield f"error of the truth, {topic}: {', '.join(sizes)} ({accuracy.kind}{source})"


def sizes_of(figures: Mapping[str, float], *, digits: int) -> list[str]:
    """``0.05 deg per sqrt(frame)``, for each figure above 0, by the names of `TruthAccuracy`."""
    return [_UNITS[name].format(significant(value, digits)) for name, value in figures.items() if value]
