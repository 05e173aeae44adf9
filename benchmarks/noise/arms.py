"""The noise assumptions that are tried on the same windows of tracks, and what each makes of them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
import polars as pl
from numpy.typing import NDArray

from benchmarks.noise.bundle import Adjusted, Assumption, Start, StudentLoss, adjust, gate_ratios
from benchmarks.noise.windows import Problem, TrackGroup, between, linear_window, magnification_of, moved
from tracknoise.estimators.kernels import NEWEST, normalised
from tracknoise.estimators.linear_window import (
    EXACT,
    determines_poses,
    of_full_rank,
)
from tracknoise.estimators.losses import PLAIN, Loss, LossKind
from tracknoise.estimators.model import Factor, Interval, factor_of
from tracknoise.inference.track_noise import TrackNoise

TEXTURE = "texture"
"""Name of what planted noise depends on."""
TUNED_ARMS = ("8d", "9c")
"""Arms whose knee is tuned: with one sigma, and with a sigma by quality."""
ADVISED = "8e"
"""The arm of what is set in a sliding window (`tracknoise.estimators.advice`); its sigma and knee are of a model."""
GATED = "3g"
"""The arm of what is set in a filter; its sigma and gate are of a model."""
_GATE_OF_WHOLE_TRACKS = 0.25
PLANTED = "U"
"""The arm that knows the planted noise."""
REFERENCE = "1"
"""The arm that all others are compared with."""


@dataclass(frozen=True, slots=True)
class Student:
    """Student's distribution: degrees of freedom, infinite for a Gaussian, and squared scale."""

    nu: float
    squared_scale: float


