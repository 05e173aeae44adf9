"""Measure one scene with every effect at one size. Sequences advance together, so that images are rendered once."""

from collections.abc import Mapping
from collections.abc import Sequence as Items
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import polars as pl

from tracknoise.experiments.effects.catalogue import Effect, Options, merged
from tracknoise.experiments.effects.shared_tracker import SharedTracker
from tracknoise.experiments.effects.shared_world import SharedWorld
from tracknoise.experiments.measure import Measurement, measure_together
from tracknoise.measurement.tracking import Progress
from tracknoise.sequences.registry import make_reader
from tracknoise.sequences.sequence import Sequence, TruthKind
from tracknoise.sequences.simulated import Simulated
from tracknoise.statistics.errors.scales import scales
from tracknoise.statistics.tracks.lifetimes import lifetimes, median_survival
from tracknoise.tables.defaults import POPULATION, TRIM_AMONG, TRIM_PERCENTILE
from tracknoise.tables.effects_schema import CLEAN, EFFECT_VALUES, EffectStatistic, Size
from tracknoise.tables.enumerations import Axis, Trimming
from tracknoise.tables.schema import check
from tracknoise.trackers.registry import make_tracker

_ERRORS = {"trimming": Trimming.trimmed, "axis": Axis.age}


@dataclass(frozen=True, slots=True)
class Study:
    """What is measured.

    Attributes
    ----------
    options
        Of the reader ``simulated``, without any effect.
    effects
        The effects.
    trackers
        Options of each tracker, by its kind.
    sizes
        Sizes of the effects.
    ages
        Ages at which errors are compared, in frames.
    population, trim_percentile, trim_among
        Which errors, and of which tracks: see `tracknoise.measure`.
    """

    options: Options
    effects: tuple[Effect, ...]
    trackers: Mapping[str, Mapping[str, Any]] = field(
        default_factory=lambda: {"lucas-kanade": {}, "correspondence": {}}
    )
    sizes: tuple[Size, ...] = tuple(Size)
    ages: tuple[int, ...] = (10,)
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


def measure_scene(study: Study, scene: str, size: Size, *, progress: Progress | None = None) -> pl.DataFrame:
    """Values of every effect at one size in one scene, and without effects.

    Parameters
    ----------
    study
        What is measured.
    scene
        Name of the scene.
    size
        Size of the effects.
    progress
        Called after each frame.

    Returns
    -------
    polars.DataFrame
        Schema `EFFECT_VALUES`.
    """
    opened = _sequences(study, scene, size)
    trackers = {kind: SharedTracker(make_tracker(kind, options)) for kind, options in study.trackers.items()}
    measured = measure_together(
        [*opened.values()],
        trackers,
        truth=TruthKind.birth,
        population=study.population,
        trim_percentile=study.trim_percentile,
        trim_among=study.trim_among,
        progress=progress,
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
    world = SharedWorld(partial(study.reader.build, scene))
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
