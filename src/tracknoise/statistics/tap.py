"""Metrics of point trackers: those of TAP-Vid, and the expected feature age of event trackers. Arrays only.

The metrics of TAP-Vid are those of its query mode "first": a point is evaluated in all frames after its own first one.
It is predicted to be visible where the tracker reports it. TAP-Vid has a position of each point in each frame, also
where it is predicted to be occluded. Most trackers have none there.

Sources: C. Doersch et al., TAP-Vid: A Benchmark for Tracking Any Point in a Video, 2022 (arXiv:2211.03726);
N. Messikommer et al., Data-driven Feature Tracking for Event Cameras, 2023 (arXiv:2211.12826).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

THRESHOLDS = (1, 2, 4, 8, 16)
"""Distances below which a position is correct in the metrics of TAP-Vid."""
AGE_THRESHOLDS = tuple(range(1, 32))
"""Distances above which a feature is lost in the expected feature age."""


@dataclass(frozen=True, slots=True, eq=False)
class PointTracks:
    """True and reported positions of n points in the k frames that a tracker saw."""

    reported_px: NDArray[np.float64]  # (n, k, 2): NaN where the tracker did not report the point
    true_px: NDArray[np.float64]  # (n, k, 2): arbitrary where not visible
    visible: NDArray[np.bool_]  # (n, k): whether the true position is known and visible
    known: NDArray[np.bool_]  # (n, k): whether it is known that the point is visible or that it is not
    first: NDArray[np.int64]  # (n,): column in which each point begins; it is reported there
    # (n, k, 2): positions also where the tracker predicts that a point is occluded; None unless it states all of them
    predicted_px: NDArray[np.float64] | None = None

    @property
    def reported(self) -> NDArray[np.bool_]:
        """Whether the tracker reported the point, (n, k)."""
        return np.asarray(~np.isnan(self.reported_px[..., 0]))

    @property
    def evaluated(self) -> NDArray[np.bool_]:
        """Frames after the first one of a point in which its visibility is known, (n, k)."""
        return np.asarray(self.known & (np.arange(self.known.shape[1]) > self.first[:, None]))

    def distance(self, scale: ArrayLike) -> NDArray[np.float64]:
        """Distance of reported and true positions, (n, k), after scaling u and v; NaN where not reported."""
        return self._distance(self.reported_px, scale)

    def predicted_distance(self, scale: ArrayLike) -> NDArray[np.float64] | None:
        """The same of all positions, also under predicted occlusion; None where the tracker does not state them."""
        return None if self.predicted_px is None else self._distance(self.predicted_px, scale)

    def _distance(self, position_px: NDArray[np.float64], scale: ArrayLike) -> NDArray[np.float64]:
        offset = (position_px - self.true_px) * np.asarray(scale)
        distance: NDArray[np.float64] = np.hypot(offset[..., 0], offset[..., 1])
        return distance


def tap_vid(points: PointTracks, scale: ArrayLike = (1.0, 1.0)) -> dict[str, float]:
    """Position accuracy, Jaccard index and occlusion accuracy of TAP-Vid.

    With v for visible, r for reported, p for a position closer than a threshold, and d for one that is reported and
    closer, all of evaluated frames: delta = |v p| / |v|, delta_reported = |v d| / |v|, Jaccard = |v d| /
    (|v| + |r and not (v d)|), and OA = |v = r| / |all|. delta_reported is no metric of TAP-Vid: it is at most delta.

    Parameters
    ----------
    points
        Of one sequence.
    scale
        Factors of u and v, such as (256 / width, 256 / height) for the raster of TAP-Vid.

    Returns
    -------
    dict
        ``delta_<threshold>``, ``delta_reported_<threshold>`` and ``jaccard_<threshold>`` of each of `THRESHOLDS`, their
        means ``delta_avg``, ``delta_avg_reported`` and ``average_jaccard``, and ``occlusion_accuracy``. NaN where
        nothing is evaluated, and delta where the tracker states no positions under predicted occlusion.
    """
    evaluated = points.evaluated
    visible, reported = points.visible & evaluated, points.reported & evaluated
    distance, predicted = points.distance(scale), points.predicted_distance(scale)
    n_visible = int(visible.sum())
    metrics: dict[str, float] = {}
    for threshold in THRESHOLDS:
        correct = int((visible & reported & (distance < threshold)).sum())
        wrong = int(reported.sum()) - correct
        near = None if predicted is None else int((visible & (predicted < threshold)).sum())
        metrics[f"delta_{threshold}"] = float("nan") if near is None else _ratio(near, n_visible)
        metrics[f"delta_reported_{threshold}"] = _ratio(correct, n_visible)
        metrics[f"jaccard_{threshold}"] = _ratio(correct, n_visible + wrong)
    means = {"delta_avg": "delta", "delta_avg_reported": "delta_reported", "average_jaccard": "jaccard"}
    for mean, name in means.items():
        metrics[mean] = float(np.mean([metrics[f"{name}_{threshold}"] for threshold in THRESHOLDS]))
    metrics["occlusion_accuracy"] = _ratio(int((evaluated & (visible == reported)).sum()), int(evaluated.sum()))
    return metrics


def expected_feature_age(points: PointTracks, scale: ArrayLike = (1.0, 1.0)) -> float:
    """Share of the time in which a point is visible for which it is tracked, averaged over points and thresholds.

    The true track of a point goes from its first frame to the last before it is not visible. Its age at a threshold is
    the number of frames, after the first, up to the last before the point is not reported or farther than the
    threshold. Age over length is averaged over the points, which is the mean over points of an age above 0 times their
    share, and then over `AGE_THRESHOLDS`. Points that are visible in their first frame only take no part. NaN if there
    is no other.
    """
    after = np.arange(points.visible.shape[1]) > points.first[:, None]
    distance = points.distance(scale)
    length = _frames_until(after & ~points.visible, points.first)
    lasting = length > 0
    if not lasting.any():
        return float("nan")
    lost = after & ~(points.visible & points.reported)
    ages = [_frames_until(lost | (after & (distance > limit)), points.first)[lasting] for limit in AGE_THRESHOLDS]
    return float(np.mean(np.array(ages) / length[lasting]))


def _frames_until(event: NDArray[np.bool_], first: NDArray[np.int64]) -> NDArray[np.int64]:
    """Number of frames after the first of each point and before its first event, (n,)."""
    n_columns = event.shape[1]
    place = np.where(event.any(axis=1), event.argmax(axis=1), n_columns)
    return np.asarray(place - first - 1, dtype=np.int64)


def _ratio(count: int, total: int) -> float:
    return count / total if total else float("nan")
