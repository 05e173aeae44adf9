"""Noise models, their calibration and tables of noise as sentences and tables.

The calibration is that of predicted covariances. Tables of noise are by tracker, speed and motion.
"""

import math
from typing import Any

from tracknoise.analysis.covariance_verdicts import are_right
from tracknoise.estimators.advice import innovations_of
from tracknoise.estimators.calibration import Calibration
from tracknoise.estimators.exports import estimator, in_words, of_common
from tracknoise.estimators.lookup_table import NoiseRow, NoiseTable, SecondMoment
from tracknoise.estimators.model import Bias, BiasKind, Interval, Landmark, Purpose
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.estimators.track_likelihood import BULK, LEAST_NU
from tracknoise.exceptions import SettingsError
from tracknoise.inference.track_noise import COMPONENTS
from tracknoise.report.cells import Cells
from tracknoise.tables.enumerations import Product, Trust, Verdict
from tracknoise.text import counted, significant
from tracknoise.topics.lookup_topic import lookup_sentences
from tracknoise.words import DASH, number, percent, ratio, thousandths

_LANDMARKS = {
    Landmark.FREE: "point solved for",
    Landmark.EXACT: "first observation exact",
    Landmark.STATE: "first direction a state",
}
_PURPOSES = {Purpose.INNOVATIONS: "innovations", Purpose.ALL_POSES: "all poses", Purpose.NEWEST_POSE: "newest pose"}


def model_sentences(model: NoiseModel, name: str) -> list[str]:
    """What a model says, the answer first: what to set in an estimator (`tracknoise.estimators.exports.estimators`)."""
    training = model.training
    return [
        f"Noise of {training.tracker} at speed {training.speed:g}.",
        *([] if model.truth.verdict is Trust.trusted else [model.truth.sentence]),
        *_advice(model, name),
        _tails(model),
        f"{_percent(model.outlier_share)} of the observations are outliers, with errors beyond about "
        f"{number(model.outliers_beyond_px)} px; the numbers do not describe them.",
        _model_bias(model),
        *_conditions(model),
        *_track_scale(model),
        *of_common(model.common_share),
        *_floor(model),
        f"Fitted to {counted(len(training.scenes), 'scene')}, {counted(training.n_tracks, 'track')}, "
        f"ages {training.ages[0]} to {training.ages[1]} frames.",
        *model.camera.notes,
    ]


def component_cells(model: NoiseModel) -> Cells:
    """The components, with the reason where one was dropped."""
    rows = []
    for one in COMPONENTS:
        part = getattr(model, one.name)
        rows.append([one.title, *interval_cells(part.sigma), one.unit, part.why_dropped or ""])
    described = f"Components, of the {_percent(1.0 - model.outlier_share)} of the observations that are no outliers"
    return Cells(described, ["component", "sigma", "low", "high", "unit", "dropped because"], rows, _NUMERIC)


_NUMERIC = (False, True, True, True, False, False)


def equivalent_cells(model: NoiseModel, window: int) -> Cells:
    """Standard deviations for windows of nearly this length, named by what they make right."""
    lengths = sorted({one.window for one in model.equivalents}, key=lambda length: (abs(length - window), length))
    some = [one for one in model.equivalents if lengths and one.window == lengths[0]]
    rows = [
        [
            _LANDMARKS[one.landmark],
            _PURPOSES[one.purpose],
            *interval_cells(one.sigma),
            DASH if one.gate_80 is None else number(one.gate_80),
            number(one.gate_95),
            number(one.gate_99),
        ]
        for one in some
    ]
    headings = ["landmark", "makes right", "sigma, px", "low", "high", "gate .80", "gate .95", "gate .99"]
    simulated = "simulated " if any(one.simulated for one in some) else ""
    caption = f"One sigma for all observations, {simulated}windows of {lengths[0] if lengths else window} frames"
    return Cells(caption, headings, rows, (False, False, *[True] * 6))


def _advice(model: NoiseModel, name: str) -> list[str]:
    """What to set, and what innovations will look like."""
    about = estimator(name)
    if about.purpose is None:
        return [f"{about.title} takes the components, which `tracknoise noise export` writes."]
    try:
        found = about.advise(model)
    except SettingsError as error:
        return [f"What to set in {about.title} is unknown: {error}."]
    innovations = innovations_of(model, found)
    to_set = in_words(found, is_bound=not model.truth.is_usable)
    return [f"In {about.title}, set {to_set}.", f"Innovations look like {number(innovations.value)} px."]


def _range(interval: Interval) -> str:
    if interval.low is None or interval.high is None:
        return number(interval.value)
    return f"{number(interval.value)} ({number(interval.low)} to {number(interval.high)})"


def _tails(model: NoiseModel) -> str:
    if math.isinf(model.tails.nu):
        return "Tails are no heavier than those of a Gaussian."
    return f"Tails are those of Student's t with {number(model.tails.nu)} degrees of freedom."


