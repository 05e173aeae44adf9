"""What is known of the noise of one tracker at one speed, as an estimator needs it.

The error of an observation about the first position of its track, at age k >= 1, is modelled as

    e_k = M_k a + w_k + sum_{1 <= i <= k} (M_k / M_i) q_i + k d                          (noise_model.error)

with the magnification of the image about the point since birth, M_k = Z_0 / Z_k; a of covariance A (the error of the
first position, its sign turned), w_k of covariance W (independent in each frame), q_i of covariance Q (walk) and d of
covariance D (drift, constant in a track).
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Gt, Le
from numpy.typing import ArrayLike, NDArray
from pydantic import GetPydanticSchema
from pydantic_core import CoreSchema, core_schema

from tracknoise.checks import require, require_bounds, require_within
from tracknoise.exceptions import SettingsError, UnknownNameError, first_line
from tracknoise.inference.track_noise import TrackNoise
from tracknoise.tables.schema import QUALITY_NAME

MOST_PX = 1e6
"""Largest standard deviation, and longest side of an image."""
LEAST_DEGREES = 0.1
"""Fewest degrees of freedom of Student's t."""
_MOST_RATIO, _MOST_LOG = 1e6, 200.0
Pixels = Annotated[float, Ge(0), Le(MOST_PX)]
"""A length in the image, px."""
Ratio = Annotated[float, Ge(0), Le(_MOST_RATIO)]
"""Of two positive numbers that are alike."""


def as_covariance() -> GetPydanticSchema:
    """Two rows of two numbers."""
    number = core_schema.float_schema(allow_inf_nan=False)
    row = core_schema.list_schema(number, min_length=2, max_length=2)
    rows = core_schema.list_schema(row, min_length=2, max_length=2)
    return _converted(rows, _covariance, lambda array: array.tolist())


def as_degrees() -> GetPydanticSchema:
    """A number from `LEAST_DEGREES` on, or null for infinity."""
    number = core_schema.nullable_schema(core_schema.float_schema(ge=LEAST_DEGREES, allow_inf_nan=False))
    return _converted(number, lambda found: math.inf if found is None else found, _finite_or_none)


def _converted(schema: CoreSchema, read: Callable[[Any], Any], write: Callable[[Any], Any]) -> GetPydanticSchema:
    written = core_schema.plain_serializer_function_ser_schema(write)
    found = core_schema.no_info_after_validator_function(read, schema, serialization=written)
    return GetPydanticSchema(lambda _kind, _handler: found)


def _finite_or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _covariance(rows: list[list[float]]) -> NDArray[np.float64]:
    covariance = np.array(rows)
    if covariance[0, 1] != covariance[1, 0] or np.linalg.eigvalsh(covariance)[0] < -1e-9 * np.trace(covariance):
        raise ValueError("a symmetric matrix without negative eigenvalues")
    return covariance


TOLERANCE = 0.02
"""Largest relative difference of focal lengths, and of rates, that count as equal."""

Covariance = Annotated[NDArray[np.float64], as_covariance()]
"""(2, 2) float64, symmetric and not negative: of u and v."""


class Landmark(StrEnum):
    """How an estimator uses the first observation of a track."""

    FREE = "free"
    """The 3-D point is solved for, and the first observation has a residual like any other."""
    EXACT = "exact"
    """The first observation is taken as true."""
    STATE = "state"
    """The first direction is a state with a prior."""
    KNOWN = "known"
    """The 3-D point is known, as that of a map, or by a depth image at the first observation."""


