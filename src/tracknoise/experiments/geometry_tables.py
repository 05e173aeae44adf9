"""Tables of a sequence that need its poses and cameras beside its observations, such as what the audit needs of it."""

from typing import get_args

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.experiments.settings import SYNTHETIC, Experiment
from tracknoise.geometry.cameras import CameraModel, KnownCamera, coefficients_of, model_of
from tracknoise.geometry.pose import invert, position_rows, transform
from tracknoise.geometry.projection import FrameGeometry
from tracknoise.processes import release_memory
from tracknoise.sequences.other_poses import path_between_frames
from tracknoise.sequences.sequence import TRIANGULATED, Sequence, TruthKind, camera_at, second_of, shutter_of, times_of
from tracknoise.statistics.noise_sums import noise_tables
from tracknoise.statistics.own_covariances import covariance_sums
from tracknoise.statistics.pair_sums import pair_sums
from tracknoise.statistics.places import image_map
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.statistics.samples import audited_observations, births_with_depth
from tracknoise.statistics.windows import noise_tracks, pair_tracks, window_noise
from tracknoise.tables.findings_schema import AUDIT_SAMPLES, CAMERAS, DEPTH_REPEATS, PATH
from tracknoise.tables.identity import Direction
from tracknoise.tables.schema import POSES, QUALITY_PREFIX, RIG, SEQUENCE, Schema, check, empty, of_second_camera
from tracknoise.truth.beside import beside
from tracknoise.truth_faults.depth_repeats import depth_repeats
from tracknoise.truth_faults.pose_errors import rigid_tables


def frame_geometry(sequence: Sequence, n_frames: int) -> FrameGeometry:
    """Stated poses and cameras of the first frames of a sequence."""
    numbers: dict[CameraModel, int] = {}
    which = [numbers.setdefault(camera_at(sequence, index), len(numbers)) for index in range(n_frames)]
    return FrameGeometry(sequence.world_from_camera[:n_frames], tuple(numbers), np.array(which, np.intp))


_SIGHT = ("u_birth_px", "v_birth_px", "depth_m")


def cameras_table(sequence: Sequence, n_frames: int) -> pl.DataFrame:
    """Table `CAMERAS` of the first frames of a sequence."""
    times, shutter = times_of(sequence), shutter_of(sequence)
    constant = {name: getattr(sequence.id, name) for name in SEQUENCE}
    rows = [
        {
            **constant,
            "frame": frame,
            "time_s": None if times is None else float(times[frame]),
            **_camera(camera_at(sequence, frame)),
            "readout_s": shutter.readout_s if shutter else None,
            "shutter_axis": shutter.axis if shutter else None,
        }
        for frame in range(n_frames)
    ]
    return pl.DataFrame(rows, schema=dict(CAMERAS))


def _camera(camera: CameraModel) -> dict[str, object]:
    """Columns of a camera; those of the lens only for the models that can be made from them again."""
    size: dict[str, object] = {"width": camera.width, "height": camera.height}
    if type(camera) not in get_args(KnownCamera):
        return size
    assert isinstance(camera, KnownCamera)
    intrinsics = {f"{name}_px": getattr(camera, name) for name in ("fx", "fy", "cx", "cy")}
    return {**size, "model": model_of(camera), **intrinsics, "distortion": list(coefficients_of(camera))}


def audit_samples(sequence: Sequence, prepared: PreparedSequence, truth: str) -> pl.DataFrame:
    """Table `AUDIT_SAMPLES` of a sequence.

    It is empty for views that are turned or played backward, whose truth is that of the upright view, and where points
    are fitted to the tracks.
    """
    upright = sequence.id.rotation == 0 and sequence.id.direction == Direction.forward
    if not upright or truth == TRIANGULATED:
        return empty(AUDIT_SAMPLES)
    samples = audited_observations(prepared)
    if prepared.key_frame is not None:
        samples = _anchored_at(samples, sequence, prepared.observations, prepared.key_frame)
    table = samples.select(pl.col(name).cast(kind) for name, kind in AUDIT_SAMPLES.items())
    return check(table, AUDIT_SAMPLES, "audit_samples")


def depth_repeats_table(sequence: Sequence, prepared: PreparedSequence) -> pl.DataFrame:
    """Table `DEPTH_REPEATS` of a sequence, by the features of all trackers."""
    births = births_with_depth(prepared)
    uv, depth_m = births.select("u_birth_px", "v_birth_px").to_numpy(), births["depth_m"].to_numpy()
    repeats = depth_repeats(sequence, births["birth_frame"].to_numpy().astype(np.intp), uv, depth_m)
    labels = {column: [getattr(sequence.id, column)] * len(repeats.depth_m) for column in SEQUENCE}
    columns = {**labels, "depth_m": repeats.depth_m, "relative_sd": repeats.relative}
    return pl.DataFrame(columns, schema=dict(DEPTH_REPEATS))


def _anchored_at(samples: pl.DataFrame, sequence: Sequence, observations: pl.DataFrame, key_frame: int) -> pl.DataFrame:
    """Observations of tracks that were found in the key frame, with its number, and their position and depth there."""
    key = ["tracker", "speed", "track"]
    there = observations.filter(pl.col("frame") == key_frame)
    at_key = there.select(*key, u_key_px="u_true_px", v_key_px="v_true_px").drop_nulls()
    joined = samples.join(at_key, on=key, how="inner", maintain_order="left")
    births = joined["birth_frame"].to_numpy().astype(np.intp)
    depth = _depth_in(sequence, key_frame, births, joined.select(_SIGHT).to_numpy())
    renamed = joined.with_columns(
        birth_frame=pl.lit(key_frame, dtype=pl.UInt32),
        u_birth_px="u_key_px",
        v_birth_px="v_key_px",
        depth_m=pl.Series(depth, nan_to_null=True),
    )
    return renamed.filter(pl.col("depth_m").is_not_null())


