"""The parts of the page in their order: the answer first, then its evidence, and how it was measured last."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tracknoise.report.contents import Section


@dataclass(frozen=True, slots=True)
class Part:
    """A part of the page.

    Attributes
    ----------
    title
        Its heading in the table of contents.
    sections
        In the order of the page.
    """

    title: str
    sections: Sequence[Section]


PARTS: Mapping[str, tuple[str, ...]] = {
    "Answer": ("findings", "estimator"),
    "Evidence": (
        *(
            "explorer",
            "error-by-tracker",
            "lifetimes",
            "outlier-ratio",
            "gaussianity",
            "time-structure",
            "changes",
            "trimming",
        ),
        *("feature-counts", "survivorship-bias", "summary"),
    ),
    "Factors": (
        *("factor-effects", "error-by-speed", "error-by-lighting", "error-by-rotation", "error-by-direction"),
        *("error-by-place", "along-and-across", "occlusion"),
    ),
    "Truth": ("truth", "truth-audit", "pose-errors", "between-trackers"),
    "Scenes": ("example-frames", "trajectory"),
    "Method": ("limits", "measured"),
}
"""Sections of every part, by title."""


def parts(sections: Mapping[str, Section]) -> list[Part]:
    """The parts that have sections.

    Parameters
    ----------
    sections
        Those of the page, by id.
    """
    made = (Part(title, [sections[name] for name in names if name in sections]) for title, names in PARTS.items())
    return [part for part in made if part.sections]
