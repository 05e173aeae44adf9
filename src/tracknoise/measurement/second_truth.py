"""A second truth of the same images: other poses, another calibration, or both."""

from collections.abc import Sequence as Items

from tracknoise.exceptions import DataError
from tracknoise.printable import counted
from tracknoise.sequences.sequence import Sequence
from tracknoise.truth.registry import make_truth
from tracknoise.truth.scan_rule import ScanRule
from tracknoise.truth.truth import Truth


def open_second_truths(
    sequences: Items[Sequence], truths: Items[Truth], second: Items[Sequence], *, scan_rule: ScanRule
) -> list[Truth] | None:
    """The second truth of each sequence, of the same kind as its first; None where there is none.

    Raises
    ------
    DataError
        If a sequence and its second truth do not have the same number of frames, or the same size of images, or the
        second lacks what this kind of truth needs.
    SettingsError
        If the second does not offer this kind of truth.
    """
    if not second:
        return None
    for sequence, other in zip(sequences, second, strict=True):
        found, expected = _frames_and_size(other), _frames_and_size(sequence)
        if found != expected:
            raise DataError(other.source, f"a second truth of {found}", f"{expected}, as the first")
    return [make_truth(other, known.kind, scan_rule=scan_rule) for other, known in zip(second, truths, strict=True)]


def second_notes(sequence: Sequence, other: Sequence) -> tuple[str, ...]:
    """The notes that only the second truth has."""
    return tuple(f"second truth: {note}" for note in other.notes if note not in sequence.notes)


def _frames_and_size(sequence: Sequence) -> str:
    return f"{counted(len(sequence), 'frame')} of {sequence.camera.width}x{sequence.camera.height}"
