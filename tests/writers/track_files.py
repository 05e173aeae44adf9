"""Files of tracks in the formats of other front ends, written from their published descriptions.

Nothing here imports the package: these writers are the other side of its readers.
"""

import sqlite3
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl


@dataclass(frozen=True)
class Observed:
    """Observations (n,) of tracks, in the order of frames; the centre of the first pixel is (0, 0)."""

    track: np.ndarray
    frame: np.ndarray
    u: np.ndarray
    v: np.ndarray
    times_s: np.ndarray
    """Of each frame."""

    @property
    def time_s(self) -> np.ndarray:
        return self.times_s[self.frame]

    @property
    def time_ns(self) -> np.ndarray:
        return np.rint(self.time_s * 1e9).astype(np.int64)


def csv(path: Path, seen: Observed) -> None:
    columns = {"track": seen.track, "frame": seen.frame, "u_px": seen.u, "v_px": seen.v}
    pl.DataFrame(columns).sample(fraction=1.0, shuffle=True, seed=0).write_csv(path)


def parquet(path: Path, seen: Observed) -> None:
    pl.DataFrame({"track": seen.track, "frame": seen.frame, "u_px": seen.u, "v_px": seen.v}).write_parquet(path)


def timed_csv(path: Path, seen: Observed) -> None:
    pl.DataFrame({"track": seen.track, "time_s": seen.time_s, "u_px": seen.u, "v_px": seen.v}).write_csv(path)


def stamped_csv(path: Path, seen: Observed) -> None:
    pl.DataFrame({"timestamp": seen.time_ns, "track": seen.track, "u_px": seen.u, "v_px": seen.v}).write_csv(path)


def xivo(path: Path, seen: Observed) -> None:
    """As numpy.savetxt writes rows of time (ns), id, u, v and a descriptor."""
    descriptor = np.random.default_rng(0).integers(0, 256, (len(seen.track), 8))
    np.savetxt(path, np.column_stack([seen.time_ns, seen.track, seen.u, seen.v, descriptor]), delimiter=",")


def events(path: Path, seen: Observed) -> None:
    """One line ``id t x y`` per update, sorted by time."""
    lines = [f"{i} {t!r} {x!r} {y!r}" for i, t, x, y in zip(*(a.tolist() for a in _columns(seen)), strict=True)]
    path.write_text("# feature_id timestamp x y\n" + "\n".join(lines) + "\n")


def _columns(seen: Observed) -> tuple[np.ndarray, ...]:
    return seen.track, seen.time_s, seen.u, seen.v


def tap(path: Path, seen: Observed) -> None:
    names, point = np.unique(seen.track, return_inverse=True)
    shape = len(names), len(seen.times_s)
    tracks, occluded = np.full((*shape, 2), np.nan), np.ones(shape, dtype=bool)
    tracks[point, seen.frame] = np.column_stack([seen.u, seen.v])
    occluded[point, seen.frame] = False
    np.savez_compressed(path, tracks=tracks, occluded=occluded)


def colmap(path: Path, seen: Observed) -> None:
    """Database of COLMAP 3: image ids in an order of their own, names in that of frames, (0, 0) at the corner."""
    n_images = len(seen.times_s)
    ids = np.random.default_rng(1).permutation(n_images) + 1
    rows = [np.flatnonzero(seen.frame == k) for k in range(n_images)]
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY, model INTEGER, width INTEGER)")
        database.execute("CREATE TABLE images (image_id INTEGER PRIMARY KEY, name TEXT UNIQUE, camera_id INTEGER)")
        database.execute("CREATE TABLE keypoints (image_id INTEGER, rows INTEGER, cols INTEGER, data BLOB)")
        database.execute(
            "CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB, "
            "config INTEGER, F BLOB, E BLOB, H BLOB)"
        )
        for k in range(n_images):
            database.execute("INSERT INTO images VALUES (?, ?, 1)", (int(ids[k]), f"frame{k:05}.png"))
            points = np.zeros((len(rows[k]), 6), np.float32)
            points[:, :2] = np.column_stack([seen.u[rows[k]], seen.v[rows[k]]]) + 0.5
            database.execute("INSERT INTO keypoints VALUES (?, ?, 6, ?)", (int(ids[k]), len(points), points.tobytes()))
        for k in range(n_images - 1):
            _, one, two = np.intersect1d(seen.track[rows[k]], seen.track[rows[k + 1]], return_indices=True)
            pairs = np.column_stack([one, two]).astype(np.uint32)
            first, second = int(ids[k]), int(ids[k + 1])
            if first > second:
                first, second, pairs = second, first, np.ascontiguousarray(pairs[:, ::-1])
            row = (first * 2147483647 + second, len(pairs), 2, pairs.tobytes())
            database.execute("INSERT INTO two_view_geometries VALUES (?, ?, ?, ?, 2, NULL, NULL, NULL)", row)


WRITERS: Mapping[str, Callable[[Path, Observed], None]] = {
    "table.csv": csv,
    "table.parquet": parquet,
    "timed.csv": timed_csv,
    "stamped.csv": stamped_csv,
    "xivo.csv": xivo,
    "events.txt": events,
    "points.npz": tap,
    "colmap.db": colmap,
}
"""By the name of the file, whose ending shows the format."""
