"""Scripts of the self-test's closed-form scenes: true positions from closed forms, and errors that are drawn."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.experiments.validation.closed_form import Array, Scene
from tracknoise.experiments.validation.scripted import Script

_CLEAR_PX = 1.5
"""Smallest distance from outlines and from the border, px. What is seen nearer to them is a matter of convention."""
_NAMES = "<U16"


@dataclass(frozen=True, slots=True)
class Shown:
    """How a scene is shown: frames in their order or reversed, images turned by quarters, every `speed`-th frame."""

    backward: bool = False
    quarters: int = 0
    speed: int = 1


@dataclass(frozen=True, slots=True)
class Lives:
    """How tracks live.

    Attributes
    ----------
    n_tracks
        Number of tracks that are tried; those that come near an outline are left out.
    end_rate
        Probability that a track ends at a step.
    outlier_share
        Share of these that end as an outlier; the others are lost.
    """

    n_tracks: int
    end_rate: float
    outlier_share: float


def scripted_tracks(
    scene: Scene, view: Shown, lives: Lives, rng: np.random.Generator, *, key_frame: int | None = None
) -> Script:
    """Tracks through a scene with errors that differ in u and v, between tracks, and where the point is occluded.

    Parameters
    ----------
    scene
        The scene.
    view
        How it is shown; the script is in frames and pixels of the view.
    lives
        How many tracks there are and how they end.
    rng
        Decides about positions, lives and errors.
    key_frame
        The frame that fixes the true positions of the tracks that are seen there; other tracks have none. Default: each
        track's first frame.
    """
    order = np.arange(scene.n_frames)[:: -1 if view.backward else 1]
    frames = np.arange(0, scene.n_frames, view.speed)
    alive, end = draw_lives(lives, len(frames), rng)
    anchor = alive.argmax(axis=1) if key_frame is None else np.full(len(alive), np.searchsorted(frames, key_frame))
    known = alive[np.arange(len(alive)), anchor]
    camera = scene.camera
    first_px = rng.uniform(_CLEAR_PX, np.array([camera.width, camera.height]) - 1 - _CLEAR_PX, (len(alive), 2))
    depth, panel = scene.look(order[frames[anchor]], first_px)
    every_px, every_depth = scene.images(scene.world(order[frames[anchor]], first_px, depth))
    true_px, depth_m = every_px[:, order[frames]], every_depth[:, order[frames]]
    status, clear = _visibility(scene, order[frames], true_px, panel)
    chosen = (clear | ~alive).all(axis=1)
    status[~known] = "no_depth"
    error_px = _errors(alive, status == "occluded", rng)
    error_px[np.arange(len(alive)), anchor] = 0.0
    at_birth = depth_m[np.arange(len(alive)), alive.argmax(axis=1)]
    return Script(
        frames=frames,
        alive=alive[chosen],
        true_px=turned(true_px, camera.width, camera.height, view.quarters)[chosen],
        error_px=error_px[chosen],
        status=status[chosen],
        end=end[chosen],
        depth_m=np.where(known, at_birth, np.nan)[chosen],
        zero_frame=frames[anchor][chosen],
    )


def turned(uv: Array, width: int, height: int, quarters: int) -> Array:
    """Where the image turned by quarters counter-clockwise shows the pixels (..., 2) of the upright one."""
    for _ in range(quarters):
        uv = np.stack([uv[..., 1], width - 1 - uv[..., 0]], axis=-1)
        width, height = height, width
    return uv


def draw_lives(lives: Lives, n_steps: int, rng: np.random.Generator) -> tuple[NDArray[np.bool_], NDArray[np.str_]]:
    """Steps in which each track is observed, (tracks, steps), and its end; half of the tracks begin at once."""
    birth = np.sort(np.where(rng.random(lives.n_tracks) < 0.5, 0, rng.integers(0, n_steps, lives.n_tracks)))
    beyond = birth + rng.geometric(lives.end_rate, lives.n_tracks)
    steps = np.arange(n_steps)
    alive = (steps >= birth[:, None]) & (steps < beyond[:, None])
    outlier = rng.random(lives.n_tracks) < lives.outlier_share
    ended = np.where(outlier, "outlier", "lost")
    return alive, np.where(beyond < n_steps, ended, "sequence_end").astype(_NAMES)


def _visibility(
    scene: Scene, frame: NDArray[np.int64], uv: Array, panel: NDArray[np.int64]
) -> tuple[NDArray[np.str_], NDArray[np.bool_]]:
    """Status of points of panels (tracks,) in frames (steps,), and whether no outline or border is near."""
    size = np.array([scene.camera.width, scene.camera.height])
    inside = np.all((uv >= -0.5) & (uv < size - 0.5), axis=-1)
    border = np.minimum(np.abs(uv + 0.5), np.abs(uv - size + 0.5)).min(axis=-1)
    frames = np.broadcast_to(frame, uv.shape[:-1])
    seen = scene.look(frames, uv)[1]
    around = [np.array([right, down]) * _CLEAR_PX for right in (-1, 0, 1) for down in (-1, 0, 1)]
    same = np.all([scene.look(frames, uv + offset)[1] == seen for offset in around], axis=0)
    status = np.where(inside, np.where(seen == panel[:, None], "valid", "occluded"), "out_of_image").astype(_NAMES)
    return status, (same | ~inside) & (border > _CLEAR_PX)


def _errors(alive: NDArray[np.bool_], occluded: NDArray[np.bool_], rng: np.random.Generator) -> Array:
    """Errors with a mean, a correlation, a scale of each track, and a heavy tail: no statistic has a special value."""
    noise = rng.standard_normal((*alive.shape, 2)) @ np.array([[0.3, 0.1], [0.0, 0.2]])
    scale = np.exp(0.5 * rng.standard_normal(len(alive)))[:, None, None]
    step = np.arange(alive.shape[1])[:, None] * np.array([0.01, -0.02])
    errors: Array = np.array([0.15, -0.08]) + step + noise * scale * np.where(occluded, 5.0, 1.0)[..., None]
    return errors
