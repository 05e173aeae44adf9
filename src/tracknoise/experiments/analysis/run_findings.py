"""Findings of a run from its statistics: intervals, tests, verdicts and sentences."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TypedDict

import polars as pl

from tracknoise.audit.pose_errors.pose_law import pose_law
from tracknoise.audit.pose_errors.rigid_share import rigid_share
from tracknoise.audit.usual import usual_mistakes
from tracknoise.experiments.analysis.finding_inputs import FindingInputs
from tracknoise.experiments.analysis.freed_memory import keep_freed_memory
from tracknoise.experiments.analysis.reference_condition import reference_condition
from tracknoise.experiments.analysis.run_audit import run_audit
from tracknoise.experiments.blas import one_blas_thread
from tracknoise.experiments.settings import FROM_FILES, Experiment
from tracknoise.findings.factors.dependence import dependence
from tracknoise.findings.factors.tracker_options import option_factors
from tracknoise.findings.fitted_noise import fitted_noise_table
from tracknoise.findings.growth.time_structure import LONG_LIVED, lagged, time_structure
from tracknoise.findings.headlines.document import findings_json
from tracknoise.findings.headlines.reported_conditions import ReportedConditions
from tracknoise.findings.headlines.table import headline_table
from tracknoise.findings.intervals.condition_table import Sampling
from tracknoise.findings.intervals.incidence import incidence_table
from tracknoise.findings.intervals.table import interval_table
from tracknoise.findings.places.image_cells import image_cells
from tracknoise.findings.places.speed_errors import speed_errors
from tracknoise.findings.places.surrounding_errors import surrounding_errors
from tracknoise.findings.point_tracking import point_tracking_metrics
from tracknoise.findings.sampling.groups import SceneGroups
from tracknoise.findings.sampling.groups_of_scenes import groups_of_scenes
from tracknoise.findings.seed_spread import Repeat, seed_spread, widened
from tracknoise.findings.shape.gaussianity import gaussianity
from tracknoise.findings.tracker_differences import tracker_differences
from tracknoise.findings.two_truths import pose_disagreement_table, two_truths_table
from tracknoise.findings.zero_mean import zero_mean
from tracknoise.noise_models.depth_intervals import depth_intervals
from tracknoise.noise_models.lookup.gains import noise_lookup
from tracknoise.noise_models.lookup.scene_sums import USED
from tracknoise.noise_models.run_models import fitted_models
from tracknoise.noise_models.window_noise import window_sigmas
from tracknoise.sequences.sequence import TRIANGULATED, TruthKind
from tracknoise.statistics.errors.change_curves import change_curves
from tracknoise.statistics.errors.curves import ASPECT_COLUMNS, aspect_curves
from tracknoise.statistics.factors.factors import ReferenceCondition
from tracknoise.statistics.grouping import in_chunks
from tracknoise.statistics.tracks.lifetimes import horizons
from tracknoise.statistics.trims import dropped_above
from tracknoise.tables.manifest import Manifest
from tracknoise.tables.schema import INCREMENTS
from tracknoise.tables.store import FINDINGS_JSON, RunFolder
from tracknoise.tables.views import identified, results_of

_OF_SEQUENCES: Mapping[str, tuple[str, Callable[..., pl.DataFrame]]] = {
    "triangulated_noise": ("fitted_noise", fitted_noise_table),
    "point_tracking_metrics": ("point_tracking", point_tracking_metrics),
    "two_truths": ("truth_differences", two_truths_table),
    "pose_disagreement": ("pose_differences", pose_disagreement_table),
    "rigid_share": ("rigid", rigid_share),
    "pose_law": ("pose_growth", pose_law),
    "tracker_differences": ("between_trackers", tracker_differences),
    "surrounding_errors": ("surroundings", surrounding_errors),
    "image_cells": ("image_map", image_cells),
    "speed_errors": ("image_speeds", speed_errors),
}
"""Findings that pool one table of each sequence, and nothing else: the table, and what makes them."""
_OF_DEPTHS = ("noise_tracks", "noise_sums", "window_noise")
_OF_PLACES = ("surrounding_errors", "image_cells", "speed_errors")
_ABOUT_ANCHORS = ("zero_mean", "gaussianity", "radii", "time_structure", *_OF_PLACES)
"""Findings about errors since a point was fixed. They are withheld where points are fitted to whole tracks."""


@one_blas_thread()
def compute_findings(run: RunFolder, experiment: Experiment, statistics: Mapping[str, pl.DataFrame]) -> None:
    """Compute the findings of a run from its scenes' moments, and write its results, findings and models.

    Parameters
    ----------
    run
        With at least one measured sequence.
    experiment
        Says where curves are cut, and which population errors are of.
    statistics
        What `tracknoise.experiments.analysis.run_statistics.compute_statistics` made of it.

    Raises
    ------
    StoreError, SchemaError
        If a table is damaged, or the folder cannot be written.
    """
    keep_freed_memory()
    manifest = run.manifest()
    reference = reference_condition(manifest, experiment, statistics["outliers"])
    tables = _tables(run, manifest, experiment, statistics, reference) | run_audit(run, manifest, experiment)
    reported = _reported(manifest, experiment, {**statistics, **tables}, reference)
    if reported.fitted:
        tables |= _without_verdicts_on_errors(tables)
    every = {**statistics, **tables}
    results = results_of(every)
    every["findings"] = headline_table(identified(results, every), reported)
    run.write_statistics(every, results=results, documents={FINDINGS_JSON: findings_json(every)})
    trackers = [tracker.label for tracker in experiment.trackers]
    run.write_statistics({}, documents=fitted_models(run, trackers, reference.speed))


def _without_verdicts_on_errors(tables: Mapping[str, pl.DataFrame]) -> dict[str, pl.DataFrame]:
    """The tables that lose rows where points are fitted to whole tracks, without these."""
    without_axis = tables["dependence"].filter(pl.col("axis").is_null())  # of lifetimes and outlier ratios
    return {**{name: tables[name].clear() for name in _ABOUT_ANCHORS}, "dependence": without_axis}


class _CurveOptions(TypedDict):
    kind: str
    level: float
    groups: SceneGroups
    key_frames: Mapping[str, int]
    min_features: int


def _tables(
    run: RunFolder,
    manifest: Manifest,
    experiment: Experiment,
    statistics: Mapping[str, pl.DataFrame],
    reference: ReferenceCondition,
) -> dict[str, pl.DataFrame]:
    population, least = experiment.truth.population, experiment.statistics.min_features
    pairs: list[pl.DataFrame] = []  # of changes
    lived: list[pl.DataFrame] = []
    groups = groups_of_scenes(manifest.sequences, experiment.dataset.groups)
    every = sorted(manifest.sequences)
    read = FindingInputs.read(run, manifest, population, reference, groups)
    pooled = _pooled_curves(run, every, least, read.few, pairs)
    asked, zeros = experiment.findings, reference.key_frames
    sampling = Sampling(asked.intervals, asked.level, groups)
    options: _CurveOptions = {
        "key_frames": zeros,
        "min_features": least,
        "kind": asked.intervals,
        "level": asked.level,
        "groups": groups,
    }
    aspects = _keeping(read.aspects, lived, lambda table: table.filter(LONG_LIVED))
    horizon = horizons(statistics["lifetimes"])
    intervals = _intervals(read, experiment, aspects, horizon)
    spread = seed_spread(intervals, _repeats(run, experiment), horizons=horizon, population=population)
    shapes = gaussianity(read.moments, run.stacked_tables("samples", every), **options)
    return {
        **pooled,
        "intervals": widened(intervals, spread, horizons=horizon),
        "seed_spread": spread,
        **_of_sequences(run, sampling),
        "incidence": incidence_table(read.ends, sampling),
        "zero_mean": zero_mean(
            read.moments, statistics["curves"], groups=groups, key_frames=zeros, population=population
        ),
        "gaussianity": shapes.gaussianity,
        "radii": shapes.radii,
        "time_structure": time_structure(  # after the intervals, which read the aspects
            read.moments, pairs, blocks=read.blocks, aspects=lived, aspect_blocks=read.aspect_blocks, **options
        ),
        "dependence": _dependence(read, experiment, statistics, zeros),
    }


def _pooled_curves(
    run: RunFolder, every: Sequence[str], least: int, few: pl.DataFrame, pairs: list[pl.DataFrame]
) -> dict[str, pl.DataFrame]:
    """Curves of aspects and of changes. What time structure needs of changes is kept in `pairs`: they are read once."""
    increments = in_chunks(run.stacked_tables("increments", every), INCREMENTS, "increments")
    moved = _keeping(increments, pairs, lambda table: lagged(table, few))
    return {
        "aspect_curves": aspect_curves(run.stacked_tables("aspects", every, only=ASPECT_COLUMNS), min_features=least),
        "changes": change_curves(moved),
    }


def _of_sequences(run: RunFolder, sampling: Sampling) -> dict[str, pl.DataFrame]:
    """Findings that need one table of every sequence that has it, and nothing else."""
    pooled = {name: pool(run.stored_tables(table), sampling) for name, (table, pool) in _OF_SEQUENCES.items()}
    windows = window_sigmas(run.stored_tables("window_noise"), run.stored_tables("window_blocks"), sampling)
    sums = run.stored_tables("noise_sums", only=USED)
    lookups = noise_lookup(sums, groups=sampling.groups, level=sampling.level)
    tracks, noise, observed = (run.stored_tables(name) for name in _OF_DEPTHS)
    depths = depth_intervals(tracks, noise, observed, sampling)
    return {**pooled, "window_sigmas": windows, "noise_lookup": lookups, "depth_intervals": depths}


def _intervals(
    read: FindingInputs, experiment: Experiment, aspects: Iterator[pl.DataFrame], horizon: pl.DataFrame
) -> pl.DataFrame:
    return interval_table(
        read.moments,
        read.ends,
        read.frames,
        blocks=read.blocks,
        aspects=aspects,
        changes=read.changes,
        aspect_blocks=read.aspect_blocks,
        scales=read.scales,
        scale_blocks=read.scale_blocks,
        groups=read.groups,
        restricted_to=horizon,
        population=experiment.truth.population,
        kind=experiment.findings.intervals,
        level=experiment.findings.level,
    )


def _repeats(run: RunFolder, experiment: Experiment) -> Iterator[Repeat]:
    """Tables of the scenes measured with each further random seed."""
    for seed in range(1, experiment.seeds):
        yield Repeat(
            **{
                name: (table.filter(seed=seed).drop("seed") for table in run.sequence_tables(f"seed_{name}"))
                for name in ("moments", "ends", "frames")
            }
        )


def _dependence(
    read: FindingInputs,
    experiment: Experiment,
    statistics: Mapping[str, pl.DataFrame],
    key_frames: Mapping[str, int],
) -> pl.DataFrame:
    return dependence(
        read.moments,
        read.scales,
        read.ends,
        read.frames,
        statistics["curves"],
        statistics["effects"],
        options=option_factors(_options(experiment)),
        groups=read.groups,
        key_frames=key_frames,
        population=experiment.truth.population,
        trimming=experiment.findings.trimming,
        margin=experiment.findings.margin,
        level=experiment.findings.level,
    )


def _options(experiment: Experiment) -> dict[str, tuple[str, Mapping[str, object]]]:
    """Kind and options of each tracker. Imported tracks are left out: their files come from any front end."""
    return {one.label: (one.kind, one.options) for one in experiment.trackers if one.kind not in FROM_FILES}


def _keeping(
    tables: Iterable[pl.DataFrame], kept: list[pl.DataFrame], part: Callable[[pl.DataFrame], pl.DataFrame]
) -> Iterator[pl.DataFrame]:
    """Each table, one at a time, of which a part is kept."""
    for table in tables:
        kept.append(part(table))
        yield table


def _reported(
    manifest: Manifest, experiment: Experiment, tables: Mapping[str, pl.DataFrame], reference: ReferenceCondition
) -> ReportedConditions:
    truths = {entry.truth for entry in manifest.sequences.values()}
    return ReportedConditions(
        reference,
        [tracker.label for tracker in experiment.trackers],
        population=experiment.truth.population,
        percentile=dropped_above(tables["trims"]),
        recorded=truths != {TruthKind.raycast},
        fitted=TRIANGULATED in truths,
        groups=groups_of_scenes(manifest.sequences, experiment.dataset.groups),
        trimming=experiment.findings.trimming,
        doubts=doubts_by_scene(manifest),
        mistakes=usual_mistakes(tables["audit"]),
    )


def doubts_by_scene(manifest: Manifest) -> dict[str, list[str]]:
    """Why data look wrong, by scene; scenes without doubts are left out."""
    found: dict[str, list[str]] = {}
    for _, entry in sorted(manifest.sequences.items()):
        if entry.doubts:
            found.setdefault(entry.sequence.scene, []).extend(entry.doubts)
    return {scene: list(dict.fromkeys(sentences)) for scene, sentences in found.items()}
