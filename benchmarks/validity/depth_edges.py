"""Whether errors at depth edges are found where there are depth edges, and not where there are none.

    python -m benchmarks.validity.depth_edges [--worlds N] [--frames N] [--width N] [--seed N]

A camera moves sideways past the objects of `objects`, and past a plain ground with a wall behind it, which meet in a
crease, forward and backward. Printed is, for each, the mean error in u of the features on the far side of
depth edges, on the near side and elsewhere, with 95 % intervals over worlds; the same by occlusion to come
and by parallax; how much of the mean is in each class; and how much of the second moment is removed by excluding
features beside depth edges. Played backward, the mean errors of both sides change their signs. Plain worlds have no
depth edges.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import polars as pl

from tracknoise.analysis.places_found import surrounding_errors
from tracknoise.experiments.measure import measure
from tracknoise.sequences.simulated import Simulated
from tracknoise.sequences.views import view
from tracknoise.simulation.built_worlds import block, ground, paint_textures
from tracknoise.simulation.world import Scenery, assemble
from tracknoise.statistics.places import surroundings
from tracknoise.tables.identity import Direction

GROUND_X_M, GROUND_Y_M = (-84.0, 84.0), (-20.0, 78.0)
STATISTICS = ("mean", "share", "share_of_mean")
PROPERTIES = ("side", "occlusion", "parallax")


@dataclass(frozen=True, slots=True, kw_only=True)
class Plain(Simulated):
    """The ground and a wall on it, which fills the rest of the image."""

    def scenery_of(self, scene: str) -> Callable[[], Scenery]:
        """What makes the world of a scene."""
        return partial(_plain, [self.seed, int(scene.rpartition("-")[2])])


def _plain(seed: list[int]) -> Scenery:
    rng = np.random.default_rng(seed)
    textures = paint_textures(rng)
    wall = block(rng, (0.0, 40.0, 39.0), (200.0, 2.0, 80.0), repeat_m=7.0)
    return Scenery(assemble([*ground(rng, GROUND_X_M, GROUND_Y_M), *wall], textures))


def errors_of(reader: Simulated, direction: Direction, tracker: str) -> pl.DataFrame:
    """`SURROUNDING_ERRORS` of all worlds of a reader, played in a direction."""
    parts = []
    for scene in reader.sequences():
        sequence = view(reader.open(scene), n_frames=None, direction=direction, rotation=0)
        parts.append(surroundings(replace(measure(sequence, [tracker]).prepared, slowest=1)))
    return surrounding_errors(parts)


def lines(errors: pl.DataFrame, at: int) -> Iterator[str]:
    """One line per class: mean error in u, share of the features, and share of the mean, with intervals."""
    in_u = errors.filter(coordinate="u", at=at)
    for surrounding in PROPERTIES:
        table = in_u.filter(surrounding=surrounding).sort("class_low")
        for name in table["class"].unique(maintain_order=True):
            rows = {row["statistic"]: row for row in table.filter(pl.col("class") == name).to_dicts()}
            yield f"  {surrounding} {name:<14}" + "".join(_cell(rows.get(key)) for key in STATISTICS)
    kept = in_u.filter(pl.col("class") == "none", surrounding="side", statistic="second_removed_by_others")
    for row in kept.to_dicts():
        yield f"  second moment removed without features beside edges: {_cell(row)}"


def _cell(row: dict[str, float] | None) -> str:
    if row is None:
        return f"{'-':>28}"
    low, high = (f"{row[name]:+.3f}" if row[name] is not None else "-" for name in ("low", "high"))
    return f"{row['value']:+10.3f} ({low} to {high})"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=12)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--tracker", default="lucas-kanade")
    chosen = parser.parse_args(arguments)
    size = {"width": chosen.width, "height": chosen.width * 3 // 4}
    options = {"motions": ("linear",), "worlds": chosen.worlds, "frames": chosen.frames, "seed": chosen.seed, **size}
    readers = {"objects": Simulated(world="objects", **options), "plain": Plain(world="objects", **options)}
    for name, reader in readers.items():
        for direction in Direction:
            errors = errors_of(reader, direction, chosen.tracker)
            at = int(errors["at"].max()) if errors.height else 0
            print(f"{name}, {direction}, age {at}: mean u (px), share of features, share of the mean", flush=True)
            print("\n".join(lines(errors, at)), flush=True)


if __name__ == "__main__":
    main()
