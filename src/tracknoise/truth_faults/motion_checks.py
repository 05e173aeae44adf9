"""Topics about image motion: focal length, usual mistakes, and whether depths and poses predict what is seen.

Where parts of the scene move, some points fit poses and depths exactly, and the others do not fit at all.
"""

from collections.abc import Sequence as ListOf
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.pose import transform
from tracknoise.inference.jackknife import jackknife
from tracknoise.text import counted, significant
from tracknoise.truth_faults.check_report import Item, Severity, Values
from tracknoise.truth_faults.depth_checks import FARTHEST_M, NEAREST_M, DepthKind, depth_kind
from tracknoise.truth_faults.image_evidence import (
    AS_GIVEN,
    AS_RAY_DEPTH,
    AS_TURNING,
    LEAST_MOTION_PX,
    LONG_PX,
    SHORT_PX,
    Evidence,
    Hypothesis,
    Pair,
    any_scale,
    corrected,
    focal_px,
    hypotheses,
    other_focal_lengths,
    relative_pose,
    residual_px,
    residuals_px,
    thinned,
)

_LOG_FACTORS = np.linspace(-0.3, 0.3, 61)
_FOCAL_LENGTH_LEAST_MOTION_PX, _FOCAL_LENGTH_FEWEST_PAIRS = 1.5, 10
_FOCAL_LENGTH_FLOOR_PX = 0.05
_MOST_GAIN, _LEAST_RELATIVE, _SURE_SD, _MOST_SD = 0.9, 0.02, 3.0, 0.05
_UNKNOWN = "The focal length cannot be determined from this recording."


