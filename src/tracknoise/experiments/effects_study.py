"""Effects of cameras and of faults of the truth on what is measured, each alone at three sizes.

Sequences of a scene advance together, so that images are rendered and tracked once. An interrupted study resumes.
"""

import io
import json
import shutil
import tomllib
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from collections.abc import Sequence as Items
from dataclasses import asdict, dataclass, field
from functools import cache
from hashlib import blake2b
from importlib import resources
from itertools import repeat
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import SettingsError, StoreError, UnknownNameError, first_line
from tracknoise.experiments.measure import Measurement, measure_together
from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.inference.conventions import LEVEL
from tracknoise.inference.paired_differences import average, half_widths_alone
from tracknoise.inference.units import Resampled
from tracknoise.processes import process_pool
from tracknoise.sequences.reader_registry import make_reader
from tracknoise.sequences.sequence import Sequence, TruthKind
from tracknoise.sequences.simulated import Simulated
from tracknoise.simulation.render import Optics, Poses, RenderedWorld
from tracknoise.statistics.lifetimes import lifetimes, median_survival
from tracknoise.statistics.scales import scales
from tracknoise.tables.defaults import POPULATION, TRIM_AMONG, TRIM_PERCENTILE
from tracknoise.tables.enumerations import Axis, Trimming
from tracknoise.tables.files import require_no_links, write_atomically
from tracknoise.tables.findings_schema import CLEAN, EFFECT_CHANGES, EFFECT_UNITS, EFFECT_VALUES, EffectStatistic, Size
from tracknoise.tables.schema import check, check_stored
from tracknoise.trackers.tracker import Frame, SequenceContext, Step, Tracker, TrackerSettings, reports_causes
from tracknoise.trackers.tracker_registry import make_tracker

Options = Mapping[str, Any]
"""Options of the reader ``simulated``."""


@dataclass(frozen=True, slots=True)
class Effect:
    """One effect."""

    name: str  # its name
    kind: str  # whether it changes `images` or the stated `truth`
    source: str  # where its sizes come from
    # options, shown: what is changed at each size, and the size as text
    options: Mapping[Size, Options]
    shown: Mapping[Size, str]


@cache
def catalogue() -> tuple[Effect, ...]:
    """All effects, in an order in which those that share rendered images follow one another."""
    return tuple(_effect(entry) for entry in _read_catalogue()["effect"])


def base_options() -> Options:
    """Options of the clean sequences."""
    options: Options = _read_catalogue()["base"]
    return options


def chosen_effects(names: list[str] | None) -> tuple[Effect, ...]:
    """Effects by name; None for all.

    Raises
    ------
    SettingsError
        If there is no name.
    UnknownNameError
        If there is no effect of a name.
    """
    known = {effect.name: effect for effect in catalogue()}
    if names == []:
        raise SettingsError(f"no name of an effect, expected some of {', '.join(known)}")
    for name in names or []:
        if name not in known:
            raise UnknownNameError("effect", name, known)
    return tuple(effect for effect in catalogue() if names is None or effect.name in names)


def merged(options: Options, changes: Options) -> dict[str, Any]:
    """Options with changes, also in nested settings."""
    both = {**options, **changes}
    nested = {name for name in options.keys() & changes.keys() if isinstance(options[name], Mapping)}
    return {**both, **{name: merged(options[name], changes[name]) for name in nested}}


def _effect(entry: Mapping[str, Any]) -> Effect:
    changes = {size: {name: value for name, value in entry[size].items() if name != "shown"} for size in Size}
    shown = {size: entry[size]["shown"] for size in Size}
    return Effect(entry["name"], entry["kind"], entry["source"], changes, shown)


def _read_catalogue() -> dict[str, Any]:
    return tomllib.loads((resources.files("tracknoise.experiments") / "effects.toml").read_text("utf-8"))


_Steps = dict[tuple[int, bytes], Step]


@dataclass(frozen=True, slots=True)
class SharedTracker:
    """A tracker for sequences that advance together, of which some have the same images.

    Parameters
    ----------
    settings
        The tracker. Its results must depend on images only, so that it cannot be an oracle.
    """

    kind: ClassVar[str] = "shared"
    description: ClassVar[str] = "another tracker that several sequences share"

    settings: TrackerSettings
    _steps: _Steps = field(default_factory=dict, compare=False, repr=False)

    @property
    def reports_causes(self) -> bool:
        """As the tracker itself: see `tracknoise.trackers.tracker.reports_causes`."""
        return reports_causes(self.settings)

    def start(self, context: SequenceContext) -> Tracker:
        """Start the tracker on one of the sequences."""
        return _Shared(self.settings.start(context), self._steps)


