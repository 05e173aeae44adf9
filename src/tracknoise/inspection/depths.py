"""The topic depth: whether its unit can be metres, and how much of the image has it."""

from collections.abc import Sequence as ListOf

import numpy as np

from tracknoise.geometry.depth import DepthMap
from tracknoise.inspection.check_report import Item, Severity, Values
from tracknoise.printable import significant
from tracknoise.sequences.sequence import Sequence

NEAREST_M, FARTHEST_M = 0.05, 1000.0
"""A median depth outside of this range is not metres."""
_LEAST_SHARE = 0.2
_FRAMES = 8


def depths(sequence: Sequence) -> Item:
    """Median depth and share of pixels with depth in some frames.

    Raises
    ------
    DataError
        If a depth map cannot be read.
    """
    maps = sampled_depths(sequence)
    if not maps:
        if sequence.truths:
            return Item("depth", Severity.ok, f"There are no depth maps; truth is possible by {sequence.truths[0]}.")
        return Item("depth", Severity.caveat, "There is no depth: truth by depth is not possible.")
    share = depth_share(maps)
    values = np.concatenate([depth.depth_m[depth.valid] for depth in maps])
    if not len(values):
        return Item("depth", Severity.fatal, "No pixel has a valid depth.", {"share": 0.0})
    low, median, high = (float(value) for value in np.percentile(values, [5, 50, 95]))
    numbers: Values = {"share": share, "median_m": median, "low_m": low, "high_m": high}
    text = (
        f"The median depth is {significant(median, 3)} m; "
        f"90 % lie between {significant(low, 3)} and {significant(high, 3)} m. "
        f"{share:.0%} of pixels have depth."
    )
    if not NEAREST_M <= median <= FARTHEST_M:
        return Item("depth", Severity.fatal, f"{text} The unit is probably not metres.", numbers)
    is_dense = maps[0].radius_px is None
    if is_dense and share < _LEAST_SHARE:
        return Item("depth", Severity.caveat, f"{text} Few features will have a truth.", numbers)
    return Item("depth", Severity.ok, text, numbers)


def sampled_depths(sequence: Sequence) -> list[DepthMap]:
    """Depth maps of some frames, spread evenly; none where there is no depth.

    Raises
    ------
    DataError
        If a depth map cannot be read.
    """
    chosen = np.unique(np.linspace(0, len(sequence) - 1, _FRAMES).astype(int)).tolist()
    return [depth for index in chosen if (depth := sequence.depth(index)) is not None]


def depth_share(maps: ListOf[DepthMap]) -> float:
    """Share of pixels with depth, over all maps."""
    return float(np.mean([depth.valid.mean() for depth in maps]))