def _model_bias(model: NoiseModel) -> str:
    verdict = {
        BiasKind.NONE: "The mean error is not part of the model",
        BiasKind.REFUSED: "No correction of the mean error is warranted",
    }
    return f"{verdict.get(model.bias.kind, 'The mean error should be corrected')}: {model.bias.why}."


def _conditions(model: NoiseModel) -> list[str]:
    return [
        f"White noise and walk depend on {one.of}: their variances change by a factor of "
        f"{number(math.exp(max(one.log_factor) - min(one.log_factor)))}. On scenes that were left out this gains "
        f"{number(one.gain.value)} nat per change{' beyond the first factor' if place else ''}."
        for place, one in enumerate(model.conditions)
    ]


def _track_scale(model: NoiseModel) -> list[str]:
    """What is gained by a scale of each track, and the bulk that is then left."""
    scale = model.track_scale
    if scale is None:
        return []
    if scale.why_refused is not None or scale.gain is None:
        return [f"The likelihood of whole tracks is not used: {scale.why_refused}."]
    bulk = [one for one in COMPONENTS if one.name in BULK]
    parts = ", ".join(f"{one.letter} {_range(getattr(scale, one.name).sigma)} {one.unit}" for one in bulk)
    gain = f"On what was left out, this gains {_range(scale.gain)} nat per track over second moments."
    qualities = " and ".join(one.of for one in scale.conditions)
    by_quality = f"; W and Q depend on {qualities}" if qualities else ""
    if scale.nu is None:
        return [f"By the likelihood of whole tracks, tails are Gaussian: {parts}{by_quality}. {gain}"]
    return [
        f"Tails of whole tracks are those of Student's t with {_freedom(scale.nu)} degrees of freedom, as of a scale "
        f"for each track, or of heavy tails in each frame. The bulk has {parts}{by_quality}. {gain}"
    ]


def _freedom(nu: Interval) -> str:
    at_limit = nu.low is None and nu.value <= LEAST_NU * (1 + 1e-6)
    return f"at most {number(nu.value)}" if at_limit else _range(nu)


def _floor(model: NoiseModel) -> list[str]:
    if not model.truth_floor_px:
        return []
    return [f"Errors of the truth are part of these numbers: {number(model.truth_floor_px)} px root mean square."]


def interval_cells(interval: Interval) -> list[str]:
    """A value and its bounds, each in a cell of its own; empty where there is none."""
    return [number(value) if value is not None else "" for value in (interval.value, interval.low, interval.high)]


def _percent(share: float) -> str:
    return f"{significant(100.0 * share, 2)} %"


def calibration_sentences(found: Calibration) -> list[str]:
    """What the comparison says, the answer first."""
    return [
        _verdict(found.nees),
        f"Compared with {counted(found.n, 'error')} of {counted(found.n_scenes, 'scene')}.",
        *_trained(found),
        *_outliers(found),
        *_impossible(found),
    ]


def _verdict(nees: Interval) -> str:
    size = number(nees.value**0.5)
    if nees.low is None or nees.high is None:
        return f"Errors are {size} times as large as predicted. There are too few scenes for an interval."
    bounds = f"{number(nees.low**0.5)} to {number(nees.high**0.5)}"
    right = are_right(nees.low, nees.high)
    if right is Verdict.yes:
        return f"The size of the errors agrees with the covariance: {size} times as large as predicted ({bounds})."
    if right is Verdict.no:
        is_what = "small" if nees.low > 1.0 else "large"
        return f"The covariance is too {is_what}: errors are {size} times as large as predicted ({bounds})."
    return f"Errors are {size} times as large as predicted ({bounds}): whether the covariance is right is undecided."


def _trained(found: Calibration) -> list[str]:
    if not found.n_trained:
        return []
    return [f"The model was fitted to {found.n_trained} of these scenes. This is no test on new scenes."]


def _outliers(found: Calibration) -> list[str]:
    if not found.outlier_share:
        return []
    return [f"{significant(100 * found.outlier_share, 2)} % of the errors are outliers of the model, and do not count."]


def _impossible(found: Calibration) -> list[str]:
    if not found.n_impossible:
        return []
    more, do = counted(found.n_impossible, "more error"), "it does" if found.n_impossible == 1 else "they do"
    return [f"For {more}, what is predicted is not positive definite; {do} not count."]


def calibration_cells(found: Calibration) -> Cells:
    """Coverage, NEES and likelihood with their intervals, and the value of a right covariance."""
    rows = [
        [f"coverage at {100 * level:g} %", *interval_cells(share), number(level)]
        for level, share in found.coverage.items()
    ]
    rows += [["NEES per degree of freedom", *interval_cells(found.nees), "1"]]
    rows += [["negative log likelihood, nat", *interval_cells(found.nll), ""]]
    rows += [["ENCE", number(found.ence), "", "", "0"]]
    return Cells("Calibration", ["quantity", "value", "low", "high", "if right"], rows, (False, *[True] * 4))


