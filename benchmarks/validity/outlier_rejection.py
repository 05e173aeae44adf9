"""Outlier ratio and lifetimes by our own rejection, beside those by the ``findHomography`` of any OpenCV.

    python -m benchmarks.validity.outlier_rejection [--data 7-Scenes|demo] [--opencv PYTHON ...] [--runs N]

Each PYTHON is an interpreter that has cv2 and numpy; OpenCV up to 4.11 is the truth for ``hypothesis`` and from 4.12 on
for ``refined``, which ours optimises locally in addition. The trackers are the same, but for the rejection.

One run is one draw: which samples are drawn decides which of many similar hypotheses wins, and the outlier ratio of
one run over the 120 frames of the 7-Scenes sample scatters by several percent. OpenCV always draws the same indices, so
that its one answer scatters no less: it is made visible by handing it the matches in another order. Compared are
therefore the means over runs, ours with different seeds, OpenCV's with the matches shuffled.
"""

import argparse
import struct
import subprocess
from collections.abc import Callable, Iterator

import numpy as np

from benchmarks.trackers import image_sequences
from tracknoise.experiments.load import load_experiment
from tracknoise.experiments.plan import open_batch, plan
from tracknoise.sequences.sequence import Sequence
from tracknoise.trackers.correspondence import Correspondence, CorrespondenceTracker
from tracknoise.trackers.lucas_kanade import LucasKanade, LucasKanadeTracker
from tracknoise.trackers.rejection import Consensus, Inliers, Rejection
from tracknoise.trackers.tracker import Frame, Tracker

SERVER = """
import struct, sys, cv2, numpy as np
sys.stdout.buffer.write(cv2.__version__.ljust(16).encode()); sys.stdout.buffer.flush()
while head := sys.stdin.buffer.read(8):
    count, = struct.unpack("<q", head)
    source, target = np.frombuffer(sys.stdin.buffer.read(16 * count), np.float32).reshape(2, count, 2)
    _, mask = cv2.findHomography(source, target, cv2.RANSAC, 3.0, maxIters=2000, confidence=0.995)
    sys.stdout.buffer.write(np.zeros(count, np.uint8) if mask is None else mask.tobytes()); sys.stdout.buffer.flush()
"""


class OtherOpenCV:
    """``cv2.findHomography`` of another interpreter, at the other end of a pipe."""

    def __init__(self, python: str) -> None:
        self._process = subprocess.Popen([python, "-c", SERVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self.version = self._process.stdout.read(16).decode().strip()

    def inliers(self, source: np.ndarray, target: np.ndarray, frame: int) -> np.ndarray:
        """The mask of inliers, in the manner of `Rejection.inliers`."""
        if len(source) < 4:
            return np.ones(len(source), dtype=np.bool_)
        points = np.stack([source, target]).astype(np.float32)
        self._process.stdin.write(struct.pack("<q", len(source)) + points.tobytes())
        self._process.stdin.flush()
        return np.frombuffer(self._process.stdout.read(len(source)), dtype=np.uint8).astype(np.bool_)


def shuffled(inliers: Inliers, seed: int) -> Inliers:
    """The same rejection with the matches in another order."""
    rng = np.random.default_rng(seed)

    def reordered(source: np.ndarray, target: np.ndarray, frame: int) -> np.ndarray:
        order, mask = rng.permutation(len(source)), np.empty(len(source), dtype=np.bool_)
        mask[order] = inliers(source[order], target[order], frame)
        return mask

    return reordered


def measure(start: Callable[[], Tracker], scenes: list[list[Frame]]) -> tuple[float, float, float]:
    """Mean over frames of f1(t) / F(t-1), the same ratio pooled, and the mean lifetime in frames."""
    runs = []
    for frames in scenes:
        tracker = start()
        runs.append([tracker.step(frame) for frame in frames])
    later = [step for steps in runs for step in steps[1:]]
    offered, outliers = (np.array([getattr(step, name) for step in later]) for name in ("offered", "outliers"))
    every = [step for steps in runs for step in steps]
    lifetime = sum(len(step.ids) for step in every) / sum(step.new for step in every)
    return float(np.mean(outliers / offered)), float(outliers.sum() / offered.sum()), lifetime


def scenes_of(data: str) -> list[list[Frame]]:
    """The frames of every scene of the 7-Scenes sample, or of the demo."""
    if data == "demo":
        images = [_images(sequence) for task in plan(load_experiment("demo")) for sequence in open_batch([task])]
    else:
        images = [image_sequences()["7-Scenes"]]
    return [[Frame(index, image) for index, image in enumerate(scene)] for scene in images]


def _images(sequence: Sequence) -> list[np.ndarray]:
    return [sequence.image(index) for index in range(len(sequence))]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--opencv", action="append", default=[], metavar="PYTHON", help="interpreter with another cv2")
    parser.add_argument("--data", choices=("7-Scenes", "demo"), default="7-Scenes")
    parser.add_argument("--runs", type=int, default=8, help="how many seeds or shuffles each mean is over")
    arguments = parser.parse_args()
    others = [OtherOpenCV(python) for python in arguments.opencv]
    scenes = scenes_of(arguments.data)
    frames = sum(map(len, scenes))
    print(f"{arguments.data}, {frames} frames, {arguments.runs} runs; +- is the standard deviation of one run")
    print(f"{'':<44}{'ratio, mean of frames':>24}{'ratio, pooled':>20}{'mean lifetime':>20}")
    for label, runs in _cases(arguments.runs, others):
        figures = np.array([measure(start, scenes) for start in runs])
        spread = figures.std(axis=0, ddof=1) if len(figures) > 1 else np.zeros(3)
        cells = [f"{mean:.4f} +- {deviation:.4f}" for mean, deviation in zip(figures.mean(axis=0), spread, strict=True)]
        print(f"{label:<44}{cells[0]:>24}{cells[1]:>20}{cells[2]:>20}", flush=True)


def _cases(runs: int, others: list[OtherOpenCV]) -> Iterator[tuple[str, list[Callable[[], Tracker]]]]:
    """What is compared: a label, and for each run what starts its tracker."""
    for settings, tracker in ((LucasKanade(), LucasKanadeTracker), (Correspondence(), CorrespondenceTracker)):

        def starts(masks: list[Inliers], settings=settings, tracker=tracker) -> list[Callable[[], Tracker]]:
            return [lambda inliers=inliers: tracker(settings, inliers) for inliers in masks]

        for consensus in Consensus:
            masks = [Rejection(consensus=consensus, seed=seed).inliers for seed in range(runs)]
            yield f"{settings.kind}, ours, {consensus}", starts(masks)
        for other in others:
            yield f"{settings.kind}, OpenCV {other.version}", starts([shuffled(other.inliers, k) for k in range(runs)])
            yield f"{settings.kind}, OpenCV {other.version}, not shuffled", starts([other.inliers])


if __name__ == "__main__":
    main()
