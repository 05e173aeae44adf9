"""The proof of a noise model on a run: what an estimator gains from it on scenes that it was not fitted to."""

from collections.abc import Sequence
from dataclasses import dataclass

import polars as pl

from tracknoise.exceptions import SettingsError
from tracknoise.findings.wording import count
from tracknoise.noise_models.noise_model import NoiseModel
from tracknoise.proof.arms import Beliefs
from tracknoise.proof.division import Division, divided, scenes_of, with_joined_scenes
from tracknoise.proof.learning import learn
from tracknoise.proof.problem import Problem, are_exact
from tracknoise.proof.recorded import Cut, recorded_problems
from tracknoise.proof.summary import sentence, summarise
from tracknoise.proof.trial import try_arms
from tracknoise.proof.triangulation import learn_sigmas, triangulate
from tracknoise.tables.store import RunFolder

RUN_ARMS = ("0", "1", "1e", "2", "3", "3b", "4", "5", "6", "6b", "7", "7b", "8", "8b", "8c", "8d")
"""Arms that need no planted noise."""


@dataclass(frozen=True, slots=True, eq=False)
class Proof:
    """What was found.

    Attributes
    ----------
    poses : polars.DataFrame
        As `tracknoise.proof.summary.summarise` returns it.
    distances : polars.DataFrame
        As `tracknoise.proof.triangulation.triangulate` returns it.
    sentences : tuple of str
        The answer first, then what limits it.
    training, tested : tuple of str
        Scenes that the arms learned from, and scenes they were tried on.
    beliefs : Beliefs
        What was learned from the training scenes.
    """

    poses: pl.DataFrame
    distances: pl.DataFrame
    sentences: tuple[str, ...]
    training: tuple[str, ...]
    tested: tuple[str, ...]
    beliefs: Beliefs


def prove(
    folder: RunFolder,
    model: NoiseModel,
    *,
    length: int = 11,
    per_sequence: int = 8,
    most_tracks: int = 80,
    seed: int = 0,
) -> Proof:
    """Try a noise model on the windows of a run.

    Parameters
    ----------
    folder
        Of a finished run that keeps its observations.
    model
        Its tracker and speed are tried. Scenes that it was fitted to are used for training if there are others. If it
        was fitted to none of them or to all, every second scene is. One scene is cut in two
        (`tracknoise.proof.division`).
    length
        Processed frames of a window.
    per_sequence, most_tracks
        Most windows of a sequence, and most tracks of a window.
    seed
        Of the choice of tracks, and of where estimators start.

    Raises
    ------
    SettingsError
        If there are no such tracks, they have no errors, or the model has no noise; if there are too few windows, or
        true positions are fitted to the tracks.
    StoreError, SchemaError
        If the run keeps no observations, or a table is missing or damaged.
    """
    training = model.training
    if any(entry.truth_is_fitted for entry in folder.manifest().sequences.values()):
        raise SettingsError(f"{folder.path}: found true positions that are fitted to the tracks, expected true depths")
    if not any(part.covariance.any() for part in (model.first, model.white, model.walk, model.drift)):
        raise SettingsError(f"noise of {training.tracker}: found a model whose components are all 0, expected noise")
    noise = model.components.per_frames(round(training.speed))
    problems = windows_for(folder, model, length=length, per_sequence=per_sequence, most_tracks=most_tracks, seed=seed)
    if problems and all(are_exact(problem) for problem in problems):
        raise SettingsError(f"{folder.path}: found no errors of {training.tracker}, expected a tracker that errs")
    parts = divided(folder, problems, training)
    beliefs = learn(parts.learned_from, noise=noise)
    joined = with_joined_scenes(folder, parts.tested)
    poses = summarise(try_arms(joined, beliefs, arms=RUN_ARMS, seed=seed))
    distances = triangulate(joined, learn_sigmas(parts.learned_from), noise)
    return Proof(
        poses=poses,
        distances=distances,
        sentences=(sentence(poses, "6"), _distance_sentence(distances), *parts.limits, _tried(parts, joined)),
        training=scenes_of(parts.learned_from),
        tested=scenes_of(parts.tested),
        beliefs=beliefs,
    )


def windows_for(
    folder: RunFolder, model: NoiseModel, *, length: int, per_sequence: int, most_tracks: int = 80, seed: int = 0
) -> list[Problem]:
    """Windows of a run that a noise model can be tried on: of its tracker and speed, without its outliers.

    Parameters
    ----------
    folder, model, length, per_sequence, most_tracks, seed
        As in `prove`.

    Raises
    ------
    SettingsError, StoreError, SchemaError
        As `tracknoise.proof.recorded.recorded_problems`.
    """
    cut = Cut(
        tracker=model.training.tracker,
        speed=round(model.training.speed),
        length=length,
        per_sequence=per_sequence,
        most_tracks=most_tracks,
        most_px=model.outliers_beyond_px,
        seed=seed,
    )
    return recorded_problems(folder, cut)


def _distance_sentence(distances: pl.DataFrame) -> str:
    values = {(row["covariance"], row["quantity"]): row["value"] for row in distances.iter_rows(named=True)}
    shares = [f"{100.0 * values[name, 'coverage_95']:.0f} % with {use}" for name, use in _COVARIANCES.items()]
    return f"95 % intervals of triangulated distances contain the true one in {', '.join(shares)}."


_COVARIANCES = {
    "residual sigma": "the sigma that residuals suggest",
    "consistent sigma": "the consistent sigma",
    "whole tracks": "the covariance of whole tracks",
}


def _tried(parts: Division, joined: Sequence[Problem]) -> str:
    scenes, units = scenes_of(parts.tested), scenes_of(joined)
    groups = "" if len(units) == len(scenes) else f" in {count(len(units), 'group')}"
    found = f"Tried on {count(len(parts.tested), 'window')} of {count(len(scenes), 'scene')}{groups}"
    apart = set(scenes).isdisjoint(scenes_of(parts.learned_from))
    return f"{found} that nothing else was learned from." if apart else f"{found}."
