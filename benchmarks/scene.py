"""What a scene costs: its parts a frame, and the whole by what is measured in it.

A simulated scene on disk is read like any other. Images are decoded, corners detected and described once a frame,
however many conditions see it; every condition adds a step of its tracker, and what is recorded of it.
"""

import tempfile
from collections.abc import Mapping
from pathlib import Path

from benchmarks.harness import Row, elapsed_ms, median_ms, write_scene
from tracknoise.experiments.measure import Measurement, measure
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.sequence import Sequence
from tracknoise.trackers.correspondence import Correspondence, describe
from tracknoise.trackers.detection import Detection, keypoints
from tracknoise.trackers.lucas_kanade import LucasKanade
from tracknoise.trackers.tracker import Frame, TrackerSettings

REPEATS = 9
LK, SIFT = {"lucas-kanade": LucasKanade()}, {"correspondence": Correspondence()}
MEASURED: tuple[tuple[Mapping[str, TrackerSettings], tuple[int, ...]], ...] = (
    (LK, (1,)),
    (SIFT, (1,)),
    (LK | SIFT, (1,)),
    (LK | SIFT, (1, 2, 4, 8, 12)),
)


def rows() -> list[Row]:
    """Of 24 frames of 320x240."""
    return _rows(24, 320, 240)


def full_rows() -> list[Row]:
    """Of 60 frames of 640x480, and of 800x600."""
    return [*_rows(60, 640, 480), *_rows(60, 800, 600)]


def _rows(frames: int, width: int, height: int) -> list[Row]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "scene"
        write_scene(folder, frames=frames, width=width, height=height)
        sequence = open_sequence("folder", folder)
        size = f"{width}x{height}"
        return [*_parts(sequence, size), *(_whole(sequence, size, *measured) for measured in MEASURED)]


def _parts(sequence: Sequence, size: str) -> list[Row]:
    """What is done once a frame."""
    image = sequence.image(1)
    corners = len(keypoints(Frame(0, image), Detection()).uv)
    decoding = median_ms(lambda: sequence.image(1), REPEATS)
    detecting = median_ms(lambda: keypoints(Frame(0, image), Detection()), REPEATS)
    describing = median_ms(lambda: describe(Frame(0, image), Detection()), REPEATS) - detecting
    return [
        Row(f"a frame of {size}: decoding a PNG", decoding, "ms"),
        Row(f"a frame of {size}: detecting corners", detecting, "ms", f"{corners} corners"),
        Row(f"a frame of {size}: describing them all", describing, "ms", f"{corners} corners"),
    ]


def _whole(sequence: Sequence, size: str, trackers: Mapping[str, TrackerSettings], speeds: tuple[int, ...]) -> Row:
    made: list[Measurement] = []
    elapsed = elapsed_ms(lambda: made.append(measure(sequence, trackers, speeds=speeds)))
    seen = made[0].observations.height
    what = f"{' and '.join(trackers)} at speed{'s' if len(speeds) > 1 else ''} {', '.join(map(str, speeds))}"
    note = f"{len(sequence)} frames, {seen / len(sequence):.0f} observations a frame"
    return Row(f"a scene of {size}: {what}", elapsed / len(sequence), "ms/frame", note)
