"""Check a recording: all topics of each sequence, the verdict, what the recording holds, and the page of a check."""

import base64
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.measurement.adjusted_depths import depth_corrections
from tracknoise.sequences.depth_samples import sampled_depths
from tracknoise.sequences.likely_times import require_likely_times
from tracknoise.sequences.sequence import Reader, Sequence, with_known_facts
from tracknoise.tables.enumerations import Trust
from tracknoise.tables.identity import readable
from tracknoise.tables.trust import AssessedTruth, TruthVerdict
from tracknoise.text import printable
from tracknoise.time_units import rate_of
from tracknoise.truth_faults.check_poses import leading_poses
from tracknoise.truth_faults.check_report import CheckReport, Item, SequenceReport, Severity
from tracknoise.truth_faults.check_verdict import sequence_trust
from tracknoise.truth_faults.clock_check import clock
from tracknoise.truth_faults.depth_checks import clipped_depth, depth_share, depths
from tracknoise.truth_faults.depth_repeats import repeatability
from tracknoise.truth_faults.image_evidence import AS_GIVEN, Evidence, Pair, relative_pose, reprojection_px
from tracknoise.truth_faults.motion_checks import focal_length, mistakes, warping
from tracknoise.truth_faults.recording_checks import (
    counts,
    independence,
    intrinsics,
    pose_jumps,
    reader_notes,
    repeated_frames,
    repeated_images,
    rotations,
    timestamps,
    view_changes,
)
from tracknoise.truth_faults.rig_check import second_camera


@dataclass(frozen=True, slots=True)
class Overview:
    """Numbers of one sequence.

    Attributes
    ----------
    n_frames, n_poses
        Images, and how many of them have a pose.
    width_px, height_px
        Size of the images.
    rate_hz
        From the median interval of the timestamps; None without timestamps.
    depth_share
        Share of pixels with depth, from some frames; None without depth maps.
    """

    n_frames: int
    n_poses: int
    width_px: int
    height_px: int
    rate_hz: float | None
    depth_share: float | None


def overview(sequence: Sequence) -> Overview:
    """Numbers of a sequence. Depth maps of some frames are read, and no image.

    Raises
    ------
    DataError
        If poses, timestamps or a depth map cannot be read.
    """
    maps = sampled_depths(sequence)
    return Overview(
        n_frames=len(sequence),
        n_poses=int(np.isfinite(sequence.world_from_camera).all(axis=(1, 2)).sum()),
        width_px=sequence.camera.width,
        height_px=sequence.camera.height,
        rate_hz=rate_of(sequence.timestamps_s),
        depth_share=depth_share(maps) if maps else None,
    )


MOST_SEQUENCES = 3
"""Of larger data sets, images of this many sequences are read; poses of all."""

_FROM_POSES: tuple[Callable[[Sequence], Item], ...] = (counts, timestamps, rotations, pose_jumps, intrinsics, depths)


_SEVERITY = {
    Trust.trusted: Severity.ok,
    Trust.unknown: Severity.unknown,
    Trust.limited: Severity.caveat,
    Trust.not_trusted: Severity.fatal,
}
"""Of what decided a verdict, if no other topic did."""


def check_sequence(sequence: Sequence, *, seen: Callable[[Sequence, Evidence], None] | None = None) -> SequenceReport:
    """Check one sequence."""
    items: list[Item] = []
    evidence, leading, fit = None, sequence, None
    try:
        require_likely_times(sequence)
        items += filter(None, [view_changes(sequence)])
        items += (topic(sequence) for topic in _FROM_POSES)
        items += filter(None, [repeated_frames(sequence)])
        items += reader_notes(sequence)
        if not any(item.topic == "counts" and item.severity is Severity.fatal for item in items):
            evidence = Evidence.measured(sequence)
            if seen is not None:
                seen(sequence, evidence)
            motion_px = {step.second: step.motion_px for step in evidence.flow.steps}
            items += filter(None, [repeated_images(sequence.world_from_camera, motion_px)])
            of_images = list(_from_images(sequence, evidence))
            of_data = (item for item in (*items, *of_images) if item.topic != "warping")
            if not any(item.severity is Severity.fatal for item in of_data):
                leading, fit, of_poses = leading_poses(sequence)
                items.append(of_poses)
            if fit is not None and fit.leads:
                evidence = evidence.with_truth(leading.world_from_camera, depth_corrections(fit.corrections))
                of_images = _of_leading(of_images, list(_from_images(leading, evidence)))
            items += of_images
            items += filter(None, [second_camera(leading)])
    except DataError as error:
        items.append(_unreadable(error))
    truth = AssessedTruth(sequence_trust(leading, evidence, items, fit))
    verdict = truth.verdict
    severity = _SEVERITY[verdict.verdict]
    if not any(item.severity is severity and item.text in verdict.text for item in items):
        items.append(Item("truth", severity, verdict.text))
    return SequenceReport(readable(sequence.id.key), tuple(items), verdict, truth.ranges)


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
            sequence = change(with_known_facts(reader.open(name)))
        except DataError as error:
            unreadable = _unreadable(error)
            refused = TruthVerdict(Trust.not_trusted, unreadable.text, "Correct the data, and check it again.")
            reports.append(SequenceReport(readable(name.key), (unreadable,), refused))
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
    if named.severity is not Severity.fatal:  # otherwise a focal length and an offset would be fitted to the mistake
        yield focal_length(evidence)
        if (clipped := clipped_depth(evidence)) is not None:
            yield clipped
        if (repeated := repeatability(evidence)) is not None:
            yield repeated
        yield clock(evidence, sequence.timestamps_s)


