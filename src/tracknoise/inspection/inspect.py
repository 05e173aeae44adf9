"""Check a recording: all topics of each sequence, and the verdict."""

from collections.abc import Callable, Iterator

from tracknoise.exceptions import DataError
from tracknoise.inspection.check_report import CheckReport, Item, SequenceReport, Severity
from tracknoise.inspection.clipped_depth import clipped_depth
from tracknoise.inspection.clock import clock
from tracknoise.inspection.depths import depths
from tracknoise.inspection.evidence import Evidence
from tracknoise.inspection.files_and_rates import counts, intrinsics, reader_notes, rotations, timestamps
from tracknoise.inspection.focal_length import focal_length
from tracknoise.inspection.independence import independence
from tracknoise.inspection.jumps import pose_jumps
from tracknoise.inspection.mistakes import mistakes
from tracknoise.inspection.warping import warping
from tracknoise.sequences.sequence import Reader, Sequence
from tracknoise.tables.identity import readable

MOST_SEQUENCES = 3
"""Of larger data sets, images of this many sequences are read; poses of all."""

_FROM_POSES: tuple[Callable[[Sequence], Item], ...] = (counts, timestamps, rotations, pose_jumps, intrinsics, depths)


def check_sequence(sequence: Sequence, *, seen: Callable[[Sequence, Evidence], None] | None = None) -> SequenceReport:
    """Check one sequence.

    Parameters
    ----------
    sequence
        As opened by its reader.
    seen
        Called with the sequence and its image motion, if its images were read.

    Returns
    -------
    SequenceReport
        With an item per topic. Data that cannot be read are an item of severity fatal.
    """
    items: list[Item] = []
    try:
        items += (topic(sequence) for topic in _FROM_POSES)
        items += reader_notes(sequence)
        if not any(item.topic == "counts" and item.severity is Severity.fatal for item in items):
            evidence = Evidence.measured(sequence)
            items += _from_images(sequence, evidence)
            if seen is not None:
                seen(sequence, evidence)
    except DataError as error:
        items.append(_unreadable(error))
    return SequenceReport(readable(sequence.id.key), tuple(items))


def check_reader(
    reader: Reader,
    source: str,
    *,
    most: int = MOST_SEQUENCES,
    seen: Callable[[Sequence, Evidence], None] | None = None,
    change: Callable[[Sequence], Sequence] = lambda sequence: sequence,
) -> CheckReport:
    """Check the sequences of a data set.

    Parameters
    ----------
    reader
        Of the data set.
    source
        Its folder, for the report.
    most
        Of how many sequences images are read.
    seen
        Called with each sequence whose images were read, and with its image motion.
    change
        Changes each sequence as it was recorded, such as its depth; by default nothing is changed. A DataError of it
        is a finding, as those of the reader are.

    Raises
    ------
    TracknoiseError
        If the reader finds no sequence, or an option is wrong.
    """
    listed = reader.sequences()
    reports, opened = [], []
    for place, name in enumerate(listed):
        try:
            sequence = change(reader.open(name))
        except DataError as error:
            reports.append(SequenceReport(readable(name.key), (_unreadable(error),)))
            continue
        opened.append(sequence)
        if place < most:
            reports.append(check_sequence(sequence, seen=seen))
    about_all = list(filter(None, [_unread(len(listed), most), independence(opened)]))
    return CheckReport(reader.name, source, tuple(reports), tuple(about_all))


def _from_images(sequence: Sequence, evidence: Evidence) -> Iterator[Item]:
    named = mistakes(evidence)
    yield named
    yield warping(evidence)
    if named.severity is not Severity.fatal:  # otherwise a focal length would be fitted to the mistake
        yield focal_length(evidence)
        if (clipped := clipped_depth(evidence)) is not None:
            yield clipped
    yield clock(evidence, sequence.timestamps_s)


def _unreadable(error: DataError) -> Item:
    return Item("files", Severity.fatal, f"{error}.")


def _unread(n_sequences: int, most: int) -> Item | None:
    if n_sequences <= most:
        return None
    text = f"Images of the first {most} of {n_sequences} sequences were read; --scenes {n_sequences} reads all."
    return Item("sequences", Severity.unknown, text, {"n_sequences": n_sequences, "n_read": most})
