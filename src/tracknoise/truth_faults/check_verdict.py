"""The verdict on the truth of a recording before it is measured, from the points that a check follows.

It rests on the same causes as that of a run: a motion of the camera that the poses lack, constant faults, random errors
of depths, and what is stated. There is one tracker, so that nothing separates the truth from what is the tracker's own.
"""

from collections.abc import Sequence as ListOf
from math import sqrt

import numpy as np
import polars as pl

from tracknoise.geometry.projection import FrameGeometry
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.sequence import SWEPT, Sequence, TruthKind
from tracknoise.sequences.views import frame_step
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.tables.manifest import PoseFit
from tracknoise.truth.accuracies import known_accuracy
from tracknoise.truth.uncertainty import AnchoredPoints, TrueErrors, TruthDerivatives
from tracknoise.truth_faults.assessment import ErrorSize, TruthEvidence, assess
from tracknoise.truth_faults.audit_fit import MEDIAN_TO_CORE
from tracknoise.truth_faults.audit_samples import AuditSamples
from tracknoise.truth_faults.audit_summary import usual_mistakes
from tracknoise.truth_faults.audit_tables import tables_of
from tracknoise.truth_faults.check_evidence import NAME, Followed, check_rigid, check_samples
from tracknoise.truth_faults.check_report import CAUTIONS, Item, Severity
from tracknoise.truth_faults.image_evidence import Evidence
from tracknoise.truth_faults.motion_checks import MOVE
from tracknoise.truth_faults.pose_accuracy import pose_share

_FEWEST = 30
"""Fewest points of an age whose errors have a size."""
_OF_STATED_POSES = {"pose jumps", "repeated images"}
"""Topics that are not about refined poses."""


def sequence_trust(
    sequence: Sequence, evidence: Evidence | None, items: ListOf[Item], fit: PoseFit | None = None
) -> pl.DataFrame:
    """The verdict on the truth of a sequence, schema `TRUST`.

    Parameters
    ----------
    sequence, evidence
        The sequence with the poses that lead, and the motion of its images; None where it was not measured.
    items
        What was found about it.
    fit
        Which poses lead; None where this was not asked.
    """
    mistakes = [item.text for item in items if item.severity is Severity.fatal]
    cautioned = CAUTIONS - _OF_STATED_POSES if fit is not None and fit.leads else CAUTIONS
    cautions = [item.text for item in items if item.severity is Severity.caveat and item.topic in cautioned]
    followed = "its images were not read" if evidence is None else Followed.of(evidence, sequence)
    samples = followed if isinstance(followed, str) else check_samples(followed)
    is_fitted = evidence is not None and not evidence.has_depth and set(TruthKind).isdisjoint(sequence.truths)
    dataset = sequence.id.dataset
    tables = tables_of(samples, dataset)
    if isinstance(followed, str) or isinstance(samples, str):
        shares, sizes = pose_share([]), {}
    else:
        shares = pose_share([check_rigid(followed)])
        sizes = {NAME: _size(sequence, followed, samples)}
    truth_evidence = TruthEvidence(
        audit=tables.audit,
        pose_shares=shares,
        sizes=sizes,
        curves=tables.audit_curves,
        mistakes=[*mistakes, *usual_mistakes(tables.audit)],
        cautions=cautions,
        depth_edges=max((float(item.values.get("edges") or 0.0) for item in items), default=0.0),
        is_fitted=is_fitted,
        measures_depths=SWEPT in sequence.truths,
        moving=MOVE if any(item.text.endswith(MOVE) for item in items) else "",
        lacks_poses=2 * int(has_pose(sequence.world_from_camera).sum()) < len(sequence),
        of_images=" ".join(item.text for item in items if is_fitted and item.topic == "warping"),
        pose_fits=[fit],
        is_check=True,
    )
    return assess(truth_evidence, dataset)


def _size(sequence: Sequence, followed: Followed, samples: AuditSamples) -> ErrorSize:
    """Size of the errors at the last age up to the reference age, and by age of what is stated of the truth."""
    ages, counts = np.unique(samples.age[samples.age <= REFERENCE_AGE], return_counts=True)
    age = int(max(ages[counts >= _FEWEST], default=ages[np.argmax(counts)] if len(ages) else 0))
    at_age = samples.chosen(np.flatnonzero(samples.age == age))
    error = at_age.observed - at_age.stated
    square = float(np.mean(np.sum(error**2, axis=1)))
    core_px = float(np.hypot(*(MEDIAN_TO_CORE * np.median(np.abs(error), axis=0)))) if len(error) else None
    stated_px = _stated_px(sequence, followed, samples.chosen(np.flatnonzero(samples.age <= age)))
    return ErrorSize(age, sqrt(square), stated_px, core_px)


def _stated_px(sequence: Sequence, followed: Followed, samples: AuditSamples) -> dict[int, float] | None:
    """RMS that the stated accuracy can cause, px, by age; None where poses or depths have none."""
    kind = TruthKind.raycast if sequence.surface is not None else TruthKind.birth
    accuracy = known_accuracy(sequence, kind)
    if not accuracy.is_complete:
        return None
    errors = TrueErrors(TruthDerivatives(sequence), accuracy.figures, step=frame_step(sequence))
    if errors.is_exact:
        return dict.fromkeys(map(int, samples.age), 0.0)
    points = _points(sequence, followed, samples)
    squares = np.full(len(samples.age), np.nan)
    for rows, error in errors.of(points):
        squares[rows] = np.trace(sum(error.covariance.values()), axis1=1, axis2=2)
    is_known = np.isfinite(squares)
    return {int(age): sqrt(squares[is_known & (samples.age == age)].mean()) for age in np.unique(samples.age[is_known])}


def _points(sequence: Sequence, followed: Followed, samples: AuditSamples) -> AnchoredPoints:
    """World points of samples, in frames of the sequence."""
    first, frame = followed.frames_of(samples.birth), followed.frames_of(samples.now)
    poses = sequence.world_from_camera
    stated = FrameGeometry(poses, samples.cameras, np.zeros(len(poses), np.intp))
    return AnchoredPoints(first, frame, stated.unproject(first, samples.uv_at_birth, samples.depth))
