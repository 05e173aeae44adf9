"""The topic warping: whether depths and poses predict the image motion that is seen."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.pose import transform
from tracknoise.inspection.check_report import Item, Severity
from tracknoise.inspection.evidence import Evidence, residual_px
from tracknoise.inspection.hypotheses import AS_GIVEN
from tracknoise.inspection.moving_scene import MovingScene, moving_scene
from tracknoise.inspection.pairs import LONG_PX, SHORT_PX, Pair
from tracknoise.inspection.residuals import relative_pose
from tracknoise.printable import significant

_CAVEAT_SHARE, _FATAL_SHARE = 0.3, 0.8
"""Residuals relative to the image motion above which poses are doubtful, or explain next to nothing."""
_NOISE_PX = 0.3
"""Residuals below this are those of the tracking."""
_BOUNDARY_PX = (SHORT_PX * LONG_PX) ** 0.5


def warping(evidence: Evidence) -> Item:
    """Distance of tracked points from their prediction, at a short and a long baseline."""
    found = [(pair.motion_px, residual_px(evidence, pair, AS_GIVEN)) for pair in evidence.pairs]
    known = np.array([one for one in found if np.isfinite(one[1])]).reshape(-1, 2)
    if not len(known):
        text = "Images could not be compared with poses: too few points were found again, or poses are missing."
        return Item("warping", Severity.unknown, text)
    values: dict[str, float | int | str | None] = {"n_pairs": len(known)}
    sentences = [_opening(evidence)]
    for name, part in (("short", known[known[:, 0] < _BOUNDARY_PX]), ("long", known[known[:, 0] >= _BOUNDARY_PX])):
        if len(part):
            motion, residual = np.median(part, axis=0).tolist()
            values |= {f"{name}_motion_px": motion, f"{name}_residual_px": residual}
            sentences.append(f"At an image motion of {significant(motion, 3)} px the residual is {residual:.2f} px.")
    share = float(np.median(known[:, 1] / np.maximum(known[:, 0], 1.0)))
    severity = _severity(share, float(np.median(known[:, 1])))
    differs = _depth_disagreement(evidence)
    sentences += [f"Depths of two images differ by {differs:.1%}."] if differs is not None else []
    if severity is not Severity.ok:
        sentences.append(f"Errors of the truth would rival the motion: residuals are {share:.0%} of it.")
        if (moving := moving_scene(evidence)) is not None:
            severity = Severity.caveat
            sentences.append(_of_moving_parts(moving))
    return Item(
        "warping", severity, " ".join(sentences), {**values, "share_of_motion": share, "depth_disagreement": differs}
    )


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
        f"{moving.share:.0%} of the points fit to within {moving.fit_px:.1f} px, and the others miss by "
        f"{moving.other_px:.1f} px. Parts of the scene probably move, such as traffic or people."
    )


def _depth_disagreement(evidence: Evidence) -> float | None:
    """Median relative difference between predicted and measured depth; None without depth."""
    differences = np.concatenate([_depth_differences(evidence, pair) for pair in evidence.pairs])
    return float(np.median(differences)) if len(differences) else None


def _depth_differences(evidence: Evidence, pair: Pair) -> NDArray[np.float64]:
    """(m,) float64: absolute differences relative to the measured depth."""
    known = np.isfinite(pair.depth_first_m) & np.isfinite(pair.depth_second_m)
    points = evidence.camera.unproject(pair.uv_first[known], pair.depth_first_m[known])
    measured = pair.depth_second_m[known]
    return np.abs(transform(relative_pose(evidence.poses, pair), points)[:, 2] - measured) / measured
