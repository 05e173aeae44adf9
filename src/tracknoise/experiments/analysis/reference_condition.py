"""The condition at which factors are held while another one varies."""

from collections.abc import Collection

import polars as pl

from tracknoise.experiments.settings import Experiment
from tracknoise.statistics.factors.factors import ReferenceCondition
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
    """The first view of a run: forward, upright, under the first lighting, of the first camera, at the lowest speed.

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
    sequences = [entry.sequence for entry in entries]
    return ReferenceCondition(
        lighting=first_lighting({sequence.lighting for sequence in sequences}, experiment),
        rotation=min(sequence.rotation for sequence in sequences),
        direction=str(max(sequence.direction for sequence in sequences)),
        speed=int(outliers["speed"].min()),  # type: ignore[arg-type]
        key_frames={str(entry.sequence.direction): entry.key_frame for entry in entries if entry.key_frame is not None},
        camera=min(sequence.camera for sequence in sequences),
    )
