"""What an audit found: sentences, and the corrections to put into an experiment.

With the corrections of a run (1) and those that its audit found (2), focal lengths have the factor s1 s2. Depths
become (a Z + b) / (c Z + d) with [a b; c d] = D2 D1 and D = [s o; q s, 1 + q o], for 1 / (1 / (s Z + o) + q). A clock
has the drift k1 + k2 + k1 k2 and the offset o1 (1 + k2) + o2 (1 + k1). The camera is mounted as M1 M2 in the frame of
the poses. All others add up. (audit.corrections)
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.corrections import UNCORRECTED
from tracknoise.tables.truth_audit import MEASURED, AuditVerdict
from tracknoise.truth_faults.audit_samples import AuditSamples
from tracknoise.truth_faults.audit_selection import POWER
from tracknoise.truth_faults.fault_parameters import FAULTS, TIMED, Family, Parameter, Shown
from tracknoise.words import DASH, MINUS, SPACE, listing, number, percent, px

_MOST_HALF, _ROUNDING = 0.25, 0.1
"""A clock offset is one of whole frames if its interval is this narrow, and holds a whole number or is this near."""


def whole_frames(offset: float, half: float) -> int:
    """Number of frames that poses are off by; 0 where a clock offset is not surely a whole number of frames."""
    whole = round(offset)
    return whole if half <= _MOST_HALF and abs(offset - whole) <= max(half, _ROUNDING) else 0


def shifted_text(frames: int) -> str:
    """``Poses are off by 1 frame: pose i + 1 belongs to frame i``."""
    plural = "s" if abs(frames) > 1 else ""
    sign = "+" if frames > 0 else "-"
    return f"Poses are off by {abs(frames)} frame{plural}: pose i {sign} {abs(frames)} belongs to frame i"


def usual_mistakes(audit: pl.DataFrame) -> list[str]:
    """Sentences about named faults that are usual mistakes, in the order of the faults.

    Parameters
    ----------
    audit
        Table `tracknoise.tables.truth_audit.AUDIT`; may be empty.
    """
    together = audit.filter(family=str(Family.named))
    usual = [row["parameter"] for row in together.iter_rows(named=True) if _is_usual(row)]
    alone = audit.filter(family=str(Family.alone)).filter(pl.col("parameter").is_in(usual))
    return alone.drop_nulls("rank").sort("rank")["text"].to_list()


def _is_usual(row: Mapping[str, Any]) -> bool:
    """Whether a row of a named fault is of a usual mistake."""
    return bool(row["parameter"] == Parameter.ray_depth) or _frames_off(row) != 0


_LEAST_AT_AGE = 30
_SHALLOW, _SLOW_PX = 0.3, 1.0


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
        values = [f"{value:g}".replace("-", MINUS) for value in self.shown.stated]  # as it is stated, not rounded
        return values[0] if len(values) == 1 else f"({', '.join(values)})"


def fault_text(parameter: Parameter, found: Estimate, effect: str, rivals: Mapping[Parameter, float]) -> str:
    """``The stated focal length is 12 % too long (523 ± 8 px instead of 585): after its correction, ...``."""
    return f"{_claim(parameter, found)}: {effect}.{_advice(parameter, found)}{_rivals_text(rivals)}"


def _advice(parameter: Parameter, fitted: Estimate) -> str:
    """What a reader who corrects the fault has to know; empty where its name says it."""
    if parameter is Parameter.depth_scale:
        length = "short" if float(fitted.values[0]) < 1.0 else "long"
        return f" A camera path that is too {length} by the same factor looks the same."
    if parameter is Parameter.smoothing:
        use = "the poses from before the filter"
        return (
            f" No setting corrects this: use {use if float(fitted.values[0]) > 0.0 else f'smoother poses, or {use}'}."
        )
    if parameter is Parameter.rotation_delay:
        return " No setting corrects this: make poses whose rotations and positions have one clock."
    return ""


def _claim(parameter: Parameter, fitted: Estimate) -> str:
    frames = whole_frames(*fitted.in_fit_units) if parameter is Parameter.clock_offset else 0
    opening = _opening(parameter, fitted.shown.stated[0], float(fitted.values[0]), frames)
    if parameter is Parameter.ray_depth:
        return f"{opening} (share {fitted.text} instead of 0)"
    if parameter is Parameter.rotation_delay:
        return f"{opening} (late by {fitted.text} about the axes of the camera)"
    shown = f"clock offset {fitted.text}" if frames else fitted.text
    return f"{opening} ({shown} instead of {fitted.stated})"


def _opening(parameter: Parameter, stated: float, value: float, frames: int) -> str:
    """What is wrong, without numbers in brackets. `frames`: whole frames that poses are off by, if they are; else 0."""
    if parameter is Parameter.ray_depth:
        return "Depth is the distance along the ray, not along the optical axis"
    if frames:
        return shifted_text(frames)
    if parameter is Parameter.smoothing and -_MOST_OF_JITTER <= value < 0.0:
        return _JITTER
    if parameter in _OPENINGS:
        return _OPENINGS[parameter][value < 0.0]
    name = FAULTS[parameter].name
    if parameter in (Parameter.focal_length, Parameter.depth_scale) and value > 0:
        excess = stated / value - 1.0
        is_focal = parameter is Parameter.focal_length
        words = ("too long", "too short") if is_focal else ("too large", "too small")
        return f"The {'stated ' if is_focal else ''}{name} is {percent(abs(excess))} {words[excess < 0]}"
    return f"The {name}{_IS_WRONG}"


_IS_WRONG = " is wrong"
_INVERSE_DEPTHS = "The inverse depths are off by a constant, as those of stereo with a wrong disparity"
_ROTATIONS = "Rotations and positions of the poses are of different times"
_OPENINGS: Mapping[Parameter, tuple[str, str]] = MappingProxyType(
    {
        Parameter.inverse_depth_offset: (_INVERSE_DEPTHS, _INVERSE_DEPTHS),
        Parameter.clock_drift: ("The clock of the poses runs too fast", "The clock of the poses runs too slow"),
        Parameter.rotation_delay: (_ROTATIONS, _ROTATIONS),
        Parameter.smoothing: ("The poses are smoothed", "The poses overshoot, as a sharpened path does"),
    }
)
"""What is wrong where a number is positive, and where it is negative."""
_JITTER = "The poses jitter from frame to frame, or overshoot as a sharpened path does"
_MOST_OF_JITTER = 0.5
"""Most negative smoothing that removes noise of poses: 1/3 if it is white, 1 / (3 - r) at a correlation r of frames."""


def fault_brief(row: Mapping[str, Any]) -> str:
    """What is wrong in a few words, from a row of `AUDIT` about a named fault; no full stop. A number says its size."""
    opening = _opening(Parameter(row["parameter"]), row["stated"], row["value"], _frames_off(row))
    if row["component"] or row["low"] is None or not opening.endswith(_IS_WRONG):
        return opening
    shown = Shown(row["unit"] or "", (row["stated"],), 1.0)
    found = Estimate(shown, np.array([row["value"]]), np.array([0.5 * (row["high"] - row["low"])]))
    return f"{opening} ({found.text} instead of {found.stated})"


def _frames_off(row: Mapping[str, Any]) -> int:
    """Whole frames that poses are off by, from the row of a clock offset; 0 of other parameters."""
    if row["parameter"] != Parameter.clock_offset:
        return 0
    frame = row["value"] / row["in_frames"] if row["in_frames"] else 1.0
    return whole_frames(row["in_frames"], 0.5 * (row["high"] - row["low"]) / frame)


def like_text(others: Sequence[Parameter], together: Estimate) -> str:
    """`` Fitted together with the clock offset of the poses, it is 28 ± 7 ms.``, after another sentence."""
    return f" Fitted together with {listing([f'the {FAULTS[name].name}' for name in others])}, it is {together.text}."


def _rivals_text(rivals: Mapping[Parameter, float]) -> str:
    if not rivals:
        return ""
    names = listing([f"the {FAULTS[rival].name}" for rival in rivals], joint="or")
    largest = number(max(rivals.values()), digits=2)
    return f" An error of {names} cannot be distinguished from it here (condition number {largest})."


def effect_text(curves: pl.DataFrame, before: str, correction: str) -> str:
    """What a correction does at the largest age: to the mean error, or to the second moment where that changes more."""
    earlier = curves.filter(pl.col("n") >= _LEAST_AT_AGE, correction=before)
    compared = earlier.join(curves.filter(correction=correction), on=["tracker", "age"], suffix="_after")
    if compared.is_empty():
        return "its correction makes errors smaller"
    oldest = compared.filter(pl.col("age") == pl.col("age").max())
    mean, second = _mean_text(oldest), _second_text(oldest)
    return f"after its correction{'' if before == MEASURED else ', too'}, {mean or second}"


def _mean_text(rows: pl.DataFrame) -> str | None:
    """The mean error that is largest before the correction, if the correction halves it."""
    sizes = [(abs(row[f"mean_{axis}_px"]), axis, row) for row in rows.iter_rows(named=True) for axis in "uv"]
    size, axis, row = max(sizes, key=lambda entry: entry[0])
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
    name = FAULTS[parameter].name
    if verdict == AuditVerdict.like_bias:
        how = f"condition number {number(condition, digits=2)}"
        return f"An error of the {name} cannot be distinguished from a bias of the trackers ({how})."
    if verdict == AuditVerdict.disagreement:
        return f"The trackers contradict each other on the {name}: no error of the truth is established in it."
    if verdict == AuditVerdict.explained:
        return _explained_text([parameter], named)
    if verdict == AuditVerdict.small:
        estimate_text = f"{found.text} instead of {found.stated}"
        return f"The {name} fits a little better as {estimate_text}, but this difference explains too little to matter."
    if verdict == AuditVerdict.undetermined and found.excludes_stated:
        return f"The {name} looks wrong ({found.text} instead of {found.stated}), but no error is established."
    if verdict == AuditVerdict.undetermined:
        return f"The {name} cannot be determined here (± {found.half_text}){_why(parameter, samples)}."
    if verdict == AuditVerdict.fault:
        return f"The {name} seems to be wrong too; correct the faults above first."
    if parameter is Parameter.ray_depth:
        return "Depth is not the distance along the ray."
    if samples.refined:
        return f"No error of the {name} was found with refined poses, which may absorb such an error."
    chance = f"{100.0 * POWER:g}{SPACE}%"
    return f"No error of the {name} was found; one above {visible} would be found with a probability of {chance}."


def _explained_text(parameters: Sequence[Parameter], named: Sequence[Parameter]) -> str:
    about, faults = (listing([f"the {FAULTS[parameter].name}" for parameter in group]) for group in (parameters, named))
    verb = "is" if len(named) == 1 else "are"
    return f"T{about[1:]} looked wrong, but no such error is established once {faults} {verb} corrected."


def kind_not_tried(z_depth_from: str) -> str:
    """The sentence about the kind of depths that are known to be along z, from what they were computed."""
    name = FAULTS[Parameter.ray_depth].name
    return f"The {name} was not tried: depths are z by construction (from {z_depth_from})."


def _why(parameter: Parameter, samples: AuditSamples) -> str:
    """What the recording lacks, if it is known."""
    low, middle, high = np.quantile(samples.depth, (0.1, 0.5, 0.9))
    spread = float((high - low) / middle)
    if FAULTS[parameter].by_depth and spread < _SHALLOW:
        return f": depth varies only by {percent(spread)}"
    steps = np.hypot(*(samples.stated - samples.uv_at_birth).T) / samples.age
    pace = float(np.median(steps))
    if parameter in TIMED and pace < _SLOW_PX:
        return f": the image moves only by {px(pace)} per frame"
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


_FACTORS = frozenset({"focal_scale", "depth_scale"})
_TURNED, _MOVED = "mounting_rotation_deg", "mounting_translation_m"
_SCALE, _OFFSET, _INVERSE = "depth_scale", "depth_offset_m", "inverse_depth_offset_per_m"
_CLOCK, _DRIFT = "clock_offset_s", "clock_drift"


def joined(present: Mapping[str, Any], found: Mapping[str, Any]) -> dict[str, Any]:
    """Corrections that do what others do one after the other: (audit.corrections).

    Exact, but for offsets of depths that were found where depths were corrected to be along the ray already: they are
    taken along the ray too. Returns: without those that change nothing.
    """
    merged = {name: _added(name, present, found) for name in (*found, *(name for name in present if name not in found))}
    if {_SCALE, _OFFSET, _INVERSE} & merged.keys():
        merged |= _bent(present, found)
    if _DRIFT in merged:
        merged |= _timed(present, found)
    if {_TURNED, _MOVED} & merged.keys():
        merged |= _mounted(present, found)
    return {name: value for name, value in merged.items() if not _is_neutral(name, value)}


def _added(name: str, present: Mapping[str, Any], found: Mapping[str, Any]) -> Any:
    if name not in present or name not in found:
        return found.get(name, present.get(name))
    first, second = present[name], found[name]
    if isinstance(first, bool):
        return first or second
    if name in _FACTORS:
        return first * second
    return np.add(first, second).tolist()


def _mounted(present: Mapping[str, Any], found: Mapping[str, Any]) -> dict[str, list[float]]:
    """M1 M2: rotation vector, degrees, and position, metres."""
    nothing = [0.0, 0.0, 0.0]
    first, second = (Rotation.from_rotvec(part.get(_TURNED, nothing), degrees=True) for part in (present, found))
    moved = np.add(present.get(_MOVED, nothing), first.apply(found.get(_MOVED, nothing)))
    return {_TURNED: (first * second).as_rotvec(degrees=True).tolist(), _MOVED: moved.tolist()}


def _bent(present: Mapping[str, Any], found: Mapping[str, Any]) -> dict[str, float]:
    """Factor and offsets of depths, from the product of both maps."""
    (a, b), (c, d) = (_bending(found) @ _bending(present)).tolist()
    common = d - c * b / a
    return {_SCALE: a / common, _OFFSET: b / common, _INVERSE: c / a}


def _bending(corrections: Mapping[str, Any]) -> NDArray[np.float64]:
    """(2, 2): a, b, c and d of the map of depths."""
    scale, offset, inverse = (corrections.get(name, getattr(UNCORRECTED, name)) for name in (_SCALE, _OFFSET, _INVERSE))
    return np.array([[scale, offset], [inverse * scale, 1.0 + inverse * offset]])


def _timed(present: Mapping[str, Any], found: Mapping[str, Any]) -> dict[str, float]:
    """Offset and drift of the clock. The middle of the poses is that of the corrected poses for those found."""
    (offset, drift), (more, growth) = ((part.get(_CLOCK, 0.0), part.get(_DRIFT, 0.0)) for part in (present, found))
    return {_CLOCK: offset * (1.0 + growth) + more * (1.0 + drift), _DRIFT: drift + growth + drift * growth}


def _is_neutral(name: str, value: Any) -> bool:
    neutral = getattr(UNCORRECTED, name, None)
    return bool(np.array_equal(value, neutral)) if isinstance(neutral, tuple) else value == neutral


NO_SETTINGS: Mapping[str, Any] = MappingProxyType({})


def recorded_step(settings: Mapping[str, Any]) -> int:
    """Frames of the recording from one measured frame to the next.

    Corrections and accuracies count frames of the recording; an audit counts those that were measured.
    """
    step: int = [*(settings.get("dataset", {}).get("frames") or (0, 0)), 1][2]
    return step


def present_corrections(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Corrections that the run has, by their keys. What it states, and an audit calls stated, includes them."""
    return dict(settings.get("truth", {}).get("corrections", {}))


