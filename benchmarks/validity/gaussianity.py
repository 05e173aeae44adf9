"""Are Gaussian, heavy-tailed, contaminated, skewed and light-tailed errors told apart?

    python -m benchmarks.validity.gaussianity [--runs N] [--scenes N ...] [--tracks N] [--seed N]

Errors of each kind grow with the root of age. In `common scale` all errors of a track share the chance that makes them
large or small, so that trimming by track can drop the tails; otherwise each frame has its own. Printed is how often
each verdict came, band by band, before and after trimming.
"""

import argparse
from collections import Counter
from collections.abc import Callable

import numpy as np

from benchmarks.validity.simulated import tables
from tracknoise.findings.shape.gaussianity import gaussianity
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.prepared import prepare_observations, prepare_sequence
from tracknoise.statistics.samples import samples
from tracknoise.tables.findings_schema import SHAPE

FRAMES = 20
Draw = Callable[[np.random.Generator, tuple[int, int]], np.ndarray]


def student(nu: float) -> Draw:
    """Scale of each error of a Student's t."""
    return lambda rng, shape: np.sqrt(nu / rng.chisquare(nu, shape))


def contaminated(share: float, spread: float) -> Draw:
    """Scale of each error, of which a share is `spread` times as large."""
    return lambda rng, shape: np.where(rng.random(shape) < share, spread, 1.0)


SCALES: dict[str, Draw] = {
    "Gaussian": lambda rng, shape: np.ones(shape),
    "Student, nu = 3": student(3),
    "Student, nu = 5": student(5),
    "Student, nu = 10": student(10),
    "contaminated, 5 % of 4 times": contaminated(0.05, 4),
    "contaminated, 10 % of 3 times": contaminated(0.10, 3),
    "contaminated, 1 % of 10 times": contaminated(0.01, 10),
}


def main() -> None:
    """Print the confusion tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--scenes", type=int, nargs="*", default=[3, 8, 28])
    parser.add_argument("--tracks", type=int, default=400, help="of each scene")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    for scenes in arguments.scenes:
        rng = np.random.default_rng([arguments.seed, scenes])
        print(f"\n{scenes} scenes of {arguments.tracks} tracks, {FRAMES} frames, {arguments.runs} runs")
        print(f"{'':<46}{''.join(f'{name:>14}' for name in SHAPE.categories)}")
        for name, draw in _kinds().items():
            counts: Counter[tuple[str, str]] = Counter()
            for run in range(arguments.runs):
                counts += _verdicts([draw(rng, (arguments.tracks, FRAMES)) for _ in range(scenes)], run)
            for trimming in ("untrimmed", "trimmed"):
                found = [counts[trimming, verdict] for verdict in SHAPE.categories]
                total = sum(found) or 1
                print(f"{name:<36}{trimming:>10}{''.join(f'{100 * n / total:>12.0f} %' for n in found)}", flush=True)


def _kinds() -> dict[str, Draw]:
    """How errors are drawn, (tracks, frames, 2)."""

    def errors(scale: Draw, *, common: bool) -> Draw:
        def draw(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
            factor = scale(rng, (shape[0], 1) if common else shape)
            return _grown(rng.standard_normal((*shape, 2)) * np.broadcast_to(factor, shape)[..., None])

        return draw

    kinds = {name: errors(scale, common=False) for name, scale in SCALES.items()}
    kinds["Student, nu = 5, common scale"] = errors(student(5), common=True)
    kinds["contaminated, 5 %, common scale"] = errors(contaminated(0.05, 4), common=True)
    kinds["skewed (log-normal, 0.2)"] = lambda rng, shape: _grown(np.exp(0.2 * rng.standard_normal((*shape, 2))) - 1.02)
    kinds["uniform"] = lambda rng, shape: _grown(rng.uniform(-1, 1, (*shape, 2)))
    return kinds


def _grown(errors: np.ndarray) -> np.ndarray:
    """Errors that are 0 at first and grow with the root of age, along axes that are not those of the image."""
    age = np.arange(errors.shape[1])
    return np.sqrt(age)[:, None] * errors @ np.array([[0.2, 0.05], [0.0, 0.1]])


def _verdicts(errors: list[np.ndarray], seed: int) -> Counter[tuple[str, str]]:
    observations, tracks = tables(errors)
    found = gaussianity(
        scene_moments(prepare_observations(observations)), samples(prepare_sequence(observations, tracks)), seed=seed
    ).gaussianity
    return Counter(found.select("trimming", "verdict").iter_rows())


if __name__ == "__main__":
    main()