class _Shared:
    """A tracker on one sequence, and the steps of the current frame by the images up to it."""

    def __init__(self, tracker: Tracker, steps: _Steps) -> None:
        self._tracker, self._steps = tracker, steps
        self._unseen: list[Frame] = []
        self._seen = b""

    def step(self, frame: Frame) -> Step:
        """Track into the next frame, or take over what was tracked in the same images."""
        self._seen = blake2b(self._seen + frame.image.tobytes()).digest()
        self._unseen.append(Frame(frame.index, frame.image))
        key = frame.index, self._seen
        if key not in self._steps:
            for past in [past for past in self._steps if past[0] != frame.index]:
                del self._steps[past]
            *_, self._steps[key] = map(self._tracker.step, self._unseen)
            self._unseen.clear()
        return self._steps[key]


class SharedWorld(RenderedWorld):
    """As `RenderedWorld`, but remembers the last image and the last depth map, with the poses that they belong to."""

    def irradiance(self, optics: Optics, exposures: Iterable[Poses]) -> NDArray[np.float32]:
        """See `RenderedWorld.irradiance`."""
        listed = list(exposures)
        key = (optics, *(poses.tobytes() for poses in listed))
        if self._image is None or self._image[0] != key:
            self._image = key, super().irradiance(optics, listed)
        return self._image[1]

    def depth(self, camera: CameraModel, poses: Poses) -> DepthMap:
        """See `RenderedWorld.depth`."""
        key = camera, poses.tobytes()
        if self._depth is None or self._depth[0] != key:
            self._depth = key, super().depth(camera, poses)
        return self._depth[1]

    _image: tuple[Hashable, NDArray[np.float32]] | None = None
    _depth: tuple[Hashable, DepthMap] | None = None


_ERRORS = {"trimming": Trimming.trimmed, "axis": Axis.age}


@dataclass(frozen=True, slots=True)
class Study:
    """What is measured."""

    options: Options  # of the reader ``simulated``, without any effect
    effects: tuple[Effect, ...]  # the effects
    # options of each tracker, by its kind
    trackers: Mapping[str, Mapping[str, Any]] = field(
        default_factory=lambda: {"lucas-kanade": {}, "correspondence": {}}
    )
    sizes: tuple[Size, ...] = tuple(Size)  # sizes of the effects
    ages: tuple[int, ...] = (10,)  # ages at which errors are compared, in frames
    # population, trim_percentile, trim_among: which errors, and of which tracks: see `tracknoise.measure`
    population: str = POPULATION
    trim_percentile: float = TRIM_PERCENTILE
    trim_among: str = TRIM_AMONG

    @property
    def reader(self) -> Simulated:
        """The reader of clean sequences."""
        return simulated_reader(self.options)

    def changed(self, effect: Effect, size: Size) -> Simulated:
        """The reader of sequences with an effect."""
        return simulated_reader(merged(self.options, effect.options[size]))


def simulated_reader(options: Options) -> Simulated:
    """The reader of simulated sequences."""
    made = make_reader(Simulated.name, None, options)
    assert isinstance(made, Simulated)
    return made


def measure_scene(study: Study, scene: str, size: Size) -> pl.DataFrame:
    """Values of every effect at one size in one scene, and without effects. Returns schema `EFFECT_VALUES`."""
    opened = _sequences(study, scene, size)
    trackers = {kind: SharedTracker(make_tracker(kind, options)) for kind, options in study.trackers.items()}
    measured = measure_together(
        [*opened.values()],
        trackers,
        truth=TruthKind.birth,
        population=study.population,
        trim_percentile=study.trim_percentile,
        trim_among=study.trim_among,
    )
    rows = [
        {"scene": scene, "effect": effect, "size": size, **row}
        for effect, measurement in zip(opened, measured, strict=True)
        for row in _values(measurement, study.ages)
    ]
    return check(pl.DataFrame(rows, schema=dict(EFFECT_VALUES)), EFFECT_VALUES, "effect values")


def _sequences(study: Study, scene: str, size: Size) -> dict[str, Sequence]:
    """Sequences by effect, in one world."""
    readers = {CLEAN: study.reader, **{effect.name: study.changed(effect, size) for effect in study.effects}}
    world = SharedWorld(study.reader.scenery_of(scene))
    name = next(item for item in study.reader.sequences() if item.scene == scene)
    return {effect: reader.open_in(world, name) for effect, reader in readers.items()}


