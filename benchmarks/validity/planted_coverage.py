"""How often intervals hold what was planted, and how often verdicts are right: by world and number of scenes.

    python -m benchmarks.validity.planted_coverage [--runs N] [--scenes 6 8 12 28] [--worlds NAME ...] [--seed N]

Intervals and verdicts are those that `tracknoise` makes of scenes of `benchmarks.validity.planted`. Printed are the
shares of 95 % intervals that hold the true value, in brackets those that lie below it, and in square brackets what
their rows say that they cover where most do. Errors are those of u at age 10, untrimmed. Sizes of growth that are not
planted are 0, and an interval that begins at 0 holds them.
"""

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl

from benchmarks.validity.planted import AGES, AT, WORLDS, Scenes, World, draw, mean_power
from benchmarks.validity.time_structure import growth_units_of
from tracknoise.analysis.curve_intervals import curve_logarithms, curve_statistics
from tracknoise.analysis.growth_models import Ages
from tracknoise.analysis.growth_verdict import Changes, Growth, behaves, grows
from tracknoise.analysis.scene_spread import Parts, own_values, with_biases
from tracknoise.analysis.time_structure import GrowthUnits, fit_ages, growth_fits
from tracknoise.inference.bootstrap import draws
from tracknoise.inference.coverage import coverage_of_heavy_errors, coverage_of_heavy_scales
from tracknoise.inference.estimates import Estimate, EstimateArray
from tracknoise.inference.intervals import Method, averaged, geometric, pooled
from tracknoise.inference.units import Units, scheme
from tracknoise.tables.defaults import MARGIN
from tracknoise.tables.enumerations import Weighting

MEAN, ETA, SECOND = 0, 2, 4
SCALES = ["linear", "linear", "log", "log", "log", "log", "linear", "log", "log", "linear"]
"""Of `curve_statistics`."""


@dataclass(frozen=True)
class Held:
    """Shares of intervals that hold a value, and that lie below it; what their rows say that they cover, on average."""

    held: float
    below: float
    stated: float | None = None

    @classmethod
    def of(cls, low: np.ndarray, high: np.ndarray, true: float, stated: np.ndarray | None = None) -> "Held":
        """Of intervals of one value; those without bounds hold it. `stated`: NaN where a row states nothing."""
        rounding = 1e-9
        below, above = high < true - rounding, low > true + rounding
        some = stated is not None and np.isfinite(stated).mean() > 0.5
        return cls(float(np.mean(~below & ~above)), float(np.mean(below)), float(np.nanmean(stated)) if some else None)

    def __str__(self) -> str:
        stated = "" if self.stated is None else f" [{100 * self.stated:.0f}]"
        return f"{100 * self.held:.1f} ({100 * self.below:.1f}){stated}"


def coverage(world: World, n_scenes: int, *, runs: int, seed: int) -> tuple[dict[str, Held], Counter[str]]:
    """Coverage by statistic, and how often each verdict on growth came."""
    rng = np.random.default_rng([seed, n_scenes])
    sums, fits, verdicts, group = [], [], Counter[str](), np.arange(n_scenes)
    for _ in range(runs):
        scenes = draw(world, n_scenes, rng)
        group = scenes.group
        sums.append(_sums(scenes))
        fit, _ = fitted(scenes)
        fits.append(fit)
        verdicts[f"grows: {grows(fit.ratio, MARGIN)}"] += 1
        verdicts[str(behaves(fit, Changes(None, None), MARGIN)[0])] += 1
    units = Units(
        np.stack(sums, axis=1),
        pl.DataFrame({"run": range(runs)}),
        tuple(f"{place:02d}" for place in range(n_scenes)),
        np.arange(n_scenes),
        scheme(group),
        group,
    )
    return {**dict(_of_curves(world, units)), **dict(_of_growth(world, fits))}, verdicts


def fitted(scenes: Scenes) -> tuple[Growth, Growth]:
    """What is fitted to the growth of one run."""
    units = grouped(growth_units_of(scenes.errors[..., 0], scenes.alive), scenes.group)
    ages = Ages(np.arange(1.0, AGES), fit_ages(units.errors, min_features=50), 1)
    return growth_fits(units, ages, draws(len(units.errors.sums), n_draws=500), Method().by_bootstrap())


def grouped(units: GrowthUnits, group: np.ndarray) -> GrowthUnits:
    """The same with scenes of one group added up, as a run with `dataset.groups` has them."""
    if len(np.unique(group)) == len(group):
        return units

    def joined(sums: np.ndarray) -> np.ndarray:
        return np.stack([sums[group == one].sum(axis=0) for one in np.unique(group)])

    n_groups = len(np.unique(group))
    errors = replace(
        units.errors, sums=joined(units.errors.sums), scenes=units.errors.scenes[:n_groups], scene=np.arange(n_groups)
    )
    lived = {age: joined(sums) for age, sums in units.lived.items()}
    return GrowthUnits(errors, joined(units.changes), lived, joined(units.fourth))


