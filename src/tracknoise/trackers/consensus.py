"""Random sample consensus: the hypothesis from a minimal sample that most matches agree with, or support best."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import gamma, gammainc, gammaincc

Floats = NDArray[np.float64]
Support = Callable[[Floats], Floats]
"""How much matches support models: squared errors in units of the squared threshold, (b, n), to (b, n)."""
Judge = Callable[[Floats], tuple[NDArray[np.bool_], Floats]]
"""Which matches (b, n) agree with models (b, 3, 3), and the scores (b,) of these."""

_FIRST_DRAW, _LARGEST_DRAW = 16, 128
_MAX_BARREN_DRAWS = 100


class Geometry(Protocol):
    """A relation between two images that a few matches determine."""

    @property
    def sample_size(self) -> int:
        """Number of matches that determine it."""
        ...

    def hypotheses(self, source: Floats, target: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Models (b k, 3, 3) through samples (b, sample_size, 2), k for each in a row, and which of them exist."""
        ...

    def agrees(self, models: Floats, source: Floats, target: Floats, threshold: float) -> NDArray[np.bool_]:
        """Which matches (n, 2) each model (b, 3, 3) explains to within the threshold: (b, n)."""
        ...

    def squared_errors(self, models: Floats, source: Floats, target: Floats) -> Floats:
        """Squared errors of matches (n, 2) by each model (b, 3, 3): (b, n)."""
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
    support: Support | None = None,
) -> Hypothesis | None:
    """The first hypothesis with the most inliers, among those of as many samples as `confidence` requires.

    With a `support`, that with the largest sum of it, of all matches.

    Hypotheses are evaluated one after the other. Each that has more inliers than all before reduces the number needed
    (`hypotheses_needed`). They are computed in batches, which only affects the time: the samples depend on the
    generator only, and surplus hypotheses of a batch are ignored. Shapes: source, target (n, 2). Returns: None if all
    samples are degenerate.
    """

    def judge(models: Floats) -> tuple[NDArray[np.bool_], Floats]:
        if support is None:
            agreement = geometry.agrees(models, source, target, threshold)
            return agreement, agreement.sum(axis=1, dtype=np.float64)
        squared = geometry.squared_errors(models, source, target) / threshold**2
        return squared <= 1.0, np.asarray(support(squared).sum(axis=1), dtype=np.float64)

    best: Hypothesis | None = None
    least = geometry.sample_size
    most, judged, needed = float(least - 1) if support is None else 0.0, 0, max_hypotheses
    for models, samples in _drawn(geometry, source, target, rng):
        agreement, scores = judge(models[samples < needed])
        for index, score in enumerate(scores.tolist()):
            if samples[index] >= needed:
                return best
            judged = int(samples[index]) + 1
            if score > most and np.count_nonzero(agreement[index]) >= least:
                hypothesis = Hypothesis(models[index], agreement[index])
                best, most = _refitted(geometry, hypothesis, score, source, target, judge, max_refits)
                share = np.count_nonzero(best.inliers) / len(source)
                needed = hypotheses_needed(share, geometry.sample_size, confidence, needed)
        if judged >= needed:
            return best
    return best


def _refitted(
    geometry: Geometry,
    hypothesis: Hypothesis,
    score: float,
    source: Floats,
    target: Floats,
    judge: Judge,
    max_refits: int,
) -> tuple[Hypothesis, float]:
    """The hypothesis after refits to its inliers, as long as each scores better than the one before, and its score."""
    for _ in range(max_refits):
        model = geometry.refine(hypothesis.model, source[hypothesis.inliers], target[hypothesis.inliers])
        (inliers,), (better,) = judge(model[None])
        if better <= score or np.count_nonzero(inliers) < geometry.sample_size:
            break
        hypothesis, score = Hypothesis(model, inliers), float(better)
    return hypothesis, score


def hypotheses_needed(inlier_share: float, sample_size: int, confidence: float, most: int) -> int:
    """Number of samples that contain one without outliers, with this confidence: log(1 - p) / log(1 - share^size).

    Rounded to the nearest whole number, and never more than `most`.
    """
    failure = 1.0 - inlier_share**sample_size
    if failure < np.finfo(np.float64).tiny:
        return 0
    needed = math.log(1.0 - confidence) / math.log(failure) if failure < 1.0 else math.inf
    return most if needed >= most else round(needed)


def _drawn(
    geometry: Geometry, source: Floats, target: Floats, rng: np.random.Generator
) -> Iterator[tuple[Floats, NDArray[np.intp]]]:
    """Models through random samples of distinct matches, and the number of the sample of each, in growing batches.

    Degenerate samples have neither models nor numbers. Ends when no usable sample is found any more.
    """
    size, barren, numbered = _FIRST_DRAW, 0, 0
    while barren < _MAX_BARREN_DRAWS:
        rows = rng.integers(len(source), size=(size, geometry.sample_size))
        ordered = np.sort(rows, axis=1)
        distinct = np.all(ordered[:, 1:] != ordered[:, :-1], axis=1)
        models, usable = geometry.hypotheses(source[rows], target[rows])
        of_each = len(models) // size
        usable = usable & np.repeat(distinct, of_each)
        models = models[usable]
        kept, samples = np.unique(np.flatnonzero(usable) // of_each, return_inverse=True)
        samples, half = samples + numbered, len(models) // 2  # one half is often enough
        yield from ((models[part], samples[part]) for part in (slice(half), slice(half, None)))
        numbered += len(kept)
        barren = 0 if len(models) else barren + 1
        size = min(2 * size, _LARGEST_DRAW)


_QUANTILE = 3.64
"""An error is shorter than so many standard deviations with 99 %, in the four dimensions of a match."""


def marginal_support(squared: Floats) -> Floats:
    """Support of matches for models: from 1 without an error to 0 at the threshold, and beyond.

    One less the loss of MAGSAC++ in units of its largest value. The loss is the integral of r w(r), where the weight w
    is the density of an error r in four dimensions, averaged over all standard deviations up to threshold / 3.64, each
    cut off at 3.64 of its own.

    `squared`: (b, n) float64: squared errors in units of the squared threshold. Returns (b, n) float64.

    D. Barath, J. Noskova, M. Ivashechkin, J. Matas, MAGSAC++, a Fast, Reliable and Accurate Robust Estimator, CVPR
    2020.
    """
    support: Floats = np.interp(np.sqrt(squared), _ERRORS, _SUPPORT, right=0.0)
    return support


def _loss(errors: Floats) -> Floats:
    """The loss (n,) of errors in units of the threshold, but for a constant factor."""
    most = _QUANTILE**2 / 2
    scaled = errors**2 * most
    tail = gamma(1.5) * (gammaincc(1.5, scaled) - gammaincc(1.5, most))
    return np.asarray(gamma(2.5) * gammainc(2.5, scaled) + scaled * tail, dtype=np.float64)


_ERRORS = np.linspace(0, 1, 1001)
_SUPPORT = 1 - _loss(_ERRORS) / _loss(_ERRORS[-1:])