def _values(measurement: Measurement, ages: Items[int]) -> list[dict[str, Any]]:
    """Rows of one sequence: tracker, age, statistic and value."""
    trackers = measurement.frames["tracker"].unique(maintain_order=True)
    cores = scales(measurement.prepared)
    rows = []
    for tracker in trackers:
        of_tracks = _of_tracks(measurement, tracker)
        for age in ages:
            errors = {"population": measurement.population, "tracker": tracker, "at": age, **_ERRORS}
            moments, core = (table.filter(**errors) for table in (measurement.moments, cores))
            values = {**_of_errors(moments, core), **of_tracks}
            condition = {"tracker": tracker, "age": age}
            rows += [{**condition, "statistic": name, "value": values.get(name)} for name in EffectStatistic]
    return rows


def _of_errors(moments: pl.DataFrame, cores: pl.DataFrame) -> dict[str, float | None]:
    """Statistics of errors of one age; none where no track lived so long."""
    if moments.is_empty():
        return {}
    (row,), (core,) = moments.to_dicts(), cores.to_dicts()
    mean_u, mean_v = row["mean_u"], row["mean_v"]
    core_u, core_v = core["core_u_px"], core["core_v_px"]
    return {
        EffectStatistic.mean_u: mean_u,
        EffectStatistic.mean_v: mean_v,
        EffectStatistic.second_moment: (row["m_uu"] + row["m_vv"]) / row["n"] + mean_u**2 + mean_v**2,
        EffectStatistic.core: None if core_u is None or core_v is None else float(np.sqrt(core_u * core_v)),
    }


def _of_tracks(measurement: Measurement, tracker: str) -> dict[str, float | None]:
    """Median lifetime and outlier ratio."""
    median = median_survival(lifetimes(measurement.tracks.filter(tracker=tracker)))["median_lifetime"].item()
    frames = measurement.frames.filter(tracker=tracker)
    offered = int(frames["offered"].sum())
    return {
        EffectStatistic.lifetime: None if median is None else float(median),
        EffectStatistic.outlier_ratio: int(frames["outliers"].sum()) / offered if offered else None,
    }


_POINT = ["effect", "size", "tracker", "age", "statistic"]
_SCENE = ["scene", "size", "tracker", "age", "statistic"]


def paired_changes(values: pl.DataFrame, *, level: float = LEVEL) -> pl.DataFrame:
    """Changes within scenes, averaged over scenes, with Student's intervals.

    Returns: effect, size, tracker, age and statistic in the order of the values, then clean, changed, change,
    change_low, change_high and n_scenes: see `EFFECT_CHANGES`. Scenes in which one of the two values is missing take no
    part.
    """
    checked = check(values, EFFECT_VALUES, "effect values")
    clean = checked.filter(effect=CLEAN).select_seq(*_SCENE, clean="value")
    pairs = checked.filter(pl.col("effect") != CLEAN).join(clean, on=_SCENE, how="left", maintain_order="left")
    points = pairs.select_seq(_POINT).unique(maintain_order=True).with_row_index("point")
    placed = pairs.join(points, on=_POINT, maintain_order="left").with_columns_seq(pl.col("scene").rank("dense") - 1)
    before, after = (_matrix(placed, column, points.height) for column in ("clean", "value"))
    known = np.where(np.isnan(before + after), np.nan, 0.0)
    means = [_mean(array + known) for array in (before, after)]
    found = average(after - before, np.zeros(len(before), np.intp), Resampled.scenes)
    width = np.where(found.n_scenes > 1, half_widths_alone(found, 1.0 - level), np.nan)
    change = np.where(found.n_scenes > 0, found.mean, np.nan)
    columns = {"clean": means[0], "changed": means[1], "change": change}
    columns |= {"change_low": change - width, "change_high": change + width}
    return points.drop("point").with_columns_seq(
        **{name: pl.Series(column, nan_to_null=True) for name, column in columns.items()},
        n_scenes=pl.Series(found.n_scenes, dtype=pl.Int32),
    )


def _matrix(placed: pl.DataFrame, column: str, count: int) -> NDArray[np.float64]:
    """(scenes, points) float64; NaN where there is no value."""
    scenes, points = placed["scene"].to_numpy(), placed["point"].to_numpy()
    matrix = np.full((int(scenes.max()) + 1 if len(scenes) else 0, count), np.nan)
    matrix[scenes, points] = placed[column].cast(pl.Float64).fill_null(np.nan).to_numpy()
    return matrix


