"""Pools of scenes that differ in a known way, and findings about them.

Each scene has its own mean error and its own scale, so that findings about a pool have known answers.

`pool` has one tracker for each way in which errors behave. All tracks live from the first to the last frame.

- `mean N`: at each age a scene has a mean error of its own, Gaussian about zero, so that the true mean is zero.
- `scale N`: at each age and coordinate a scene has a scale of its own, whose logarithm is Gaussian.
- `biased`: as `mean`, with a true mean that is not zero.
- `white`, `walk`, `drift`: independent errors, sums of independent steps, and errors that grow in proportion to age.
- `heavy`: as `white`, with Student's distribution of three degrees of freedom.

Ages are independent of each other in `mean` and `scale`, so that a few trackers give hundreds of independent intervals.

`factors` has every scene under two lightings. Under the second, errors and outliers of `rough` are larger by known
ratios, and errors of `calm` by a ratio below the margin. Turned images exist for too few scenes to decide anything.

Single intervals and p-values are wrong by chance now and then, so that limits apply to all of them together. A correct
program exceeds a limit with a probability of at most `ALARM`. Limits allow intervals to contain the true value in
`LEAST` to `MOST` of all cases, and to be wider or narrower than Student's by `SLACK` (mean errors) or `LOOSE_SLACK`
(second moments, whose intervals have no exact width).

Half the width of Student's interval of a mean is t s / sqrt(n), where s has n - 1 degrees of freedom d. The expected
value of log s is log sigma + (psi(d / 2) + log(2 / d)) / 2, and its variance psi'(d / 2) / 4 (width).
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from collections.abc import Sequence as Items
from dataclasses import replace

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.special import polygamma, psi, stdtrit
from scipy.stats import binom, kstwo, norm

from tracknoise.experiments.measure import measure
from tracknoise.experiments.settings import DatasetSettings, Experiment, StatisticsSettings, TrackerChoice
from tracknoise.experiments.task import write_measurement, write_settings
from tracknoise.experiments.validation.comparison import Area, answer, within
from tracknoise.experiments.validation.known_worlds import (
    Array,
    Lives,
    Scene,
    Script,
    Scripted,
    draw_lives,
    in_memory,
    plain_scene,
)
from tracknoise.experiments.validation.known_worlds import turned as turned_pixels
from tracknoise.inference.conventions import LEVEL
from tracknoise.sequences.sequence import Sequence
from tracknoise.sequences.views import turned
from tracknoise.tables.enumerations import Behaviour, Shape, Verdict
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
    """Measure `pool`, and return the settings of the run. Statistics and findings are not computed."""
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


ALARM = 1e-4
"""Probability that a correct program exceeds one limit."""
LEAST, MOST = 0.93, 0.97
"""Shares of intervals that contain the true value, between which a method counts as correct."""
SLACK, LOOSE_SLACK = 1.1, 1.35
_NULL = [f"{kind} {number}" for kind in ("mean", "scale") for number in range(REPLICATES)]
_GROWTH = {"white": Behaviour.white, "walk": Behaviour.random_walk, "drift": Behaviour.drift}
_LARGER = {"eta": Verdict.yes, "Phi": Verdict.yes, "outlier_ratio": Verdict.yes, "lifetime": Verdict.no}
_SAME = {"eta": Verdict.no, "outlier_ratio": Verdict.no, "lifetime": Verdict.no}
"""Verdicts on the second lighting, of `rough` and of `calm`."""


def pool_checks(run: RunFolder, *, scenes: int) -> Iterator[pl.DataFrame]:
    """Compare intervals and verdicts of `pool` with what is known. Yields schema `CHECKS`."""
    yield from interval_checks(run.statistics("intervals"), scenes=scenes)
    yield from zero_mean_checks(run.statistics("zero_mean").filter(trimming="untrimmed"))
    yield from _growth(run.statistics("time_structure").filter(trimming="untrimmed"))
    yield from _shape(run.statistics("gaussianity").filter(trimming="untrimmed"))


def factor_checks(run: RunFolder) -> Iterator[pl.DataFrame]:
    """Compare verdicts on factors in `factors` with what is known: see `pool_checks`."""
    verdicts = run.statistics("dependence")
    for tracker, known in (("rough", _LARGER), ("calm", _SAME)):
        for statistic, verdict in known.items():
            found = verdicts.filter(factor="lighting", tracker=tracker, statistic=statistic)["verdict"].to_list()
            quantity = f"lighting changes {statistic} of {tracker}"
            yield answer(Area.factors, "factors", quantity, found, allowed=[verdict])
    few = verdicts.filter(factor="rotation")["verdict"].to_list()
    yield answer(Area.factors, "factors", "rotation, too few scenes", few, allowed=[Verdict.undecided])


def interval_checks(intervals: pl.DataFrame, *, scenes: int) -> Iterator[pl.DataFrame]:
    """Coverage and width of the intervals of mean errors and second moments."""
    chosen = intervals.filter(
        pl.col("at") > 0, aspect="all", population="visible", trimming="untrimmed", weighting="features"
    )
    means = chosen.filter(pl.col("tracker").str.starts_with("mean"), statistic="nu")
    second = NOISE_PX**2 * math.exp(2 * LOG_SPREAD**2)
    scales = chosen.filter(pl.col("tracker").str.starts_with("scale"), pl.col("coordinate") != "uv", statistic="Phi")
    covered = [(part["low"] <= value) & (part["high"] >= value) for part, value in ((means, 0.0), (scales, second))]
    yield from _coverage(pl.concat(covered).drop_nulls().to_list())
    apart_px = math.sqrt(MEAN_SPREAD_PX**2 + NOISE_PX**2 / N_TRACKS)
    half = (means["high"] - means["low"]) / 2
    yield _width("mean error", half, apart_px, scenes, slack=SLACK)
    apart = math.sqrt(math.exp(4 * LOG_SPREAD**2) * (1 + 2 / N_TRACKS) - 1)
    yield _width("second moment", (scales["high"] / scales["low"]).log() / 2, apart, scenes, slack=LOOSE_SLACK)


def _coverage(covered: Items[bool]) -> Iterator[pl.DataFrame]:
    n = len(covered)
    low, high = binom.ppf(ALARM, n, LEAST) / max(n, 1), binom.isf(ALARM, n, MOST) / max(n, 1)
    share = float(np.mean(covered)) if covered else None
    yield within(Area.intervals, "pool", "share of intervals with the true value", share, low=low, high=high, n=n)


def _width(quantity: str, half: pl.Series, apart: float, scenes: int, *, slack: float) -> pl.DataFrame:
    """Geometric mean of half the widths, relative to (width) for scenes whose values are `apart`."""
    freedom, n = scenes - 1, half.len()
    student = float(stdtrit(freedom, (1 + LEVEL) / 2)) * apart / math.sqrt(scenes)
    expected = math.log(student) + (float(psi(freedom / 2)) + math.log(2 / freedom)) / 2
    error = float(norm.isf(ALARM / 2)) * math.sqrt(float(polygamma(1, freedom / 2)) / 4 / max(n, 1))
    mean = half.log().mean()
    ratio = None if mean is None or half.null_count() else math.exp(float(mean) - expected)  # type: ignore[arg-type]
    limit = slack * math.exp(error)
    what = f"width of intervals of the {quantity}, over Student's"
    return within(Area.intervals, "pool", what, ratio, low=1 / limit, high=limit, n=n)


def zero_mean_checks(tests: pl.DataFrame) -> Iterator[pl.DataFrame]:
    """Verdicts of true zeros and of a mean that is not zero, and the distribution of p-values of true zeros."""
    zeros = tests.filter(pl.col("tracker").is_in(_NULL))
    overall = zeros.filter(pl.col("at").is_null())["verdict"].cast(pl.String)
    yes, most = int((overall == Verdict.yes).sum()), int(binom.isf(ALARM, overall.len(), 1 - LEVEL))
    yield within(Area.zero_mean, "pool", "true zeros that are rejected", yes, low=0, high=most, n=overall.len())
    p = zeros.filter(pl.col("at").is_not_null())["sign_flip_p"].drop_nulls().sort().to_numpy()
    places = np.arange(len(p)) / max(len(p), 1)
    distance = float(np.max(np.maximum(p - places, places + 1 / len(p) - p))) if len(p) else None
    limit = float(kstwo.isf(ALARM, max(len(p), 1)))
    what = "distance of p-values from uniform (Kolmogorov)"
    yield within(Area.zero_mean, "pool", what, distance, low=0, high=limit, n=len(p))
    found = tests.filter(pl.col("at").is_null(), tracker="biased")["verdict"].to_list()
    yield answer(Area.zero_mean, "pool", "a mean of half a pixel", found, allowed=[Verdict.yes])


def _growth(growth: pl.DataFrame) -> Iterator[pl.DataFrame]:
    for tracker, verdict in _GROWTH.items():
        found = growth.filter(tracker=tracker)["verdict"].to_list()
        yield answer(Area.growth, "pool", tracker, found, allowed=[verdict])


def _shape(shapes: pl.DataFrame) -> Iterator[pl.DataFrame]:
    """Gaussian errors may be undecided in some bands of ages, but not in most."""
    gaussian = shapes.filter(tracker="white")["verdict"].to_list()
    yield answer(Area.shape, "pool", "Gaussian errors", gaussian, allowed=[Shape.gaussian, Shape.undecided])
    certain = sum(verdict == Shape.gaussian for verdict in gaussian)
    bands = len(gaussian)
    yield within(Area.shape, "pool", "bands that are Gaussian", certain, low=(bands + 1) // 2, high=bands, n=bands)
    heavy = shapes.filter(tracker="heavy")["verdict"].to_list()
    yield answer(Area.shape, "pool", "heavy tails", heavy, allowed=[Shape.heavy_tailed, Shape.contaminated])
