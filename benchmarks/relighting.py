"""What it costs to relight a position of the light stage, against decoding its images; one core."""

from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

from benchmarks.harness import Row, median_ms
from tracknoise.geometry.cameras import Camera
from tracknoise.paper.dtu import LED_COUNT, Relit, weights
from tracknoise.paper.light_stage import LightStage, led_positions

REPEATS = 7
FILES = {"BMP": "bmp", "PNG": "png", "colour BMP": "bmp"}


def rows() -> list[Row]:
    """Decoding 19 images of 1600x1200, relighting all 19 lightings at half size, and the ratio, for each format."""
    cv2.setNumThreads(1)
    stage = LightStage(1)
    images = list(stage.images(0))
    table = []
    with TemporaryDirectory() as folder:
        for kind, suffix in FILES.items():
            paths = [Path(folder) / f"{number:02d}.{suffix}" for number in range(LED_COUNT)]
            for path, image in zip(paths, images, strict=True):
                cv2.imwrite(str(path), cv2.merge([image] * 3) if "colour" in kind else image)
            table += _compare(kind, paths, stage.camera)
    return table


def _decode(paths: list[Path]) -> None:
    for path in paths:
        cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)


def _compare(kind: str, paths: list[Path], camera: Camera) -> list[Row]:
    decoding = median_ms(lambda: _decode(paths), REPEATS)
    relit = Relit([paths, paths], weights(led_positions()), camera, halve=True)
    frames = iter(np.arange(REPEATS + 1) % 2)
    both = median_ms(lambda: relit.image(int(next(frames)), 0), REPEATS)  # another frame each time: none is kept
    return [
        Row(f"decoding 19 {kind} images of 1600x1200", decoding, "ms"),
        Row(f"decoding and relighting them in 19 lightings at 800x600, {kind}", both, "ms"),
        Row(f"relighting alone relative to decoding, {kind}", (both - decoding) / decoding, ""),
        Row(f"decoding and relighting relative to decoding, {kind}", both / decoding, ""),
    ]