def _sums(scenes: Scenes) -> np.ndarray:
    """Sums of each scene at the age, (scenes, 8)."""
    there = scenes.alive[:, :, AT].astype(float)
    u, v = np.moveaxis(scenes.errors[:, :, AT], -1, 0)
    values = (np.ones_like(u), u, v, u * u, u * v, v * v, np.abs(u), np.abs(v))
    return np.stack([(value * there).sum(axis=1) for value in values], axis=-1)


def _of_curves(world: World, units: Units) -> Iterator[tuple[str, Held]]:
    method, none, true = Method(), np.empty((0, len(units.sums))), _true(world)
    for weighting, estimated in ((Weighting.features, pooled), (Weighting.scenes, averaged)):
        found = estimated(units, none, curve_statistics, method, scales=SCALES)
        found = with_biases(units, Parts.of(units, weighting), found, [SECOND, SECOND + 1])
        for name, row in (("mean", MEAN), ("eta", ETA), ("second", SECOND)):
            if name in true:
                yield (
                    f"{name}, {weighting}",
                    Held.of(found.low[row], found.high[row], true[name], _stated(units, found, row)),
                )
    if world.lives != "lost":
        found = geometric(units, none, _logarithms, method)
        true = world.second() * np.exp(2 * world.log_scale())
        stated = _if_heavy(units, level=found.level)[1]
        yield "second, geometric", Held.of(found.low[0], found.high[0], true, stated)


def _stated(units: Units, found: EstimateArray, row: int) -> np.ndarray | None:
    """What the rows say that the intervals cover."""
    if row == MEAN:
        return None
    own, power = own_values(units, curve_statistics), 1.0 if row == SECOND else 0.5
    stated = coverage_of_heavy_scales(own[row], found.n_units[row], power=power, level=found.level)
    return np.fmin(stated, _if_heavy(units, level=found.level)[0]) if row == SECOND else stated


def _if_heavy(units: Units, *, level: float) -> tuple[np.ndarray, np.ndarray]:
    own = own_values(units, curve_statistics)
    return coverage_of_heavy_errors(own[SECOND], own[ETA], units.sums[..., 0].T, level=level)


def _logarithms(sums: np.ndarray) -> np.ndarray:
    return curve_logarithms(sums)[[2]]


def _true(world: World) -> dict[str, float]:
    """True mean, second moment and, where it is known in closed form, mean absolute error."""
    if world.lives == "lost":
        scenes = draw(world, 2000, np.random.default_rng(1))
        u = scenes.errors[:, :, AT, 0][scenes.alive[:, :, AT]]
        return {"mean": 0.0, "second": float(np.mean(u**2)), "eta": float(np.mean(np.abs(u)))}
    noise = world.second() - world.bias**2
    true = {"mean": world.bias, "second": noise * world.squared_scale() + world.bias**2}
    if world.bias or not world.is_gaussian():
        return true
    scale = mean_power(world.scale, 1) * mean_power(world.tracker, 1)
    return {**true, "eta": float(np.sqrt(2 / np.pi * noise)) * scale}


def _of_growth(world: World, fits: Sequence[Growth]) -> Iterator[tuple[str, Held]]:
    if world.lives != "lost":
        yield "growth ratio", _held([fit.ratio or Estimate(None) for fit in fits], world.rise())
    if world.ar or world.lives == "lost" or world.bias:
        return
    for term, size in world.sizes().items():
        typical, every = size * np.exp(world.log_scale()), size * world.squared_scale() ** 0.5
        yield f"{term}, geometric", _held([fit.geometric[term] for fit in fits], typical)
        yield f"{term}, pooled", _held([fit.sizes[term] for fit in fits], every)


def _held(found: Sequence[Estimate], true: float) -> Held:
    low = np.array([-np.inf if one.low is None else one.low for one in found])
    high = np.array([np.inf if one.high is None else one.high for one in found])
    return Held.of(low, high, true)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=600)
    parser.add_argument("--scenes", type=int, nargs="+", default=[6, 8, 12, 28])
    parser.add_argument("--worlds", nargs="+", choices=WORLDS, default=list(WORLDS))
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    for name in given.worlds:
        for n_scenes in given.scenes:
            held, verdicts = coverage(WORLDS[name], n_scenes, runs=given.runs, seed=given.seed)
            print(f"\n{name}, {n_scenes} scenes, {given.runs} runs")
            print("  " + "; ".join(f"{statistic} {share}" for statistic, share in held.items()))
            print(
                "  " + ", ".join(f"{kind} {100 * n / given.runs:.1f}" for kind, n in verdicts.most_common()), flush=True
            )


if __name__ == "__main__":
    main()