@dataclass(frozen=True, slots=True, eq=False)
class Law:
    """Noise of whole tracks: scale matrices of its components, degrees of freedom, and factors on W and Q."""

    noise: TrackNoise
    nu: float = np.inf
    conditions: tuple[Factor, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Knee:
    """Cauchy's loss: the standard deviation of one observation, and where the loss begins to differ, px."""

    sigma_px: float = 1.0
    knee_px: float = 1.0

    @property
    def loss(self) -> Loss:
        """On whitened residuals."""
        return Loss(LossKind.CAUCHY, self.knee_px / self.sigma_px)


@dataclass(frozen=True, slots=True, kw_only=True)
class Gated:
    """The standard deviation of one observation, px, and the factor on the gate that 95 % of Gaussian tracks pass."""

    sigma_px: float = 1.0
    factor: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Beliefs:
    """What was learned from training scenes."""

    noise: TrackNoise  # components of the noise
    # the standard deviation for which the newest pose of training windows has a normalised error squared of 1
    tuned_px: float
    about_birth_px: float  # root mean square error about the first position, of each coordinate
    # newest_pose_px, innovations_px: standard deviations that the linear benchmark names for the newest pose and for
    # innovations
    newest_pose_px: float
    innovations_px: float
    by_quality: Law  # Gaussian noise of whole tracks, with factors by what a front end knows
    # scaled, scaled_by_quality: the same with a scale of its own for each track, without and with these factors
    scaled: Law
    scaled_by_quality: Law
    drift_px: NDArray[np.float64]  # (2,) float64, px per frame: mean drift
    of_errors: Student  # Student's distribution of single errors; its squared scale is in px^2
    # Cauchy's loss of single observations as it was tuned, by the names of `TUNED_ARMS`, and that of `ADVISED`
    knees: Mapping[str, Knee] = field(default_factory=lambda: dict.fromkeys((*TUNED_ARMS, ADVISED), Knee()))
    gated: Gated = field(default_factory=Gated)  # what is set in a filter
    planted: Law | None = None  # the true noise, if it is known


@dataclass(frozen=True, slots=True)
class Arm:
    """A noise assumption."""

    title: str  # what it is
    covariances: Callable[[Problem, Beliefs], Sequence[NDArray[np.float64]]]  # of the tracks of a problem
    loss: Callable[[Beliefs], Loss | StudentLoss] = lambda _: PLAIN  # of the whitened residuals
    unbiased: bool = False  # whether the mean drift is taken from the tracks first
    # Factor on the gate of tracks, if there is one. Tracks that fail it at the poses that a Cauchy loss of one sigma
    # gives are left out.
    gate: Callable[[Beliefs], float] | None = None

    def apply(self, problem: Problem, beliefs: Beliefs) -> tuple[Problem, Assumption]:
        """What an estimator gets: the problem, and the noise to assume."""
        given = without_drift(problem, beliefs.drift_px) if self.unbiased else problem
        return given, Assumption(self.covariances(problem, beliefs), self.loss(beliefs))

    def adjusted(self, problem: Problem, start: Start, beliefs: Beliefs) -> Adjusted:
        """Poses and points of a window under this assumption; without a gate's tracks, if too few pass it."""
        given, assumption = self.apply(problem, beliefs)
        if self.gate is not None:
            given, start, assumption = _gated(given, start, assumption, self.gate(beliefs))
        return adjust(given, start, assumption)


def _gated(problem: Problem, start: Start, assumption: Assumption, factor: float) -> tuple[Problem, Start, Assumption]:
    """The same without the tracks that fail a gate; all of them where the others do not determine the poses."""
    covariances = assumption.covariances
    found = adjust(problem, start, Assumption(covariances, Loss(LossKind.CAUCHY, 1.0)))
    passed = [ratio <= factor for ratio in gate_ratios(problem, found, covariances)]
    some = [place for place, own in enumerate(passed) if own.any()]
    groups = tuple(problem.groups[place].chosen(passed[place]) for place in some)
    rest = replace(problem, groups=groups)
    if not determines_poses(linear_window(rest)):
        return problem, start, assumption
    points = tuple(start.points[place][passed[place]] for place in some)
    kept = [covariances[place][passed[place]] for place in some]
    return rest, Start(start.poses, points), replace(assumption, covariances=kept)


def without_drift(problem: Problem, drift_px: NDArray[np.float64]) -> Problem:
    """The same tracks with a mean drift, (2,) px per frame, taken from them."""
    return problem.with_uv(tuple(group.uv - group.ages[:, :, None] * drift_px for group in problem.groups))


def one_sigma(problem: Problem, sigma: float) -> list[NDArray[np.float64]]:
    """Independent errors of one standard deviation, px."""
    sizes = [group.uv.shape for group in problem.groups]
    return [np.tile(sigma**2 * np.eye(2 * length), (count, 1, 1)) for count, length, _ in sizes]


def whole_tracks(problem: Problem, noise: TrackNoise, conditions: Sequence[Factor] = ()) -> list[NDArray[np.float64]]:
    """Covariances of whole tracks."""
    return [_whole(problem, group, noise, factor_in(group, conditions)) for group in problem.groups]


def factor_in(group: TrackGroup, conditions: Sequence[Factor]) -> NDArray[np.float64]:
    """(tracks, n) float64: factor on W and Q of each observation; 1 where nothing is known."""
    at = {factor.of: group.quality[factor.of].ravel() for factor in conditions if factor.of in group.quality}
    return factor_of(conditions, at, group.frames.size).reshape(group.frames.shape)


def _whole(problem: Problem, group: TrackGroup, noise: TrackNoise, factor: NDArray[np.float64]) -> NDArray[np.float64]:
    magnification = magnification_of(problem, group)
    found = noise.covariance(magnification, ages=group.ages, factor=factor)
    begun = factor[:, :1, None] * noise.white
    found[:, :2, :2] = np.where(group.born[:, None, None], noise.first, begun)
    return of_full_rank(found)


def independent(covariances: Sequence[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """The same variances of each observation, without what observations have in common."""
    blocks = [np.kron(np.eye(part.shape[1] // 2), np.ones((2, 2))) for part in covariances]
    return [part * block for part, block in zip(covariances, blocks, strict=True)]


def _by_age(problem: Problem, beliefs: Beliefs) -> list[NDArray[np.float64]]:
    return independent(whole_tracks(problem, beliefs.noise))


def _by_quality(problem: Problem, beliefs: Beliefs) -> list[NDArray[np.float64]]:
    return independent(_tracks_by_quality(problem, beliefs))


def _tracks_by_quality(problem: Problem, beliefs: Beliefs) -> list[NDArray[np.float64]]:
    return whole_tracks(problem, beliefs.by_quality.noise, beliefs.by_quality.conditions)


def _planted(problem: Problem, beliefs: Beliefs) -> list[NDArray[np.float64]]:
    planted = beliefs.planted or Law(beliefs.noise)
    return whole_tracks(problem, planted.noise, planted.conditions)


def _tuned(problem: Problem, beliefs: Beliefs) -> list[NDArray[np.float64]]:
    return one_sigma(problem, beliefs.tuned_px)


def _exact_first(problem: Problem, beliefs: Beliefs) -> list[NDArray[np.float64]]:
    covariances = one_sigma(problem, beliefs.tuned_px)
    for part in covariances:
        part[:, :2, :2] *= EXACT**2
    return covariances


def _modelled(problem: Problem, beliefs: Beliefs) -> list[NDArray[np.float64]]:
    return whole_tracks(problem, beliefs.noise)


def _student(beliefs: Beliefs) -> Loss:
    nu = beliefs.of_errors.nu
    return Loss(LossKind.CAUCHY, float(np.sqrt(nu + 2.0))) if np.isfinite(nu) else PLAIN


def _student_core(problem: Problem, beliefs: Beliefs) -> list[NDArray[np.float64]]:
    nu, squared_scale = beliefs.of_errors.nu, beliefs.of_errors.squared_scale
    share = nu / (nu + 2.0) if np.isfinite(nu) else 1.0
    return one_sigma(problem, float(np.sqrt(share * squared_scale)))


def _scaled(problem: Problem, beliefs: Beliefs) -> list[NDArray[np.float64]]:
    return whole_tracks(problem, beliefs.scaled.noise)


def _scaled_by_quality(problem: Problem, beliefs: Beliefs) -> list[NDArray[np.float64]]:
    return whole_tracks(problem, beliefs.scaled_by_quality.noise, beliefs.scaled_by_quality.conditions)


def _loss_of_tracks(nu: float) -> Loss | StudentLoss:
    return StudentLoss(nu) if np.isfinite(nu) else PLAIN


def _of_knee(arm: str) -> Callable[[Problem, Beliefs], list[NDArray[np.float64]]]:
    """The sigma that belongs to the knee of an arm."""
    return lambda problem, beliefs: one_sigma(problem, beliefs.knees[arm].sigma_px)


def _cauchy_by_quality(problem: Problem, beliefs: Beliefs) -> list[NDArray[np.float64]]:
    factors = [factor_in(group, beliefs.scaled_by_quality.conditions) for group in problem.groups]
    one = _of_knee("9c")(problem, beliefs)
    return [np.repeat(factor, 2, axis=1)[:, :, None] * part for factor, part in zip(factors, one, strict=True)]


SCALARS: Mapping[str, tuple[str, Callable[[Beliefs], float]]] = MappingProxyType(
    {
        "0": ("1 px", lambda _: 1.0),
        "1": ("one sigma, tuned for the newest pose", lambda beliefs: beliefs.tuned_px),
        "2": ("root mean square about the first observation", lambda beliefs: beliefs.about_birth_px),
        "3": ("one sigma, from the model, for the newest pose", lambda beliefs: beliefs.newest_pose_px),
        "3b": ("one sigma, from the model, for innovations", lambda beliefs: beliefs.innovations_px),
    }
)
"""Arms with one standard deviation. They lead to the same poses: only what they claim differs."""

ARMS: Mapping[str, Arm] = MappingProxyType(
    {
        "1e": Arm("one sigma, first observation exact", _exact_first),
        GATED: Arm(
            "what is set in a filter: one sigma, gate",
            lambda problem, beliefs: one_sigma(problem, beliefs.gated.sigma_px),
            gate=lambda beliefs: beliefs.gated.factor,
        ),
        "4": Arm("by age, independent", _by_age),
        "5": Arm("by quality, independent", _by_quality),
        "6": Arm("whole tracks", _modelled),
        "6b": Arm("whole tracks, by quality", _tracks_by_quality),
        "6g": Arm("whole tracks, gate .25", _modelled, gate=lambda _: _GATE_OF_WHOLE_TRACKS),
        "7": Arm("whole tracks, mean drift corrected", _modelled, unbiased=True),
        "7b": Arm("one sigma, mean drift corrected", _tuned, unbiased=True),
        "8": Arm("one sigma, Huber 1.345", _tuned, lambda _: Loss(LossKind.HUBER, 1.345)),
        "8b": Arm("one sigma, Cauchy 1", _tuned, lambda _: Loss(LossKind.CAUCHY, 1.0)),
        "8c": Arm("core sigma, Cauchy of Student's knee", _student_core, _student),
        "8d": Arm("one sigma, Cauchy, knee tuned", _of_knee("8d"), lambda beliefs: beliefs.knees["8d"].loss),
        "8e": Arm("what is set in a sliding window", _of_knee(ADVISED), lambda beliefs: beliefs.knees[ADVISED].loss),
        "9": Arm("scale of each track", _scaled, lambda beliefs: _loss_of_tracks(beliefs.scaled.nu)),
        "9b": Arm(
            "scale of each track, by quality",
            _scaled_by_quality,
            lambda beliefs: _loss_of_tracks(beliefs.scaled_by_quality.nu),
        ),
        "9c": Arm("sigma by quality, Cauchy, knee tuned", _cauchy_by_quality, lambda beliefs: beliefs.knees["9c"].loss),
        PLANTED: Arm(
            "whole tracks, planted noise",
            _planted,
            lambda beliefs: _loss_of_tracks(beliefs.planted.nu) if beliefs.planted else PLAIN,
        ),
    }
)
"""All other arms, by their short names."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlantedNoise:
    """The noise of simulated tracks."""

    noise: TrackNoise = field(default_factory=TrackNoise)  # components of the errors
    # Degrees of freedom of Student's distribution of every part of an error, above 2. Covariances stay the same.
    student_nu: float = np.inf
    # degrees of freedom of a scale of each track: its errors together have Student's distribution, whose scale matrices
    # are those of the noise
    track_nu: float = np.inf
    # mean drift of all tracks along u and v, px per frame since birth
    bias_px_per_frame: tuple[float, float] = (0.0, 0.0)
    # share of W, and of Q, that all tracks of a frame have in common, from 0 to 1
    common_share: float = 0.0
    # the independent variance is multiplied by texture^(-2 exponent), where the logarithm of the texture is Gaussian
    # with mean 0 and standard deviation 0.5
    texture_exponent: float = 0.0

    @property
    def law(self) -> Law:
        """What an estimator that knows it would assume."""
        exponent, furthest = self.texture_exponent, 10.0
        texture = Factor(
            of=TEXTURE,
            log_knots=(-furthest, furthest),
            log_factor=(2.0 * exponent * furthest, -2.0 * exponent * furthest),
            gain=Interval(value=0.0),
        )
        return Law(self.noise, self.track_nu, (texture,) if exponent else ())


_PERTURBED_RAD, _PERTURBED_SHARE = 0.002, 0.02
"""How wrong an estimator starts: rotations, and the share by which positions and inverse depths err."""


def perturbed(problem: Problem, *, seed: int = 0) -> Start:
    """The true poses and points, a little wrong; the same for everything that is tried on a problem."""
    random = np.random.default_rng((seed, 2))
    true = problem.world_from_camera
    baseline_m = float(np.linalg.norm(true[-1, :3, 3] - true[0, :3, 3]))
    scale = np.tile(np.repeat((_PERTURBED_RAD, _PERTURBED_SHARE * baseline_m), 3), len(true))
    gauge = problem.gauge
    poses = moved(gauge, true, gauge.free(scale * random.standard_normal(scale.shape)))
    points = []
    for group in problem.groups:
        eye = true[group.frames[:, 0], :3, 3]
        share = np.exp(_PERTURBED_SHARE * random.standard_normal((len(eye), 1)))
        points.append(eye + share * (group.points - eye))
    return Start(poses, tuple(points))


ALL_ARMS = (*SCALARS, *ARMS)


def try_arms(
    problems: Sequence[Problem], beliefs: Beliefs, *, arms: Iterable[str] = ALL_ARMS, seed: int = 0
) -> pl.DataFrame:
    """Adjust every window under every assumption, all from the same perturbed truth.

    `problems`: windows of scenes that the beliefs were not learned from; `beliefs`: what was learned from training
    scenes; `arms`: short names, of `benchmarks.noise.arms`. Returns one row per window and arm: scene, window,
    arm, n_tracks, position_m and rotation_rad (norms of the errors of the newest pose), nees_newest, nees_position,
    nees_rotation and nees_all (normalised errors squared over their degrees of freedom), innovations, steps, converged.
    """
    wanted = tuple(arms)
    rows = [
        {"scene": problem.scene, "window": place, "arm": arm, "n_tracks": problem.n_tracks, **numbers}
        for place, problem in enumerate(problems)
        for arm, numbers in _of_window(problem, beliefs, wanted, (seed + place)).items()
    ]
    return pl.DataFrame(rows)


def _of_window(
    problem: Problem, beliefs: Beliefs, arms: tuple[str, ...], seed: int
) -> dict[str, dict[str, float | int | bool]]:
    start = perturbed(problem, seed=seed)
    one = adjust(problem, start, Assumption(one_sigma(problem, 1.0))) if set(arms) & set(SCALARS) else None
    found = {}
    for arm in arms:
        if one is not None and arm in SCALARS:
            found[arm] = _numbers(problem, one, SCALARS[arm][1](beliefs) ** 2)
        else:
            found[arm] = _numbers(problem, ARMS[arm].adjusted(problem, start, beliefs), 1.0)
    return found


def _numbers(problem: Problem, found: Adjusted, scale: float) -> dict[str, float | int | bool]:
    """Numbers of an answer whose claimed covariance is multiplied by a scale."""
    error = between(problem.gauge, found.poses, problem.world_from_camera)
    claimed = scale * found.claimed
    position, rotation = error[-2:], error[-NEWEST:-2]
    return {
        "position_m": float(np.linalg.norm(position)),
        "rotation_rad": float(np.linalg.norm(rotation)),
        "nees_newest": normalised(error[-NEWEST:], claimed[-NEWEST:, -NEWEST:]),
        "nees_position": normalised(position, claimed[-2:, -2:]),
        "nees_rotation": normalised(rotation, claimed[-NEWEST:-2, -NEWEST:-2]),
        "nees_all": normalised(error, claimed),
        "innovations": found.innovations / scale,
        "steps": found.steps,
        "converged": found.converged,
    }