def reliability_cells(found: Calibration) -> Cells:
    """Predicted and measured standard deviations by class."""
    measured = [Interval(value=one.measured_px, low=one.low_px, high=one.high_px) for one in found.reliability]
    rows = [
        [number(one.predicted_px), *interval_cells(interval), str(one.n)]
        for one, interval in zip(found.reliability, measured, strict=True)
    ]
    headings = ["predicted, px", "measured, px", "low", "high", "errors"]
    return Cells("Standard deviations by class", headings, rows, (True,) * 5)


_ALL = "all"


def noise_table_sentences(table: NoiseTable) -> list[str]:
    """Which lookup is worth it on scenes that were left out, and how much bias is warranted."""
    truth = [] if table.truth.verdict is Trust.trusted else [table.truth.sentence]
    gains = [text for product in (Product.error, Product.change) for text in lookup_sentences(table.gains, product)]
    warranted = sum(_is_warranted(row.bias) for row in table.rows)
    bias = f"A correction of the mean error is warranted in {warranted} of {counted(len(table.rows), 'row')}."
    return [*truth, *(gains or [_no_gain(table)]), bias]


def _no_gain(table: NoiseTable) -> str:
    """Why no gain is known."""
    reasons = table.gains["why"].drop_nulls().unique(maintain_order=True).to_list()
    if not reasons:
        return "The run varies neither tracker, speed nor motion."
    return f"It is unknown whether the noise depends on tracker, speed or motion: {reasons[0]}."


def noise_table_cells(table: NoiseTable) -> Cells:
    """One row per tracker, speed and motion: sigmas, root second moments, and the bias."""
    age = _common_age(table)
    headings = ["tracker", "speed", "motion", "scenes", "innovations", "newest pose", "change u", "change v"]
    headings += [f"error u, age {age}", f"error v, age {age}"] if age else []
    rows = [_row(row, age) for row in table.rows]
    caption = (
        f"Noise in px. Sigma that makes innovations and the newest pose right, windows of {table.window} frames; root "
        "second moments about zero of changes between observations and of errors about the first position"
    )
    numeric = [False, True, False, *[True] * (len(headings) - 3), True, False]
    return Cells(caption, [*headings, "outliers", "bias"], rows, numeric)


def gain_cells(table: NoiseTable) -> Cells:
    """What each lookup gains on scenes that were left out."""
    headings = ["second moment of", "looked up by", "over", "gain, nat", "low", "high", "gain", "factor", "before"]
    rows = [_gain(row) for row in table.gains.to_dicts()]
    return Cells(
        "Gain on scenes that were left out, per error, and by which factor the second moment of a scene differs",
        [*headings, "scenes", "why"],
        rows,
        [False] * 3 + [True] * 3 + [False] + [True] * 3 + [False],
    )


def _common_age(table: NoiseTable) -> int | None:
    """The oldest age at which all rows have errors."""
    ages = [{one.age for one in row.errors if one.age is not None} for row in table.rows]
    return max(set.intersection(*ages), default=None) if ages else None


def _row(row: NoiseRow, age: int | None) -> list[str]:
    sigmas = [row.sigma.get(purpose) for purpose in (Purpose.INNOVATIONS, Purpose.NEWEST_POSE)]
    error = next((one for one in row.errors if one.age == age), None)
    return [
        row.tracker,
        str(row.speed),
        row.motion or _ALL,
        str(len(row.scenes)),
        *(DASH if one is None else number(one.value) for one in sigmas),
        *_roots(row.changes),
        *(_roots(error) if age else ()),
        percent(row.outlier_share),
        _table_bias(row.bias),
    ]


def _roots(one: SecondMoment | None) -> list[str]:
    return [DASH, DASH] if one is None else [number(math.sqrt(one.uu)), number(math.sqrt(one.vv))]


def _is_warranted(bias: Bias) -> bool:
    return bias.kind in (BiasKind.BY_AGE, BiasKind.ALONG_MOTION)


def _table_bias(bias: Bias) -> str:
    """The correction, or that none is warranted."""
    if bias.kind is BiasKind.ALONG_MOTION:
        return f"{number(bias.per_motion)} per px of motion"
    if bias.kind is BiasKind.BY_AGE:
        longest = max(bias.mean_px, key=lambda mean: math.hypot(*mean))
        return f"by age, up to {number(math.hypot(*longest))} px"
    return "none"


def _gain(row: dict[str, Any]) -> list[str]:
    what = [row["product"], row["lookup"], row["against"]]
    nats = [thousandths(row[name]) for name in ("gain_nats", "low", "high")]
    factors = [DASH if row[name] is None else ratio(row[name]) for name in ("factor", "factor_against")]
    verdict = {True: "established", False: "not established", None: "unknown"}[row["established"]]
    return [*what, *nats, verdict, *factors, str(row["n_scenes"]), row["why"] or ""]
