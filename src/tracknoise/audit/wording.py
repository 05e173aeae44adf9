"""Sentences about the truth: what is wrong with it, and what the correction does."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.audit.parameters import Parameter
from tracknoise.audit.samples import AuditSamples
from tracknoise.audit.units import Shown
from tracknoise.audit.usual import shifted_text, whole_frames
from tracknoise.audit.visible import POWER
from tracknoise.findings.wording import DASH, MINUS, SPACE, listing, number, percent, px
from tracknoise.tables.audit_schema import MEASURED, AuditVerdict

PARAMETER_NAMES: Mapping[str, str] = MappingProxyType(
    {
        Parameter.focal_length: "focal length",
        Parameter.principal_point: "principal point",
        Parameter.k1: "radial distortion k1",
        Parameter.depth_scale: "scale of the depths",
        Parameter.depth_offset: "offset of the depths",
        Parameter.mounting_rotation: "rotation between camera and poses",
        Parameter.mounting_translation: "translation between camera and poses",
        Parameter.clock_offset: "clock offset of the poses",
        Parameter.readout: "readout time of the shutter",
        Parameter.ray_depth: "kind of depth",
    }
)
"""What each parameter is called in text."""
_LEAST_AT_AGE = 30
_SHALLOW, _SLOW_PX = 0.3, 1.0
_ABOUT_DEPTH = frozenset(
    {Parameter.focal_length, Parameter.depth_scale, Parameter.depth_offset, Parameter.mounting_translation}
)
_ABOUT_TIME = frozenset({Parameter.clock_offset, Parameter.readout})


@dataclass(frozen=True, slots=True)
class Estimate:
    """A fitted parameter in the units of its text: values and half of their intervals, each (k,)."""

    shown: Shown
    values: NDArray[np.float64]
    half: NDArray[np.float64]

    @property
    def text(self) -> str:
        """``523 ± 8 px``."""
        digits = [_decimals(half) for half in self.half.tolist()]
        pairs = [
            f"{value:.{digit}f} ± {half:.{digit}f}".replace("-", MINUS)
            for value, half, digit in zip(self.values.tolist(), self.half.tolist(), digits, strict=True)
        ]
        return _with_unit(pairs[0] if len(pairs) == 1 else f"({', '.join(pairs)})", self.shown.unit)

    @property
    def half_text(self) -> str:
        """Half of the widest interval: ``8 px``."""
        return _with_unit(number(float(np.max(self.half)), digits=2), self.shown.unit)

    @property
    def excludes_stated(self) -> bool:
        """Whether an interval does not hold the stated value."""
        return bool(np.any(np.abs(self.values - np.asarray(self.shown.stated)) > self.half))

    @property
    def in_fit_units(self) -> tuple[float, float]:
        """The first value as a change from the stated one, and half of its interval, in units of the fit."""
        change = float(self.values[0]) - self.shown.stated[0]
        return change / self.shown.factor, float(self.half[0]) / abs(self.shown.factor)

    @property
    def stated(self) -> str:
        """The stated value as text, without its unit."""
        values = [number(value) for value in self.shown.stated]
        return values[0] if len(values) == 1 else f"({', '.join(values)})"


def fault_text(parameter: Parameter, found: Estimate, effect: str, rivals: Mapping[Parameter, float]) -> str:
    """``The focal length is 12 % too long (523 ± 8 px instead of 585): corrected, ...``."""
    return f"{_claim(parameter, found)}: {effect}.{_rivals_text(rivals)}"


def _claim(parameter: Parameter, found: Estimate) -> str:
    name = PARAMETER_NAMES[parameter]
    if parameter is Parameter.ray_depth:
        return f"Depth is the distance along the ray, not along the optical axis (share {found.text} instead of 0)"
    if parameter is Parameter.clock_offset and (frames := whole_frames(*found.in_fit_units)):
        return f"{shifted_text(frames)} (clock offset {found.text} instead of {found.stated})"
    if parameter in (Parameter.focal_length, Parameter.depth_scale) and found.values[0] > 0:
        excess = found.shown.stated[0] / float(found.values[0]) - 1.0
        words = ("too long", "too short") if parameter is Parameter.focal_length else ("too large", "too small")
        return f"The {name} is {percent(abs(excess))} {words[excess < 0]} ({found.text} instead of {found.stated})"
    return f"The {name} is wrong ({found.text} instead of {found.stated})"


def family_text(others: Sequence[Parameter], together: Estimate) -> str:
    """`` Fitted together with the clock offset of the poses, it is 28 ± 7 ms.``, after another sentence."""
    return f" Fitted together with {listing([f'the {PARAMETER_NAMES[one]}' for one in others])}, it is {together.text}."


def _rivals_text(rivals: Mapping[Parameter, float]) -> str:
    if not rivals:
        return ""
    names = listing([f"the {PARAMETER_NAMES[one]}" for one in rivals], joint="or")
    largest = number(max(rivals.values()), digits=2)
    return f" An error of {names} cannot be distinguished from it here (condition number {largest})."


def effect_text(curves: pl.DataFrame, before: str, correction: str) -> str:
    """What a correction does at the largest age: to the mean error, or to the second moment where that changes more.

    Parameters
    ----------
    curves
        Table `AUDIT_CURVES`.
    before, correction
        Corrections in it.
    """
    earlier = curves.filter(pl.col("n") >= _LEAST_AT_AGE, correction=before)
    both = earlier.join(curves.filter(correction=correction), on=["tracker", "age"], suffix="_after")
    if both.is_empty():
        return "corrected, the errors become smaller"
    oldest = both.filter(pl.col("age") == pl.col("age").max())
    mean, second = _mean_text(oldest), _second_text(oldest)
    return f"corrected{'' if before == MEASURED else ' as well'}, {mean or second}"


def _mean_text(rows: pl.DataFrame) -> str | None:
    """The mean error that is largest before the correction, if the correction halves it."""
    found = [(abs(row[f"mean_{axis}_px"]), axis, row) for row in rows.iter_rows(named=True) for axis in "uv"]
    size, axis, row = max(found, key=lambda one: one[0])
    after = row[f"mean_{axis}_px_after"]
    if size < 0.1 or abs(after) > 0.5 * size:
        return None
    before = px(row[f"mean_{axis}_px"])
    return f"the mean error in {axis} of {row['tracker']} at age {row['age']} falls from {before} to {px(after)}"


def _second_text(rows: pl.DataFrame) -> str:
    gains = rows.with_columns(
        before=pl.col("second_uu") + pl.col("second_vv"), after=pl.col("second_uu_after") + pl.col("second_vv_after")
    ).with_columns(share=pl.col("after") / pl.col("before"))
    row = gains.sort("share").row(0, named=True)
    before, after = number(row["before"], digits=2), number(row["after"], digits=2)
    if before == after:
        return f"errors at age {row['age']} stay about the same"
    verb = "falls" if row["after"] < row["before"] else "goes"
    unit = f"{SPACE}px²"
    return f"the second moment of {row['tracker']} at age {row['age']} {verb} from {before} to {after}{unit}"


def other_text(
    parameter: Parameter,
    verdict: AuditVerdict,
    visible: str,
    *,
    condition: float,
    found: Estimate,
    named: Sequence[Parameter],
    samples: AuditSamples,
) -> str:
    """The sentence about a parameter that is not named as a fault."""
    name = PARAMETER_NAMES[parameter]
    if verdict == AuditVerdict.like_bias:
        how = f"condition number {number(condition, digits=2)}"
        return f"What an error of the {name} would explain cannot be distinguished from a bias of the trackers ({how})."
    if verdict == AuditVerdict.disagreement:
        return f"The trackers contradict each other on the {name}: that the truth is wrong in it is not established."
    if verdict == AuditVerdict.explained:
        others = listing([f"the {PARAMETER_NAMES[one]}" for one in named])
        verb = "is" if len(named) == 1 else "are"
        return f"The {name} looked wrong, but this is no longer established once {others} {verb} corrected."
    if verdict == AuditVerdict.small:
        other = f"{found.text} instead of {found.stated}"
        return f"The {name} fits a little better as {other}, but this explains too little to matter."
    if verdict == AuditVerdict.undetermined and found.excludes_stated:
        return f"The {name} looks wrong ({found.text} instead of {found.stated}), but that is not established."
    if verdict == AuditVerdict.undetermined:
        return f"The {name} cannot be determined here (± {found.half_text}){_why(parameter, samples)}."
    if verdict == AuditVerdict.fault:
        return f"The {name} seems to be wrong too; correct the faults above first."
    if parameter is Parameter.ray_depth:
        return "Depth is not the distance along the ray."
    return f"No error of the {name} was found; {100.0 * POWER:g}{SPACE}% of those above {visible} would be seen."


def kind_not_tried(z_depth_from: str) -> str:
    """The sentence about the kind of depths that are known to be along z, from what they were computed."""
    name = PARAMETER_NAMES[Parameter.ray_depth]
    return f"The {name} was not tried: depths are z by construction (from {z_depth_from})."


def _why(parameter: Parameter, samples: AuditSamples) -> str:
    """What the recording lacks, if it is known."""
    low, middle, high = np.quantile(samples.depth, (0.1, 0.5, 0.9))
    spread = float((high - low) / middle)
    if parameter in _ABOUT_DEPTH and spread < _SHALLOW:
        return f": depth varies by {percent(spread)} only"
    steps = np.hypot(*(samples.stated - samples.uv_at_birth).T) / samples.age
    pace = float(np.median(steps))
    if parameter in _ABOUT_TIME and pace < _SLOW_PX:
        return f": the image moves by {px(pace)} per frame only"
    return ": the motion of the camera does not distinguish it from biases of the trackers"


def in_unit(values: NDArray[np.float64], shown: Shown) -> str:
    """The largest of some sizes with its unit; a dash where it has no bound."""
    largest = abs(float(np.max(values))) * abs(shown.factor)
    return _with_unit(number(largest, digits=2), shown.unit) if np.isfinite(largest) else DASH


def _with_unit(text: str, unit: str) -> str:
    return f"{text}{SPACE}{unit}" if unit else text


def _decimals(half: float) -> int:
    """Decimals that show an error with one digit, or with two where it begins with 1."""
    if not half > 0.0 or not np.isfinite(half):
        return 0
    exponent = int(np.floor(np.log10(half)))
    return max(0, -exponent + (half / 10.0**exponent < 2.0))
