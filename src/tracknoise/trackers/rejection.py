"""Outlier rejection: the matches of a step that no common motion of the image explains."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import require, require_at_least, require_positive
from tracknoise.trackers.fundamental import Fundamental
from tracknoise.trackers.homography import Homography
from tracknoise.trackers.ransac import Geometry, best_hypothesis

Floats = NDArray[np.float64]

Inliers = Callable[[Floats, Floats, int], NDArray[np.bool_]]
"""Decides which matches stay: source (n, 2) px, target (n, 2) px and the frame's index, to (n,) bool."""


class Model(StrEnum):
    """What relates the two images: a homography, a fundamental matrix, or nothing (no rejection)."""

    homography = "homography"
    fundamental = "fundamental"
    none = "none"


class Consensus(StrEnum):
    """Whose inliers stay: those of the best minimal hypothesis, or of the model refined on these."""

    hypothesis = "hypothesis"
    refined = "refined"


class ReferencePosition(StrEnum):
    """Where a match starts: at the track's previous position, or at its first."""

    previous = "previous"
    first = "first"


_GEOMETRIES: dict[Model, Geometry] = {Model.homography: Homography(), Model.fundamental: Fundamental()}


@dataclass(frozen=True, slots=True)
class Rejection:
    """How outliers are told from inliers, by random sample consensus of our own.

    The share of outliers and the lifetimes of tracks are results, so that their definition must not move with a
    library: from version 4.12 on the mask of OpenCV's ``findHomography`` has been that of the refined model, and
    up to 4.11 that of the best minimal hypothesis. `consensus` chooses between the two; the paper's software had
    the old meaning. A step with fewer matches than determine a model, or whose samples are all degenerate, has no
    outliers.

    Parameters
    ----------
    model
        Homography (4 matches; error: forward reprojection) or fundamental matrix (8 matches; error: Sampson's), or
        none.
    consensus
        The inliers of the best hypothesis, or of the model refined on them.
    reference
        Whether the tracker matches each track's previous or first position with its present one.
    threshold_px
        Largest error of an inlier.
    confidence
        Probability of drawing at least one sample without outliers.
    max_hypotheses
        How many samples are drawn at most, degenerate ones not counted.
    seed
        Of the samples, with the index of the frame.
    """

    model: Model = Model.homography
    consensus: Consensus = Consensus.hypothesis
    reference: ReferencePosition = ReferencePosition.previous
    threshold_px: float = 3.0
    confidence: float = 0.995
    max_hypotheses: int = 2000
    seed: int = 0

    def __post_init__(self) -> None:
        for name, kind in (("model", Model), ("consensus", Consensus), ("reference", ReferencePosition)):
            value = getattr(self, name)
            require(value in tuple(kind), name, value, f"one of {', '.join(kind)}")
            object.__setattr__(self, name, kind(value))  # so that a name will do for the member
        require_positive("threshold_px", self.threshold_px)
        require(0 < self.confidence < 1, "confidence", self.confidence, "a number between 0 and 1")
        require_at_least("max_hypotheses", self.max_hypotheses, 1)
        require_at_least("seed", self.seed, 0)

    def inliers(self, source: Floats, target: Floats, frame: int) -> NDArray[np.bool_]:
        """Which matches stay.

        Parameters
        ----------
        source, target
            (n, 2) float64, px: where the features were, and are.
        frame
            Index of the present frame.

        Returns
        -------
        (n,) bool
        """
        everything = np.ones(len(source), dtype=np.bool_)
        if self.model is Model.none:
            return everything
        geometry = _GEOMETRIES[self.model]
        if len(source) <= geometry.sample_size:
            return everything
        source, target, scale = _conditioned(source, target)
        threshold = self.threshold_px * scale
        best = best_hypothesis(
            geometry,
            source,
            target,
            threshold=threshold,
            confidence=self.confidence,
            max_hypotheses=self.max_hypotheses,
            rng=np.random.default_rng([self.seed, frame]),
        )
        if best is None:
            return everything
        if self.consensus is Consensus.hypothesis:
            return best.inliers
        refined = geometry.refine(best.model, source[best.inliers], target[best.inliers])
        within: NDArray[np.bool_] = geometry.agrees(refined[None], source, target, threshold)[0]
        return within


def _conditioned(source: Floats, target: Floats) -> tuple[Floats, Floats, float]:
    """Both point sets about their centroids, and divided by one length: that keeps the algebra well conditioned."""
    source, target = source - source.mean(axis=0), target - target.mean(axis=0)
    spread = max(float(np.abs(source).mean()), float(np.abs(target).mean()))
    scale = 1.0 / spread if spread > 0 else 1.0
    return source * scale, target * scale, scale
