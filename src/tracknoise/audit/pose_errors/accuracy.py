"""The accuracy of poses, as tracks of unlike trackers show it, for the settings of an experiment."""

from collections.abc import Mapping
from types import MappingProxyType

import polars as pl

LEAST_SHARE = 0.05
"""Smallest share of the second moment that pose errors must explain."""
_KEYS: Mapping[tuple[str, str], str] = MappingProxyType(
    {
        ("rotation", "white"): "rotation_white_deg",
        ("rotation", "random walk"): "rotation_deg_per_sqrt_frame",
        ("translation", "white"): "translation_white_m",
        ("translation", "random walk"): "translation_m_per_sqrt_frame",
    }
)


def accuracy_toml(law: pl.DataFrame, share: pl.DataFrame, step: int = 1) -> str | None:
    """The block ``[truth.accuracy]`` with the pose errors that the tracks show; None where they do not confirm any.

    They are confirmed if at least two trackers have shares of (rigid.share) that were fitted to other trackers, and if
    at most ages each of these shares is at least `LEAST_SHARE` with an interval above 0. A motion that one tracker
    alone sees may be its own.

    Parameters
    ----------
    law
        Table `POSE_LAW`. Its upright, forward view is used.
    share
        Table `RIGID_SHARE`.
    step
        Frames of the recording from one measured frame to the next, see `tracknoise.audit.run_settings`.

    Returns
    -------
    str or None
        Values with three digits, in the units of `tracknoise.geometry.accuracy.TruthAccuracy`: a random walk over
        frames of the recording, sqrt(step) times as small as that over measured frames.
    """
    upright = law.filter((pl.col("rotation") == 0) & (pl.col("direction") == "forward"))
    rows = upright.unique(["motion", "law"], keep="first", maintain_order=True)
    if rows.is_empty() or not _is_confirmed(share):
        return None
    per_frame = {"white": 1.0, "random walk": step**-0.5}
    lines = [
        f"{_KEYS[motion, law]} = {value * per_frame[law]:.3g}"
        for motion, law, value in rows["motion", "law", "value"].iter_rows()
    ]
    return "\n".join(["[truth.accuracy]", *lines])


def _is_confirmed(share: pl.DataFrame) -> bool:
    of_others = share.filter((pl.col("fitted_to") == "others") & (pl.col("coordinate") == "both"))
    shown = (pl.col("share") >= LEAST_SHARE) & (pl.col("low").fill_null(0.0) > 0.0)
    by_tracker = of_others.group_by("tracker").agg(most=shown.mean() > 0.5)
    return by_tracker.height > 1 and bool(by_tracker["most"].all())
