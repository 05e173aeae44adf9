"""Are the kinds of growth named rightly or refused, and do the intervals of their parameters hold the truth?

    python -m benchmarks.validity.time_structure [--runs N] [--scenes N ...] [--spread S ...] [--frames N] [--seed N]

Errors are zero at birth. Their size varies from scene to scene by a log-normal factor (`spread` is the standard
deviation of its logarithm). Tracks live for as long as each other or end at random, by turns, except in the worlds in
which tracks are lost because their errors are large. Printed is how often each verdict came and how often it was right
or refused. `held` is how often the intervals held the true value: of the geometric mean over scenes, of all errors
together (the root mean square over all scenes there could be), and of the autocorrelation at one step. Untrimmed, one
coordinate.
"""

import argparse
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import polars as pl

from tracknoise.analysis.curve_intervals import correlated
from tracknoise.analysis.growth_models import Ages
from tracknoise.analysis.growth_verdict import Changes, Growth, behaves
from tracknoise.analysis.time_structure import GrowthUnits, growth_fits
from tracknoise.inference.bootstrap import draws
from tracknoise.inference.estimates import Estimate
from tracknoise.inference.intervals import Method
from tracknoise.inference.units import Resampled, Units
from tracknoise.statistics.definitions import LAGS, LONG_LIVED_AGES
from tracknoise.tables.defaults import MARGIN
from tracknoise.tables.enumerations import Behaviour

REFUSED = (Behaviour.none, Behaviour.undecided)
N_DRAWS = 500
LOST_PX = 0.8
Shape = tuple[int, int, int]
Draw = Callable[[np.random.Generator, Shape], np.ndarray]


@dataclass(frozen=True, slots=True)
class World:
    """How errors are drawn, (scenes, tracks, ages), what they are called, and the true sizes."""

    draw: Draw
    verdict: Behaviour | None
    truth: dict[str, float] = field(default_factory=dict)
    related: float | None = None
    lost: bool = False


def white(rng: np.random.Generator, shape: Shape) -> np.ndarray:
    """Independent errors of 0.2 px, none at birth."""
    errors = 0.2 * rng.standard_normal(shape)
    errors[..., 0] = 0
    return errors


def detected(rng: np.random.Generator, shape: Shape) -> np.ndarray:
    """Independent errors of 0.2 px, as seen from a birth that has one, too."""
    errors = 0.2 * rng.standard_normal(shape)
    return errors - errors[..., :1]


def offset(rng: np.random.Generator, shape: Shape) -> np.ndarray:
    """An offset of 0.2 px that stays."""
    return 0.2 * rng.standard_normal((*shape[:2], 1)) * (np.arange(shape[2]) > 0)


def walk(rng: np.random.Generator, shape: Shape) -> np.ndarray:
    """Steps of 0.1 px that add up."""
    return 0.5 * white(rng, shape).cumsum(axis=-1)


def drift(rng: np.random.Generator, shape: Shape) -> np.ndarray:
    """0.03 px per frame with noise of 0.05 px."""
    return 0.25 * white(rng, shape) + 0.03 * np.arange(shape[2])


def own_drift(rng: np.random.Generator, shape: Shape) -> np.ndarray:
    """Every track drifts its own way."""
    return 0.03 * rng.standard_normal((*shape[:2], 1)) * np.arange(shape[2])


def unequal_drift(rng: np.random.Generator, shape: Shape) -> np.ndarray:
    """Every track drifts at a rate of its own, which is log-normal."""
    return 0.03 * np.exp(0.8 * rng.standard_normal((*shape[:2], 1))) * np.arange(shape[2])


def _chain(rng: np.random.Generator, shape: Shape, phi: float, *, start: float) -> np.ndarray:
    """A stationary process of standard deviation 1 that begins at `start` times a stationary value."""
    steps = np.sqrt(1 - phi**2) * rng.standard_normal(shape)
    values = np.empty(shape)
    values[..., 0] = start * rng.standard_normal(shape[:2])
    for place in range(1, shape[2]):
        values[..., place] = phi * values[..., place - 1] + steps[..., place]
    return values