def _depth_in(
    sequence: Sequence, frame: int, births: NDArray[np.intp], sight: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Depth in one frame of points that others show at u, v with a depth, (n, 3)."""
    depth = np.full(len(births), np.nan)
    poses = sequence.world_from_camera
    for birth in np.unique(births).tolist():
        rows = births == birth
        points = camera_at(sequence, birth).unproject(sight[rows, :2], sight[rows, 2])
        depth[rows] = transform(invert(poses[frame]) @ poses[birth], points)[:, 2]
    return depth


_POSITION = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")


def geometry_tables(
    experiment: Experiment, sequence: Sequence, prepared: PreparedSequence, n_frames: int, truth: str
) -> dict[str, pl.DataFrame]:
    """Poses, cameras, samples for the audit, pose errors, noise of windows, and the map of the image, by name."""
    of_images = [choice.label for choice in experiment.trackers if choice.kind not in SYNTHETIC]
    geometry, camera = frame_geometry(sequence, n_frames), sequence.camera
    beside_it = of_second_camera(prepared.observations)
    labels = [choice.label for choice in experiment.trackers]
    first = prepared.of_trackers([label for label in labels if label not in beside_it]) if beside_it else prepared
    tables = _of_errors(first, geometry, experiment.truth.population, truth)
    if beside_it:
        of_second = prepared.of_trackers(beside_it), frame_geometry(beside(sequence), n_frames)
        more = _of_errors(*of_second, experiment.truth.population, truth)
        tables = {name: _together(tables[name], more[name]) for name in tables}
        tables |= {"pair_sums": pair_sums(of_second[0]), "rig": rig_table(sequence)}
        if truth != TRIANGULATED:
            tables["pair_tracks"] = pair_tracks(of_second[0], population=experiment.truth.population)
    return {
        **camera_tables(sequence, n_frames),
        "audit_samples": audit_samples(sequence, first, truth),
        "image_map": image_map(prepared, width=camera.width, height=camera.height),
        **rigid_tables(first, geometry, witnesses=of_images),
        **tables,
        **({"depth_repeats": depth_repeats_table(sequence, first)} if truth == TruthKind.birth else {}),
    }


def _of_errors(
    prepared: PreparedSequence, geometry: FrameGeometry, population: str, truth: str
) -> dict[str, pl.DataFrame]:
    """Tables of the noise of trackers of one camera."""
    with_depth = truth != TRIANGULATED
    tables = window_noise(prepared, geometry, population=population, with_depth=with_depth)
    tables = {**tables, "covariance_sums": covariance_sums(prepared, geometry)}
    return {**tables, **(_of_depth(prepared, geometry, population) if with_depth else {})}


def camera_tables(sequence: Sequence, n_frames: int) -> dict[str, pl.DataFrame]:
    """Poses and cameras by name, which do not depend on what trackers saw."""
    return {
        "poses": poses_table(sequence, n_frames),
        **_path(sequence, n_frames),
        "cameras": cameras_table(sequence, n_frames),
    }


def rig_table(sequence: Sequence) -> pl.DataFrame:
    """Table `RIG` of a sequence with a second camera."""
    second = second_of(sequence)
    assert second is not None, "it has one"
    labels = {name: [getattr(sequence.id, name)] for name in SEQUENCE}
    camera = {name: [value] for name, value in _camera(second.camera).items() if name in RIG}
    place = dict(zip(_POSITION, position_rows(second.first_from_second[None]).T, strict=True))
    rows = {name: {**labels, **camera, **place}.get(name, [None]) for name in RIG}
    return pl.DataFrame(rows, schema=dict(RIG))


def _together(first: pl.DataFrame, second: pl.DataFrame) -> pl.DataFrame:
    """Rows of both cameras; what trackers report of observations comes last, in alphabetical order."""
    both = pl.concat([first, second], how="diagonal")
    quality = sorted(name for name in both.columns if name.startswith(QUALITY_PREFIX))
    return both.select(pl.exclude(quality), *quality)


def _of_depth(prepared: PreparedSequence, geometry: FrameGeometry, population: str) -> dict[str, pl.DataFrame]:
    """Tables that need the depths of points."""
    release_memory()
    tracks = noise_tracks(prepared, geometry, population=population)
    return {**noise_tables(prepared, geometry), "noise_tracks": tracks}


def poses_table(sequence: Sequence, n_frames: int) -> pl.DataFrame:
    """Table `POSES` of the frames that were read."""
    frames = pl.Series("frame", np.arange(n_frames))
    return _posed(sequence, frames, sequence.world_from_camera[:n_frames], POSES)


def _path(sequence: Sequence, n_frames: int) -> dict[str, pl.DataFrame]:
    """Table `PATH`, where the recording has poses at other times than those of the frames that were read."""
    path = path_between_frames(sequence, n_frames)
    return {} if path is None else {"path": _posed(sequence, pl.Series("time_s", path.times), path.poses, PATH)}


def _posed(sequence: Sequence, at: pl.Series, poses: NDArray[np.float64], columns: Schema) -> pl.DataFrame:
    """A table of poses (n, 4, 4) of a sequence at frames or times."""
    rows = zip(_POSITION, position_rows(poses).T, strict=True)
    values = {name: pl.Series(row, nan_to_null=True) for name, row in rows}
    labels = {column: [getattr(sequence.id, column)] * len(at) for column in SEQUENCE}
    return pl.DataFrame({**labels, at.name: at, **values}, schema=dict(columns))
