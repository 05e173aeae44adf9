"""The figures of the report: a file a family, in the order of the page.

A new family is a new file and a line here.
"""

from tracknoise.report.figures import (
    curves,
    factors,
    lifetimes,
    occlusion,
    outlier_ratio,
    picture,
    survivors,
    throw_out,
)
from tracknoise.report.figures.figure import Absence, Family, Figure

__all__ = ["FAMILIES", "Absence", "Family", "Figure"]

FAMILIES: tuple[Family, ...] = (
    picture.FAMILY,
    throw_out.FAMILY,
    lifetimes.FAMILY,
    survivors.FAMILY,
    outlier_ratio.FAMILY,
    curves.FAMILY,
    factors.SPEED,
    factors.LIGHTING,
    occlusion.FAMILY,
)