class Purpose(StrEnum):
    """What one standard deviation is to make right."""

    INNOVATIONS = "innovations"
    """Normalised innovations or residuals are as large as their degrees of freedom."""
    ALL_POSES = "all_poses"
    """The covariance of all poses of a window is right on average."""
    NEWEST_POSE = "newest_pose"
    """The covariance of the newest pose is right."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """A value with the bounds of its interval, all in the same unit. Bounds are None where there is no interval."""

    value: float
    low: float | None = None
    high: float | None = None

    def __post_init__(self) -> None:
        """Refuse a lower bound above the upper one."""
        if self.low is not None and self.high is not None and self.low > self.high:
            raise ValueError(f"a lower bound not above the upper one, found {self.low:g} and {self.high:g}")

    @classmethod
    def of(cls, value: float, low: float, high: float) -> "Interval":
        """From numbers, with bounds that are NaN where there is no interval."""
        known = [None if math.isnan(bound) else bound for bound in (low, high)]
        return cls(value=value, low=known[0], high=known[1])

    def within(self, least: float, most: float) -> "Interval":
        """The same with numbers that are not beyond these."""
        return self._changed(lambda number: min(max(number, least), most))

    def times(self, factor: float) -> "Interval":
        """A product with a positive number, with its bounds."""
        return self._changed(lambda number: number * factor)

    def root(self) -> "Interval":
        """The root of a number that is not negative, with its bounds."""
        return self._changed(math.sqrt)

    def _changed(self, change: Callable[[float], float]) -> "Interval":
        """An increasing function of the value and of the bounds."""
        low, high = (None if bound is None else change(bound) for bound in (self.low, self.high))
        return Interval(value=change(self.value), low=low, high=high)

    def require_within(self, name: str, **bounds: float) -> None:
        """Raise InvalidValueError, naming the field, unless all numbers are finite and within bounds."""
        for number in (self.value, self.low, self.high):
            if number is not None:
                require_within(name, number, bounds)


def _require_ratio(name: str, ratio: Interval) -> None:
    ratio.require_within(name, ge=1.0 / _MOST_RATIO, le=_MOST_RATIO)


def _require_variance(per_feature: Interval | None) -> None:
    if per_feature is not None:
        per_feature.require_within("per_feature", ge=0.0, le=MOST_PX**2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Component:
    """A covariance of `noise_model.error`.

    Parameters
    ----------
    covariance
        (2, 2) float64, px^2 at full resolution; of the walk px^2 per frame, of the drift px^2 per frame^2. Zero if the
        component was dropped.
    sigma
        The square root of half its trace, px, with its interval over scenes.
    why_dropped
        A sentence, if the component was dropped.
    """

    covariance: Covariance
    sigma: Interval
    why_dropped: str | None = None

    def __post_init__(self) -> None:
        """Refuse what no tracker has: see `MOST_PX`."""
        self.sigma.require_within("sigma", ge=0.0, le=MOST_PX)
        for variance in np.diagonal(self.covariance):
            require_within("covariance", float(variance), {"ge": 0.0, "le": MOST_PX**2})


NO_COMPONENT = Component(covariance=np.zeros((2, 2)), sigma=Interval(value=0.0))
"""Of a model that was fitted without it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Equivalent:
    """One standard deviation for all observations, and what it makes right.

    Parameters
    ----------
    landmark, purpose
        Estimators and uses it is right for.
    window
        Length of the window, frames.
    sigma
        Standard deviation of each coordinate, px at full resolution.
    gate_95, gate_99, gate_80
        What to multiply a chi-square gate at .95, .99 or .80 by, so that it lets through that share of good tracks at
        true poses. That of .80 is missing in files of earlier versions.
    simulated
        Whether the windows are simulated, sideways and forward: no recording has so many frames that move.
    per_feature
        What each feature of a frame adds to the square of sigma, px^2, because features err together; None where this
        is not known.
    """

    landmark: Landmark
    purpose: Purpose
    window: Annotated[int, Ge(2), Le(100_000)]
    sigma: Interval
    gate_95: Ratio
    gate_99: Ratio
    gate_80: Ratio | None = None
    simulated: bool = False
    per_feature: Interval | None = None

    def __post_init__(self) -> None:
        """Refuse sigmas and gates that no tracker has."""
        require_bounds(self)
        self.sigma.require_within("sigma", ge=0.0, le=MOST_PX)
        _require_variance(self.per_feature)


class LossKind(StrEnum):
    """Robust losses of estimators."""

    CAUCHY = "cauchy"
    HUBER = "huber"


@dataclass(frozen=True, slots=True, kw_only=True)
class Kernel:
    """A robust loss, and the sigma with which the covariance that a bundle adjustment claims is right.

    It was tried on windows of the recordings (`tracknoise.estimators.kernels`). A knee in px decides on the poses,
    sigma only on what is claimed of them: the two belong together.

    Parameters
    ----------
    kind
        Of the loss.
    knee_px
        Its knee, px.
    sigma_ratio
        The sigma with which the newest pose has a NEES of 1 under this loss, over that of `Equivalent` for the same
        window, a free landmark and the newest pose. It is taken to be the same for other windows and landmarks.
    all_poses_ratio
        The same for all poses; None in models of earlier versions.
    error_ratio
        Errors of the newest pose over those of least squares, geometric mean over windows, position and rotation.
    windows
        Number of windows.
    """

    kind: LossKind
    knee_px: Annotated[float, Gt(0), Le(MOST_PX)]
    sigma_ratio: Interval
    error_ratio: Interval
    windows: Annotated[int, Ge(1)]
    all_poses_ratio: Interval | None = None

    def __post_init__(self) -> None:
        """Refuse a knee and ratios that no loss has."""
        require_bounds(self)
        _require_ratio("sigma_ratio", self.sigma_ratio)
        _require_ratio("error_ratio", self.error_ratio)
        if self.all_poses_ratio is not None:
            _require_ratio("all_poses_ratio", self.all_poses_ratio)

    def ratio(self, purpose: Purpose) -> Interval | None:
        """That of a purpose; None if it is not known."""
        return self.all_poses_ratio if purpose is Purpose.ALL_POSES else self.sigma_ratio