def _of_leading(stated: list[Item], leading: list[Item]) -> list[Item]:
    """Items about stated poses; what makes results wrong with these alone is to be kept in mind.

    What poses are used for, to measure camera and depths, is by the leading ones.
    """
    by_leading = {item.topic: item for item in leading}
    found = [by_leading.get(item.topic, item) if item.topic in _OF_CAMERA_AND_DEPTHS else item for item in stated]
    wrong = {item.topic for item in leading if item.severity is Severity.fatal}
    return [
        replace(item, severity=Severity.caveat, text=f"{item.text} {_STATED_ALONE}")
        if item.severity is Severity.fatal and item.topic not in wrong
        else item
        for item in found
    ]


_OF_CAMERA_AND_DEPTHS = ("focal length", "depth repeatability")
_STATED_ALONE = "This holds for the stated poses, and not for the refined ones."


def _unreadable(error: DataError) -> Item:
    return Item("files", Severity.fatal, f"{error}.")


def _unread(n_sequences: int, most: int) -> Item | None:
    if n_sequences <= most:
        return None
    text = f"Images of the first {most} of {n_sequences} sequences were read; --scenes {n_sequences} reads all."
    return Item("sequences", Severity.unknown, text, {"n_sequences": n_sequences, "n_read": most})


_OBSERVED, _PREDICTED = (80, 200, 80), (60, 60, 230)  # BGR
_SHIFT = 4
"""Fractional bits of positions that OpenCV draws."""


@dataclass(slots=True)
class Pictures:
    """Collects a picture per sequence while a recording is checked.

    Attributes
    ----------
    by_sequence
        PNG files in base 64, by the name of the sequence.
    """

    by_sequence: dict[str, str] = field(default_factory=dict)

    def take(self, sequence: Sequence, evidence: Evidence) -> None:
        """Draw where points were seen and where they were predicted, in the pair with the most motion."""
        if not evidence.pairs:
            return
        pair = max(evidence.pairs, key=lambda candidate: candidate.motion_px)
        try:
            image = sequence.image(pair.first)
        except DataError:  # it was readable a moment ago; the check itself has reported what is wrong
            return
        _, png = cv2.imencode(".png", _drawn(image, pair, evidence))
        self.by_sequence[readable(sequence.id.key)] = base64.b64encode(png.tobytes()).decode()

    def page(self, report: CheckReport) -> str:
        """The page as HTML."""
        loader = PackageLoader("tracknoise.truth_faults", "template")
        environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
        environment.finalize = lambda value: printable(value, keep="\n\t") if type(value) is str else value
        return environment.get_template("check.html.j2").render(report=report, pictures=self.by_sequence)


def _drawn(image: NDArray[np.uint8], pair: Pair, evidence: Evidence) -> NDArray[np.uint8]:
    """The first image with lines from where points were to where they were seen, and to where they were predicted."""
    canvas = np.ascontiguousarray(np.repeat(image[..., None], 3, axis=2))
    _lines(canvas, pair.uv_first, pair.uv_second, _OBSERVED)
    if evidence.has_depth:
        has_depth = np.isfinite(pair.depth_first_m)
        residual = reprojection_px(pair, relative_pose(evidence.poses, pair), evidence.camera, AS_GIVEN)
        _lines(canvas, pair.uv_first[has_depth], pair.uv_second[has_depth] - residual, _PREDICTED)
    return canvas


def _lines(
    canvas: NDArray[np.uint8],
    starts: NDArray[np.float64],
    ends: NDArray[np.float64],
    colour: tuple[int, int, int],
) -> None:
    near = np.abs(ends).max(axis=1, initial=0.0) < 4 * max(canvas.shape)  # also leaves out what is behind the camera
    for start, end in zip(starts[near], ends[near], strict=True):
        points = [tuple(np.round(point * 2**_SHIFT).astype(int).tolist()) for point in (start, end)]
        cv2.line(canvas, points[0], points[1], colour, 1, cv2.LINE_AA, _SHIFT)
        cv2.circle(canvas, points[1], 2 << _SHIFT, colour, 1, cv2.LINE_AA, _SHIFT)
