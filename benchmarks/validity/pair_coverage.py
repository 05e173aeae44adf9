"""How often intervals of what two cameras say together hold the value that was planted.

    python -m benchmarks.validity.pair_coverage [--repeats N] [--scenes N]

Two parallel cameras of 450 px and 12 cm, and points at 1 to 8 m in scenes of 60 tracks of 12 frames. Errors in both
cameras are white or walks, of .1 and .15 px for each frame, independent of each other or with a correlation of .6;
those in the first are 0 at birth. Scenes differ by a factor of 20 % (standard deviation). No image is made. What was
planted is the same quantity of 2,000 further scenes. Printed are the shares of intervals of 95 % that hold it.
"""

import argparse
from collections.abc import Iterator

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.pair_intervals import pair_intervals
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.stereo_pair import StereoPair
from tracknoise.statistics.pair_sums import pair_sums
from tracknoise.statistics.prepared import prepare_sequence
from tracknoise.tables.schema import OBSERVATIONS, PAIR, TRACKS

Array = NDArray[np.float64]

TRACKS_OF_SCENE, FRAMES = 60, 12
FIRST_PX, SECOND_PX, SPREAD, SHARED = 0.1, 0.15, 0.2, 0.6
CAMERA = Camera(640, 480, 450.0, 450.0, 319.5, 239.5)
PLACE = np.eye(4)
PLACE[0, 3] = 0.12
RIG = StereoPair(CAMERA, CAMERA, PLACE)


def errors(law: str, correlation: float, factor: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """(tracks, frames, 2) each: errors in both cameras, px."""
    shape = TRACKS_OF_SCENE, FRAMES, 2
    common, own = rng.standard_normal(shape), rng.standard_normal(shape)
    noise = [common, correlation * common + np.sqrt(1.0 - correlation**2) * own]
    if law == "walk":
        noise = [one.cumsum(axis=1) for one in noise]
        noise[0] -= noise[0][:, :1]
    noise[0][:, 0] = 0.0
    return FIRST_PX * factor * noise[0], SECOND_PX * factor * noise[1]


def scene(name: str, law: str, correlation: float, rng: np.random.Generator) -> pl.DataFrame:
    """Sums of one scene."""
    return pair_sums(prepare_sequence(*tables(name, law, correlation, rng)))


def tables(name: str, law: str, correlation: float, rng: np.random.Generator) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Observations and tracks of one scene."""
    first, second = errors(law, correlation, float(np.exp(SPREAD * rng.standard_normal())), rng)
    uv = rng.uniform((100.0, 60.0), (540.0, 420.0), (TRACKS_OF_SCENE, 2))
    depth = np.repeat(np.exp(rng.uniform(0.0, np.log(8.0), TRACKS_OF_SCENE)), FRAMES)
    true = np.repeat(uv, FRAMES, axis=0)
    beside = true - np.column_stack([450.0 * 0.12 / depth, np.zeros(len(depth))])
    seen, seen_beside = true + first.reshape(-1, 2), beside + second.reshape(-1, 2)
    across, along = RIG.errors_px(seen, seen_beside, true, beside)
    values = (*first.reshape(-1, 2).T, across, along, RIG.depth_m(seen, seen_beside), depth)
    track, frame = np.repeat(np.arange(TRACKS_OF_SCENE), FRAMES), np.tile(np.arange(FRAMES), TRACKS_OF_SCENE)
    origin = {"dataset": "made", "scene": name, "lighting": "default", "rotation": 0, "direction": "forward"}
    origin |= {"camera": "", "tracker": "second", "speed": 1}
    columns = {
        "track": track,
        "frame": frame,
        "age": frame,
        **dict(zip(("u_px", "v_px", "u_true_px", "v_true_px"), (*seen_beside.T, *beside.T), strict=True)),
        "truth": ["valid"] * len(track),
        **dict(zip(("du_px", "dv_px"), (seen_beside - beside).T, strict=True)),
        "kept": [True] * len(track),
        **dict(zip(PAIR, values, strict=True)),
    }
    literals = [pl.lit(value).alias(key) for key, value in origin.items()]
    kinds = {**OBSERVATIONS, **PAIR}
    observations = pl.DataFrame(columns).with_columns(literals).select(pl.col(key).cast(kinds[key]) for key in kinds)
    of_tracks = {"track": np.arange(TRACKS_OF_SCENE), "first_frame": 0, "lifetime": FRAMES, "end": "sequence_end"}
    made = pl.DataFrame(of_tracks).with_columns(literals, kept=pl.lit(value=True))
    absent = [pl.lit(None).alias(key) for key in TRACKS if key not in made.columns]
    tracks = made.with_columns(absent).select(pl.col(key).cast(kind) for key, kind in TRACKS.items())
    return observations, tracks


def quantities(law: str, correlation: float, scenes: int, rng: np.random.Generator) -> pl.DataFrame:
    """Quantities of some scenes, with intervals."""
    return pair_intervals([pl.concat(scene(f"s{place}", law, correlation, rng) for place in range(scenes))])


def main() -> None:
    """Print the shares."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=200)
    parser.add_argument("--scenes", type=int, default=10)
    given = parser.parse_args()
    for line in lines(given.repeats, given.scenes):
        print(line, flush=True)


def lines(repeats: int, scenes: int) -> Iterator[str]:
    """A line for each kind of noise."""
    every: list[bool] = []
    for place, (law, correlation) in enumerate((law, one) for law in ("white", "walk") for one in (0.0, SHARED)):
        rng = np.random.default_rng([5, place])
        true = dict(quantities(law, correlation, 2000, rng).select("quantity", "value").iter_rows())
        held: dict[str, list[bool]] = {name: [] for name in true}
        for _ in range(repeats):
            for row in quantities(law, correlation, scenes, rng).to_dicts():
                held[row["quantity"]].append(row["low"] <= true[row["quantity"]] <= row["high"])
        every += [one for part in held.values() for one in part]
        shares = ", ".join(f"{name} {np.mean(part):.3f}" for name, part in held.items())
        yield f"{law}, correlation {correlation:g}: {shares}"
    yield f"all: {np.mean(every):.3f} of {len(every)}"


if __name__ == "__main__":
    main()
