"""The proof of a noise model on a run: what an estimator gains from it on scenes that it was not fitted to."""

from collections.abc import Sequence
from dataclasses import dataclass

import polars as pl

from tracknoise.exceptions import SettingsError
from tracknoise.noise_models.noise_model import NoiseModel
from tracknoise.noise_models.track_noise import TrackNoise
from tracknoise.proof.arms import Beliefs
from tracknoise.proof.learning import learn
from tracknoise.proof.problem import Problem
from tracknoise.proof.recorded import Cut, recorded_problems
from tracknoise.proof.summary import sentence, summarise
from tracknoise.proof.trial import try_arms
from tracknoise.proof.triangulation import learn_sigmas, triangulate
from tracknoise.tables.store import RunFolder

RUN_ARMS = ("0", "1", "1e", "2", "3", "3b", "4", "5", "6", "6b", "7", "7b", "8", "8b", "8c", "8d")
"""Arms that need no planted noise."""
_LEAST_SCENES = 2


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
        Its tracker and speed are tried. Scenes that it was fitted to are used for training if there are others.
    length
        Processed frames of a window.
    per_sequence, most_tracks
        Most windows of a sequence, and most tracks of a window.
    seed
        Of the choice of tracks, and of where estimators start.

    Raises
    ------
    SettingsError
        If there are too few windows.
    StoreError, SchemaError
        If the run keeps no observations, or a table is missing or damaged.
    """
    training = model.training
    cut = Cut(
        tracker=training.tracker,
        speed=round(training.speed),
        length=length,
        per_sequence=per_sequence,
        most_tracks=most_tracks,
        most_px=model.outliers_beyond_px,
        seed=seed,
    )
    learned_from, tested, is_held_out = _divided(recorded_problems(folder, cut), set(training.scenes), folder)
    noise = per_processed_frame(model.components, round(training.speed))
    beliefs = learn(learned_from, noise=noise)
    poses = summarise(try_arms(tested, beliefs, arms=RUN_ARMS, seed=seed))
    distances = triangulate(tested, learn_sigmas(learned_from), noise)
    limits = () if is_held_out else (_SAME_SCENES,)
    return Proof(
        poses=poses,
        distances=distances,
        sentences=(sentence(poses, "6"), _distance_sentence(distances), *limits, _few(tested)),
        training=_scenes(learned_from),
        tested=_scenes(tested),
        beliefs=beliefs,
    )


_SAME_SCENES = "The model was fitted to all scenes of this run, so that the gain of whole tracks may be too large."


def per_processed_frame(noise: TrackNoise, speed: int) -> TrackNoise:
    """The same noise with walk and drift per processed frame; `noise` has them per frame of the recording."""
    return TrackNoise(first=noise.first, white=noise.white, walk=noise.walk * speed, drift=noise.drift * speed**2)


def _divided(
    problems: Sequence[Problem], fitted: set[str], folder: RunFolder
) -> tuple[list[Problem], list[Problem], bool]:
    """Windows of training scenes, windows of the others, and whether the model has not seen the others."""
    scenes = _scenes(problems)
    if len(scenes) < _LEAST_SCENES:
        found = f"usable windows in {len(scenes)} scenes"
        raise SettingsError(
            f"{folder.path}: found {found}, expected at least {_LEAST_SCENES}; shorter windows may help"
        )
    training = {scene for scene in scenes if scene in fitted}
    is_held_out = 0 < len(training) < len(scenes)
    if not is_held_out:
        training = set(scenes[::2])
    learned_from = [problem for problem in problems if problem.scene in training]
    return learned_from, [problem for problem in problems if problem.scene not in training], is_held_out


def _scenes(problems: Sequence[Problem]) -> tuple[str, ...]:
    return tuple(sorted({problem.scene for problem in problems}))


def _distance_sentence(distances: pl.DataFrame) -> str:
    values = {(row["covariance"], row["quantity"]): row["value"] for row in distances.iter_rows(named=True)}
    shares = [f"{100.0 * values[name, 'coverage_95']:.0f} % with {use}" for name, use in _COVARIANCES.items()]
    return f"95 % intervals of triangulated distances contain the true one in {', '.join(shares)}."


_COVARIANCES = {
    "residual sigma": "the sigma that residuals suggest",
    "consistent sigma": "the consistent sigma",
    "whole tracks": "the covariance of whole tracks",
}


def _few(problems: Sequence[Problem]) -> str:
    return f"Tried on {len(problems)} windows of {len(_scenes(problems))} scenes that nothing else was learned from."
