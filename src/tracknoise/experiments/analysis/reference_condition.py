"""The condition at which factors are held while another one varies."""

from collections.abc import Collection

import polars as pl

from tracknoise.experiments.settings import Experiment
from tracknoise.statistics.factors import ReferenceCondition
from tracknoise.statistics.lightings import lightings_in_order
from tracknoise.tables.manifest import Manifest


def first_lighting(lightings: Collection[str], experiment: Experiment) -> str:
    """The reference lighting: the first in the order of `lightings_in_order`.

    Parameters
    ----------
    lightings
        At least one, those that there are.
    experiment
        Which may name lightings.
    """
    return lightings_in_order(lightings, experiment.dataset.lightings)[0]


def reference_condition(manifest: Manifest, experiment: Experiment, outliers: pl.DataFrame) -> ReferenceCondition:
    """The view that comes first in a run: forward, upright, and under the first lighting, at the lowest speed.

    Parameters
    ----------
    manifest
        With at least one measured sequence.
    experiment
        Which may name lightings.
    outliers
        Statistics table of that name, which has every condition that was measured.
    """
    entries = list(manifest.sequences.values())
    return ReferenceCondition(
        lighting=first_lighting({entry.lighting for entry in entries}, experiment),
        rotation=min(entry.rotation for entry in entries),
        direction=max(entry.direction for entry in entries),
        speed=int(outliers["speed"].min()),  # type: ignore[arg-type]
        key_frames={entry.direction: entry.key_frame for entry in entries if entry.key_frame is not None},
    )
