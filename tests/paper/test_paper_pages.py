"""The documentation's map of the paper's figures holds every figure of ours, and none that is not there."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tracknoise.report.figures.families import FAMILIES
from tracknoise.report.figures.figure import Figure
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder

PAGE = Path(__file__).resolve().parents[2] / "docs" / "paper.md"
TRACKER = "lucas-kanade"
WORLDS = {
    "DTU": {"key_frame": 8, "lightings": ("diffuse", "LR0", "BF0"), "views": ((0, "forward"), (90, "forward"))},
    "Gazebo Linear": {"views": ((0, "forward"), (0, "backward"))},
}
BESIDES = {
    *("example-frames-1", "occlusion", "time-structure", "changes", "gaussianity", "ends-by-cause"),
    "gross-error-share",
    *(f"along-and-across-{TRACKER}", f"survivorship-bias-{TRACKER}", f"surroundings-{TRACKER}"),
    *("pose-errors", "error-by-image-speed", "window-sigmas", "depth-intervals", f"audit-{TRACKER}"),
}


def mapped(experiment: str) -> set[str]:
    """Figures that the page names for an experiment, its wildcards filled in."""
    rows = [
        line.strip("|").split("|") for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("|")
    ]
    (heading,) = [row for row in rows if row[0].strip() == "what the paper shows"]
    column = [cell.strip() for cell in heading].index(experiment)
    named = {name for row in rows if len(row) == len(heading) for name in re.findall(r"`([^`]+)`", row[column])}
    filled = [name.replace("TRACKER", TRACKER) for name in named]
    return {re.sub(r"speed-S(?=$|-)", f"speed-{speed}", name) for name in filled for speed in (1, 2)}


@pytest.mark.parametrize("experiment", WORLDS)
def test_the_map_is_whole(make_run: Callable[..., RunFolder], experiment: str) -> None:
    settings = {
        "scenes": ("one",),
        "trackers": (TRACKER,),
        "n_frames": 14,
        "min_features": 15,
        "hidden": 0.1,
    }
    data = ReportData.of(make_run(**settings, **WORLDS[experiment]))
    figures = {item.id for family in FAMILIES for item in family.figures(data) if isinstance(item, Figure)}
    besides = BESIDES | {f"error-by-{data.axis.name}-untrimmed"}
    assert figures - besides - {f"image-map-{TRACKER}"} == mapped(experiment)
    assert figures >= besides


def test_the_other_experiments_have_the_same_figures_but_for_the_direction() -> None:
    by_direction = f"error-by-direction-{TRACKER}"
    expected = mapped("Gazebo Linear") - {by_direction, f"{by_direction}-untrimmed"}
    assert mapped("KITTI") == mapped("Gazebo AR/VR") == expected
