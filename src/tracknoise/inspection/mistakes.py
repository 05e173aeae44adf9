"""The topic mistakes: whether the image motion would fit better if a usual mistake were undone."""

from collections.abc import Sequence as ListOf
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.inspection.check_report import Item, Severity, Values
from tracknoise.inspection.depth_kind import depth_kind
from tracknoise.inspection.depths import FARTHEST_M, NEAREST_M
from tracknoise.inspection.evidence import Evidence, residual_px, thinned
from tracknoise.inspection.hypotheses import AS_GIVEN, AS_RAY_DEPTH, Hypothesis, corrected, hypotheses
from tracknoise.inspection.pairs import Pair
from tracknoise.printable import counted, significant

MOST_GAIN, LEAST_BETTER = 0.75, 0.75
"""A mistake is named if residuals fall below this share, in at least this share of the pairs that did not choose it."""
FEW_PAIRS, MOST_GAIN_OF_FEW = 20, 0.4
"""Fewer pairs than this both choose and judge, and residuals must fall below this share."""

_FEWEST_PAIRS = 6
_FLOOR_PX, _CAP_PX, _CAP_MOTION = 0.05, 20.0, 3.0
_TIE = 0.15
"""Mistakes whose logarithmic gains differ by less than this cannot be distinguished."""


@dataclass(frozen=True, slots=True)
class Fit:
    """How much better a hypothesis fits than what is given.

    Attributes
    ----------
    hypothesis
        The mistake.
    gain
        Geometric mean of the residual relative to that as given.
    better
        Share of pairs whose residual is smaller.
    residual_px
        Median residual with the mistake undone.
    """

    hypothesis: Hypothesis
    gain: float
    better: float
    residual_px: float


def mistakes(evidence: Evidence) -> Item:
    """Name the mistake that explains the image motion clearly better than what is given, if there is one."""
    if len(evidence.pairs) < _FEWEST_PAIRS:
        few = counted(len(evidence.pairs), "pair")
        text = f"Mistakes in poses cannot be looked for: only {few} of images with motion."
        return Item("usual mistakes", Severity.unknown, text)
    candidates = hypotheses(has_depth=evidence.has_depth, is_z=evidence.z_depth_from is not None)
    pairs = thinned(evidence.pairs)
    given_px = _residuals(evidence, pairs, AS_GIVEN)
    tried = np.array([_residuals(evidence, pairs, one) for one in candidates])
    are_few = len(pairs) < FEW_PAIRS
    even = np.arange(len(pairs)) % 2 == 0
    choosing, judging = even | are_few, ~even | are_few
    gains = np.array([_fit(one, row, given_px, choosing).gain for one, row in zip(candidates, tried, strict=True)])
    tied = np.flatnonzero(np.log(gains) <= np.log(gains.min()) + _TIE)
    fits = [_fit(candidates[place], tried[place], given_px, judging) for place in tied]
    if fits[0].gain <= (MOST_GAIN_OF_FEW if are_few else MOST_GAIN) and fits[0].better >= LEAST_BETTER:
        return _named(evidence, fits, float(np.median(given_px)))
    if (ray := _ray_depth(evidence)) is not None:
        return ray
    text = f"None of {len(candidates)} usual mistakes explains the image motion clearly better than what is given."
    return Item("usual mistakes", Severity.ok, text + _not_tried(evidence), {"best_gain": float(gains.min())})


def _residuals(evidence: Evidence, pairs: ListOf[Pair], assumed: Hypothesis) -> NDArray[np.float64]:
    """(n,) float64: median residual of each pair, px, cut at some times the motion; NaN where a pose is missing."""
    undone = replace(evidence, poses=corrected(evidence.poses, assumed))
    found = np.array([residual_px(undone, pair, assumed) for pair in pairs])
    most = np.array([_CAP_MOTION * pair.motion_px + _CAP_PX for pair in pairs])
    return np.asarray(np.minimum(np.maximum(found, _FLOOR_PX), most), dtype=np.float64)


def _fit(
    hypothesis: Hypothesis, tried: NDArray[np.float64], given: NDArray[np.float64], chosen: NDArray[np.bool_]
) -> Fit:
    """How a hypothesis fits some of the pairs."""
    known = chosen & np.isfinite(tried) & np.isfinite(given)
    if known.sum() < _FEWEST_PAIRS // 2:
        return Fit(hypothesis, 1.0, 0.0, np.nan)
    change = np.log(tried[known]) - np.log(given[known])
    return Fit(hypothesis, float(np.exp(change.mean())), float((change < 0).mean()), float(np.median(tried[known])))


def _named(evidence: Evidence, fits: ListOf[Fit], given_px: float) -> Item:
    """The item about the first fit; others that fit as well are named too."""
    best = fits[0]
    name = _with_unit(evidence, best.hypothesis)
    others = list(dict.fromkeys(fit.hypothesis.name for fit in fits[1:] if fit.hypothesis.name != best.hypothesis.name))
    text = (
        f"It looks as if {name}. The median residual falls from {significant(given_px, 3)} to "
        f"{significant(best.residual_px, 2)} px if this is undone; "
        f"it is smaller in {best.better:.0%} of the pairs of images that test it."
    )
    if others:
        text += f" This recording cannot distinguish it from: {'; or '.join(others[:2])}."
    text += _not_tried(evidence)
    values: Values = {
        "mistake": best.hypothesis.kind,
        "gain": best.gain,
        "given_px": given_px,
        "undone_px": best.residual_px,
    }
    return Item("usual mistakes", Severity.fatal, text, values)


def _not_tried(evidence: Evidence) -> str:
    """A further sentence where the kind of depth is known; otherwise empty."""
    if evidence.z_depth_from is None:
        return ""
    return f" Not tried: that {AS_RAY_DEPTH.name}; depths are z by construction (from {evidence.z_depth_from})."


def _with_unit(evidence: Evidence, mistake: Hypothesis) -> str:
    """Name of a mistake; of one in scale, with the unit that was probably mistaken."""
    if mistake.depth_scale not in (1000.0, 0.001):
        return mistake.name
    depth_m = float(np.nanmedian(np.concatenate([pair.depth_first_m for pair in evidence.pairs])))
    are_metres = NEAREST_M <= depth_m <= FARTHEST_M / 5
    if mistake.depth_scale == 1000.0:
        unit = "positions are probably in millimetres, read as metres"
        other = "depths are probably divided by 1000 once too often"
    else:
        unit = "positions are probably divided by 1000 once too often"
        other = "depths are probably in millimetres, read as metres"
    return f"{mistake.name} ({unit if are_metres else other})"


def _ray_depth(evidence: Evidence) -> Item | None:
    """The item about distances along the ray, where the change of depth from image to image shows them."""
    kind = depth_kind(evidence)
    if kind is None or not kind.is_ray:
        return None
    text = (
        f"It looks as if {AS_RAY_DEPTH.name}. Depths of the same point in two images differ by "
        f"{kind.slope:.2f} +- {kind.sd:.2f} times what such distances would (0 is expected of depths)."
    )
    values: Values = {"mistake": AS_RAY_DEPTH.kind, "slope": kind.slope, "slope_sd": kind.sd}
    return Item("usual mistakes", Severity.fatal, text, values)
