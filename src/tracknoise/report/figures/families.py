"""The sections of the report that hold figures, in the order of the page.

What a section shows is said by the modules that draw: `FIGURES` of each.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from tracknoise.report.cells import Cells
from tracknoise.report.figures.figure import Absence, Figure, require_distinct
from tracknoise.report.report_data import ReportData

_WITHHELD = (
    "The true positions are fitted to the tracks themselves, so that these errors would not be those of the tracker. "
    "The findings state its noise."
)


@dataclass(frozen=True, slots=True)
class Family:
    """Figures of one kind.

    Attributes
    ----------
    id, title
        Anchor and heading of the section.
    lead
        Its first sentences. They hold for any data.
    what_if
        What the figures would look like if errors were as many estimators assume, or the compared factor had no effect.
    of_errors
        Whether it is about errors since a point was fixed. They are withheld where points are fitted to whole tracks.
    """

    id: str
    title: str
    lead: str
    of_errors: bool = False
    what_if: str = ""

    def figures(self, data: ReportData) -> Sequence[Figure | Absence]:
        """Make the figures of a run, in order. Modules are imported when they are needed.

        Altair's checks of each part against the schema of Vega-Lite are off: they take a third of the time. The tests
        check whole figures.
        """
        from altair.utils.schemapi import debug_mode  # takes half a second, and the answer in a terminal has no figures

        makers = [make for module in _modules() for make in module.FIGURES.get(self.id, ())]
        with debug_mode(False):
            figures = [item for make in makers for item in make(data)]
        require_distinct(figures)
        withheld = self.of_errors and data.truth_is_fitted
        return [Absence(item.id, item.title, _WITHHELD) for item in figures] if withheld else figures

    def tables(self, data: ReportData) -> Sequence[Cells]:
        """Make the tables below the figures."""
        if self.of_errors and data.truth_is_fitted:
            return []
        makers = [getattr(module, "TABLES", {}).get(self.id) for module in _modules()]
        return [cells for make in makers if make is not None for cells in make(data)]


_MODULES = (
    *("noise_models", "error_curves", "rankings", "topic_curves", "track_ends", "levels", "distributions"),
    *("growth_curves", "maps", "truth_curves", "frames"),
)
"""Modules of this package that draw. The figures of a section are in the order of these."""


def _modules() -> list[Any]:
    """What has `FIGURES`, and may have `TABLES`. Modules are imported when they are needed."""
    return [import_module(f"tracknoise.report.figures.{name}") for name in _MODULES]


FAMILIES: tuple[Family, ...] = (
    Family(
        "estimator",
        "For your estimator",
        "An estimator that fits points to windows of tracks needs one sigma. The sigma of its own residuals is not the "
        "one that makes its depths as certain as it claims, because errors of one track are alike from frame to frame.",
        of_errors=True,
        what_if="If errors were independent in every frame, both sigmas would be equal in windows of any length, depth "
        "intervals would lie on the diagonal with either, and errors would not grow with age.",
    ),
    Family(
        "error-by-tracker",
        "Error by tracker",
        "This section shows how the error grows from the frame where it is zero by construction. Usually that is the "
        "frame in which a feature was first seen. If one scan gives the true positions of all features, it is the key "
        "frame of that scan.",
        of_errors=True,
        what_if="If errors had zero mean and were independent, the mean would be zero and all other rows would "
        "be flat.",
    ),
    Family(
        "lifetimes",
        "Lifetimes",
        "The lifetime of a track is the number of consecutive frames in which its tracker found it, including the "
        "first. A track that is alive in the last frame is censored: its lifetime is cut short by the data.",
        what_if="If features were lost by chance alone, the share that survives would fall exponentially.",
    ),
    Family(
        "outlier-ratio",
        "Outlier ratio",
        "In every frame a tracker rejects features that do not move consistently with the others. The outlier ratio is "
        "the share of rejected features among those carried over from the previous frame.",
        what_if="If no match were wrong, all boxes would lie at zero.",
    ),
    Family(
        "gaussianity",
        "Error distribution",
        "Most estimators assume Gaussian errors. This section compares the shape of the distribution with a Gaussian "
        "of the same covariance. In the table, a Gaussian has skewness 0 and kurtosis 8. P(99 %) is the share of "
        "errors outside the 99 % ellipse, relative to that of a Gaussian.",
        of_errors=True,
        what_if="If errors were Gaussian, all points would lie on the diagonal.",
    ),
    Family(
        "time-structure",
        "Error growth",
        "Many estimators assume that the error is independent in every frame. If it accumulates instead, they trust "
        "long tracks too much. The growth of the second moment and the correlation of successive changes distinguish "
        "the two cases.",
        of_errors=True,
        what_if="If errors were independent in every frame, the second moment would be flat, and successive "
        "changes would have a correlation of -0.5.",
    ),
    Family(
        "changes",
        "Changes from frame to frame",
        "The change of the error in one frame is what the process noise of a filter, or a factor between two frames, "
        "has to model.",
        of_errors=True,
        what_if="If the tracker took over no error from the frame before, changes would not depend on age.",
    ),
    Family(
        "trimming",
        "Errors before trimming",
        "Some tracks follow the wrong point. The paper drops the tracks with the largest errors in each scene. What is "
        "left then depends on how many tracks are lost, and on the length of the sequences. The figures say which "
        "errors they show.",
        what_if="If errors were Gaussian, the cut would lie close to the largest error.",
    ),
    Family(
        "feature-counts",
        "Feature counts",
        "An average over few features is unreliable. Curves are therefore cut where too few features remain.",
        what_if="If no feature were lost, all counts would be those of the first age.",
    ),
    Family(
        "survivorship-bias",
        "Survivorship bias",
        "A tracker tends to lose its worst features first. Tracks that live long are therefore not a random sample of "
        "all tracks.",
        of_errors=True,
        what_if="If the loss of tracks did not depend on their errors, long-lived tracks would have the curve "
        "of all tracks.",
    ),
    Family(
        "error-by-speed",
        "Error by speed",
        "This section shows what changes when the camera moves faster, or the tracker sees fewer frames.",
        of_errors=True,
        what_if="If errors did not depend on speed, all curves would coincide.",
    ),
    Family(
        "error-by-lighting",
        "Error by lighting",
        "This section shows what changes when the same camera path is seen under different lighting.",
        of_errors=True,
        what_if="If errors did not depend on lighting, all curves would coincide.",
    ),
    Family(
        "error-by-rotation",
        "Error in rotated images",
        "This section shows what changes when the trackers see the same images rotated. The camera axes are rotated "
        "too.",
        of_errors=True,
        what_if="If the tracker treated all directions alike, all curves would coincide.",
    ),
    Family(
        "error-by-direction",
        "Error by direction",
        "This section shows what changes when the same frames are played backward, as if the camera moved in reverse.",
        of_errors=True,
        what_if="If errors did not depend on the direction of play, both curves would coincide.",
    ),
    Family(
        "error-by-place",
        "Error by place",
        "Errors that depend on the place in the image, or on the speed of the image, often come from the truth: lens, "
        "focal length, shutter or clock. Errors at depth edges come from the tracker.",
        of_errors=True,
        what_if="If errors did not depend on the place, every map would have one colour and every curve would be flat.",
    ),
    Family(
        "along-and-across",
        "Error along motion and gradient",
        "Errors are caused by motion and image structure, not by the directions u and v. An error along the motion or "
        "along an edge is easier to see in that direction.",
        of_errors=True,
        what_if="If errors had no preferred direction, both columns would be equal.",
    ),
    Family(
        "occlusion",
        "Occlusion",
        "When a point becomes occluded, a tracker may continue its track on the object in front. The paper counts "
        "such features. Counting them changes the error.",
        of_errors=True,
        what_if="If trackers noticed that a point is occluded, both curves would coincide.",
    ),
    Family(
        "truth-audit",
        "Corrections of the truth",
        "A wrong focal length, clock or shutter looks like an error of tracks. The audit fits such faults to the "
        "errors of all trackers.",
        of_errors=True,
        what_if="If the truth were exact, no correction would change a curve.",
    ),
    Family(
        "pose-errors",
        "Pose errors",
        "An error of the stated poses moves all features of a frame together, as a motion of the camera does. The "
        "tracks measure such motions. What other tracks predict is not noise of single features.",
        of_errors=True,
        what_if="If the poses were exact, all shares would be zero.",
    ),
    Family(
        "between-trackers",
        "Differences between trackers",
        "Two trackers that follow the same corner have the same true position. Their difference contains no error of "
        "the truth.",
        what_if="If both trackers followed the same point, their mean difference would be zero.",
    ),
    Family(
        "example-frames",
        "Example frames",
        "One frame of each scene, with the features and their errors.",
        what_if="If errors were noise alone, lines would point in all directions.",
    ),
    Family(
        "trajectory",
        "Camera path",
        "The camera motion determines how features move. Rotation shifts image points regardless of their depth. "
        "Translation shifts near points more than far ones.",
        what_if="If the camera only rotated, its path would be a point.",
    ),
)
