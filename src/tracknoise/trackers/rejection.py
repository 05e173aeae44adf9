"""Outlier rejection: the matches of a step that do not agree with a common motion of the image."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from tracknoise.checks import Between0And1, Positive, require, require_bounds
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
    """Whose inliers stay: those of the best minimal hypothesis, or of a model refined on inliers.

    hypothesis: as in the paper's software. Which of many similar hypotheses wins depends on the random seed. refined:
    every hypothesis that is better than all before is fitted to its inliers again, and so is the best (LO-RANSAC). The
    result depends far less on the seed.
    """

    hypothesis = "hypothesis"
    refined = "refined"


class ReferencePosition(StrEnum):
    """Start of a match: the track's previous position, or its first."""

    previous = "previous"
    first = "first"


_MAX_REFITS = 10
"""Largest number of refits of one hypothesis; few are needed until its inliers no longer grow."""
_GEOMETRIES: dict[Model, Geometry] = {Model.homography: Homography(), Model.fundamental: Fundamental()}


@dataclass(frozen=True, slots=True)
class Rejection:
    """How outliers are distinguished from inliers, by our own random sample consensus.

    Outlier ratio and lifetimes are results, so their definition must not change with a library. Up to OpenCV 4.11 the
    mask of ``findHomography`` was that of the best minimal hypothesis; since 4.12 it is that of the refined model.
    `consensus` selects one of the two. The paper's software used the former, and so do the presets of the paper. With
    `refined`, local optimisation finds nearly the same model with any seed. A step has no outliers if it has fewer
    matches than determine a model, or if all samples are degenerate.

    Parameters
    ----------
    model
        Homography (4 matches; error: forward reprojection) or fundamental matrix (8 matches; error: Sampson's), or
        none.
    consensus
        The inliers of the best hypothesis, or of the locally optimised and refined model.
    reference
        Whether the tracker matches each track's previous or first position with its present one.
    threshold_px
        Largest error of an inlier.
    confidence
        Probability of drawing at least one sample without outliers.
    max_hypotheses
        Largest number of samples, not counting degenerate ones.
    seed
        Random seed of the samples, combined with the index of the frame.

    References
    ----------
    Local optimisation: O. Chum, J. Matas, J. Kittler, Locally Optimized RANSAC, DAGM 2003.
    """

    model: Model = Model.homography
    consensus: Consensus = Consensus.refined
    reference: ReferencePosition = ReferencePosition.previous
    threshold_px: Positive = 3.0
    confidence: Between0And1 = 0.995
    max_hypotheses: Annotated[int, Ge(1)] = 2000
    seed: Annotated[int, Ge(0)] = 0

    def __post_init__(self) -> None:
        for name, kind in (("model", Model), ("consensus", Consensus), ("reference", ReferencePosition)):
            value = getattr(self, name)
            require(value in tuple(kind), name, value, f"one of {', '.join(kind)}")
            object.__setattr__(self, name, kind(value))  # so that a name will do for the member
        require_bounds(self)

    def repeated(self, repeat: int) -> "Rejection":
        """The same rejection with another random seed, for each repetition of a measurement; 0 changes nothing."""
        return replace(self, seed=self.seed + repeat)

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
            max_refits=_MAX_REFITS if self.consensus is Consensus.refined else 0,
        )
        if best is None:
            return everything
        if self.consensus is Consensus.hypothesis:
            return best.inliers
        refined = geometry.refine(best.model, source[best.inliers], target[best.inliers])
        within: NDArray[np.bool_] = geometry.agrees(refined[None], source, target, threshold)[0]
        return within


def _conditioned(source: Floats, target: Floats) -> tuple[Floats, Floats, float]:
    """Both point sets relative to their centroids, in units of one length, so that the algebra is well conditioned."""
    source, target = source - source.mean(axis=0), target - target.mean(axis=0)
    spread = max(float(np.abs(source).mean()), float(np.abs(target).mean()))
    scale = 1.0 / spread if spread > 0 else 1.0
    return source * scale, target * scale, scale
