"""The check as one HTML page that needs no other file, with a picture of each sequence."""

import base64
from dataclasses import dataclass, field

import cv2
import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.inspection.check_report import CheckReport
from tracknoise.inspection.evidence import Evidence
from tracknoise.inspection.hypotheses import AS_GIVEN
from tracknoise.inspection.pairs import Pair
from tracknoise.inspection.residuals import relative_pose, reprojection_px
from tracknoise.printable import printable
from tracknoise.sequences.sequence import Sequence
from tracknoise.tables.identity import readable

_OBSERVED, _PREDICTED = (80, 200, 80), (60, 60, 230)  # BGR
_SHIFT = 4
"""Fractional bits of positions that OpenCV draws."""


@dataclass(slots=True)
class Pictures:
    """Collects a picture per sequence while a recording is checked.

    Attributes
    ----------
    by_sequence
        PNG files in base 64, by the name of the sequence.
    """

    by_sequence: dict[str, str] = field(default_factory=dict)

    def take(self, sequence: Sequence, evidence: Evidence) -> None:
        """Draw where points were seen and where they were predicted, in the pair with the most motion."""
        if not evidence.pairs:
            return
        pair = max(evidence.pairs, key=lambda one: one.motion_px)
        try:
            image = sequence.image(pair.first)
        except DataError:  # it was readable a moment ago; the check itself has reported what is wrong
            return
        _, png = cv2.imencode(".png", _drawn(image, pair, evidence))
        self.by_sequence[readable(sequence.id.key)] = base64.b64encode(png.tobytes()).decode()

    def page(self, report: CheckReport) -> str:
        """The page as HTML."""
        loader = PackageLoader("tracknoise.inspection", "template")
        environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
        environment.finalize = lambda value: printable(value, keep="\n\t") if type(value) is str else value
        return environment.get_template("check.html.j2").render(report=report, pictures=self.by_sequence)


def _drawn(image: NDArray[np.uint8], pair: Pair, evidence: Evidence) -> NDArray[np.uint8]:
    """The first image with lines from where points were to where they were seen, and to where they were predicted."""
    canvas = np.ascontiguousarray(np.repeat(image[..., None], 3, axis=2))
    _lines(canvas, pair.uv_first, pair.uv_second, _OBSERVED)
    if evidence.has_depth:
        known = np.isfinite(pair.depth_first_m)
        residual = reprojection_px(pair, relative_pose(evidence.poses, pair), evidence.camera, AS_GIVEN)
        _lines(canvas, pair.uv_first[known], pair.uv_second[known] - residual, _PREDICTED)
    return canvas


def _lines(
    canvas: NDArray[np.uint8],
    starts: NDArray[np.float64],
    ends: NDArray[np.float64],
    colour: tuple[int, int, int],
) -> None:
    near = np.abs(ends).max(axis=1, initial=0.0) < 4 * max(canvas.shape)  # also leaves out what is behind the camera
    for start, end in zip(starts[near], ends[near], strict=True):
        points = [tuple(np.round(point * 2**_SHIFT).astype(int).tolist()) for point in (start, end)]
        cv2.line(canvas, points[0], points[1], colour, 1, cv2.LINE_AA, _SHIFT)
        cv2.circle(canvas, points[1], 2 << _SHIFT, colour, 1, cv2.LINE_AA, _SHIFT)