def pulled_back(phi: float) -> Draw:
    """An Ornstein-Uhlenbeck process from zero."""
    return lambda rng, shape: 0.2 * _chain(rng, shape, phi, start=0.0)


def since_first(rng: np.random.Generator, shape: Shape) -> np.ndarray:
    """A stationary process of this kind, seen from its first value."""
    values = 0.2 * _chain(rng, shape, 0.9, start=1.0)
    return values - values[..., :1]


def related_steps(phi: float) -> Draw:
    """Steps that are correlated, as a first-order autoregression, add up."""

    def errors(rng: np.random.Generator, shape: Shape) -> np.ndarray:
        steps = 0.1 * _chain(rng, shape, phi, start=1.0)
        steps[..., 0] = 0
        return steps.cumsum(axis=-1)

    return errors


W, R, D, S = Behaviour.white, Behaviour.random_walk, Behaviour.drift, Behaviour.saturating
WORLDS = {
    "white": World(white, W, {"white": 0.2}),
    "white, birth included": World(detected, W, {"white": 0.2 * 2**0.5}, -0.5),
    "offset that stays": World(offset, W, {"white": 0.2}),
    "random walk": World(walk, R, {"walk": 0.1}, 0.0),
    "white and walk, even at 4": World(lambda *a: white(*a) + walk(*a), R, {"white": 0.2, "walk": 0.1}),
    "drift": World(drift, D, {"drift": 0.03}),
    "drift, each its own": World(own_drift, D, {"drift": 0.03}, 1.0),
    "drift, unequal rates": World(unequal_drift, D, {"drift": 0.03 * float(np.exp(0.64))}, 1.0),
    "pulled back, phi = .3": World(pulled_back(0.3), S),
    "pulled back, phi = .8": World(pulled_back(0.8), S),
    "pulled back, phi = .95": World(pulled_back(0.95), S),
    "pulled back, since first": World(since_first, S),
    "AR(1) steps, phi = .3": World(related_steps(0.3), None),
    "AR(1) steps, phi = .8": World(related_steps(0.8), None),
    "AR(1) steps, phi = .95": World(related_steps(0.95), None),
    "walk, lost beyond .8 px": World(walk, None, lost=True),
    "unequal drift, lost beyond .8": World(unequal_drift, None, lost=True),
}