def focal_length(evidence: Evidence) -> Item:
    """The focal length that fits best, where depths and motion determine it."""
    pairs = thinned([pair for pair in evidence.pairs if pair.motion_px >= _FOCAL_LENGTH_LEAST_MOTION_PX])
    if not evidence.has_depth or len(pairs) < _FOCAL_LENGTH_FEWEST_PAIRS:
        return Item("focal length", Severity.unknown, _UNKNOWN)
    zoomed = [Hypothesis("focal", "another focal length", zoom=float(np.exp(factor))) for factor in _LOG_FACTORS]
    residuals = np.array([[residual_px(evidence, pair, hypothesis) for hypothesis in zoomed] for pair in pairs])
    logs = np.log(np.clip(residuals, _FOCAL_LENGTH_FLOOR_PX, None))
    best, sd = jackknife(logs, lambda rows: float(_LOG_FACTORS[np.argmin(rows.mean(axis=0))]))
    means = logs.mean(axis=0)
    return _item(focal_px(evidence.camera), best, sd, gain=float(np.exp(means.min() - means[len(means) // 2])))


def _item(given_px: float, best: float, sd: float, *, gain: float) -> Item:
    fitted_px = given_px * float(np.exp(best))
    values: Values = {"given_px": given_px, "fitted_px": fitted_px, "fitted_sd_px": fitted_px * sd, "gain": gain}
    if sd > _MOST_SD:
        return Item("focal length", Severity.unknown, _UNKNOWN, values)
    if abs(best) > max(_LEAST_RELATIVE, _SURE_SD * sd) and gain < _MOST_GAIN:
        text = (
            f"A focal length of {fitted_px:.0f} ± {max(fitted_px * sd, 1.0):.0f} px fits the image motion better than "
            f"the stated {given_px:.0f} px. Residuals fall to {gain:.0%}."
        )
        return Item("focal length", Severity.caveat, text, values)
    text = f"The focal length of {given_px:.4g} px agrees with the image motion."
    return Item("focal length", Severity.ok, text, values)


MOST_GAIN, LEAST_BETTER = 0.75, 0.75
"""A mistake is named if residuals fall below this share, in at least this share of the pairs that did not choose it."""
FEW_PAIRS, FEW_FRAMES, MOST_GAIN_OF_FEW = 20, 15, 0.25
"""Fewer pairs than this, or pairs of fewer frames, both choose and judge, and residuals must fall below this share.

They share a few poses, whose errors one of many mistakes may undo by chance: in cuts of 6 to 10 frames of KITTI and TUM
residuals fell to .35 and .74.
"""

_MISTAKE_FEWEST_PAIRS = 6
_MISTAKE_FLOOR_PX, _CAP_PX, _CAP_MOTION = 0.05, 20.0, 3.0
_TIE = 0.15
"""Mistakes whose logarithmic gains differ by less than this cannot be distinguished."""
_MOST_OF_PARALLAX = 0.5
"""Positions in another unit leave at most this part of what the camera's rotation alone leaves."""


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
    """Name the mistake that explains the image motion clearly better than what is given, if there is one.

    The nearest tenth of the points has to fit better too: where most points are on things that move, the poses that
    are given fit the others. Without depths, residuals are distances from epipolar lines. On a straight path small
    errors of the poses may fit better with turned poses, so residuals must rival the motion too, or fall to those of
    the tracking.
    """
    if evidence.stands_still:
        return _without_motion(evidence)
    if len(evidence.pairs) < _MISTAKE_FEWEST_PAIRS:
        few = f"only {counted(len(evidence.pairs), 'pair')}" if evidence.pairs else "no pair"
        text = f"Usual mistakes in poses cannot be checked: {few} of images with motion."
        return Item("usual mistakes", Severity.unknown, text)
    kind = depth_kind(evidence)
    is_z = evidence.z_depth_from is not None or (kind is not None and kind.is_z)
    candidates = hypotheses(
        has_depth=evidence.has_depth,
        is_z=is_z,
        expected=evidence.expected,
        body_from_camera=evidence.body_from_camera,
    )
    n_usual = len(candidates)
    pairs = thinned(evidence.pairs)
    motion_px = np.array([pair.motion_px for pair in pairs])
    most_px = _CAP_MOTION * motion_px + _CAP_PX
    given_px = _residuals(evidence, pairs, AS_GIVEN, most_px)
    tried = np.array([_residuals(evidence, pairs, hypothesis, most_px) for hypothesis in candidates])
    are_few = (
        len(pairs) < FEW_PAIRS or len({frame for pair in pairs for frame in (pair.first, pair.second)}) < FEW_FRAMES
    )
    even = np.arange(len(pairs)) % 2 == 0
    choosing, judging = even | are_few, ~even | are_few
    gains = _gains(candidates, tried, given_px, choosing)
    more = [*(any_scale() if candidates[int(np.argmin(gains))].kind == "scale" else ())]  # usual factors come first
    more += other_focal_lengths() if gains.min() <= MOST_GAIN else ()
    if more:
        candidates = [*candidates, *more]
        tried = np.concatenate([tried, [_residuals(evidence, pairs, hypothesis, most_px) for hypothesis in more]])
        gains = _gains(candidates, tried, given_px, choosing)
    tied = _tied(candidates, np.log(gains))
    fits = [_fit(candidates[place], tried[place], given_px, judging) for place in tied]
    is_clear = fits[0].gain <= (MOST_GAIN_OF_FEW if are_few else MOST_GAIN) and fits[0].better >= LEAST_BETTER
    rival_motion = np.nanmedian(given_px / np.maximum(motion_px, 1.0)) >= _CAVEAT_SHARE
    if is_clear:
        nearest_px, as_given_px = (_nearest_px(evidence, one, _NEAREST) for one in (fits[0].hypothesis, AS_GIVEN))
        is_clear = nearest_px < as_given_px
    if is_clear and (evidence.has_depth or rival_motion or fits[0].residual_px <= _NOISE_PX):
        return _named(evidence, fits, float(np.median(given_px)))
    if kind is not None and kind.is_ray:
        return _ray_depth(kind)
    text = f"None of {n_usual} usual mistakes explains the image motion clearly better than the data as stated."
    return Item("usual mistakes", Severity.ok, text + _not_tried(evidence), {"best_gain": float(gains.min())})


def _gains(
    candidates: ListOf[Hypothesis], tried: NDArray[np.float64], given: NDArray[np.float64], chosen: NDArray[np.bool_]
) -> NDArray[np.float64]:
    return np.array(
        [_fit(hypothesis, row, given, chosen).gain for hypothesis, row in zip(candidates, tried, strict=True)]
    )


def _tied(candidates: ListOf[Hypothesis], log_gains: NDArray[np.float64]) -> list[int]:
    """Places of those that fit best, and as well, the most usual first.

    Where larger depths fit best, positions of the camera must explain the parallax then. Otherwise their errors are
    larger than the parallax, and the factor only makes them smaller.
    """
    best = int(np.argmin(log_gains))
    if candidates[best].depth_scale > 1.0:
        turning = candidates.index(AS_TURNING)
        if log_gains[best] > log_gains[turning] + np.log(_MOST_OF_PARALLAX):
            near = np.flatnonzero(np.abs(log_gains - log_gains[turning]) <= _TIE).tolist()
            return [turning, *(place for place in near if place != turning)]
    near = np.flatnonzero(log_gains <= log_gains[best] + _TIE).tolist()
    is_usual = any(candidates[place].kind == "scale" and not candidates[place].is_about for place in near)
    return [place for place in near if not (is_usual and candidates[place].is_about)]


def _without_motion(evidence: Evidence) -> Item:
    """Poses that are all the same are those of a tripod where the images stand still too, and wrong where they move."""
    motions = [pair.motion_px for pair in (*evidence.flow.steps, *evidence.flow.wide)]
    if motions and (moved := float(np.median(motions))) >= LEAST_MOTION_PX:
        text = f"All poses are the same, but the images move by {significant(moved, 2)} px (median over pairs)."
        return Item("usual mistakes", Severity.fatal, text, {"motion_px": moved})
    text = "All poses are the same, and the images do not move: mistakes in poses cannot be checked."
    return Item("usual mistakes", Severity.unknown, text)


def _residuals(
    evidence: Evidence, pairs: ListOf[Pair], assumed: Hypothesis, most_px: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n,) float64: median residual of each pair, px, cut at the most that counts; NaN where a pose is missing."""
    undone = replace(evidence, poses=corrected(evidence.poses, assumed))
    residuals = np.array([residual_px(undone, pair, assumed) for pair in pairs])
    return np.asarray(np.minimum(np.maximum(residuals, _MISTAKE_FLOOR_PX), most_px), dtype=np.float64)


def _fit(
    hypothesis: Hypothesis, tried: NDArray[np.float64], given: NDArray[np.float64], chosen: NDArray[np.bool_]
) -> Fit:
    """How a hypothesis fits some of the pairs."""
    usable = chosen & np.isfinite(tried) & np.isfinite(given)
    if usable.sum() < _MISTAKE_FEWEST_PAIRS // 2:
        return Fit(hypothesis, 1.0, 0.0, np.nan)
    change = np.log(tried[usable]) - np.log(given[usable])
    return Fit(hypothesis, float(np.exp(change.mean())), float((change < 0).mean()), float(np.median(tried[usable])))


def _named(evidence: Evidence, fits: ListOf[Fit], given_px: float) -> Item:
    """The item about the first fit; others that fit as well are named too."""
    best = fits[0]
    name = _with_unit(evidence, best.hypothesis)
    is_seen = best.hypothesis is AS_TURNING and best.residual_px > _NOISE_PX  # a parallax that no factor explains
    names_no_scale = is_seen or best.hypothesis.is_about  # other factors of the same series are no rivals
    rivals = [fit.hypothesis for fit in fits[1:] if not (names_no_scale and fit.hypothesis.kind == "scale")]
    other_names = list(dict.fromkeys(rival.name for rival in rivals if rival.name != best.hypothesis.name))
    undone = "without any motion of the positions" if best.hypothesis is AS_TURNING else "if that is corrected"
    text = (
        f"It looks as if {name}. The median residual falls from {significant(given_px, 3)} to "
        f"{significant(best.residual_px, 2)} px {undone}; "
        f"it is smaller in {best.better:.0%} of the pairs of images that test it."
    )
    if other_names:
        text += f" This recording cannot distinguish it from: {'; or '.join(other_names[:2])}."
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
    return f" Depth along the ray was not tried: depths are z by construction (from {evidence.z_depth_from})."


def _with_unit(evidence: Evidence, mistake: Hypothesis) -> str:
    """Name of a mistake; of one in scale, with the unit that was probably mistaken."""
    if mistake.depth_scale not in (1000.0, 100.0, 0.01, 0.001):
        return mistake.name
    depth_m = float(np.nanmedian(np.concatenate([pair.depth_first_m for pair in evidence.pairs])))
    are_metres = NEAREST_M <= depth_m <= FARTHEST_M / 5
    factor = round(max(mistake.depth_scale, 1.0 / mistake.depth_scale))
    of_metres = {1000: "millimetres", 100: "centimetres"}[factor]
    read, divided = f"are probably in {of_metres}, read as metres", f"are probably divided by {factor} once too often"
    unit, other = f"positions {read}", f"depths {divided}"
    if mistake.depth_scale < 1.0:
        unit, other = f"positions {divided}", f"depths {read}"
    return f"{mistake.name} ({unit if are_metres else other})"


def _ray_depth(kind: DepthKind) -> Item:
    """The item about distances along the ray, where the change of depth from image to image shows them."""
    text = (
        f"It looks as if {AS_RAY_DEPTH.name}. Depths of the same point in two images differ by "
        f"{kind.slope:.2f} ± {kind.sd:.2f} times what such distances would (depths along the axis: 0)."
    )
    values: Values = {"mistake": AS_RAY_DEPTH.kind, "slope": kind.slope, "slope_sd": kind.sd}
    return Item("usual mistakes", Severity.fatal, text, values)


_MOVING_LEAST_MOTION_PX, _FIT_SHARE = 2.0, 0.15
"""A point that moves at least this far fits if its residual is at most this share of its own motion."""
_LEAST_SHARE, _LEAST_RATIO = 0.25, 10.0
"""Wrong poses or depths leave fewer points that fit, or a gradual transition between those that do and do not."""
_LEAST_OTHERS = 0.25
"""Where most points fit, fewer others may be errors of the tracking at depth edges: on TartanAir they are .23."""
_FEWEST_POINTS = 100


@dataclass(frozen=True, slots=True)
class MovingScene:
    """Points in two groups.

    Attributes
    ----------
    share
        Share of points that fit.
    fit_px, other_px
        Median residual of the points that fit, and of the others.
    """

    share: float
    fit_px: float
    other_px: float


def moving_scene(evidence: Evidence, *, least_others: float) -> MovingScene | None:
    """Both groups of points; None where points do not form two groups, or the second has less than this share."""
    points = np.concatenate([_points(evidence, pair) for pair in evidence.pairs])
    points = points[points[:, 1] >= _MOVING_LEAST_MOTION_PX]
    fits: NDArray[np.bool_] = points[:, 0] <= _FIT_SHARE * points[:, 1]
    if len(points) < _FEWEST_POINTS or fits.all() or not _LEAST_SHARE <= fits.mean() <= 1.0 - least_others:
        return None
    scene = MovingScene(float(fits.mean()), float(np.median(points[fits, 0])), float(np.median(points[~fits, 0])))
    return scene if _LEAST_RATIO * scene.fit_px <= scene.other_px < np.inf else None


def _points(evidence: Evidence, pair: Pair) -> NDArray[np.float64]:
    """(m, 2) float64: residual and motion of each point, px, with depth if there is; none where a pose is missing."""
    residual = residuals_px(pair, evidence.poses, evidence.camera, AS_GIVEN, has_depth=evidence.has_depth)
    if not len(residual):
        return np.empty((0, 2))
    motion = np.linalg.norm(pair.uv_second - pair.uv_first, axis=1)
    return np.column_stack([residual, motion[np.isfinite(pair.depth_first_m)] if evidence.has_depth else motion])


_CAVEAT_SHARE, _FATAL_SHARE = 0.3, 0.8
"""Residuals relative to the image motion above which poses are doubtful, or explain next to nothing."""
_NOISE_PX = 0.3
"""Residuals below this are those of the tracking."""
_MOST_EPIPOLAR_PX, _MOST_EPIPOLAR_SHARE, _FEWEST_OFF = 1.0, 0.05, 3
"""Medians of distances from epipolar lines above both, px and relative to the motion, are no errors of the tracking.

They are of at least so many pairs. Points that were not found on the way back to within 0.5 px are left out. Three
quarters of the points have to be off by more than the tracking too.
"""
_OFF = "Rotations of the poses, directions of their motion, or the intrinsics are wrong."
_AGREE = (
    "Rotations of the poses and directions of their motion agree with the images within these residuals. Errors along "
    "epipolar lines, and the scale of the positions, cannot be seen."
)
_NEAREST, _QUARTER = 0.1, 0.25
_BOUNDARY_PX = (SHORT_PX * LONG_PX) ** 0.5


def warping(evidence: Evidence) -> Item:
    """Distance of tracked points from their prediction, at a short and a long baseline."""
    residuals = [(pair.motion_px, residual_px(evidence, pair, AS_GIVEN)) for pair in evidence.pairs]
    finite = np.array([row for row in residuals if np.isfinite(row[1])]).reshape(-1, 2)
    if not len(finite):
        text = "Images could not be compared with poses: too few points were found again, or poses are missing."
        return Item("warping", Severity.unknown, text)
    values: dict[str, float | int | str | None] = {"n_pairs": len(finite)}
    sentences, is_off = [_opening(evidence)], False
    for name, part in (("short", finite[finite[:, 0] < _BOUNDARY_PX]), ("long", finite[finite[:, 0] >= _BOUNDARY_PX])):
        if len(part):
            motion, residual = np.median(part, axis=0).tolist()
            values |= {f"{name}_motion_px": motion, f"{name}_residual_px": residual}
            sentences.append(f"At an image motion of {significant(motion, 3)} px the residual is {residual:.2f} px.")
            is_off |= len(part) >= _FEWEST_OFF and residual > max(_MOST_EPIPOLAR_PX, _MOST_EPIPOLAR_SHARE * motion)
    share, typical_px = float(np.median(finite[:, 1] / np.maximum(finite[:, 0], 1.0))), float(np.median(finite[:, 1]))
    severity = _severity(share, typical_px)
    differs = _depth_disagreement(evidence)
    sentences += [f"Depths of the same points in two images differ by {differs:.1%}."] if differs is not None else []
    if not evidence.has_depth:
        is_off = is_off and _nearest_px(evidence, AS_GIVEN, _QUARTER) > _NOISE_PX
        severity = Severity.fatal if is_off else Severity.ok
    moving = moving_scene(evidence, least_others=_LEAST_OTHERS if severity is Severity.ok else 0.0)
    if not evidence.has_depth and moving is None:
        sentences.append(_OFF if is_off else _AGREE)
    elif severity is not Severity.ok:
        sentences.append(f"Errors of the truth are large: residuals are {share:.0%} of the image motion.")
    if moving is not None:
        severity = Severity.caveat
        sentences.append(f"{_of_moving_parts(moving)} {MOVE}")
    elif severity is not Severity.ok:
        nearest_px = _nearest_px(evidence, AS_GIVEN, _NEAREST)
        if nearest_px <= min(_NOISE_PX, typical_px / _LEAST_RATIO):
            severity = Severity.caveat
            sentences.append(f"{_NEAREST:.0%} of the points have residuals of at most {nearest_px:.2f} px. {MOVE}")
    return Item(
        "warping", severity, " ".join(sentences), {**values, "share_of_motion": share, "depth_disagreement": differs}
    )


def _nearest_px(evidence: Evidence, assumed: Hypothesis, share: float) -> float:
    """Distance from the prediction within which a share of the points of a median pair are, px.

    Errors of the poses move nearly all points; traffic moves its own.
    """
    undone = corrected(evidence.poses, assumed)
    residuals = (
        residuals_px(pair, undone, evidence.camera, assumed, has_depth=evidence.has_depth) for pair in evidence.pairs
    )
    of_pairs = [np.quantile(np.nan_to_num(of_pair, nan=np.inf), share) for of_pair in residuals if len(of_pair)]
    return float(np.median(of_pairs))


def _opening(evidence: Evidence) -> str:
    if evidence.has_depth:
        return "Tracked points were compared with what depths and poses predict."
    return "Tracked points were compared with the epipolar lines of the poses."


def _severity(share: float, typical_px: float) -> Severity:
    if share < _CAVEAT_SHARE or typical_px < _NOISE_PX:
        return Severity.ok
    return Severity.fatal if share > _FATAL_SHARE else Severity.caveat


def _of_moving_parts(moving: MovingScene) -> str:
    return (
        f"{moving.share:.0%} of the points have residuals of {significant(moving.fit_px, 2)} px, and the others of "
        f"{significant(moving.other_px, 2)} px."
    )


MOVE = "Parts of the scene probably move, such as traffic or people."
"""Ends the item about points of which some fit and others are far off."""


def _depth_disagreement(evidence: Evidence) -> float | None:
    """Median relative difference between predicted and measured depth; None without depth."""
    differences = np.concatenate([_depth_differences(evidence, pair) for pair in evidence.pairs])
    return float(np.median(differences)) if len(differences) else None


def _depth_differences(evidence: Evidence, pair: Pair) -> NDArray[np.float64]:
    """(m,) float64: absolute differences relative to the measured depth."""
    has_depths = np.isfinite(pair.depth_first_m) & np.isfinite(pair.depth_second_m)
    points = evidence.camera.unproject(pair.uv_first[has_depths], pair.depth_first_m[has_depths])
    measured = pair.depth_second_m[has_depths]
    return np.abs(transform(relative_pose(evidence.poses, pair), points)[:, 2] - measured) / measured