NO_FAULT = "No constant fault of the stated truth was found."
_REPORTED = (AuditVerdict.like_bias, AuditVerdict.disagreement)
_MS = 1000.0


def audit_sentences(audit: pl.DataFrame, *, every: bool = False) -> list[str]:
    """What an audit says, the answer first: the faults in their order, then what cannot be determined.

    Parameters
    ----------
    audit
        Table `AUDIT`; may be empty.
    every
        Also a sentence for each parameter without a fault. Otherwise those that cannot be determined share one, and so
        do those that the faults explain.

    Returns
    -------
    list of str
        Empty where there was no audit.
    """
    if audit.is_empty() or audit["family"][0] is None:
        return audit["text"].to_list()
    about = audit.filter(pl.col("family") == Family.alone).unique("parameter", keep="first", maintain_order=True)
    named = about.filter(pl.col("rank").is_not_null()).sort("rank")
    faults = named["text"].to_list()
    rest = pl.col("rank").is_null() & (pl.lit(every) | pl.col("verdict").is_in([str(verdict) for verdict in _REPORTED]))
    shared = [] if every else [*_explained(about, named), *_undetermined(about)]
    return [*(faults or [NO_FAULT]), *about.filter(rest)["text"].to_list(), *shared]


def _explained(about: pl.DataFrame, named: pl.DataFrame) -> list[str]:
    """A sentence that names the parameters that the faults explain; none where there are none."""
    explained = about.filter(verdict=str(AuditVerdict.explained))
    parameters, faults = ([Parameter(name) for name in table["parameter"]] for table in (explained, named))
    return [_explained_text(parameters, faults)] if parameters else []


