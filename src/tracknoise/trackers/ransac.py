"""Random sample consensus: the hypothesis from a minimal sample that most matches agree with."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_FIRST_DRAW, _LARGEST_DRAW = 16, 128
_MAX_BARREN_DRAWS = 100


class Geometry(Protocol):
    """A relation between two images that a few matches determine."""

    @property
    def sample_size(self) -> int:
        """Number of matches that determine it."""
        ...

    def hypotheses(self, source: Floats, target: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Models (b, 3, 3) through samples (b, sample_size, 2), and which samples were not degenerate."""
        ...

    def agrees(self, models: Floats, source: Floats, target: Floats, threshold: float) -> NDArray[np.bool_]:
        """Which matches (n, 2) each model (b, 3, 3) explains to within the threshold: (b, n)."""
        ...

    def refine(self, model: Floats, source: Floats, target: Floats) -> Floats:
        """The model (3, 3) that fits all these matches (n, 2) best, starting from an approximate model."""
        ...


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A model (3, 3) and the matches (n,) that agree with it."""

    model: Floats
    inliers: NDArray[np.bool_]


def best_hypothesis(
    geometry: Geometry,
    source: Floats,
    target: Floats,
    *,
    threshold: float,
    confidence: float,
    max_hypotheses: int,
    rng: np.random.Generator,
    max_refits: int = 0,
) -> Hypothesis | None:
    """The first hypothesis with the most inliers, among as many as `confidence` requires.

    Hypotheses are evaluated one after the other. Each that has more inliers than all before reduces the number needed
    (`hypotheses_needed`). They are computed in batches, which only affects the time: the samples depend on the
    generator only, and surplus hypotheses of a batch are ignored.

    Parameters
    ----------
    geometry
        The kind of model.
    source, target
        (n, 2) float64: matched points, n > geometry.sample_size.
    threshold
        Largest error of an inlier, in the unit of the points.
    confidence
        Probability of having drawn at least one sample without outliers.
    max_hypotheses
        Largest number of hypotheses that are evaluated.
    rng
        Draws the samples; degenerate ones are replaced.
    max_refits
        Local optimisation (Chum, Matas and Kittler 2003): each hypothesis that has more inliers than all before is
        fitted to its inliers again, up to this number of times, as long as that gives more inliers. The number of
        hypotheses needed then follows from these. By default it is not refitted.

    Returns
    -------
    Hypothesis or None
        None if all samples are degenerate.
    """
    best: Hypothesis | None = None
    most, judged, needed = geometry.sample_size - 1, 0, max_hypotheses
    for models in _drawn(geometry, source, target, rng):
        agreement = geometry.agrees(models[: needed - judged], source, target, threshold)
        for index, count in enumerate(np.count_nonzero(agreement, axis=1).tolist()):
            if count > most:
                best = _refitted(
                    geometry, Hypothesis(models[index], agreement[index]), source, target, threshold, max_refits
                )
                most = int(np.count_nonzero(best.inliers))
                needed = hypotheses_needed(most / len(source), geometry.sample_size, confidence, needed)
            judged += 1
            if judged >= needed:
                return best
    return best


def _refitted(
    geometry: Geometry, found: Hypothesis, source: Floats, target: Floats, threshold: float, max_refits: int
) -> Hypothesis:
    """The hypothesis after refits to its inliers, as long as each has more inliers than the one before."""
    for _ in range(max_refits):
        model = geometry.refine(found.model, source[found.inliers], target[found.inliers])
        inliers = geometry.agrees(model[None], source, target, threshold)[0]
        if np.count_nonzero(inliers) <= np.count_nonzero(found.inliers):
            break
        found = Hypothesis(model, inliers)
    return found


def hypotheses_needed(inlier_share: float, sample_size: int, confidence: float, most: int) -> int:
    """Number of samples that contain one without outliers, with this confidence: log(1 - p) / log(1 - share^size).

    Rounded to the nearest whole number, and never more than `most`.
    """
    failure = 1.0 - inlier_share**sample_size
    if failure < np.finfo(np.float64).tiny:
        return 0
    needed = math.log(1.0 - confidence) / math.log(failure) if failure < 1.0 else math.inf
    return most if needed >= most else round(needed)


def _drawn(geometry: Geometry, source: Floats, target: Floats, rng: np.random.Generator) -> Iterator[Floats]:
    """Models through random samples of distinct matches, without degenerate ones, in growing batches.

    Ends when no usable sample is found any more.
    """
    size, barren = _FIRST_DRAW, 0
    while barren < _MAX_BARREN_DRAWS:
        rows = rng.integers(len(source), size=(size, geometry.sample_size))
        ordered = np.sort(rows, axis=1)
        distinct = np.all(ordered[:, 1:] != ordered[:, :-1], axis=1)
        models, usable = geometry.hypotheses(source[rows], target[rows])
        models = models[usable & distinct]
        yield from (models[: size // 2], models[size // 2 :])  # one half is often enough
        barren = 0 if len(models) else barren + 1
        size = min(2 * size, _LARGEST_DRAW)
