"""Where factors are held while another one varies."""

from collections.abc import Collection

from tracknoise.experiments.settings import Experiment
from tracknoise.statistics.effects import Reference
from tracknoise.tables.store import Manifest

_PLAIN = ("diffuse", "default")
"""What a lighting without a direction is called."""


def first_lighting(lightings: Collection[str], experiment: Experiment) -> str:
    """The lighting that stands for all: the first that the experiment names, else a plain one, else the first by name.

    Parameters
    ----------
    lightings
        At least one, those that there are.
    experiment
        Which may name lightings.
    """
    named = [name for name in experiment.dataset.lightings or _PLAIN if name in lightings]
    return [*named, *sorted(lightings)][0]


def reference(manifest: Manifest, experiment: Experiment, *, speed: int) -> Reference:
    """The view that comes first in a run: forward, upright, and under the first lighting.

    Parameters
    ----------
    manifest
        With at least one measured sequence.
    experiment
        Which may name lightings.
    speed
        The lowest one measured.
    """
    entries = list(manifest.sequences.values())
    return Reference(
        lighting=first_lighting({entry.lighting for entry in entries}, experiment),
        rotation=min(entry.rotation for entry in entries),
        direction=max(entry.direction for entry in entries),
        speed=speed,
        key_frames={entry.direction: entry.key_frame for entry in entries if entry.key_frame is not None},
    )