def main() -> None:
    """Print verdicts and coverage."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--scenes", type=int, nargs="*", default=[8, 11, 28])
    parser.add_argument("--spread", type=float, nargs="*", default=[0.2, 0.7])
    parser.add_argument("--tracks", type=int, default=100, help="of each scene")
    parser.add_argument("--frames", type=int, default=31)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    for scenes in given.scenes:
        for spread in given.spread:
            print(
                f"\n{scenes} scenes of {given.tracks} tracks, log sd {spread}, {given.frames} frames, {given.runs} runs"
            )
            heads = [*Behaviour, "right", "right/refused", "held: geometric", "pooled", "autocorr."]
            print(f"{'':<30}{''.join(f'{head:>16}' for head in heads)}")
            for name, world in WORLDS.items():
                rng = np.random.default_rng([given.seed, scenes, round(100 * spread)])
                shape = (scenes, given.tracks, given.frames)
                found = [one_run(world, rng, shape, spread, short=run % 2 == 1) for run in range(given.runs)]
                print(f"{name:<30}{''.join(f'{cell:>16}' for cell in _cells(found, world, spread))}", flush=True)


def one_run(
    world: World, rng: np.random.Generator, shape: Shape, spread: float, *, short: bool
) -> tuple[Behaviour, Growth, Estimate]:
    """Verdict of one run, what was fitted, and the autocorrelation at one step."""
    errors = world.draw(rng, shape) * np.exp(spread * rng.standard_normal((shape[0], 1, 1)))
    ends = np.clip(rng.geometric(0.1, shape[:2]) + 1, 2, None) if short else np.full(shape[:2], shape[2] - 1)
    alive = np.arange(shape[2]) <= ends[..., None]
    if world.lost:
        alive = np.logical_and.accumulate(np.abs(errors) < LOST_PX, axis=-1)
    units = growth_units_of(errors, alive)
    weights = draws(shape[0], n_draws=N_DRAWS)
    changes = Units(units.changes[:, :1], pl.DataFrame(), units.errors.scenes, units.errors.scene, Resampled.scenes)
    related = correlated(changes, weights, Method()).at(0)
    since = np.arange(1.0, shape[2])
    enough = np.logical_and.accumulate(units.errors.sums[..., 0].sum(axis=0) >= 50)
    fit, _ = growth_fits(units, Ages(since, enough, 1), weights, Method().by_bootstrap())
    return behaves(fit, Changes(related, None), MARGIN)[0], fit, related


def growth_units_of(errors: np.ndarray, alive: np.ndarray) -> GrowthUnits:
    """Sums of every scene, as the tables of a run would give them, with v the same as u."""
    scenes, _, ages = errors.shape
    since = pl.DataFrame({"since": np.arange(1, ages)})
    names = tuple(f"{scene:03}" for scene in range(scenes))
    units = Units(_sums(errors, alive), since, names, np.arange(scenes), Resampled.scenes)
    steps, moved = np.diff(errors, axis=-1), alive[..., 1:]
    changes = np.zeros((scenes, LAGS, 5))
    for lag in range(1, LAGS + 1):
        now, before, there = steps[..., lag:], steps[..., :-lag], moved[..., lag:]
        values = (np.ones_like(now), *2 * (now * before, (now**2 + before**2) / 2))
        changes[:, lag - 1] = np.stack([(value * there).sum(axis=(1, 2)) for value in values], axis=-1)
    last = alive.sum(axis=-1, keepdims=True) - 1
    lived = {age: _sums(errors, alive & (last >= age)) for age in LONG_LIVED_AGES if age < ages}
    fourth = (errors**4 * alive)[..., 1:].sum(axis=1)
    return GrowthUnits(units, changes, lived, np.stack([fourth, fourth], axis=-1))


def _sums(errors: np.ndarray, alive: np.ndarray) -> np.ndarray:
    n, squares = alive[..., 1:].sum(axis=1), (errors**2 * alive)[..., 1:].sum(axis=1)
    return np.stack([n, squares, squares], axis=-1).astype(float)


def _cells(found: list[tuple[Behaviour, Growth, Estimate]], world: World, spread: float) -> list[str]:
    verdicts = Counter(verdict for verdict, _, _ in found)
    right = verdicts[world.verdict] if world.verdict else 0
    refused = sum(verdicts[verdict] for verdict in REFUSED)
    shares = [*(verdicts[verdict] for verdict in Behaviour), right, right + refused]
    cells = [f"{100 * count / len(found):.0f} %" for count in shares]
    fits = [fit for _, fit, _ in found]
    for pooled in (False, True):
        factor = float(np.exp(spread**2)) if pooled else 1.0  # root mean square of the factors of scenes
        cells.append(", ".join(
            _held([(fit.sizes if pooled else fit.geometric)[term] for fit in fits], value * factor)
            for term, value in world.truth.items()
        ))  # fmt: skip
    return [*cells, "" if world.related is None else _held([related for _, _, related in found], world.related)]


def _held(estimates: list[Estimate], truth: float) -> str:
    rounding = 1e-9
    held = [found.low - rounding <= truth <= found.high + rounding for found in estimates]  # type: ignore[operator]
    return f"{100 * np.mean(held):.1f} %"


if __name__ == "__main__":
    main()
