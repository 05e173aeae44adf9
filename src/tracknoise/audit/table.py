"""The tables of an audit."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.audit.assessment import Assessment
from tracknoise.audit.curves import curves, second_moments
from tracknoise.audit.fit import fit
from tracknoise.audit.fitted import Fit
from tracknoise.audit.held_out import Gain
from tracknoise.audit.jackknife import condition_number
from tracknoise.audit.parameters import JOINT, NUMBERS, TIMED, Family, Parameter
from tracknoise.audit.read import AuditedTables, read_samples
from tracknoise.audit.resampled_fit import LEVEL, ResampledFit
from tracknoise.audit.samples import AuditSamples
from tracknoise.audit.selection import Named, Selection, Stage, available, select
from tracknoise.audit.units import Shown, shown
from tracknoise.audit.verdicts import Judged, judge
from tracknoise.audit.wording import Estimate, effect_text, family_text, fault_text, in_unit, kind_not_tried, other_text
from tracknoise.findings.sampling.groups import SceneGroups
from tracknoise.tables.audit_schema import AUDIT, AUDIT_CURVES, EVERYTHING, MEASURED, AuditVerdict
from tracknoise.tables.schema import check, empty

Row = dict[str, Any]
JointFits = dict[Family, ResampledFit]


@dataclass(frozen=True, slots=True)
class AuditTables:
    """Tables `AUDIT` and `AUDIT_CURVES`."""

    audit: pl.DataFrame
    audit_curves: pl.DataFrame


def audit_tables(
    tables: Sequence[AuditedTables], groups: SceneGroups, *, dataset: str, without: Collection[str] = ()
) -> AuditTables:
    """Audit the truth of a run.

    Parameters
    ----------
    tables
        Of one view of each scene and camera.
    groups
        Scenes that are not independent of each other.
    dataset
        Its name.
    without
        Trackers that take no part unless there are no others, such as those that were made from the truth.
    """
    samples = read_samples(tables, groups, without=without)
    if isinstance(samples, str):
        row = {
            "dataset": dataset,
            "verdict": AuditVerdict.undetermined,
            "text": f"The truth was not audited: {samples}.",
        }
        return AuditTables(pl.DataFrame([row], schema=dict(AUDIT)), empty(AUDIT_CURVES))
    return tables_of(samples, dataset)


def tables_of(samples: AuditSamples, dataset: str) -> AuditTables:
    """Tables of the audit of some observations."""
    selection = select(samples)
    curve = curves(samples, _corrected_errors(samples, selection), dataset)
    joint = _joint_fits(samples, selection)
    rows = [*_single_rows(samples, selection, joint, curve), *_joint_rows(selection, joint)]
    table = pl.DataFrame([{"dataset": dataset, **row} for row in rows], schema=dict(AUDIT))
    return AuditTables(check(table, AUDIT, "audit"), check(curve, AUDIT_CURVES, "audit_curves"))


def _corrected_errors(samples: AuditSamples, selection: Selection) -> dict[str, NDArray[np.float64]]:
    """Errors (n, 2), px, by correction: as measured, with each fault and those before it corrected, and with all."""
    found = {MEASURED: samples.observed - samples.stated}
    for one in selection.named:
        found[one.parameter] = one.resampled.error
    if selection.named:
        found[EVERYTHING] = selection.final.resampled.error
    return found


def _joint_fits(samples: AuditSamples, selection: Selection) -> JointFits:
    """The stated joint fits, and that of the named faults together, with biases of trackers where these matter."""
    start, every = selection.beside_bias.basis.start, available(samples)
    with_bias = selection.final.fitted.with_bias
    fits = {
        family: fit(samples, [one for one in parameters if one in every], start, with_bias=with_bias)
        for family, parameters in JOINT.items()
    }
    found = {family: ResampledFit.of(samples, one) for family, one in fits.items()}
    if selection.named:
        found[Family.named] = selection.final.resampled
    return found


def _single_rows(samples: AuditSamples, selection: Selection, joint: JointFits, curve: pl.DataFrame) -> Iterator[Row]:
    """Of the families of one parameter; verdicts and sentences are in the rows of the family alone."""
    judged = judge(selection)
    for one in judged:
        extra = {"rank": one.rank, "verdict": one.verdict, "text": _text(samples, selection, joint, one, curve)}
        factor = shown(samples, one.parameter).factor
        for component, row in enumerate(_assessed_rows(Family.alone, selection.alone, one.parameter)):
            visible = abs(factor) * float(one.visible_above[component])
            yield {**row, **extra, "visible_above": visible if np.isfinite(visible) else None}
    yield from _known_rows(samples)
    for one in judged:
        yield from _assessed_rows(Family.beside_bias, selection.beside_bias, one.parameter)


def _known_rows(samples: AuditSamples) -> Iterator[Row]:
    """A sentence about what was not tried, because the program itself made it so."""
    if samples.z_depth_from is not None:
        yield {
            "family": Family.alone,
            "parameter": Parameter.ray_depth,
            "component": "",
            "unit": "",
            "verdict": AuditVerdict.not_tried,
            "text": kind_not_tried(samples.z_depth_from),
        }


def _assessed_rows(family: Family, stage: Stage, parameter: Parameter) -> Iterator[Row]:
    one = stage.assessed[parameter]
    for row in _fit_rows(family, one.resampled, one.gain):
        yield {**row, "p": stage.p[parameter]}


def _joint_rows(selection: Selection, joint: JointFits) -> Iterator[Row]:
    """Of the joint fits."""
    base = (selection.beside_bias if selection.final.fitted.with_bias else selection.alone).basis
    for family, one in joint.items():
        yield from _fit_rows(family, one, base.gain_of(one))


def _fit_rows(family: Family, resampled: ResampledFit, explained: Gain) -> Iterator[Row]:
    """One row per free number of a fit."""
    samples, fitted = resampled.samples, resampled.fitted
    names = [(one, component) for one in fitted.parameters for component in NUMBERS[one].components]
    half = resampled.half_widths
    related = _correlations(fitted)
    errors = {MEASURED: samples.observed - samples.stated, EVERYTHING: resampled.error}
    second = second_moments(samples, errors)
    fits = {
        "level": LEVEL,
        "resampled": samples.resampled,
        "n_units": samples.n_clusters,
        "n_scenes": samples.n_scenes,
        "n": len(samples.age),
        "gain": explained.value,
        "gain_low": explained.low,
        "gain_high": explained.high,
        "second_moment_share": 1.0 - second[EVERYTHING] / max(second[MEASURED], 1e-300),
        "condition": condition_number(fitted.equations),
    }
    for place, (parameter, component) in enumerate(names):
        yield {
            "family": family,
            "parameter": parameter,
            "component": component,
            **_values(samples, parameter, component, float(fitted.estimate[place]), float(half[place])),
            **fits,
            **_most_related(names, related[place], place),
        }


def _values(samples: AuditSamples, parameter: Parameter, component: str, number: float, half: float) -> Row:
    """The corrected value of a number of the fit beside the stated one, in the unit of its text."""
    unit = shown(samples, parameter)
    stated = unit.stated[NUMBERS[parameter].components.index(component)]
    value, reach = stated + unit.factor * number, abs(unit.factor) * half
    return {
        "unit": unit.unit,
        "stated": stated,
        "value": value,
        "low": value - reach,
        "high": value + reach,
        "in_frames": value / unit.factor if parameter in TIMED else None,
    }


def _correlations(fitted: Fit) -> NDArray[np.float64]:
    """Correlation of each free number with all numbers of the fit, (free, free)."""
    covariance = np.linalg.inv(fitted.equations.information)[: len(fitted.free), : len(fitted.free)]
    root = np.sqrt(np.diag(covariance))
    return np.asarray(covariance / root[:, None] / root)


def _most_related(names: Sequence[tuple[Parameter, str]], related: NDArray[np.float64], place: int) -> Row:
    others = np.abs(related)
    others[place] = -1.0
    if len(names) < 2:
        return {}
    other = int(np.argmax(others))
    return {"correlation": float(related[other]), "correlated_with": " ".join(names[other]).strip()}


def _text(samples: AuditSamples, selection: Selection, joint: JointFits, one: Judged, curve: pl.DataFrame) -> str:
    unit = shown(samples, one.parameter)
    if one.rank is not None:
        names = [MEASURED, *(fault.parameter for fault in selection.named)]
        effect = effect_text(curve, names[one.rank - 1], one.parameter)
        fault = selection.named[one.rank - 1]
        found = _estimate(unit, fault)
        beside_others = _in_its_family(samples, selection, joint, one, found)
        return fault_text(one.parameter, found, effect, fault.rivals) + beside_others
    beside = selection.last.assessed[one.parameter]
    return other_text(
        one.parameter,
        one.verdict,
        in_unit(one.visible_above, unit),
        condition=one.condition,
        found=_estimate(unit, beside),
        named=[fault.parameter for fault in selection.named],
        samples=samples,
    )


def _estimate(unit: Shown, found: Assessment | Named) -> Estimate:
    """Of a parameter, together with the faults that were named before it."""
    return Estimate(unit, unit.values(found.estimate), found.half_widths * abs(unit.factor))


def _in_its_family(samples: AuditSamples, selection: Selection, joint: JointFits, one: Judged, found: Estimate) -> str:
    """A sentence if the first fault has another value beside parameters of its kind, none of which was named."""
    family = next(family for family, parameters in JOINT.items() if one.parameter in parameters)
    resampled = joint[family]
    fitted = resampled.fitted
    others = [parameter for parameter in fitted.parameters if parameter != one.parameter]
    if (
        family is Family.all
        or not others
        or one.rank != 1
        or any(fault.parameter in others for fault in selection.named)
    ):
        return ""
    mine = fitted.places_of(one.parameter)
    unit = shown(samples, one.parameter)
    together = Estimate(unit, unit.values(fitted.estimate[mine]), resampled.half_widths[mine] * abs(unit.factor))
    moved = np.abs(together.values - found.values) > found.half
    return family_text(others, together) if moved.any() else ""
