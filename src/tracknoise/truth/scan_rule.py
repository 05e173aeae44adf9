"""How features are associated with a scan."""

from dataclasses import dataclass
from enum import StrEnum

from tracknoise.tables.defaults import SCAN_RADIUS_PX


class ScanAnchoring(StrEnum):
    """What a feature takes from the scan point that it is associated with."""

    ray = "ray"
    """The point's depth, along the feature's own ray, so that the error is zero in the key frame."""
    point = "point"
    """The point itself."""


@dataclass(frozen=True, slots=True)
class ScanRule:
    """How features are associated with a scan.

    Parameters
    ----------
    radius_px
        Largest distance between a feature and the projection of its scan point, px.
    anchoring
        What the feature takes from the scan point.
    """

    radius_px: float = SCAN_RADIUS_PX
    anchoring: ScanAnchoring = ScanAnchoring.ray


SCAN_RULE = ScanRule()
"""The rule that applies by default."""
