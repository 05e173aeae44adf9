"""How often the audit names planted faults, holds their size in its interval, and finds faults where there are none.

    python -m benchmarks.validity.audit [--runs 200] [--seed N] [--only exact biased visible focal_length ...]

Recordings are made up (`benchmarks.validity.audit_worlds`): points at random depths, smooth random camera paths, two
trackers of different noise that walks within tracks, and outliers. Each fault is planted at two sizes: in eight scenes,
in one scene that is cut into blocks, where only two of eight scenes turn and change their speed, where each tracker has
another drift in each scene, and where both hold. Printed are, for each cell, the share of runs in which the planted
fault is named first, in which another is named, and in which the interval of its number holds the planted value: of the
parameter alone, beside biases of the trackers, and of all named faults together where it is named.

The cells `exact` have no fault, and count any fault that is named. The cells `biased` have trackers with a bias of
their own: the same constant for both, the same drift for both, and a drift of one; the cell `single` one tracker with a
drift. A fault that is named there is a false alarm too.

The lines `visible` are about sizes of which an audit of an exact recording says that 90 % would have been seen: the
share of recordings in which an error of this size is named, if it is planted in the same recording.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.validity.audit_worlds import World, make_samples, theta_of
from tracknoise.truth_faults.audit_selection import Assessment, Judged, Selection, judge, select
from tracknoise.truth_faults.fault_parameters import FAULTS, SLICES, Parameter

SIZES: dict[Parameter, tuple[float | tuple[float, ...], float | tuple[float, ...]]] = {
    Parameter.focal_length: (0.005, 0.1),
    Parameter.principal_point: ((4.0, -4.0), (20.0, 15.0)),
    Parameter.k1: (0.01, 0.1),
    Parameter.depth_scale: (0.01, 0.1),
    Parameter.depth_offset: (0.03, 0.2),
    Parameter.inverse_depth_offset: (0.005, 0.05),
    Parameter.mounting_rotation: ((0.006, -0.006, 0.006), (0.03, 0.02, -0.04)),
    Parameter.mounting_translation: ((0.02, 0.02, -0.02), (0.1, -0.05, 0.05)),
    Parameter.clock_offset: (0.06, 0.5),
    Parameter.clock_drift: (0.2, 1.0),
    Parameter.readout: (0.2, 0.8),
    Parameter.rotation_delay: ((0.1, 0.1, 0.1), (0.5, 0.5, 0.5)),
    Parameter.smoothing: (0.2, 2.0),
    Parameter.ray_depth: (1.0, 1.0),
}
"""Small and large, in the units of the fit: 1, px, metres, 1/m, radians, frame intervals, their squares; of a kind, 1.
"""
ONE_SCENE = World(n_scenes=1, n_frames=240, per_scene=1600)
EIGHT_SCENES = World(per_scene=200)
TWO_LIVELY = replace(EIGHT_SCENES, lively=2, steady_m=(0.02, 0.0, 0.02))
PLACES = {
    "eight scenes": EIGHT_SCENES,
    "one scene": ONE_SCENE,
    "two lively scenes": TWO_LIVELY,
    "drifting scenes": replace(EIGHT_SCENES, drift_of_scene=0.01),
    "two lively of drifting scenes": replace(TWO_LIVELY, drift_of_scene=0.01),
}
BIASED = {
    "both constant": {"bias_px": ((0.3, -0.2), (0.3, -0.2))},
    "both drift": {"drift_px_per_frame": ((0.03, 0.02), (0.03, 0.02))},
    "one drifts": {"drift_px_per_frame": ((0.05, -0.02), (0.0, 0.0))},
    "single": {"noise_px": (0.3,), "bias_px": ((0.0, 0.0),), "drift_px_per_frame": ((0.03, 0.02),)},
}


@dataclass(frozen=True, slots=True)
class Cell:
    """A world, and what is planted in it."""

    name: str
    world: World
    parameter: Parameter | None = None
    size: float | tuple[float, ...] = 0.0


def cells() -> Iterator[Cell]:
    """All of them, with names that `--only` chooses from."""
    for where, world in PLACES.items():
        yield Cell(f"exact, {where}", world)
        for name, biases in BIASED.items():
            yield Cell(f"biased: {name}, {where}", replace(world, **biases))
        for parameter, sizes in SIZES.items():
            for size in dict.fromkeys(sizes):
                yield Cell(f"{parameter} {size}, {where}", world, parameter, size)


def run(cell: Cell, seed: int) -> Selection:
    """Audit one recording of a cell."""
    theta = theta_of({} if cell.parameter is None else {cell.parameter: cell.size})
    return select(make_samples(np.random.default_rng(seed), cell.world, theta))


def holds(one: Assessment, size: float | tuple[float, ...]) -> list[bool]:
    """Whether the interval of each number holds the planted value."""
    return [bool(inside) for inside in np.abs(one.estimate - np.atleast_1d(size)) <= one.half_widths]


def holds_finally(found: Selection, parameter: Parameter, size: float | tuple[float, ...]) -> list[bool]:
    """The same for the fit of all named faults, if the parameter is one of them."""
    if parameter not in found.final.fitted.parameters:
        return []
    planted = np.zeros(len(found.final.fitted.theta))
    planted[SLICES[parameter]] = size
    free = found.final.fitted.free
    half = found.final.resampled.half_widths[: len(free)]
    inside = np.abs(found.final.fitted.estimate - planted[free]) <= half
    return [bool(one) for one, place in zip(inside, free, strict=True) if planted[place] != 0.0]


def summary(cell: Cell, seeds: range) -> str:
    """One line of the printed table."""
    first: Counter[str] = Counter()
    more, inside = 0, {"alone": [], "beside biases": [], "named": []}
    for seed in seeds:
        found = run(cell, seed)
        names = [one.parameter for one in found.named]
        first[names[0] if names else "none"] += 1
        more += any(name != cell.parameter for name in names)
        if cell.parameter is not None:
            inside["alone"] += holds(found.alone.assessed[cell.parameter], cell.size)
            inside["beside biases"] += holds(found.beside_bias.assessed[cell.parameter], cell.size)
            inside["named"] += holds_finally(found, cell.parameter, cell.size)
    held = ", ".join(f"{name} {np.mean(some):.3f}" for name, some in inside.items() if some)
    counts = ", ".join(f"{name} {count}" for name, count in first.most_common())
    return f"{cell.name}: first {counts}; another named in {more} of {len(seeds)}" + (
        f"; holds: {held}" if held else ""
    )


def visible_summary(world: World, seeds: range) -> str:
    """How often errors are named of which an audit says that 90 % of their size would have been seen."""
    named: dict[Parameter, list[bool]] = {}
    for seed in seeds:
        for judged in judge(run(Cell("exact", world), seed)):
            is_size = not FAULTS[judged.parameter].is_kind and np.isfinite(judged.visible_above).all()
            if judged.rank is None and is_size:
                named.setdefault(judged.parameter, []).append(is_seen(world, judged, seed))
    return ", ".join(f"{one} {np.mean(seen):.2f} of {len(seen)}" for one, seen in named.items())


def is_seen(world: World, judged: Judged, seed: int) -> bool:
    """Whether an error of the first number of a parameter is named in a recording, if it is as large as is visible."""
    size = np.where(np.arange(len(judged.visible_above)) == 0, judged.visible_above, 0.0)
    found = run(Cell("visible", world, judged.parameter, tuple(size)), seed)
    return any(one.parameter == judged.parameter for one in found.named)


def main() -> None:
    """Print a line for each cell."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="*", default=[""], help="cells whose names begin like this")
    options = parser.parse_args()
    seeds = range(options.seed, options.seed + options.runs)
    for cell in cells():
        if cell.name.startswith(tuple(options.only)):
            print(summary(cell, seeds), flush=True)
    for where, world in PLACES.items():
        if f"visible, {where}".startswith(tuple(options.only)):
            print(f"visible, {where}: {visible_summary(world, seeds)}", flush=True)


if __name__ == "__main__":
    main()
