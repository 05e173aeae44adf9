"""From tables of sequences to the samples of an audit."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.audit.motion import Paths
from tracknoise.audit.parameters import COUNT
from tracknoise.audit.prediction import predict
from tracknoise.audit.samples import AuditSamples
from tracknoise.findings.sampling.groups import SceneGroups, scheme
from tracknoise.geometry.lenses import KnownCamera, make_camera
from tracknoise.geometry.pose import from_quaternion
from tracknoise.statistics.scattered import scattered
from tracknoise.tables.enumerations import Resampled

MOST_SAMPLES = 16_000
"""Largest number of observations that are used, shared equally by sequences and trackers."""
LEAST_SAMPLES, LEAST_CLUSTERS = 200, 4
"""Fewest observations, and fewest scenes or blocks of tracks, of an audit."""
_BLOCKS_JOINED = 2
"""Neighbouring blocks of tracks are joined, so that few errors are common to two of them."""
_REPRODUCED_PX = 0.01
"""An observation is used if its stated true position is reproduced this well."""
_QUATERNION = ("qx", "qy", "qz", "qw")


@dataclass(frozen=True, slots=True)
class AuditedTables:
    """Tables of one sequence: `AUDIT_SAMPLES`, `CAMERAS` and `POSES`."""

    samples: pl.DataFrame
    cameras: pl.DataFrame
    poses: pl.DataFrame

    @property
    def has_known_lens(self) -> bool:
        """Whether the cameras can be made again from the table."""
        return self.cameras["model"].null_count() == 0


def read_samples(
    tables: Sequence[AuditedTables], groups: SceneGroups, *, without: Collection[str] = ()
) -> AuditSamples | str:
    """Samples of several sequences.

    Parameters
    ----------
    tables
        Of sequences of one dataset, one view of each scene and camera.
    groups
        Scenes that are not independent of each other.
    without
        Trackers that are left out, unless there are no others.

    Returns
    -------
    AuditSamples or str
        Why there is no audit, as the end of a sentence.
    """
    if not tables:
        return "no sequence was measured upright and forward"
    used = [one for one in tables if one.has_known_lens and not one.samples.is_empty()]
    if not used:
        unknown = any(not one.has_known_lens for one in tables)
        return "the camera model is not known" if unknown else "it is fitted to the tracks, or none was followed"
    names = sorted(set().union(*(one.samples["tracker"].unique() for one in used)))
    trackers = tuple(name for name in names if name not in without) or tuple(names)
    samples = _usable(_joined(used, trackers, groups))
    if len(samples.age) < LEAST_SAMPLES or samples.n_clusters < LEAST_CLUSTERS:
        return f"only {len(samples.age)} observations in {samples.n_clusters} scenes or blocks of tracks can be used"
    return samples


def _usable(samples: AuditSamples) -> AuditSamples:
    """Observations whose frames have poses around them, and whose true position is reproduced."""
    surrounded = samples.paths.surrounded
    safe = samples.chosen(np.flatnonzero(surrounded[samples.birth] & surrounded[samples.now]))
    if not len(safe.age):
        return safe
    apart = np.abs(predict(safe, np.zeros(COUNT)).uv - safe.stated).max(axis=1)
    return safe.chosen(np.flatnonzero(apart <= _REPRODUCED_PX))


def _joined(used: Sequence[AuditedTables], trackers: tuple[str, ...], groups: SceneGroups) -> AuditSamples:
    share = max(1, MOST_SAMPLES // (len(used) * len(trackers)))
    parts = [_thinned(one.samples.filter(pl.col("tracker").is_in(trackers)), share) for one in used]
    lengths = [one.cameras.height for one in used]
    first = np.cumsum([0, *lengths[:-1]])
    seconds = pl.concat([one.cameras["time_s"] for one in used])
    timed = seconds.null_count() == 0
    gaps = np.concatenate([np.diff(one.cameras["time_s"].to_numpy()) for one in used]) if timed else np.ones(1)
    interval = float(np.median(gaps)) if len(gaps) else 1.0
    frames = np.concatenate([np.arange(length, dtype=np.float64) for length in lengths])
    sequence = np.repeat(np.arange(len(used)), lengths)
    poses = np.concatenate([_poses(one.poses) for one in used])
    cameras, camera = _cameras(pl.concat([one.cameras for one in used]))
    shutters = pl.concat([one.cameras.select("readout_s", "shutter_axis") for one in used])
    table = pl.concat(parts)
    offset = np.repeat(first, [part.height for part in parts])
    cluster, resampled, n_scenes = _clusters(table, groups)
    return AuditSamples(
        trackers=trackers,
        tracker=np.searchsorted(trackers, table["tracker"].to_list()).astype(np.intp),
        age=table["age"].to_numpy().astype(np.intp),
        cluster=cluster,
        resampled=resampled,
        n_scenes=n_scenes,
        birth=offset + table["birth_frame"].to_numpy().astype(np.intp),
        now=offset + table["frame"].to_numpy().astype(np.intp),
        uv_at_birth=table.select("u_birth_px", "v_birth_px").to_numpy(),
        observed=table.select("u_px", "v_px").to_numpy(),
        stated=table.select("u_true_px", "v_true_px").to_numpy(),
        depth=table["depth_m"].to_numpy(),
        paths=Paths.of(seconds.to_numpy() / interval if timed else frames, poses, sequence),
        cameras=cameras,
        camera=camera,
        readout_of=shutters["readout_s"].fill_null(0.0).to_numpy() / interval,
        axis_of=shutters["shutter_axis"].fill_null(1).to_numpy().astype(np.intp),
        interval_s=interval if timed else None,
    )


def _thinned(table: pl.DataFrame, share: int) -> pl.DataFrame:
    """At most `share` rows of each tracker, chosen by a hash of track and frame."""
    hashed = scattered(scattered(table["track"].to_numpy()) ^ table["frame"].to_numpy().astype(np.uint64))
    ranked = table.with_columns(hashed=pl.Series(hashed))
    return ranked.filter(pl.col("hashed").rank("ordinal").over("tracker") <= share).drop("hashed")


def _poses(table: pl.DataFrame) -> NDArray[np.float64]:
    """(n, 4, 4): NaN where a frame has none."""
    known = table["qw"].is_not_null().to_numpy()
    poses = np.full((table.height, 4, 4), np.nan)
    rows = table.filter(pl.col("qw").is_not_null())
    poses[known] = from_quaternion(rows.select("x_m", "y_m", "z_m").to_numpy(), rows.select(_QUATERNION).to_numpy())
    return poses


def _cameras(table: pl.DataFrame) -> tuple[tuple[KnownCamera, ...], NDArray[np.intp]]:
    """The different cameras, and the place of each frame's camera among them."""
    columns = ["model", "width", "height", "fx_px", "fy_px", "cx_px", "cy_px", "distortion"]
    rows = [(*row[:-1], tuple(row[-1])) for row in table.select(columns).iter_rows()]
    places = {row: place for place, row in enumerate(dict.fromkeys(rows))}
    made = tuple(make_camera(row[0], row[1:3], row[3:7], row[7]) for row in places)
    return made, np.array([places[row] for row in rows], dtype=np.intp)


def _clusters(table: pl.DataFrame, groups: SceneGroups) -> tuple[NDArray[np.intp], Resampled, int]:
    """Cluster of each row, without gaps: groups, scenes, or blocks of tracks within scenes where these are few."""
    scenes = table["scene"].unique().sort().to_list()
    scene = np.searchsorted(scenes, table["scene"].to_list())
    group = groups.of(table["dataset"][0] if table.height else "", scenes)
    resampled = scheme(group) or Resampled.blocks
    number = group[scene] if resampled == Resampled.groups else scene
    if resampled == Resampled.blocks:
        block = table["block"].to_numpy().astype(np.intp) // _BLOCKS_JOINED
        number = scene * (int(block.max(initial=0)) + 1) + block
    _, cluster = np.unique(number, return_inverse=True)
    return cluster.astype(np.intp), resampled, len(scenes)
