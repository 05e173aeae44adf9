"""Noise assumptions on a run, each half of its scenes tried with what the other half says.

    python -m benchmarks.proof_halves RUN --trackers lucas-kanade --every 2 --arms 1 6 8d 9 9c

Every second scene of a motion is one half. The motion is what precedes the last dash in the name of a scene. Windows
may overlap, so that short runs have more of them: intervals are over scenes. Prints errors over those of arm 1, and
over those of the tuned Cauchy loss (8d).
"""

import argparse
import os
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import polars as pl

from benchmarks.noise.arms import REFERENCE, try_arms
from benchmarks.noise.learning import learn
from benchmarks.noise.proof import summarise, with_advice
from benchmarks.noise.windows import Cut, Problem, recorded_problems, scenes_of
from benchmarks.proof import table
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.estimators.training import training_tables
from tracknoise.tables.store import RunFolder

_CAUCHY = "8d"


def main() -> None:
    options = _options()
    folder = RunFolder(options.run)
    for tracker in options.trackers:
        problems = recorded_problems(folder, _cut(folder, tracker, options))
        scenes = scenes_of(problems)
        motions = [scene.rpartition("-")[0] for scene in scenes]
        even = {scene for place, scene in enumerate(scenes) if motions[:place].count(motions[place]) % 2 == 0}
        halves = (even, set(scenes) - even)
        trial = pl.concat([_tried(folder, tracker, problems, half, options.arms) for half in halves])
        print(f"{tracker}: {len(problems)} windows of {len(scenes)} scenes, over arm {REFERENCE}")
        print(table(summarise(trial)))
        if {REFERENCE, _CAUCHY} <= set(options.arms):
            others = trial.filter(pl.col("arm") != REFERENCE)
            print(f"over arm {_CAUCHY}, here named {REFERENCE}")
            print(table(summarise(others.with_columns(pl.col("arm").replace(_CAUCHY, REFERENCE)))), flush=True)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.proof_halves", description=__doc__.partition("\n")[0])
    parser.add_argument("run", type=Path, help="run that keeps its observations")
    parser.add_argument("--trackers", nargs="+", default=["lucas-kanade", "correspondence"])
    parser.add_argument("--length", type=int, default=10, help="frames of a window")
    parser.add_argument("--every", type=int, default=2, help="frames from one window to the next")
    parser.add_argument("--arms", nargs="+", default=["1", "6", "8b", "8d", "8e", "9", "9b", "9c"])
    return parser.parse_args()


def _cut(folder: RunFolder, tracker: str, options: argparse.Namespace) -> Cut:
    """Windows of all scenes, without outliers."""
    counts = training_tables(folder, tracker=tracker, speed=1)["noise_outliers"]
    limit_px = float((counts["limit_px"] * counts["n"]).sum() / counts["n"].sum())
    return Cut(
        tracker=tracker, speed=1, length=options.length, every=options.every, per_sequence=1000, most_px=limit_px
    )


def _tried(
    folder: RunFolder, tracker: str, problems: list[Problem], training: set[str], arms: list[str]
) -> pl.DataFrame:
    """The windows of all other scenes."""
    model = NoiseModel.fit(folder.path, tracker=tracker, scenes=training)
    learned = learn([problem for problem in problems if problem.scene in training], noise=model.components)
    beliefs = with_advice(learned, model, len(problems[0].world_from_camera))
    trial = try_arms([problem for problem in problems if problem.scene not in training], beliefs, arms=arms)
    return trial.with_columns(window=pl.struct("scene", "window").hash())


if __name__ == "__main__":
    main()