def _mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of the scenes that have a value; NaN where none has."""
    there = ~np.isnan(values)
    count = there.sum(axis=0)
    return np.asarray(np.where(there, values, 0.0).sum(axis=0) / np.where(count > 0, count, np.nan))


_SETTINGS, _SCENES = "settings.json", "scenes"

Part = tuple[str, Size]
"""A scene and a size of effects, which are measured together."""


def run_study(
    study: Study, folder: Path, *, workers: int = 1, fresh: bool = False, done: Callable[[Part, int, int], None]
) -> pl.DataFrame:
    """Measure a study, or what is missing of it, and compare.

    Parameters
    ----------
    study
        What is measured.
    folder
        New or empty, or that of a study with the same settings, which may have another number of scenes.
    workers
        Number of processes.
    fresh
        Delete what the folder holds of another study.
    done
        Called for each part that is measured, with how many parts are done, and the count of all.

    Returns
    -------
    polars.DataFrame
        Schema `EFFECT_CHANGES`.

    Raises
    ------
    SettingsError
        If the sequences are too short for the ages.
    StoreError
        If the folder holds something else, or cannot be written.
    """
    oldest, frames = max(study.ages), study.reader.frames
    if oldest >= frames:
        raise SettingsError(f"age {oldest} of {frames} frames, expected an age of at most {frames - 1}")
    _prepare(folder, study, fresh=fresh)
    parts = [(name.scene, size) for name in study.reader.sequences() for size in study.sizes]
    missing = [part for part in parts if not _file(folder, part).exists()]
    for count, (part, values) in enumerate(_measured(study, missing, workers), len(parts) - len(missing) + 1):
        write_atomically(_file(folder, part), values)
        done(part, count, len(parts))
    return _changes(study, pl.concat([_read_scene(_file(folder, part)) for part in parts]))


def _measured(study: Study, parts: list[Part], workers: int) -> Iterator[tuple[Part, bytes]]:
    """Tables of the parts as Parquet files, in order."""
    if workers == 1 or len(parts) < 2:
        yield from ((part, _measure(study, part)) for part in parts)
        return
    with process_pool(min(workers, len(parts))) as pool:
        yield from zip(parts, pool.map(_measure, repeat(study), parts), strict=True)


def _measure(study: Study, part: Part) -> bytes:
    buffer = io.BytesIO()
    measure_scene(study, *part).write_parquet(buffer)
    return buffer.getvalue()


def _changes(study: Study, values: pl.DataFrame) -> pl.DataFrame:
    """Changes with the texts of the effects, in the order of the catalogue."""
    rows = [(effect.name, effect.kind, size, effect.shown[size]) for effect in study.effects for size in study.sizes]
    schema = {name: EFFECT_CHANGES[name] for name in ("effect", "kind", "size", "shown")}
    named = pl.DataFrame(rows, schema=schema, orient="row")
    units = pl.col("statistic").cast(pl.String).replace_strict({str(name): unit for name, unit in EFFECT_UNITS.items()})
    changes = named.join(paired_changes(values), on=["effect", "size"], maintain_order="left_right")
    return check(changes.with_columns(unit=units).select(*EFFECT_CHANGES), EFFECT_CHANGES, "effect changes")


def _prepare(folder: Path, study: Study, *, fresh: bool) -> None:
    """Make the folder, and refuse one with other settings."""
    settings, path = _settings(study), folder / _SETTINGS
    known = path.exists()
    if not known and folder.is_dir() and any(folder.iterdir()):
        raise StoreError(f"{folder}: holds other files, expected a new or empty folder, or a study of effects")
    if known and not fresh and path.read_bytes() != settings:
        raise StoreError(f"{folder}: holds a study with other settings, expected the same, another folder or --fresh")
    require_no_links(folder)
    if fresh or not known:
        shutil.rmtree(folder / _SCENES, ignore_errors=True)
        write_atomically(path, settings)


def _settings(study: Study) -> bytes:
    """What results depend on; not the number of scenes."""
    options = {name: value for name, value in study.options.items() if name != "worlds"}
    content = json.dumps({**asdict(study), "options": options}, indent=1, default=dict)
    return content.encode()


def _file(folder: Path, part: Part) -> Path:
    scene, size = part
    return folder / _SCENES / f"{scene}-{size}.parquet"


def _read_scene(path: Path) -> pl.DataFrame:
    """One part."""
    try:
        return check_stored(pl.read_parquet(path), EFFECT_VALUES, path.name)
    except (OSError, pl.exceptions.PolarsError) as error:
        found = f"damaged ({first_line(error)})"
        raise StoreError(f"{path}: {found}, expected a table; delete it to measure again") from error