@dataclass(frozen=True, slots=True, kw_only=True)
class TriedGate:
    """What the gate of a filter does to the covariance that it claims: see `tracknoise.estimators.pose_trials`.

    Parameters
    ----------
    nees
        Of the newest pose from the tracks that pass, over that from all, for which sigma is right.
    passed
        Share of the tracks that pass.
    window, windows
        Length, frames, and number of the windows.
    """

    nees: Interval
    passed: Interval
    window: Annotated[int, Ge(2), Le(100_000)]
    windows: Annotated[int, Ge(1)]

    def __post_init__(self) -> None:
        """Refuse a NEES and a share that no gate leaves."""
        require_bounds(self)
        self.nees.require_within("nees", ge=0.0, le=_MOST_RATIO)
        self.passed.require_within("passed", ge=0.0, le=1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownPoints:
    """A standard deviation for one pose from points that are known: see `tracknoise.estimators.pose_trials`.

    Parameters
    ----------
    window
        Oldest age of the observations, frames.
    kernel, knee_px
        The robust loss, and its knee, px; None without a loss.
    sigma
        Standard deviation of each coordinate, px at full resolution.
    per_feature
        As that of `Equivalent`.
    """

    window: Annotated[int, Ge(1), Le(100_000)]
    kernel: LossKind | None
    knee_px: Annotated[float, Gt(0), Le(MOST_PX)] | None
    sigma: Interval
    per_feature: Interval | None = None

    def __post_init__(self) -> None:
        """Refuse what no tracker has: see `MOST_PX`."""
        require_bounds(self)
        self.sigma.require_within("sigma", ge=0.0, le=MOST_PX)
        _require_variance(self.per_feature)


@dataclass(frozen=True, slots=True, kw_only=True)
class OfBoth:
    """What positions in two cameras are to an estimator: see `tracknoise.estimators.two_cameras`.

    Parameters
    ----------
    correlation
        Of the errors in both cameras, of those older than 0 frames.
    correlated_ratio
        Sigma of an estimator that knows this correlation, over that of one that takes positions as independent, for a
        free landmark and the newest pose.
    position_ratio, rotation_ratio
        Errors of the newest pose with both cameras, over those with the first alone, where the scale is known.
    windows
        Number of windows.
    """

    correlation: Annotated[float, Ge(-1), Le(1)]
    correlated_ratio: Annotated[float, Gt(0), Le(_MOST_RATIO)]
    position_ratio: Interval
    rotation_ratio: Interval
    windows: Annotated[int, Ge(1)]

    def __post_init__(self) -> None:
        """Refuse ratios that no cameras have."""
        require_bounds(self)
        _require_ratio("position_ratio", self.position_ratio)
        _require_ratio("rotation_ratio", self.rotation_ratio)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tails:
    """Student t of the errors, untrimmed.

    Parameters
    ----------
    nu
        Degrees of freedom; infinite where the Gaussian describes the errors at least as well.
    core_sigma
        Scale of the core (2-D, per axis) at the ages of the sample, px.
    core_ratio
        This scale over the standard deviation that all components give at the same ages, none of them dropped.
    """

    nu: Annotated[float, as_degrees()]
    core_sigma: Pixels
    core_ratio: Ratio = 1.0

    def __post_init__(self) -> None:
        """Refuse degrees of freedom, and a core, that no errors have."""
        require_bounds(self)
        require(self.nu >= LEAST_DEGREES, "nu", self.nu, f"a number of at least {LEAST_DEGREES:g}, or infinity")


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraOfModel:
    """The camera of the recordings of a model: image size, px, and if known focal length, px, and rate, Hz.

    Focal length and rate are unknown where recordings differ in them. `notes` are sentences that say so.
    """

    width: Annotated[int, Gt(0), Le(MOST_PX)]
    height: Annotated[int, Gt(0), Le(MOST_PX)]
    focal_px: Annotated[float, Ge(1e-3), Le(MOST_PX)] | None
    rate_hz: Annotated[float, Ge(1e-6), Le(1e6)] | None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what no camera has."""
        require_bounds(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Training:
    """What a model was fitted to.

    Parameters
    ----------
    dataset, tracker, speed
        Names as in the run; speed in frames of the recording per processed frame.
    tracker_settings
        Resolved options of the tracker, as in ``experiment.toml``.
    scenes
        Names of the scenes.
    n_tracks, n_observations
        Counts of what was fitted.
    ages
        First and last age that were fitted, frames.
    median_lifetime
        Kaplan-Meier median of the lifetime of tracks, frames that the tracker processed; None where more than half are
        alive at the end of the data, or where it is not known.
    """

    dataset: str
    tracker: str
    speed: Annotated[float, Gt(0), Le(_MOST_RATIO)]
    tracker_settings: dict[str, object]
    scenes: tuple[str, ...]
    n_tracks: Annotated[int, Ge(0)]
    n_observations: Annotated[int, Ge(0)]
    ages: tuple[int, int]
    median_lifetime: Annotated[int, Ge(0)] | None = None

    def __post_init__(self) -> None:
        """Refuse counts and a speed that no run has."""
        require_bounds(self)


class BiasKind(StrEnum):
    """What is known of the mean error."""

    NONE = "none"
    """It was not examined, or is not known."""
    REFUSED = "refused"
    """No correction is warranted."""
    BY_AGE = "by_age"
    """It depends on the age of the track."""
    ALONG_MOTION = "along_motion"
    """It is proportional to the motion of the image."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bias:
    """Mean error, and whether a correction by it is warranted.

    Parameters
    ----------
    kind
        What it depends on.
    why
        A sentence.
    ages, mean_px
        Ages, and the mean error (u, v) at each of them, px; empty for other kinds.
    per_motion
        Error along the motion of the image, per px of motion from one frame to the next; 0 for other kinds.
    reduction
        Share of the second moment of the errors of scenes that were left out, that the correction removes.
    """

    kind: BiasKind
    why: str
    ages: tuple[int, ...] = ()
    mean_px: tuple[tuple[float, float], ...] = ()
    per_motion: Annotated[float, Ge(-_MOST_RATIO), Le(_MOST_RATIO)] = 0.0
    reduction: Interval | None = None

    def __post_init__(self) -> None:
        """Refuse ages without a mean error, means without an age, and a mean by age without any."""
        require_bounds(self)
        for mean in self.mean_px:
            for number in mean:
                require_within("mean_px", number, {"ge": -MOST_PX, "le": MOST_PX})
        missing = self.kind == BiasKind.BY_AGE and not self.ages
        if missing or len(self.ages) != len(self.mean_px) or not _increase(self.ages):
            raise ValueError("increasing ages and a mean error of each")


@dataclass(frozen=True, slots=True, kw_only=True)
class Factor:
    """A factor on the covariances of white noise and walk, by something that is known at run time.

    It is piecewise linear in the natural logarithm of the covariate, and constant outside of the trained range.

    Parameters
    ----------
    of
        Name of the covariate: ``motion_px``, or that of a quality that the tracker reports. It becomes a part of names
        in code, and has the form of `tracknoise.tables.schema.QUALITY_NAME`.
    log_knots, log_factor
        Natural logarithms of the covariate, and of the factor there.
    gain
        Mean gain in log likelihood on scenes that were left out, nat per change of the error, or per track where the
        factor is one of `TrackScale`. That of a second factor is beyond the first one.
    """

    of: str
    log_knots: tuple[float, ...]
    log_factor: tuple[float, ...]
    gain: Interval

    def __post_init__(self) -> None:
        """Refuse names that are no part of a name in code, knots without a factor, and factors without a knot."""
        require(re.fullmatch(QUALITY_NAME, self.of) is not None, "of", self.of, f"a name of the form {QUALITY_NAME}")
        for number in (*self.log_knots, *self.log_factor):
            require_within("logarithm", number, {"ge": -_MOST_LOG, "le": _MOST_LOG})
        if not self.log_knots or len(self.log_knots) != len(self.log_factor) or not _increase(self.log_knots):
            raise ValueError("increasing knots and a factor at each")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackScale:
    """Noise with a scale of its own for each track (`tracknoise.estimators.track_likelihood`).

    The covariance of a track is S / g, with a gamma variable g of mean 1 and shape nu / 2: its errors together have
    Student's distribution. S is made of `first`, `white` and `walk` as covariances of second moments are. It describes
    the bulk of the tracks. The second moment is S nu / (nu - 2), which the worst tracks decide. It is better than a
    Gaussian for heavy tails in each frame, too: this does not show that scales are of tracks.

    Parameters
    ----------
    nu
        Degrees of freedom, with their interval over scenes; None where all tracks have the same scale. Fewer than 2.05
        are not fitted: 2.05 without bounds is at most that.
    why_one_scale
        A sentence, where all tracks have the same scale.
    first, white, walk
        Scale matrices A, W and Q of S, the same in all directions, with intervals over scenes.
    conditions
        Factors on W and Q in S. They multiply.
    gain
        Gain in log likelihood over the components of second moments, on scenes that were left out, nat per track; None
        if nothing can be left out.
    why_refused
        A sentence, if this gain is not warranted; the components of second moments are then to be used.
    """

    nu: Interval | None
    why_one_scale: str | None = None
    first: Component
    white: Component
    walk: Component
    conditions: tuple[Factor, ...] = ()
    gain: Interval | None
    why_refused: str | None = None

    def __post_init__(self) -> None:
        """Refuse degrees of freedom that no scale has."""
        if self.nu is not None:
            self.nu.require_within("nu", ge=LEAST_DEGREES)

    @property
    def noise(self) -> TrackNoise:
        """The scale matrices of the bulk."""
        parts = {name: getattr(self, name).covariance for name in ("first", "white", "walk")}
        return TrackNoise(**parts)


def _increase(values: Sequence[float]) -> bool:
    return all(before < after for before, after in pairwise(values))


def factor_of(conditions: Sequence[Factor], at: Mapping[str, ArrayLike], count: int) -> NDArray[np.float64]:
    """Product of the factors, (count,) float64; what is unknown or NaN has the factor 1."""
    by_name = {factor.of: factor for factor in conditions}
    for name in at:
        if name not in by_name:
            raise UnknownNameError("condition of the noise model", name, by_name)
    total = np.zeros(count)
    for name, values in at.items():
        total += log_factor(by_name[name], np.broadcast_to(np.asarray(values, dtype=np.float64), (count,)))
    return np.asarray(np.exp(total))


def of_one_length(**values: ArrayLike) -> list[NDArray[np.float64]]:
    """Numbers and rows of numbers as rows of one length, (n,) float64.

    Raises
    ------
    SettingsError
        Naming the first that is neither, or is not as long as those before it.
    """
    arrays = {name: numbers(name, value) for name, value in values.items()}
    count = next((array.size for array in arrays.values() if array.ndim), 1)
    for name, array in arrays.items():
        if array.ndim > 1 or (array.ndim and array.size != count):
            raise SettingsError(f"{name}: found shape {array.shape}, expected one number or ({count},)")
    return [np.full(count, array, dtype=np.float64) for array in arrays.values()]


def numbers(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """An array of numbers, of any shape. Raises SettingsError, naming it, unless it is one."""
    try:
        found = np.asarray(values)
    except ValueError as error:
        raise SettingsError(f"{name}: {first_line(error)}, expected numbers") from error
    require(found.dtype.kind in "iuf", name, values, "numbers")
    return found.astype(np.float64)


def log_factor(factor: Factor, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Logarithms of a factor at values (n,) of its covariate; 0 where they are NaN."""
    least = np.exp(factor.log_knots[0])
    known = np.where(np.isnan(values), least, np.maximum(values, least))
    found = np.interp(np.log(known), factor.log_knots, factor.log_factor)
    return np.where(np.isnan(values), 0.0, found)


def corrected(
    bias: Bias, uv: NDArray[np.float64], ages: NDArray[np.float64], flow: ArrayLike | None
) -> NDArray[np.float64]:
    """Positions (n, 2) px without the bias, at ages (n,). First positions stay: biases are about them."""
    if bias.kind == BiasKind.BY_AGE:
        return uv - by_age(bias, ages)
    if bias.kind == BiasKind.ALONG_MOTION:
        if flow is None:
            raise SettingsError("correction: found no flow, expected it because the bias is along the motion")
        later = np.where(ages[:, None] > 0.0, np.asarray(flow, dtype=np.float64), 0.0)
        return np.asarray(uv - bias.per_motion * later)
    return uv.copy()


def by_age(bias: Bias, ages: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean error at ages (n,), (n, 2) px: between the known ages along a line, beyond them that of the last."""
    mean = np.array(bias.mean_px)
    since = np.array((0, *bias.ages), dtype=np.float64)
    return np.stack([np.interp(ages, since, [0.0, *mean[:, axis]]) for axis in (0, 1)], axis=1)
