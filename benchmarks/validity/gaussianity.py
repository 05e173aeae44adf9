"""Are Gaussian, heavy-tailed, contaminated, skewed and light-tailed errors told apart?

    python -m benchmarks.validity.gaussianity [--runs N] [--scenes N ...] [--spread S ...] [--tracks N] [--seed N]

Errors of each kind grow with the root of age. In `common scale` all errors of a track share the chance that makes them
large or small, so that trimming by track can drop the tails; otherwise each frame has its own. Printed is how often
each verdict came, band by band, before and after trimming. The size of errors varies from scene to scene by a
log-normal factor (`spread` is the standard deviation of its logarithm). `within` is Student's gain within scenes in
nats, `scales` what the different scales of scenes add to it, both on average. Errors on a grid of 1/16 px, and errors
of which one in twenty is exactly zero, allow no verdict on their shape.
"""

import argparse
from collections import Counter
from collections.abc import Callable

import numpy as np
import polars as pl

from benchmarks.validity.simulated import tables
from tracknoise.analysis.gaussianity import gaussianity
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
    parser.add_argument("--spread", type=float, nargs="*", default=[0.0, 0.4, 0.7])
    parser.add_argument("--tracks", type=int, default=400, help="of each scene")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    for scenes in arguments.scenes:
        for spread in arguments.spread:
            rng = np.random.default_rng([arguments.seed, scenes, round(100 * spread)])
            size = f"{arguments.tracks} tracks, {FRAMES} frames, {arguments.runs} runs"
            print(f"\n{scenes} scenes, log sd {spread}, {size}")
            print(f"{'':<46}{''.join(f'{name:>14}' for name in (*SHAPE.categories, 'within', 'scales'))}")
            for name, draw in _kinds().items():
                found = pl.concat(
                    _one_run(rng, draw, scenes, spread, arguments.tracks, run) for run in range(arguments.runs)
                )
                for (trimming,), rows in found.partition_by("trimming", as_dict=True).items():
                    print(f"{name:<36}{trimming:>10}{''.join(f'{cell:>14}' for cell in _cells(rows))}", flush=True)


def _cells(rows: pl.DataFrame) -> list[str]:
    counts = Counter(rows["verdict"])
    gains = [rows[name].mean() for name in ("gain_student_within_nats", "gain_scales_nats")]
    shares = [f"{100 * counts[verdict] / rows.height:.0f} %" for verdict in SHAPE.categories]
    return [*shares, *("" if gain is None else f"{gain:.3f}" for gain in gains)]


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
    kinds["Gaussian on a grid of 1/16 px"] = _on_grid
    kinds["Gaussian, one in 20 exactly zero"] = _some_zero
    kinds["uniform"] = lambda rng, shape: _grown(rng.uniform(-1, 1, (*shape, 2)))
    return kinds


def _grown(errors: np.ndarray) -> np.ndarray:
    """Errors that are 0 at first and grow with the root of age, along axes that are not those of the image."""
    age = np.arange(errors.shape[1])
    return np.sqrt(age)[:, None] * errors @ np.array([[0.2, 0.05], [0.0, 0.1]])


def _on_grid(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    return np.round(16 * _grown(rng.standard_normal((*shape, 2)))) / 16


def _some_zero(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    return np.where(rng.random((*shape, 1)) < 0.05, 0.0, _grown(rng.standard_normal((*shape, 2))))


def _one_run(rng: np.random.Generator, draw: Draw, scenes: int, spread: float, tracks: int, run: int) -> pl.DataFrame:
    errors = [draw(rng, (tracks, FRAMES)) for _ in range(scenes)]
    scaled = errors if draw is _on_grid else [e * np.exp(spread * rng.standard_normal()) for e in errors]
    observations, lives = tables(scaled)
    return gaussianity(
        scene_moments(prepare_observations(observations)), samples(prepare_sequence(observations, lives)), seed=run
    ).gaussianity


if __name__ == "__main__":
    main()
