"""What to set in one estimator, all together: sigma, gates, robust loss and its knee.

**Sigma and gates of a filter.** A filter whose covariance is used needs the sigma that makes the newest pose right. It
is larger than residuals, so that a chi-square gate at its shipped size lets all pass. The tails of good tracks would
widen a gate that all but a few of them pass, and let bad ones in. So the gate is the one that four of five good tracks
pass at true poses:

    gate = g_.80 q_k(.80) / q_k(.95)    (advice.gate)

with the gate g_.80 of good tracks at true poses, and quantiles q of chi square with the k degrees of freedom of a
track. For one observation of a feature in the state .95 takes the place of .80, because a feature is lost with it; its
gate is at most 1. A filter claims a hundredth of the variance of innovations of tracks for errors of predicted poses,
and a tenth of that of features in its state. Nothing is added for them, but no gate is smaller than this share, which
would lose what has no noise. With a third added, the NEES of Lucas-Kanade was 1.45 in place of 1.25, and errors of
positions .63 [.50, .80] in place of .57 [.48, .68] of those with 1 px (`python -m benchmarks.filter_trial`).
Tracks that pass have smaller errors than all, for which sigma is right: the NEES that this leaves is tried and said
(`tracknoise.estimators.pose_trials`).

Features in the state stay there as long as they are tracked. Errors that walk go on meanwhile, so that their sigma is
that of windows of 60 frames, in which tracks end as they do in the run. With windows of 30 frames the NEES was 1.75.

**Sigma and knee of a robust loss** belong together (`tracknoise.estimators.kernels`). The knee is the largest of
those that were tried whose errors of poses are within 2 % of the smallest, and sigma the one that makes the claimed
covariance right with it. Where none was tried, the knee is 1 (Cauchy) or 1.345 (Huber) sigmas of innovations, because
it decides on the poses, and sigma is that of least squares, because residuals promise too much.

**A point that is known**, from a map or a depth image at its first observation, leaves the whole error in the image:
that about the first position, ages 1 to the length of the window. Without a loss, sigma is its RMS. With one, sigma is
smaller, and makes the NEES of a pose 1 (`tracknoise.estimators.pose_trials`).

**Errors in common** of the N features of a frame do not average out. Where their share of the variance is above 0, and
the truth, whose poses may make such errors, is trusted, sigma is for N features:

    sigma(N)^2 = sigma^2 + N c (r / e)^2    (advice.features)

with what each feature adds, c, from (equivalents.common) or (known.common). A robust loss that makes sigma r times and
errors e times as large does not make errors in common smaller; r = e = 1 without one, and for known points. Bounds are
those of a sum whose terms are independent. Gates stay as large in px.

In a filter with an inertial sensor, 5 % in common did not make the NEES larger with 200 features per frame
(`python -m benchmarks.filter_trial --common .05 --tracks 24`). With such a sensor, features are taken as independent
unless their number is stated.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import Field, dataclass
from enum import StrEnum
from typing import Any, ClassVar, Protocol

import numpy as np
from scipy.special import gammaincinv

from tracknoise.checks import require_whole
from tracknoise.estimators.losses import Loss, expected_nees
from tracknoise.estimators.losses import LossKind as BundleLoss
from tracknoise.estimators.model import (
    Bias,
    CameraOfModel,
    Component,
    Equivalent,
    Interval,
    Kernel,
    KnownPoints,
    Landmark,
    LossKind,
    OfBoth,
    Purpose,
    Tails,
    Training,
    TriedGate,
)
from tracknoise.exceptions import SettingsError
from tracknoise.inference.track_noise import COMPONENTS, TrackNoise
from tracknoise.tables.enumerations import Trust
from tracknoise.tables.trust import TruthVerdict


class ExportedModel(Protocol):
    """What advice and exports use of a noise model: see `tracknoise.estimators.noise_model.NoiseModel`."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    @property
    def training(self) -> Training:
        """What it was fitted to."""

    @property
    def camera(self) -> CameraOfModel:
        """The camera of the recordings that it was fitted to."""

    @property
    def first(self) -> Component:
        """Noise of the first position."""

    @property
    def white(self) -> Component:
        """White noise."""

    @property
    def walk(self) -> Component:
        """Random walk."""

    @property
    def drift(self) -> Component:
        """Drift."""

    @property
    def tails(self) -> Tails:
        """Student's distribution of single errors."""

    @property
    def common_share(self) -> Interval | None:
        """Share of the variance that all features of a frame have in common; None where it is not known."""

    @property
    def outlier_share(self) -> float:
        """Share of the observations that are outliers."""

    @property
    def bias(self) -> Bias:
        """Mean error."""

    @property
    def equivalents(self) -> tuple[Equivalent, ...]:
        """Standard deviations for all observations, named by what they make right."""

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """Robust losses that were tried."""

    @property
    def gate_trial(self) -> TriedGate | None:
        """What the gate of a filter does; None where it was not tried."""

    @property
    def known_points(self) -> tuple[KnownPoints, ...]:
        """Sigmas for one pose from known points."""

    @property
    def of_both(self) -> OfBoth | None:
        """What positions in two cameras are to an estimator; None of a tracker of one camera."""

    @property
    def truth(self) -> TruthVerdict:
        """The verdict on the truth that it was fitted with."""

    @property
    def components(self) -> TrackNoise:
        """All components."""

    @property
    def text(self) -> str:
        """The model as a document."""

    @property
    def sha256(self) -> str:
        """Hash of the document."""

    def equivalent(self, *, landmark: Landmark, window: int, purpose: Purpose) -> Equivalent:
        """The standard deviation for a purpose."""


