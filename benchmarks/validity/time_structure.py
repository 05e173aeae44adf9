"""Are white errors, random walks and drifts told apart, and do the intervals of their parameters hold the truth?

    python -m benchmarks.validity.time_structure [--runs N] [--scenes N ...] [--tracks N] [--frames N] [--seed N]

Errors are zero at birth. Their size varies from scene to scene by a log-normal factor of 0.2, and drifts have a part of
their own in each scene, so that what a scene has in common is in the intervals. Tracks live for as long as each other
or end at random, by turns. Printed is how often each verdict came, and how often the intervals held the true value:
that of all scenes there could be, not of those drawn. Untrimmed, both coordinates.
"""

import argparse
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import polars as pl

from benchmarks.validity.simulated import tables
from tracknoise.findings.growth.time_structure import time_structure
from tracknoise.statistics.increments import increments
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.prepared import prepare_observations, prepare_sequence
from tracknoise.tables.findings_schema import BEHAVIOUR

SCENE_SPREAD = 0.2
SCALE = float(np.exp(SCENE_SPREAD**2))
"""Root mean square of the factor of a scene."""
VALUES = ("white_px", "walk_px_per_sqrt_frame", "drift_px_per_frame", "autocorrelation")
Draw = Callable[[np.random.Generator, int, int], np.ndarray]


@dataclass(frozen=True, slots=True)
class Kind:
    """Errors of one kind: how those of a scene are drawn, (tracks, ages, 2), and what should come back."""

    draw: Draw
    truth: dict[str, float]


def white(rng: np.random.Generator, tracks: int, frames: int) -> np.ndarray:
    """Independent errors of 0.2 px, none at birth."""
    errors = 0.2 * rng.standard_normal((tracks, frames, 2))
    errors[:, 0] = 0
    return errors


def detected(rng: np.random.Generator, tracks: int, frames: int) -> np.ndarray:
    """Independent errors of 0.2 px, as seen from a birth that has one, too."""
    errors = 0.2 * rng.standard_normal((tracks, frames, 2))
    return errors - errors[:, :1]


def walk(rng: np.random.Generator, tracks: int, frames: int) -> np.ndarray:
    """Steps of 0.1 px that add up."""
    steps = 0.1 * rng.standard_normal((tracks, frames, 2))
    steps[:, 0] = 0
    return np.cumsum(steps, axis=1)


def drift(rng: np.random.Generator, tracks: int, frames: int) -> np.ndarray:
    """0.03 px per frame with noise of 0.05 px."""
    return 0.25 * white(rng, tracks, frames) + 0.03 * np.arange(frames)[:, None]


def own_drift(rng: np.random.Generator, tracks: int, frames: int) -> np.ndarray:
    """Every track drifts its own way."""
    return 0.03 * rng.standard_normal((tracks, 1, 2)) * np.arange(frames)[:, None]


def offset(rng: np.random.Generator, tracks: int, frames: int) -> np.ndarray:
    """An offset of 0.2 px that stays."""
    return 0.2 * rng.standard_normal((tracks, 1, 2)) * (np.arange(frames) > 0)[:, None]


KINDS = {
    "white": Kind(white, {"white_px": 0.2}),
    "white, birth included": Kind(detected, {"white_px": 0.2 * 2**0.5, "autocorrelation": -0.5}),
    "offset that stays": Kind(offset, {"white_px": 0.2}),
    "random walk": Kind(walk, {"walk_px_per_sqrt_frame": 0.1, "autocorrelation": 0.0}),
    "white and walk, even at 4": Kind(
        lambda *a: white(*a) + walk(*a), {"white_px": 0.2, "walk_px_per_sqrt_frame": 0.1}
    ),
    "drift": Kind(drift, {"drift_px_per_frame": 0.03}),
    "drift, each its own": Kind(own_drift, {"drift_px_per_frame": 0.03, "autocorrelation": 1.0}),
}


def main() -> None:
    """Print verdicts and coverage."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--scenes", type=int, nargs="*", default=[8, 11, 28])
    parser.add_argument("--tracks", type=int, default=100, help="of each scene")
    parser.add_argument("--frames", type=int, default=21)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    for scenes in arguments.scenes:
        print(f"\n{scenes} scenes of {arguments.tracks} tracks, {arguments.frames} frames, {arguments.runs} runs")
        heads = [*BEHAVIOUR.categories, "held: white", "walk", "drift", "correlated"]
        print(f"{'':<28}{''.join(f'{head:>13}' for head in heads)}")
        for name, kind in KINDS.items():
            rng = np.random.default_rng([arguments.seed, scenes])
            found = pl.concat(_runs(kind, rng, arguments, scenes))
            verdicts = Counter(found["verdict"])
            cells = [f"{100 * verdicts[verdict] / found.height:.0f} %" for verdict in BEHAVIOUR.categories]
            print(f"{name:<28}{''.join(f'{cell:>13}' for cell in (*cells, *_held(found, kind)))}", flush=True)


def _runs(kind: Kind, rng: np.random.Generator, arguments: argparse.Namespace, scenes: int) -> Iterator[pl.DataFrame]:
    for run in range(arguments.runs):
        errors = [
            kind.draw(rng, arguments.tracks, arguments.frames) * np.exp(SCENE_SPREAD * rng.standard_normal())
            for _ in range(scenes)
        ]
        observations, tracks = tables(errors)
        observations = observations.filter(pl.col("age") < _ends(rng, observations, arguments, short=run % 2 == 1))
        found = time_structure(
            scene_moments(prepare_observations(observations)),
            increments(prepare_sequence(observations, tracks)),
            min_features=50,
        )
        yield found.filter(trimming="untrimmed")


def _ends(
    rng: np.random.Generator, observations: pl.DataFrame, arguments: argparse.Namespace, *, short: bool
) -> pl.Series:
    """Age at which each observation's track ends: at random, but not before it was seen thrice, if `short`."""
    track = observations["track"].to_numpy() + arguments.tracks * observations["scene"].cast(pl.Int64).to_numpy()
    ends = np.full(track.max() + 1, arguments.frames)
    return pl.Series(np.clip(rng.geometric(0.1, len(ends)) + 2, 3, None)[track] if short else ends[track])


def _held(found: pl.DataFrame, kind: Kind) -> list[str]:
    """How often intervals held the true value, which of a size is that of its mean square over scenes."""
    cells = []
    for name in VALUES:
        truth = kind.truth.get(name)
        if truth is None:
            cells.append("")
            continue
        value = truth if name == "autocorrelation" else truth * SCALE
        low, high = found[f"{name}_low"], found[f"{name}_high"]
        rounding = 1e-9
        held = ((low <= value + rounding) & (value - rounding <= high)).fill_null(value=False).mean()
        cells.append(f"{100 * float(held):.1f} %")  # type: ignore[arg-type]
    return cells


if __name__ == "__main__":
    main()
