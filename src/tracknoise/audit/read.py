"""From tables of sequences to the samples of an audit."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.audit.instants import instants_of
from tracknoise.audit.motion import Paths
from tracknoise.audit.parameters import COUNT
from tracknoise.audit.prediction import predict
from tracknoise.audit.samples import AuditSamples
from tracknoise.findings.sampling.groups import SceneGroups, scheme
from tracknoise.findings.wording import listing
from tracknoise.geometry.lenses import KnownCamera, make_camera
from tracknoise.printable import counted
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


@dataclass(frozen=True, slots=True)
class AuditedTables:
    """Tables of one sequence: `AUDIT_SAMPLES`, `CAMERAS` and `POSES`, and `PATH` where it has one.

    z_depth_from is what its depths were computed from, if they are along z by construction.
    """

    samples: pl.DataFrame
    cameras: pl.DataFrame
    poses: pl.DataFrame
    path: pl.DataFrame | None = None
    z_depth_from: str | None = None

    @property
    def has_known_lens(self) -> bool:
        """Whether the cameras can be made again from the table."""
        return self.cameras["model"].null_count() == 0

    @property
    def has_times(self) -> bool:
        """Whether the time of each frame is known."""
        return self.cameras["time_s"].null_count() == 0

    @property
    def has_readout(self) -> bool:
        """Whether a rolling shutter is stated."""
        return self.cameras["readout_s"].null_count() < self.cameras.height


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
    if len({one.has_times for one in used}) == 2 and any(one.has_readout for one in used):
        return "a readout in seconds is stated, and some recordings have timestamps while others have none"
    names = sorted(set().union(*(one.samples["tracker"].unique() for one in used)))
    trackers = tuple(name for name in names if name not in without) or tuple(names)
    surrounded = _surrounded(_joined(used, trackers, groups))
    samples = _reproduced(surrounded)
    if len(samples.age) < LEAST_SAMPLES or samples.n_clusters < LEAST_CLUSTERS:
        return _too_few(samples, unlike=len(surrounded.age) - len(samples.age))
    return samples


def _too_few(samples: AuditSamples, *, unlike: int) -> str:
    """Why there is no audit, where the stated positions of `unlike` observations are not those of poses and cameras."""
    clusters = counted(samples.n_clusters, "scene or block of tracks", "scenes or blocks of tracks")
    found = f"only {counted(len(samples.age), 'observation')} in {clusters} can be used"
    return f"{found}; poses and cameras of the run give other true positions of {unlike} more" if unlike else found


def _surrounded(samples: AuditSamples) -> AuditSamples:
    """Observations whose frames have poses around them."""
    surrounded = samples.paths.surrounded
    return samples.chosen(np.flatnonzero(surrounded[samples.birth] & surrounded[samples.now]))


def _reproduced(samples: AuditSamples) -> AuditSamples:
    """Observations whose stated true position is that of the stated poses and cameras."""
    if not len(samples.age):
        return samples
    apart = np.abs(predict(samples, np.zeros(COUNT)).uv - samples.stated).max(axis=1)
    return samples.chosen(np.flatnonzero(apart <= _REPRODUCED_PX))


def _joined(used: Sequence[AuditedTables], trackers: tuple[str, ...], groups: SceneGroups) -> AuditSamples:
    share = max(1, MOST_SAMPLES // (len(used) * len(trackers)))
    parts = [_thinned(one.samples.filter(pl.col("tracker").is_in(trackers)), share) for one in used]
    interval = _interval_s(used)
    timed = interval is not None
    instants = [instants_of(one.cameras, one.poses, one.path if timed else None) for one in used]
    lengths = [len(one.poses) for one in instants]
    places = [start + one.place for start, one in zip(np.cumsum([0, *lengths[:-1]]), instants, strict=True)]
    cameras, camera = _cameras(pl.concat([one.cameras for one in instants]))
    unit = interval or 1.0
    times = [one.cameras["time_s" if timed else "frame"].to_numpy() / unit for one in instants]
    shutters = pl.concat([one.cameras.select("readout_s", "shutter_axis") for one in instants])
    table = pl.concat(parts)
    cluster, block, resampled, n_scenes = _clusters(table, groups)
    return AuditSamples(
        trackers=trackers,
        tracker=np.searchsorted(trackers, table["tracker"].to_list()).astype(np.intp),
        age=table["age"].to_numpy().astype(np.intp),
        cluster=cluster,
        block=block,
        resampled=resampled,
        n_scenes=n_scenes,
        birth=_placed(parts, places, "birth_frame"),
        now=_placed(parts, places, "frame"),
        uv_at_birth=table.select("u_birth_px", "v_birth_px").to_numpy(),
        observed=table.select("u_px", "v_px").to_numpy(),
        stated=table.select("u_true_px", "v_true_px").to_numpy(),
        depth=table["depth_m"].to_numpy(),
        paths=Paths.of(
            np.concatenate(times),
            np.concatenate([one.poses for one in instants]),
            np.repeat(np.arange(len(used)), lengths),
        ),
        cameras=cameras,
        camera=camera,
        readout_of=shutters["readout_s"].fill_null(0.0).to_numpy() / unit,
        axis_of=shutters["shutter_axis"].fill_null(1).to_numpy().astype(np.intp),
        interval_s=interval,
        z_depth_from=_z_depth_from(used),
    )


def _z_depth_from(used: Sequence[AuditedTables]) -> str | None:
    """What depths are known to be along z from; None where that is not known of any sequence.

    A correction of the kind of depth holds for all sequences of a run, so that one of them rules it out.
    """
    known = [one.z_depth_from for one in used if one.z_depth_from is not None]
    if not known:
        return None
    text = listing(dict.fromkeys(known))
    return text if len(known) == len(used) else f"{text}, in {len(known)} of {len(used)} sequences"


def _interval_s(used: Sequence[AuditedTables]) -> float | None:
    """Median time between frames, seconds; None where times of a sequence are unknown."""
    if not all(one.has_times for one in used):
        return None
    times = [one.cameras["time_s"] for one in used]
    gaps = np.concatenate([np.diff(one.to_numpy()) for one in times])
    return float(np.median(gaps)) if len(gaps) else 1.0


def _placed(parts: Sequence[pl.DataFrame], places: Sequence[NDArray[np.intp]], frame: str) -> NDArray[np.intp]:
    """Where the frames of samples are among the times of all sequences, (n,)."""
    return np.concatenate([place[part[frame].to_numpy()] for part, place in zip(parts, places, strict=True)])


def _thinned(table: pl.DataFrame, share: int) -> pl.DataFrame:
    """At most `share` rows of each tracker, chosen by a hash of track and frame."""
    hashed = scattered(scattered(table["track"].to_numpy()) ^ table["frame"].to_numpy().astype(np.uint64))
    ranked = table.with_columns(hashed=pl.Series(hashed))
    return ranked.filter(pl.col("hashed").rank("ordinal").over("tracker") <= share).drop("hashed")


def _cameras(table: pl.DataFrame) -> tuple[tuple[KnownCamera, ...], NDArray[np.intp]]:
    """The different cameras, and the place of each frame's camera among them."""
    columns = ["model", "width", "height", "fx_px", "fy_px", "cx_px", "cy_px", "distortion"]
    rows = [(*row[:-1], tuple(row[-1])) for row in table.select(columns).iter_rows()]
    places = {row: place for place, row in enumerate(dict.fromkeys(rows))}
    made = tuple(make_camera(row[0], row[1:3], row[3:7], row[7]) for row in places)
    return made, np.array([places[row] for row in rows], dtype=np.intp)


def _clusters(table: pl.DataFrame, groups: SceneGroups) -> tuple[NDArray[np.intp], NDArray[np.intp], Resampled, int]:
    """Cluster and block of tracks of each row, both without gaps.

    Clusters are groups, scenes, or the blocks within scenes where these are few.
    """
    scenes = table["scene"].unique().sort().to_list()
    scene = np.searchsorted(scenes, table["scene"].to_list())
    group = groups.of(table["dataset"][0] if table.height else "", scenes)
    resampled = scheme(group) or Resampled.blocks
    within = table["block"].to_numpy().astype(np.intp) // _BLOCKS_JOINED
    block = scene * (int(within.max(initial=0)) + 1) + within
    number = {Resampled.groups: group[scene], Resampled.blocks: block}.get(resampled, scene)
    cluster, block = (np.unique(one, return_inverse=True)[1].astype(np.intp) for one in (number, block))
    return cluster, block, resampled, len(scenes)
