"""Findings of a run from its statistics: intervals, tests, verdicts, and sentences.

A scene counts where it has what is pooled. One whose images show no features has frames only, and a tracker may be
missing in some scenes of a view.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypedDict

import polars as pl

from tracknoise.analysis.condition_units import Sampling, groups_of_scenes
from tracknoise.analysis.covariance_verdicts import allowing_for_truth, own_covariances
from tracknoise.analysis.curve_intervals import interval_table
from tracknoise.analysis.factor_values import option_factors
from tracknoise.analysis.factors import dependence
from tracknoise.analysis.gaussianity import gaussianity
from tracknoise.analysis.lifetime_intervals import incidence_table
from tracknoise.analysis.places_found import image_cells, speed_errors, surrounding_errors
from tracknoise.analysis.ranking import LEAST_TRACKERS, ranking
from tracknoise.analysis.ratio_intervals import point_tracking_metrics, ratio_intervals
from tracknoise.analysis.seed_spread import Repeat, seed_spread, widened
from tracknoise.analysis.time_structure import LONG_LIVED, lagged, time_structure
from tracknoise.analysis.truth_shares import (
    fitted_noise_table,
    pose_disagreement_table,
    tracker_differences,
    two_truths_table,
)
from tracknoise.analysis.zero_mean import zero_mean
from tracknoise.estimators.depth_intervals import depth_intervals
from tracknoise.estimators.lookup_table import USED, noise_lookup
from tracknoise.estimators.run_models import RunModels, advice_table, fitted_models
from tracknoise.estimators.training import RunTruth
from tracknoise.estimators.window_noise import window_sigmas
from tracknoise.experiments.local_workers import beside
from tracknoise.experiments.machine import keep_freed_memory, one_blas_thread
from tracknoise.experiments.reference_kinds import KindTables, read_kind_tables
from tracknoise.experiments.run_statistics import reference_condition
from tracknoise.experiments.run_truth import run_audit, trust_table
from tracknoise.experiments.settings import FROM_FILES, Experiment
from tracknoise.inference.units import SceneGroups, scheme
from tracknoise.phrases.headline import ReportedConditions
from tracknoise.phrases.headlines import findings_json, headline_table
from tracknoise.sequences.sequence import TRIANGULATED
from tracknoise.statistics.changes import change_curves
from tracknoise.statistics.curves import ASPECT_COLUMNS, aspect_curves
from tracknoise.statistics.definitions import POOLED, dropped_above
from tracknoise.statistics.grouping import (
    Condition,
    TablesByCondition,
    by_condition,
    in_chunks,
    number_names,
    without_blocks,
)
from tracknoise.statistics.lifetimes import horizons
from tracknoise.statistics.yardstick import ReferenceCondition
from tracknoise.tables.enumerations import Population
from tracknoise.tables.findings_schema import RANKS
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.manifest import Manifest
from tracknoise.tables.quantities import Topic
from tracknoise.tables.result_views import Identified, results_of
from tracknoise.tables.results import beside_untrusted_truth
from tracknoise.tables.schema import ENDS, INCREMENTS, ORIGIN, RIGID, VIEW, empty
from tracknoise.tables.store import FINDINGS_JSON, SEQUENCE_TABLES, RunFolder
from tracknoise.tables.trust import TruthVerdict
from tracknoise.truth_faults.pose_accuracy import pose_law, pose_share, rigid_share

_OF = "population"
_MANY_FRAMES = 150
"""From so many on, it takes longer to audit their truth than to start a process."""


def has_errors(population: str) -> pl.Expr:
    """Rows of `MOMENTS` and `SCALES` with visible observations, or with those that an experiment is about."""
    return (pl.col("n") > 0) & pl.col(_OF).is_in(sorted({Population.visible, population}))


def conditions_of_few_scenes(
    moments: TablesByCondition, ends: TablesByCondition, frames: TablesByCondition, groups: SceneGroups
) -> pl.DataFrame:
    """Conditions of which the frames, the tracks or the errors are of too few scenes for these to be resampled.

    Returns: columns `POOLED`: a row for each, sorted. `ends, frames`: schema `ENDS` and `FRAME_COUNTS`.
    """
    few = {key for table in (frames, ends) for key, part in table.items() if _are_few(key, part["scene"], groups)}
    for key, part in moments.items():
        names, populations = part["scene"], part[_OF]
        if any(_are_few(key, names.filter(populations == each), groups) for each in populations.unique()):
            few.add(key)
    return pl.DataFrame(sorted(few), schema={name: ORIGIN[name] for name in POOLED}, orient="row")


def _are_few(condition: Condition, scenes: pl.Series, groups: SceneGroups) -> bool:
    return scheme(groups.of(condition[0], number_names(scenes)[0])) is None


Reduce = Callable[[pl.DataFrame], pl.DataFrame]


@dataclass(frozen=True, slots=True)
class FindingInputs:
    """Tables of all sequences of a run.

    Tables that several findings need are in memory together and grow with the number of sequences. Each is therefore
    reduced as it is read, and kept by condition, so that no finding needs a copy of all of it.

    Attributes
    ----------
    few
        Conditions whose scenes are too few to be resampled (`conditions_of_few_scenes`).
    moments, scales
        Of the visible observations, and of those that the experiment is about.
    aspects, changes
        Of the reference view at the lowest speed, which figures show; aspects are read on demand, once.
    aspect_blocks
        Of these, where scenes are too few to be resampled.
    blocks, scale_blocks
        Where they are.
    ends
        By block there, otherwise of all blocks together, as block 0.
    frames
        All.
    by_kind
        Moments and scales by each kind of reference tracks alone.
    groups
        Groups of scenes that are not independent of each other.
    """

    few: pl.DataFrame
    moments: TablesByCondition
    scales: TablesByCondition
    aspects: Iterator[pl.DataFrame]
    changes: TablesByCondition
    aspect_blocks: TablesByCondition
    blocks: TablesByCondition
    scale_blocks: TablesByCondition
    ends: TablesByCondition
    frames: TablesByCondition
    by_kind: KindTables
    groups: SceneGroups

    @classmethod
    def read(
        cls,
        run: RunFolder,
        manifest: Manifest,
        population: str,
        reference: ReferenceCondition,
        groups: SceneGroups,
    ) -> "FindingInputs":
        """Read them from a run."""
        every = sorted(manifest.sequences)
        shown = [key for key in every if _is_seen(manifest.sequences[key].sequence, reference)]
        seen, slowest = has_errors(population), pl.col("speed") == reference.speed

        def read(name: str, keys: list[str], reduce: Reduce = lambda table: table) -> TablesByCondition:
            return by_condition(run.stacked_tables(name, keys), SEQUENCE_TABLES[name], name, reduce)

        moments = read("moments", every, lambda table: table.filter(seen))
        ends, frames = read("ends", every), read("frames", every)
        scales = read("scales", every, lambda table: table.filter(seen))
        few = conditions_of_few_scenes(moments, ends, frames, groups)
        with_blocks = (every, shown) if few.height else ([], [])
        return cls(
            few=few,
            moments=moments,
            scales=scales,
            aspects=(run.sequence_table("aspects", key).filter(slowest) for key in shown),
            changes=read("increments", shown, lambda table: table.filter(slowest)),
            aspect_blocks=read("aspect_blocks", with_blocks[1], lambda table: _of(few, table.filter(slowest))),
            blocks=read("blocks", with_blocks[0], lambda table: _of(few, table)),
            scale_blocks=read("scale_blocks", with_blocks[0], lambda table: _of(few, table)),
            ends=_of_all_blocks(ends, few),
            frames=frames,
            by_kind=read_kind_tables(run, every, {"moments": moments, "scales": scales}),
            groups=groups,
        )


def _is_seen(sequence: SequenceId, reference: ReferenceCondition) -> bool:
    return all(getattr(sequence, name) == getattr(reference, name) for name in VIEW)


def _of(conditions: pl.DataFrame, table: pl.DataFrame) -> pl.DataFrame:
    return table.join(conditions, on=POOLED, how="semi", maintain_order="left")


def _of_all_blocks(ends: TablesByCondition, few: pl.DataFrame) -> TablesByCondition:
    """Counts by block where scenes are few, otherwise of all blocks together."""
    by_block = set(few.rows())
    return {
        key: part if key in by_block else without_blocks(part, [*ORIGIN, "lifetime"], ENDS)
        for key, part in ends.items()
    }


_OF_SEQUENCES: Mapping[str, tuple[str, Callable[..., pl.DataFrame]]] = {
    "triangulated_noise": ("fitted_noise", fitted_noise_table),
    "point_tracking_metrics": ("point_tracking", point_tracking_metrics),
    "two_truths": ("truth_differences", two_truths_table),
    "pose_disagreement": ("pose_differences", pose_disagreement_table),
    "pose_law": ("pose_growth", pose_law),
    "tracker_differences": ("between_trackers", tracker_differences),
    "surrounding_errors": ("surroundings", surrounding_errors),
    "image_cells": ("image_map", image_cells),
    "speed_errors": ("image_speeds", speed_errors),
    "ratios": ("ratio_sums", ratio_intervals),
    "own_covariances": ("covariance_sums", own_covariances),
}
"""Findings that pool one table of each sequence, and nothing else: the table, and what makes them."""
_OF_DEPTHS = ("noise_tracks", "noise_sums", "window_noise")
_OF_PLACES = ("surrounding_errors", "image_cells", "speed_errors", "ratios", "own_covariances")
_ABOUT_ANCHORS = ("zero_mean", "gaussianity", "radii", "time_structure", *_OF_PLACES)
"""Findings about errors since a point was fixed. They are withheld where points are fitted to whole tracks."""


@one_blas_thread()
def compute_findings(
    run: RunFolder, experiment: Experiment, statistics: Mapping[str, pl.DataFrame], *, workers: int = 1
) -> None:
    """Compute the findings of a run from its scenes' moments, and write its results, findings and models.

    Parameters
    ----------
    run
        With at least one measured sequence.
    experiment
        Says where curves are cut, and which population errors are of.
    statistics
        What `tracknoise.experiments.run_statistics.compute_statistics` made of it.
    workers
        Processes that may take part.

    Raises
    ------
    StoreError, SchemaError
        If a table is damaged, or the folder cannot be written.
    """
    keep_freed_memory()
    manifest = run.manifest()
    reference = reference_condition(manifest, experiment, statistics["outliers"])
    frames = sum(entry.n_frames for entry in manifest.sequences.values())
    with beside(is_wanted=workers > 1 and frames >= _MANY_FRAMES) as begin:
        audited = begin(run_audit, run, manifest, experiment)
        groups = groups_of_scenes(manifest.sequences, experiment.dataset.groups)
        sampling = Sampling(experiment.findings.intervals, experiment.findings.level, groups)
        tables = _of_sequences(run, sampling) | _tables(run, manifest, experiment, statistics, reference, sampling)
        tables |= audited()
        tables["trust"] = trust_table(run, manifest, experiment, {**statistics, **tables}, reference)
        tables["own_covariances"] = allowing_for_truth(tables["own_covariances"], tables["trust"])
        truth = RunTruth(TruthVerdict.of(tables["trust"]), tables["audit_curves"])
        trackers = [tracker.label for tracker in experiment.trackers]
        models = fitted_models(run, trackers, reference.speed, truth, workers=workers, begin=begin)
    tables["advice"] = advice_table(models, experiment.estimator.name, experiment.estimator.window, _place(reference))
    _write_findings(run, manifest, experiment, {**statistics, **tables}, reference, models)


def _place(reference: ReferenceCondition) -> dict[str, Any]:
    return {name: getattr(reference, name) for name in (*VIEW, "speed")}


def _write_findings(
    run: RunFolder,
    manifest: Manifest,
    experiment: Experiment,
    every: dict[str, pl.DataFrame],
    reference: ReferenceCondition,
    models: RunModels,
) -> None:
    reported = _reported(manifest, experiment, every, reference)
    if reported.fitted:
        every |= _without_verdicts_on_errors(every)
    if TruthVerdict.of(every["trust"]).are_tracks_wrong:
        every |= {name: every[name].clear() for name in _BLAMING_TRUTH}
    results = results_of(every)
    if not TruthVerdict.of(every["trust"]).is_usable:
        results = beside_untrusted_truth(results)
    every["findings"] = headline_table(Identified(_cited(results, reference), every), reported)
    documents = {FINDINGS_JSON: findings_json(every), **models.documents}
    run.write_statistics(every, results=results, documents=documents)


def _cited(results: pl.DataFrame, reference: ReferenceCondition) -> pl.DataFrame:
    """The results without curves of errors of other views and speeds: most rows of a large run, and in no sentence."""
    shown = pl.all_horizontal(pl.col(name) == getattr(reference, name) for name in (*VIEW, "speed"))
    return results.filter((pl.col("topic") != Topic.errors) | shown)


def _without_verdicts_on_errors(tables: Mapping[str, pl.DataFrame]) -> dict[str, pl.DataFrame]:
    """The tables that lose rows where points are fitted to whole tracks, without these."""
    without_axis = tables["dependence"].filter(pl.col("axis").is_null())  # of lifetimes and outlier ratios
    return {**{name: tables[name].clear() for name in _ABOUT_ANCHORS}, "dependence": without_axis}


_BLAMING_TRUTH = ("audit", "audit_curves", "pose_law", "pose_share", "rigid_share")
"""Findings about the truth from errors of the tracks. They are withheld where tracks do not follow the images."""


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
    sampling: Sampling,
) -> dict[str, pl.DataFrame]:
    population, least = experiment.truth.population, experiment.statistics.min_features
    pairs: list[pl.DataFrame] = []  # of changes
    lived: list[pl.DataFrame] = []
    groups = sampling.groups
    every = sorted(manifest.sequences)
    read = FindingInputs.read(run, manifest, population, reference, groups)
    pooled = _pooled_curves(run, every, least, read.few, pairs)
    asked, zeros = experiment.findings, reference.key_frames
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
        "incidence": incidence_table(read.ends, sampling),
        "zero_mean": zero_mean(
            read.moments, statistics["curves"], groups=groups, key_frames=zeros, population=population
        ),
        "gaussianity": shapes.gaussianity,
        "radii": shapes.radii,
        "time_structure": time_structure(  # after the intervals, which read the aspects
            read.moments,
            pairs,
            blocks=read.blocks,
            aspects=lived,
            aspect_blocks=read.aspect_blocks,
            margin=asked.margin,
            **options,
        ),
        "dependence": _dependence(read, experiment, statistics, zeros),
        "ranks": empty(RANKS)
        if len(experiment.trackers) < LEAST_TRACKERS
        else ranking(_dependence(read, experiment, statistics, zeros, pairs=True)),
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
    return {
        **pooled,
        **_of_motions(run, sampling),
        "window_sigmas": windows,
        "noise_lookup": lookups,
        "depth_intervals": depths,
    }


def _of_motions(run: RunFolder, sampling: Sampling) -> dict[str, pl.DataFrame]:
    """What errors of the poses explain, by age and of all ages; the table of motions is read once."""
    rigid = by_condition(run.stored_tables("rigid"), RIGID, "rigid")
    return {"rigid_share": rigid_share(rigid, sampling), "pose_share": pose_share(rigid, sampling)}


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
    *,
    pairs: bool = False,
) -> pl.DataFrame:
    return dependence(
        read.moments,
        read.scales,
        read.ends,
        read.frames,
        statistics["curves"],
        statistics["effects"],
        by_kind=read.by_kind,
        options=option_factors(_options(experiment)),
        groups=read.groups,
        key_frames=key_frames,
        population=experiment.truth.population,
        trimming=experiment.findings.trimming,
        margin=experiment.findings.margin,
        level=experiment.findings.level,
        pairs=pairs,
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
        fitted=TRIANGULATED in truths,
        groups=groups_of_scenes(manifest.sequences, experiment.dataset.groups),
        trimming=experiment.findings.trimming,
    )
