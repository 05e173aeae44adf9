"""The figures of the report: a file a family, in the order of the page.

A new family is a new file and a line here.
"""

from tracknoise.report.figures import (
    changes,
    curves,
    directions,
    gaussianity,
    lifetimes,
    lightings,
    occlusion,
    outlier_ratio,
    picture,
    speeds,
    survivors,
    survivorship,
    throw_out,
    time_structure,
    trajectory,
    views,
)
from tracknoise.report.figures.figure import Absence, Family, Figure

__all__ = ["FAMILIES", "Absence", "Family", "Figure"]

FAMILIES: tuple[Family, ...] = (
    picture.FAMILY,
    trajectory.FAMILY,
    throw_out.FAMILY,
    lifetimes.FAMILY,
    survivors.FAMILY,
    outlier_ratio.FAMILY,
    curves.FAMILY,
    time_structure.FAMILY,
    changes.FAMILY,
    gaussianity.FAMILY,
    directions.FAMILY,
    survivorship.FAMILY,
    speeds.FAMILY,
    lightings.FAMILY,
    views.ROTATION,
    views.DIRECTION,
    occlusion.FAMILY,
)