class Gate(StrEnum):
    """What a chi-square test of an estimator accepts or rejects as a whole."""

    TRACK = "track"
    """All observations of a track, its point eliminated."""
    OBSERVATION = "observation"
    """One observation of a feature in the state, or of a point that is known."""


SHORTEST_WINDOW = 2
"""Frames."""
FEATURES = 200
"""Of a frame, where it is not stated how many an estimator uses."""
CLAIMED: Mapping[Gate, float] = {Gate.TRACK: 0.01, Gate.OBSERVATION: 0.1}
"""Share of the variance of innovations that a filter claims for errors of predicted poses: the least gates."""
GOOD = 0.8
"""Share of good tracks that a gate lets through."""
UNTRIED_KNEES: Mapping[LossKind, float] = {LossKind.CAUCHY: 1.0, LossKind.HUBER: 1.345}
"""Knees in sigmas of innovations where none was tried."""
_ALIKE = 1.02
"""Errors of poses that differ by less than this factor are alike; the larger knee has fewer local minima."""
_GAUSSIAN_KNEE = 2.385
"""Knee of a Cauchy loss that keeps 95 % of the efficiency of least squares for Gaussian errors."""
LEVEL = 0.95
"""Level of the quantile that the factor of a gate multiplies."""
_LEAST_PX = 1e-9
"""A smaller sigma is a rounding error."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice:
    """What to set in one estimator."""

    # landmark, purpose, window: What sigma is for: how the estimator uses the first observation, what is made right,
    # and the length of its window, frames. It is the length that the model has, nearest to that of the estimator.
    landmark: Landmark
    purpose: Purpose
    window: int
    sigma: Interval  # standard deviation of each coordinate, px
    # kernel, knee_px: the robust loss, and its knee in px; None where the estimator has none
    kernel: LossKind | None = None
    knee_px: float | None = None
    # of a frame, whose errors in common sigma counts; None where it takes them as independent
    features: int | None = None
    simulated: bool = False  # whether its windows are
    windows: int = 0  # on how many windows of the recordings the loss was tried; 0 where it was not
    gates: Mapping[Gate, float]  # what to multiply a chi-square gate at .95 by, with `sigma`
    gated: TriedGate | None = None  # what its gate of tracks does; None where it has none, or it was not tried
    state: "Advice | None" = None  # of features in the state, where these have a sigma of their own

    @property
    def every_gate(self) -> Mapping[Gate, float]:
        """Also those of features in the state."""
        return self.gates if self.state is None else {**self.gates, **self.state.gates}

    @property
    def knee(self) -> float | None:
        """The knee in units of sigma."""
        return None if self.knee_px is None else self.knee_px / self.sigma.value

    @property
    def is_without_trial(self) -> bool:
        """Whether sigma is that without the loss, because this was not tried. Known points need no trial."""
        return self.kernel is not None and self.landmark is not Landmark.KNOWN and not self.windows


def advise(
    model: ExportedModel,
    *,
    landmark: Landmark,
    purpose: Purpose,
    window: int,
    features: int | None = None,
    kernel: LossKind | None = None,
    knee: float | None = None,
    gates: Sequence[Gate] = (),
) -> Advice:
    """What to set in an estimator.

    `model`: in px and frames of the estimator; `landmark`, `purpose`, `window`: how it uses the first observation of a
    track, what its sigma is to make right, and the length of its window; `features`: of a frame, None for independent
    ones; `kernel`, `knee`: its robust loss, None if it has none; and the knee in sigmas where the estimator fixes it;
    `gates`: its chi-square tests.
    """
    require_whole("window", window, SHORTEST_WINDOW)
    if features is not None:
        require_whole("features", features, 1)
    if model.components.is_zero:
        tracker = model.training.tracker
        raise SettingsError(f"no noise of {tracker} was measured: found components of 0 px only, expected one above 0")
    if landmark is Landmark.KNOWN:
        return _of_known_point(model, window, features, kernel, knee, gates)
    found = _positive(model, landmark, purpose, window)
    added = _in_common(model, found.per_feature, features)
    if kernel is None:
        sigma, knee_px, windows = _sum_of_squares(found.sigma, added), None, 0
    else:
        sigma, knee_px, windows = _with_kernel(model, found, kernel, knee, added)
    limits = {gate: _gate(model, found, gate, sigma.value) for gate in gates}
    is_tried = Gate.TRACK in limits and (landmark, purpose, kernel) == (Landmark.FREE, Purpose.NEWEST_POSE, None)
    return Advice(
        landmark=landmark,
        purpose=purpose,
        window=found.window,
        simulated=found.simulated,
        sigma=sigma,
        features=None if added is None else features,
        kernel=kernel,
        knee_px=knee_px,
        windows=windows,
        gates=limits,
        gated=model.gate_trial if is_tried else None,
    )


def _in_common(model: ExportedModel, per_feature: Interval | None, features: int | None) -> Interval | None:
    """What errors in common add to the square of sigma, px^2; None where sigma does not count them.

    They have to be shown, and to be those of the tracker.
    """
    share = model.common_share
    is_shown = share is not None and bool(share.low) and model.truth.verdict is Trust.trusted
    if features is None or per_feature is None or not is_shown:
        return None
    return _product(per_feature, Interval(value=float(features)))


def _sum_of_squares(sigma: Interval, added: Interval | None) -> Interval:
    """The root of the square of sigma and what is added, with bounds of a sum of independent terms."""
    if added is None:
        return sigma
    total = sigma.value**2 + added.value

    def bound(of_sigma: float | None, of_added: float | None, sign: float) -> float | None:
        if of_sigma is None or of_added is None:
            return None
        return math.sqrt(max(total + sign * math.hypot(of_sigma**2 - sigma.value**2, of_added - added.value), 0.0))

    low, high = bound(sigma.low, added.low, -1.0), bound(sigma.high, added.high, 1.0)
    return Interval(value=math.sqrt(total), low=low, high=high)


def innovations_of(model: ExportedModel, found: Advice) -> Interval:
    """What innovations and residuals look like in the windows of an advice, px.

    Parameters
    ----------
    model
        That the advice is from.
    found
        Whatever its landmark is, points are solved for.

    Raises
    ------
    SettingsError
        If the model has no such sigma.
    """
    return model.equivalent(landmark=Landmark.FREE, window=found.window, purpose=Purpose.INNOVATIONS).sigma


def _positive(model: ExportedModel, landmark: Landmark, purpose: Purpose, window: int) -> Equivalent:
    found = model.equivalent(landmark=landmark, window=window, purpose=purpose)
    if found.sigma.value < _LEAST_PX:
        raise SettingsError(
            f"sigma for {found.purpose}, windows of {found.window} frames, is {found.sigma.value:g} px, "
            "expected a number above 0"
        )
    return found


def _with_kernel(
    model: ExportedModel, plain: Equivalent, kernel: LossKind, knee: float | None, added: Interval | None
) -> tuple[Interval, float, int]:
    """Sigma, knee in px, and on how many windows they were tried, in place of the sigma of least squares."""
    ratios = {one: ratio for one in model.kernels if one.kind is kernel and (ratio := one.ratio(plain.purpose))}
    tried = list(ratios)
    if not tried:
        residuals = _positive(model, plain.landmark, Purpose.INNOVATIONS, plain.window).sigma.value
        sigma = _sum_of_squares(plain.sigma, added)
        return sigma, UNTRIED_KNEES[kernel] * residuals if knee is None else knee * sigma.value, 0
    if knee is None:
        best = _best(tried)
        return _under_loss(plain, ratios[best], best, added), best.knee_px, best.windows
    sigma, grown = plain.sigma, 1.0
    for _ in range(1 if added is None else 10):  # the knee follows sigma
        nearest, ratio = _at_fixed_knee(ratios, knee * plain.sigma.value * grown)
        sigma = _under_loss(plain, ratio, nearest, added)
        grown = sigma.value / (plain.sigma.value * ratio.value)
    return sigma, knee * sigma.value, tried[0].windows


def _under_loss(plain: Equivalent, ratio: Interval, tried: Kernel, added: Interval | None) -> Interval:
    """Sigma with a robust loss, by (advice.features)."""
    sigma = _product(plain.sigma, ratio)
    kept = Interval(value=(ratio.value / tried.error_ratio.value) ** 2)
    return _sum_of_squares(sigma, None if added is None else _product(added, kept))


def _best(tried: Sequence[Kernel]) -> Kernel:
    """The mildest of the best ones. A gain over least squares that is not established is chance: then the mildest."""
    sure = [one for one in tried if one.error_ratio.high is None or one.error_ratio.high < 1.0] or [
        max(tried, key=lambda one: one.knee_px)
    ]
    least = min(one.error_ratio.value for one in sure)
    return max((one for one in sure if one.error_ratio.value <= _ALIKE * least), key=lambda one: one.knee_px)


def _at_fixed_knee(ratios: Mapping[Kernel, Interval], knee_px: float) -> tuple[Kernel, Interval]:
    """Sigma ratio r with a knee of r times a number of px, between the knees that were tried; and the nearest."""
    ordered = sorted(ratios, key=lambda one: one.knee_px)
    values = np.array([ratios[one].value for one in ordered])
    excess = np.array([np.log(one.knee_px) for one in ordered]) - np.log(knee_px * values)
    value = float(np.exp(np.interp(0.0, excess, np.log(values))))
    nearest = ordered[int(np.argmin(np.abs(excess)))]
    return nearest, _product(ratios[nearest], Interval(value=value / ratios[nearest].value))


def _product(interval: Interval, factor: Interval) -> Interval:
    """A product with the relative bounds of the factor; where it has none, those of the interval."""
    value = interval.value * factor.value
    bounds = factor if factor.low is not None and factor.high is not None else interval
    low, high = (None if bound is None else value * bound / bounds.value for bound in (bounds.low, bounds.high))
    return Interval(value=value, low=low, high=high)


def _gate(model: ExportedModel, plain: Equivalent, gate: Gate, sigma: float) -> float:
    """Factor on a chi-square gate at .95, with this sigma, by (advice.gate)."""
    if gate is Gate.TRACK:
        good = plain.gate_95 if plain.gate_80 is None else plain.gate_80
        cameras = 1 if model.of_both is None else 2
        return track_gate(good * (plain.sigma.value / sigma) ** 2, plain.window, cameras)
    innovations = model.equivalent(landmark=plain.landmark, window=plain.window, purpose=Purpose.INNOVATIONS).sigma
    return min(max(observation_gate(model, innovations.value, sigma, LEVEL), CLAIMED[gate]), 1.0)


def track_gate(good: float, window: int, cameras: int = 1) -> float:
    """Factor on a chi-square gate of tracks at .95, by (advice.gate), from that of good tracks at true poses."""
    freedom = 2 * cameras * window - 3
    return max(good * chi_square(GOOD, freedom) / chi_square(LEVEL, freedom), CLAIMED[Gate.TRACK])


def observation_gate(model: ExportedModel, innovations: float, sigma: float, level: float) -> float:
    """Factor on a chi-square gate of one observation at a level, which that share of good observations passes.

    Good observations are no outliers of the model. They are at true poses, as in (advice.gate).
    """
    noise, tails, good = (innovations / sigma) ** 2, model.tails, level * (1.0 - model.outlier_share)
    if math.isfinite(tails.nu):
        square = tails.core_ratio**2 * tails.nu * ((1.0 - good) ** (-2.0 / tails.nu) - 1.0)  # of Student's distribution
        noise *= square / chi_square(level, 2)
    return noise


def chi_square(level: float, freedom: int) -> float:
    """Quantile of chi square."""
    return 2.0 * float(gammaincinv(freedom / 2.0, level))


def _of_known_point(
    model: ExportedModel,
    window: int,
    features: int | None,
    kernel: LossKind | None,
    knee: float | None,
    gates: Sequence[Gate],
) -> Advice:
    """For points that are known."""
    tried = [one for one in model.known_points if one.kernel is kernel and knee is None]
    found = min(tried, key=lambda one: (abs(one.window - window), one.window), default=None)
    found = _untried_points(model, window, kernel, knee) if found is None else found
    plain = rms_about_first(model.components, found.window)
    added = _in_common(model, found.per_feature, features)
    sigma = _sum_of_squares(found.sigma, added)
    limits = {gate: observation_gate(model, plain, sigma.value, LEVEL) for gate in gates}
    return Advice(
        landmark=Landmark.KNOWN,
        purpose=Purpose.NEWEST_POSE,
        window=found.window,
        features=None if added is None else features,
        sigma=sigma,
        kernel=kernel,
        knee_px=found.knee_px,
        gates=limits,
    )


def rms_about_first(noise: TrackNoise, window: int) -> float:
    """RMS of the errors about the first position by the components, px, ages 1 to the length of a window."""
    ages = np.arange(1.0, window + 1.0)
    parts = zip(COMPONENTS, noise, strict=True)
    return math.sqrt(sum(np.trace(own) / 2.0 * (ages**one.power).mean() for one, own in parts))


def usual_knee(tails: Tails, rms_px: float) -> float:
    """Knee of a robust loss, px, for errors of Student's distribution whose RMS is this by the components."""
    usual = math.sqrt(tails.nu) if math.isfinite(tails.nu) else _GAUSSIAN_KNEE
    return min(usual, _GAUSSIAN_KNEE) * tails.core_ratio * rms_px


def _untried_points(model: ExportedModel, window: int, kernel: LossKind | None, knee: float | None) -> KnownPoints:
    """Sigma and knee, px, for errors of Student's distribution that are the same in all scenes, by (loss.nees)."""
    plain = rms_about_first(model.components, window)
    if kernel is None:
        return KnownPoints(window=window, kernel=None, knee_px=None, sigma=Interval(value=plain))
    core, kind = model.tails.core_ratio * plain, BundleLoss(kernel)
    knee_px, sigma = usual_knee(model.tails, plain) if knee is None else knee * core, core
    for _ in range(1 if knee is None else 30):  # a fixed knee follows sigma
        sigma = math.sqrt(expected_nees(Loss(kind, knee_px / core), nu=model.tails.nu)) * core
        knee_px = knee_px if knee is None else knee * sigma
    return KnownPoints(window=window, kernel=kernel, knee_px=knee_px, sigma=Interval(value=sigma))
