"""Pools of scenes that differ: each scene has its own mean error and its own scale, and findings have known answers.

`pool`: one tracker for each way in which errors behave. All tracks live from the first to the last frame.

- `mean N`: at each age a scene has a mean error of its own, Gaussian about zero, so that the true mean is zero.
- `scale N`: at each age and coordinate a scene has a scale of its own, whose logarithm is Gaussian.
- `biased`: as `mean`, with a true mean that is not zero.
- `white`, `walk`, `drift`: independent errors, sums of independent steps, and errors that grow in proportion to age.
- `heavy`: as `white`, with Student's distribution of three degrees of freedom.

Ages are independent of each other in `mean` and `scale`, so that a few trackers give hundreds of independent intervals.

`factors`: every scene under two lightings. Under the second, errors and outliers of `rough` are larger by known ratios,
and errors of `calm` by a ratio below the margin. Turned images exist for too few scenes to decide anything.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.experiments.measure import measure
from tracknoise.experiments.running.measured_sequences import write_measurement, write_settings
from tracknoise.experiments.settings import DatasetSettings, Experiment, StatisticsSettings, TrackerChoice
from tracknoise.experiments.validation.closed_form import Array, Scene, plain_scene
from tracknoise.experiments.validation.recordings import in_memory
from tracknoise.experiments.validation.scripted import Script, Scripted
from tracknoise.experiments.validation.tracks import Lives, draw_lives
from tracknoise.experiments.validation.tracks import turned as turned_pixels
from tracknoise.sequences.sequence import Sequence
from tracknoise.sequences.views import turned
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.store import RunFolder

N_FRAMES, N_FRAMES_LIT = 25, 13
"""Of `pool` and of `factors`."""
N_TRACKS = 40
N_TRACKS_OF_SHAPES = 160
"""Of `white` and `heavy`: a verdict on the shape takes more errors than others."""
REPLICATES = 4
"""Trackers of the kinds `mean` and `scale`."""
MEAN_SPREAD_PX, NOISE_PX = 0.2, 0.3
"""Standard deviation between scenes of their mean errors, and within scenes."""
LOG_SPREAD = 0.25
"""Standard deviation between scenes of the logarithms of their scales."""
BIAS_PX = np.array([0.4, -0.3])
DRIFT_PX = np.array([0.05, -0.04])
ROUGHER, CALMER, MORE_OUTLIERS = 1.5, 1.02, 3
"""Ratios of the second lighting to the first: of errors of `rough` and of `calm`, and of the outliers of `rough`."""
SECOND_LIGHTING = "second"
N_TURNED = 4
"""Scenes with turned images: fewer than a verdict needs."""

_LIVES = Lives(120, 0.08, 0.2)

Errors = Callable[[np.random.Generator, tuple[int, int]], Array]


def _mean(rng: np.random.Generator, shape: tuple[int, int]) -> Array:
    own: Array = MEAN_SPREAD_PX * rng.standard_normal((1, shape[1], 2))
    return own + NOISE_PX * rng.standard_normal((*shape, 2))


def _scale(rng: np.random.Generator, shape: tuple[int, int]) -> Array:
    own: Array = np.exp(LOG_SPREAD * rng.standard_normal((1, shape[1], 2)))
    return own * NOISE_PX * rng.standard_normal((*shape, 2))


def _biased(rng: np.random.Generator, shape: tuple[int, int]) -> Array:
    errors: Array = BIAS_PX + _mean(rng, shape)
    return errors


def _white(rng: np.random.Generator, shape: tuple[int, int]) -> Array:
    return NOISE_PX * rng.standard_normal((*shape, 2))


def _walk(rng: np.random.Generator, shape: tuple[int, int]) -> Array:
    return np.cumsum(0.1 * rng.standard_normal((*shape, 2)), axis=1)


def _drift(rng: np.random.Generator, shape: tuple[int, int]) -> Array:
    steps = np.arange(shape[1], dtype=np.float64)[:, None]
    errors: Array = steps * DRIFT_PX + 0.05 * rng.standard_normal((*shape, 2))
    return errors


def _heavy(rng: np.random.Generator, shape: tuple[int, int]) -> Array:
    ratio = np.sqrt(rng.chisquare(3, shape) / 3)[..., None]
    return NOISE_PX * rng.standard_normal((*shape, 2)) / ratio


ERRORS: Mapping[str, Errors] = {
    **{f"mean {number}": _mean for number in range(REPLICATES)},
    **{f"scale {number}": _scale for number in range(REPLICATES)},
    "biased": _biased,
    "white": _white,
    "walk": _walk,
    "drift": _drift,
    "heavy": _heavy,
}
"""Errors of each tracker of `pool`: (tracks, steps, 2) px, before the first is set to zero."""


def measure_pool(run: RunFolder, *, scenes: int, seed: int) -> Experiment:
    """Measure `pool`, and return the settings of the run. Statistics and findings are not computed.

    Parameters
    ----------
    run
        Where the run is written.
    scenes
        Number of scenes.
    seed
        Random seed of the errors.
    """
    experiment, entries = _experiment("pool", ERRORS, min_features=2), []
    for number, rng in enumerate(np.random.default_rng([seed, 1]).spawn(scenes)):
        scene = plain_scene(number, n_frames=N_FRAMES)
        recording = in_memory(scene, SequenceId("pool", scene_name(number)))
        scripts = {name: _script_of(scene, rng, name) for name in ERRORS}
        trackers = {name: Scripted({(recording.id.key, 1): script}) for name, script in scripts.items()}
        entries.append(write_measurement(run, experiment, measure(recording, trackers, trim_percentile=100.0)))
    write_settings(run, experiment, entries)
    return experiment


def _script_of(scene: Scene, rng: np.random.Generator, tracker: str) -> Script:
    """The tracks of a tracker, which live from the first to the last frame."""
    n_tracks = N_TRACKS_OF_SHAPES if tracker in ("white", "heavy") else N_TRACKS
    alive = np.ones((n_tracks, N_FRAMES), dtype=bool)
    return _script(*_paths(scene, rng, n_tracks), alive, ERRORS[tracker](rng, alive.shape))


def scene_name(number: int) -> str:
    """Names without anything in common, from which no groups of scenes can be read."""
    return "".join(chr(ord("a") + int(digit, 26)) for digit in np.base_repr(number, 26))


def measure_factors(run: RunFolder, *, scenes: int, seed: int) -> Experiment:
    """Measure `factors`; see `measure_pool` for the parameters."""
    experiment, entries = _experiment("factors", ("rough", "calm"), min_features=15 * scenes), []
    for number, rng in enumerate(np.random.default_rng([seed, 2]).spawn(scenes)):
        for recording, scripts in _lit(number, rng):
            trackers = {name: Scripted({(recording.id.key, 1): script}) for name, script in scripts.items()}
            entries.append(write_measurement(run, experiment, measure(recording, trackers, trim_percentile=100.0)))
    write_settings(run, experiment, entries)
    return experiment


def _lit(number: int, rng: np.random.Generator) -> Iterator[tuple[Sequence, dict[str, Script]]]:
    """A scene under both lightings and, if it is one of the first, turned."""
    scene = plain_scene(number, n_frames=N_FRAMES_LIT)
    name = SequenceId("factors", scene_name(number))
    recording = in_memory(scene, name)
    paths = _paths(scene, rng, _LIVES.n_tracks)
    first, second = {}, {}
    for tracker, ratio in (("rough", ROUGHER), ("calm", CALMER)):
        alive, end = draw_lives(_LIVES, N_FRAMES_LIT, rng)
        errors = _biased(rng, alive.shape)
        outliers = MORE_OUTLIERS if tracker == "rough" else 1
        first[tracker] = _script(*paths, alive, errors, end)
        second[tracker] = _script(*paths, alive, _changed(errors, ratio, rng), _with_outliers(end, outliers, rng))
    yield recording, first
    yield replace(recording, id=replace(name, lighting=SECOND_LIGHTING)), second
    if number < N_TURNED:
        yield turned(recording, 90), {tracker: _turned(script, scene) for tracker, script in first.items()}


def _changed(errors: Array, ratio: float, rng: np.random.Generator) -> Array:
    """Errors that are larger by a ratio, apart from a little noise of their own."""
    return ratio * errors + 0.02 * rng.standard_normal(errors.shape)


def _with_outliers(end: NDArray[np.str_], times: int, rng: np.random.Generator) -> NDArray[np.str_]:
    """Ends of which `times` as many are outliers."""
    share = (times - 1) * _LIVES.outlier_share / (1 - _LIVES.outlier_share)
    return np.where((end == "lost") & (rng.random(len(end)) < share), "outlier", end)


def _turned(script: Script, scene: Scene) -> Script:
    """A script in the pixels of the turned image, with the errors of the upright one."""
    camera = scene.camera
    return replace(script, true_px=turned_pixels(script.true_px, camera.width, camera.height, 1))


def _paths(scene: Scene, rng: np.random.Generator, n_tracks: int) -> tuple[Array, Array]:
    """True positions (tracks, frames, 2) and depths (tracks, frames) of features that stay in the image."""
    size = np.array([scene.camera.width, scene.camera.height])
    first_px = rng.uniform(0.2 * size, 0.8 * size, (n_tracks, 2))
    frame = np.zeros(n_tracks, dtype=np.int64)
    return scene.images(scene.world(frame, first_px, scene.look(frame, first_px)[0]))


def _script(
    true_px: Array,
    depth_m: Array,
    alive: NDArray[np.bool_],
    error_px: Array,
    end: NDArray[np.str_] | None = None,
) -> Script:
    """A script of visible features, whose errors are zero in their first frames."""
    birth = alive.argmax(axis=1)
    errors = error_px.copy()
    errors[np.arange(len(alive)), birth] = 0.0
    return Script(
        frames=np.arange(alive.shape[1]),
        alive=alive,
        true_px=true_px,
        error_px=errors,
        status=np.full(alive.shape, "valid"),
        end=np.full(len(alive), "sequence_end") if end is None else end,
        depth_m=depth_m[np.arange(len(alive)), birth],
        zero_frame=birth,
    )


def _experiment(name: str, trackers: Iterable[str], *, min_features: int) -> Experiment:
    return Experiment(
        name=f"selfcheck {name}",
        dataset=DatasetSettings(reader="folder"),
        trackers=[TrackerChoice(kind="scripted", name=tracker) for tracker in trackers],
        statistics=StatisticsSettings(trim_percentile=100.0, min_features=min_features),
    )
