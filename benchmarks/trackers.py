"""What the trackers cost beside the OpenCV calls they cannot do without."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmarks.harness import Row, median_ms
from tracknoise.trackers.correspondence import describe
from tracknoise.trackers.detection import Detection
from tracknoise.trackers.lucas_kanade import LucasKanade, LucasKanadeTracker
from tracknoise.trackers.matching import mutual_nearest
from tracknoise.trackers.tracker import Frame, Step

PASSES = 3
SYNTHETIC_FRAMES = 40
MATCHED = (1200, 3200)
"""Descriptors of the features that are followed, and of the corners of a frame."""
Image = np.ndarray
Points = np.ndarray


@dataclass
class Work:
    """What one step of Lucas-Kanade gave OpenCV to do, and how long it took."""

    start: Points
    source: Points
    target: Points
    detected: bool
    step_ms: float


def rows() -> list[Row]:
    """Time Lucas-Kanade against its OpenCV calls with 1 and 2 threads, and matching against BFMatcher."""
    table, threads = [], cv2.getNumThreads()
    for name, images in image_sequences().items():
        for count in (1, 2):
            cv2.setNumThreads(count)
            table += _lucas_kanade_rows(f"{name}, {count} OpenCV thread{'s'[: count - 1]}", images)
    cv2.setNumThreads(1)
    table += _matching_rows()
    cv2.setNumThreads(threads)
    return table


def image_sequences() -> dict[str, list[Image]]:
    """The 7-Scenes sample, where there is one, and textured noise that turns and grows slowly."""
    default = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("TRACKNOISE_DATA", default)) / "sevenscenes" / "seq-01"
    paths = sorted(folder.glob("*.color.jpg"))
    real = {"7-Scenes": [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in paths]} if paths else {}
    return {**real, "synthetic": _synthetic(np.random.default_rng(0))}


def _synthetic(rng: np.random.Generator) -> list[Image]:
    texture = _texture(rng, (700, 900))
    motions = (cv2.getRotationMatrix2D((450, 350), 0.2 * k, 1 + 0.002 * k) for k in range(SYNTHETIC_FRAMES))
    shift = np.array([[0, 0, -130], [0, 0, -110]])
    return [cv2.warpAffine(texture, motion + shift, (640, 480), flags=cv2.INTER_CUBIC) for motion in motions]


def _texture(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    coarse, fine = (cv2.GaussianBlur(rng.normal(size=shape), (0, 0), sigma) for sigma in (6.0, 1.2))
    return np.clip(128 + 200 * coarse / np.ptp(coarse) + 250 * fine / np.ptp(fine), 0, 255).astype(np.uint8)


def _lucas_kanade_rows(name: str, images: list[Image]) -> list[Row]:
    passes = [_timed(images) for _ in range(PASSES)]
    steps = float(np.min([[work.step_ms for work in works] for works, _ in passes], axis=0).sum())
    calls = float(np.min([alone for _, alone in passes], axis=0).sum())
    per_frame = 1 / len(images)
    return [
        Row(f"Lucas-Kanade step: {name}", steps * per_frame, "ms/frame"),
        Row(f"its OpenCV calls: {name}", calls * per_frame, "ms/frame", "AGAST, pyramidal LK, one findHomography"),
        Row(f"Lucas-Kanade / its OpenCV calls: {name}", steps / calls, "x", f"{len(images)} frames"),
    ]


def _timed(images: list[Image]) -> tuple[list[Work], list[float]]:
    """Every step, and right after each its OpenCV calls alone on the same inputs, ms."""
    settings, works, alone = LucasKanade(), [], []
    matches: list[tuple[Points, Points]] = []

    def inliers(source: Points, target: Points, frame: int) -> np.ndarray:
        matches.append((source, target))
        return settings.rejection.inliers(source, target, frame)

    tracker, uv = LucasKanadeTracker(settings, inliers), np.empty((0, 2))
    for index, image in enumerate(images):
        start = time.perf_counter()
        step = tracker.step(Frame(index, image))
        step_ms = (time.perf_counter() - start) * 1e3
        works.append(Work(uv, *matches[-1], _detected(step, settings), step_ms))
        alone.append(_opencv_ms(images[max(index - 1, 0)], image, works[-1]))
        uv = step.uv
    return works, alone


def _detected(step: Step, settings: LucasKanade) -> bool:
    return step.alive - step.new < settings.min_features


def _opencv_ms(before: Image, image: Image, work: Work) -> float:
    """The calls themselves, without even the conversion of their inputs."""
    start = work.start.astype(np.float32)
    guess, source, target = start.copy(), work.source.astype(np.float32), work.target.astype(np.float32)
    detector = cv2.xfeatures2d.AgastFeatureDetector.create(10, True, cv2.xfeatures2d.AgastFeatureDetector_OAST_9_16)
    begin = time.perf_counter()
    if work.detected:
        detector.detect(image)
    if len(start):
        criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 0.01)
        flow = {"winSize": (15, 15), "maxLevel": 4, "criteria": criteria, "flags": cv2.OPTFLOW_USE_INITIAL_FLOW}
        cv2.calcOpticalFlowPyrLK(before, image, start, guess, **flow)
    if len(source) > 4:
        cv2.findHomography(source, target, cv2.RANSAC, 3.0, maxIters=2000, confidence=0.995)
    return (time.perf_counter() - begin) * 1e3


def _matching_rows() -> list[Row]:
    """SIFT of two images of the same, one moved by a few pixels; as many descriptors as a large image has."""
    (before, after), wanted = _descriptors(np.random.default_rng(1)), MATCHED
    query, train = before[: wanted[0]], after[: wanted[1]]
    matcher = cv2.BFMatcher(cv2.NORM_L2, crossCheck=True)
    found = mutual_nearest(query, train)
    ours = set(zip(found.query_rows.tolist(), found.train_rows.tolist(), strict=True))
    theirs = {(match.queryIdx, match.trainIdx) for match in matcher.match(query, train)}
    size = f"{len(query)} x {len(train)} descriptors, one thread"
    product, brute = (
        median_ms(call, 9) for call in (lambda: mutual_nearest(query, train), lambda: matcher.match(query, train))
    )
    return [
        Row("matching by matrix product", product, "ms", size),
        Row("matching by BFMatcher(crossCheck=True)", brute, "ms", size),
        Row("BFMatcher / matrix product", brute / product, "x", f"{len(theirs)} matches, {len(ours ^ theirs)} differ"),
    ]


def _descriptors(rng: np.random.Generator) -> tuple[Points, Points]:
    texture = _texture(rng, (1000, 1300))
    images = (np.ascontiguousarray(texture[20:980, left : left + 1240]) for left in (20, 23))
    before, after = (describe(Frame(index, image), Detection()).descriptors for index, image in enumerate(images))
    return before, after
