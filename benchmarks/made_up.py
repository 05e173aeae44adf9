"""Tables as a measurement makes them, made up: for benchmarks of what comes after."""

from types import SimpleNamespace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.geometry.cameras import Camera
from tracknoise.measurement.sequence_tables import SequenceTables
from tracknoise.sequences.sequence import TruthKind
from tracknoise.tables import schema
from tracknoise.tables.identity import SequenceId

TRACKERS, SPEEDS = ("lucas-kanade", "correspondence"), (1, 2, 4, 8, 12)
MEAN_LIFETIME = 20
CAMERA = Camera(800, 600, 500.0, 500.0, 399.5, 299.5)
EXPERIMENT = """
name = "made up"
keep = "statistics"
speeds = [1, 2, 4, 8, 12]
[[trackers]]
kind = "lucas-kanade"
[[trackers]]
kind = "correspondence"
[dataset]
reader = "simulated"
"""
"""That might have measured them; more settings of the dataset may follow."""


def seen_by_a_still_camera(name: SequenceId, frames: int) -> SimpleNamespace:
    """What a measurement reads of a sequence besides its images: name, camera and poses."""
    poses = np.broadcast_to(np.eye(4), (frames, 4, 4))
    return SimpleNamespace(id=name, world_from_camera=poses, camera=CAMERA)


def made_up(scene: str, *, seed: int, frames: int, observations: int, lighting: str = "default") -> SequenceTables:
    """What might have been measured in a scene: errors that grow with age, lifetimes that are geometric.

    Parameters
    ----------
    scene
        Its name.
    seed
        Of all that is made up.
    frames
        How many the scene has; at speed s every s-th is seen.
    observations
        About how many there are, of all conditions together.
    lighting
        Under which it was seen.
    """
    rng = np.random.default_rng(seed)
    conditions = [(tracker, speed) for tracker in TRACKERS for speed in SPEEDS]
    n_tracks = observations // (len(conditions) * min(MEAN_LIFETIME, frames))
    parts = [_condition(rng, (scene, lighting), frames, n_tracks, tracker, speed) for tracker, speed in conditions]
    tables = [pl.concat(each) for each in zip(*parts, strict=True)]
    return SequenceTables(
        *tables, schema.empty(schema.FLOORS), TruthKind.birth, None, frames, 0, np.zeros((1, 1), np.uint8)
    )


def renamed(tables: dict[str, pl.DataFrame], names: dict[str, str]) -> dict[str, pl.DataFrame]:
    """Tables of a sequence under other names of its scene and lighting."""
    return {
        name: table.with_columns(pl.lit(value).alias(key) for key, value in names.items() if key in table.columns)
        for name, table in tables.items()
    }


def _condition(
    rng: np.random.Generator, view: tuple[str, str], frames: int, n_tracks: int, tracker: str, speed: int
) -> list[pl.DataFrame]:
    """Observations, tracks and frames of a scene under a lighting."""
    n_seen = len(range(0, frames, speed))
    lifetime = np.minimum(rng.geometric(1 / MEAN_LIFETIME, n_tracks), n_seen)
    first = rng.integers(0, n_seen - lifetime + 1) * speed
    order = np.argsort(first, kind="stable")
    first, lifetime = first[order], lifetime[order]
    track = np.repeat(np.arange(len(lifetime)), lifetime)
    age = (np.arange(len(track)) - np.repeat(np.cumsum(lifetime) - lifetime, lifetime)) * speed
    error = rng.standard_normal((len(track), 2)) * np.sqrt(0.01 + 0.05 * age)[:, None]
    place = rng.uniform(0, 600, (len(track), 2))
    observed = {"track": track, "frame": first[track] + age, "age": age, **_pairs("u_px", "v_px", place + error)}
    observed |= {**_pairs("u_true_px", "v_true_px", place), **_pairs("du_px", "dv_px", error)}
    lived = {"track": np.arange(len(lifetime)), "first_frame": first, "lifetime": lifetime}
    offered = rng.integers(200, 1200, n_seen)
    seen = {"frame": np.arange(n_seen) * speed, "outliers": offered // rng.integers(5, 50, n_seen)}
    seen |= dict.fromkeys(("offered", "matched", "alive", "new"), offered)
    origin = {"dataset": "made up", "scene": view[0], "lighting": view[1], "rotation": 0}
    same = {**origin, "direction": "forward", "camera": "", "tracker": tracker, "speed": speed, "kept": True}
    return [
        _table(observed, same | {"truth": "valid"}, schema.OBSERVATIONS),
        _table(lived, same | {"end": "lost"}, schema.TRACKS),
        _table(seen, same, schema.FRAME_COUNTS),
    ]


def _pairs(first: str, second: str, values: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    return {first: values[:, 0], second: values[:, 1]}


def _table(columns: dict[str, NDArray], same: dict[str, object], layout: schema.Schema) -> pl.DataFrame:
    """A table of a layout; columns that are neither given nor the same in every row are null."""
    literals = [pl.lit(same.get(name)).alias(name) for name in layout if name not in columns]
    table = pl.DataFrame(columns).with_columns(literals)
    return table.select(pl.col(name).cast(kind) for name, kind in layout.items())
