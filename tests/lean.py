"""Runs without what takes most of their time and a test does not look at."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from typing import Any

import polars as pl
import pytest

from tracknoise.estimators.run_models import RunModels, fitted_models
from tracknoise.experiments import execute, run_findings, run_statistics, task
from tracknoise.experiments.geometry_tables import camera_tables
from tracknoise.sequences.sequence import Sequence
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.statistics.summarise import statistics_of
from tracknoise.tables.schema import empty
from tracknoise.tables.store import SEQUENCE_TABLES, RunFolder
from tracknoise.tables.truth_audit import AuditTables
from tracknoise.topics.catalogue import ANALYSES, by_table
from tracknoise.topics.depth_topic import DEPTHS
from tracknoise.topics.topic import Topic
from tracknoise.topics.truth_topic import ERRORS_OF_POSES, TRUTH_ANALYSES
from tracknoise.truth_faults.audit_tables import tables_of


@contextmanager
def measured_only() -> Iterator[None]:
    """Runs keep what they measured, and no statistics and findings are made of it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(execute, "compute_statistics", lambda *_: {})
        patch.setattr(execute, "compute_findings", lambda *_, **__: None)
        yield


@contextmanager
def without_findings() -> Iterator[None]:
    """Runs are finished and have their statistics, but nothing is found in them."""

    def written(run: RunFolder, _: object, statistics: Mapping[str, pl.DataFrame], **_others: object) -> None:
        run.write_statistics(by_table(statistics))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(execute, "compute_statistics", run_statistics.compute_statistics)
        patch.setattr(execute, "compute_findings", written)
        yield


@contextmanager
def with_findings() -> Iterator[None]:
    """Runs are finished as in a program, with findings."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(execute, "compute_statistics", run_statistics.compute_statistics)
        patch.setattr(execute, "compute_findings", run_findings.compute_findings)
        yield


@contextmanager
def measured_by_command() -> Iterator[None]:
    """As `measured_only`, of runs that the command line starts: there is no answer to print."""
    summary = import_module("tracknoise.cli.run_summary")  # of which most tests have no need
    with measured_only(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(summary, "print_results", lambda *_, **__: None)
        yield


@contextmanager
def without_models() -> Iterator[None]:
    """Findings are made as if no tracker had enough tracks for a noise model: a fit takes longer than all others."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_findings, "fitted_models", lambda *_, **__: RunModels())
        yield


@contextmanager
def with_models() -> Iterator[None]:
    """Findings are made as in a program."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_findings, "fitted_models", fitted_models)
        yield


@contextmanager
def without_audit() -> Iterator[None]:
    """Findings are made as if the truth could not be audited, which takes half the time of the findings of a scene."""

    def audited(run: RunFolder, *_: object) -> AuditTables:
        return tables_of("it is not asked for", next(iter(run.manifest().sequences.values())).sequence.dataset)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_findings, "run_audit", audited)
        yield


@contextmanager
def without_depths() -> Iterator[None]:
    """Findings are made as if no tracker had tracks for the intervals of depths, which take a third of their time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_findings, "ANALYSES", [analysis for analysis in ANALYSES if analysis not in DEPTHS.analyses])
        yield


@contextmanager
def only_topics(*topics: Topic) -> Iterator[None]:
    """Findings have the tables of these topics alone, and those that the verdict on the truth needs."""
    with pytest.MonkeyPatch.context() as patch:
        of_topics = [analysis for topic in (ERRORS_OF_POSES, *topics) for analysis in topic.analyses]
        patch.setattr(run_findings, "ANALYSES", (*of_topics, *TRUTH_ANALYSES))
        yield


_OF_POSES = ("audit_samples", "image_map", "rigid", "pose_growth", "window_noise", "window_blocks")
_OF_PLACES = ("aspects", "aspect_blocks", "fitted_noise", "surroundings", "image_speeds", "between_trackers")


@contextmanager
def without_geometry() -> Iterator[None]:
    """Sequences have the statistics of their errors, and not where errors lie and how they agree with the poses.

    That is half of what it takes to measure one.
    """

    def of_poses(_: object, sequence: Sequence, __: object, n_frames: int, ___: object) -> dict[str, pl.DataFrame]:
        return camera_tables(sequence, n_frames) | _empty(_OF_POSES)

    def of_errors(prepared: PreparedSequence, names: list[str], **options: Any) -> dict[str, pl.DataFrame]:
        few = [name for name in names if name not in _OF_PLACES]
        return statistics_of(prepared, few, **options) | _empty(_OF_PLACES)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(task, "geometry_tables", of_poses)
        patch.setattr(task, "statistics_of", of_errors)
        yield


def _empty(names: tuple[str, ...]) -> dict[str, pl.DataFrame]:
    return {name: empty(SEQUENCE_TABLES[name]) for name in names}


@contextmanager
def without_figure_files() -> Iterator[None]:
    """Reports are pages alone, with the figures of one family."""
    page = import_module("tracknoise.report.page")  # of which most tests have no need
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page, "FAMILIES", [family for family in page.FAMILIES if family.id == "feature-counts"])
        patch.setattr(page, "write_report", partial(page.write_report, figure_formats=()))
        yield


def of_reader(*named: str) -> list[str]:
    """Options of a reader, such as ``width=64``, on a command line."""
    return [part for one in named for part in ("--option", one)]
