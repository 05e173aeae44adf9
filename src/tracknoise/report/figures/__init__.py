"""The figures of the report: one module per family."""

from tracknoise.report.figures.families import FAMILIES, Family
from tracknoise.report.figures.figure import Absence, Figure

__all__ = ["FAMILIES", "Absence", "Family", "Figure"]
