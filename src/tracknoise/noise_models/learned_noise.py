"""Noise that is learned from some scenes, to be tried on others.

Scenes are divided into at most `FOLDS` parts. Scenes of a group stay together. What is tried on the scenes of a part
was learned from all other parts.
"""

from collections.abc import Collection, Iterator, Sequence

import numpy as np
import polars as pl

from tracknoise.exceptions import SettingsError
from tracknoise.findings.sampling.groups import SceneGroups
from tracknoise.noise_models.depth_windows import LearnedNoise
from tracknoise.noise_models.fitting.components import fit_noise, sums_of_units
from tracknoise.noise_models.track_noise import TrackNoise
from tracknoise.noise_models.window_noise import scene_quantities
from tracknoise.tables.defaults import LEVEL

FOLDS = 4
"""Most parts that scenes are divided into."""


def learned_noise(
    scenes: Collection[str], sums: pl.DataFrame, windows: pl.DataFrame, *, groups: SceneGroups
) -> Iterator[tuple[Sequence[str], LearnedNoise]]:
    """Scenes, and what all others say that are of none of their groups; nothing where none of these has windows.

    Parameters
    ----------
    scenes
        Names of the scenes that it is tried on.
    sums, windows
        Rows of the condition, schemas `NOISE_SUMS` and `WINDOW_NOISE`.
    groups
        Groups of scenes that are not independent of each other.
    """
    seen = {*windows["scene"]}
    for part in _parts(sorted(seen | {*sums["scene"]}), sums, windows, groups):
        tried = [scene for scene in part if scene in seen.intersection(scenes)]
        if tried and seen.difference(part):
            yield tried, _learned(sums, windows, part, groups)


def _parts(scenes: list[str], sums: pl.DataFrame, windows: pl.DataFrame, groups: SceneGroups) -> list[list[str]]:
    """Scenes that are left out together."""
    if not scenes:
        return []
    (dataset,) = {*sums["dataset"], *windows["dataset"]}
    part = groups.of(dataset, scenes) % FOLDS
    return [[scene for scene, own in zip(scenes, part, strict=True) if own == one] for one in np.unique(part)]


def _learned(sums: pl.DataFrame, windows: pl.DataFrame, left_out: Collection[str], groups: SceneGroups) -> LearnedNoise:
    others = ~pl.col("scene").is_in(list(left_out))
    together = windows.filter(others).with_columns(scene=pl.lit(""))
    by_trimming = together.partition_by("trimming", as_dict=True).items()
    sigmas = [scene_quantities(own).with_columns(trimming=pl.lit(str(name))) for (name,), own in by_trimming]
    return LearnedNoise(pl.concat(sigmas), _components(sums.filter(others), groups))


def _components(sums: pl.DataFrame, groups: SceneGroups) -> TrackNoise | None:
    if sums.is_empty():
        return None
    try:
        noise = fit_noise(sums_of_units(sums, groups), level=LEVEL)
    except SettingsError:  # too few errors
        return None
    return noise if (noise.first + noise.white + noise.walk + noise.drift).any() else None