def _undetermined(about: pl.DataFrame) -> list[str]:
    """A sentence that names the parameters that cannot be determined; none where there are none."""
    names = about.filter(verdict=str(AuditVerdict.undetermined))["parameter"].to_list()
    if not names:
        return []
    verb = "is" if len(names) == 1 else "are"
    return [f"Whether {listing(f'the {FAULTS[name].name}' for name in names)} {verb} right cannot be determined here."]


def corrections_toml(audit: pl.DataFrame, settings: Mapping[str, Any] = NO_SETTINGS) -> str | None:
    """The block ``[truth.corrections]`` that corrects the named faults; None where there is none.

    The values are those of all faults together. Faults that no setting undoes are not in it. Corrections
    that the run has already are part of it, so that it takes the place of that of the run.

    Parameters
    ----------
    audit
        Table `AUDIT`; may be empty.
    settings
        Of the run, as its ``experiment.toml`` has them; by default those of one without corrections.
    """
    rows = audit.filter(pl.col("family") == Family.named)
    if rows.is_empty():
        return None
    named = rows.group_by("parameter", maintain_order=True).agg("unit", "stated", "value")
    undone = [row for row in named.iter_rows(named=True) if FAULTS[Parameter(row["parameter"])].key]
    if not undone:
        return None
    step = recorded_step(settings)
    corrections = dict(_correction(Parameter(row["parameter"]), row, step) for row in undone)
    together = joined(present_corrections(settings), corrections)
    return "\n".join(["[truth.corrections]", *(f"{name} = {_text(value)}" for name, value in together.items())])


def _correction(parameter: Parameter, row: Mapping[str, Any], step: int) -> tuple[str, bool | float | list[float]]:
    """Key and value of a correction."""
    fault = FAULTS[parameter]
    if fault.is_kind:
        return fault.key, True
    pairs = list(zip(row["value"], row["stated"], strict=True))
    values = [value / stated if fault.is_factor else value - stated for value, stated in pairs]
    unit = row["unit"][0]
    factor = {"ms": 1.0 / _MS, "ms/s": 1.0 / _MS, "frames": float(step), "frames per 100": 0.01}.get(unit, 1.0)
    key, values = fault.in_frames if unit.startswith("frames") else fault.key, [factor * value for value in values]
    return key, values if len(values) > 1 else values[0]


def _text(value: bool | float | list[float]) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"[{', '.join(map(_short, value))}]" if isinstance(value, list) else _short(value)


def _short(value: float) -> str:
    """Five digits, always with a point."""
    rounded = float(f"{value:.4e}")
    digits = 5 if rounded == 0.0 else max(1, 4 - math.floor(math.log10(abs(rounded))))
    return f"{rounded:.{digits}f}"
