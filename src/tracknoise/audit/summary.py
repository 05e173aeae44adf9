"""What an audit found, from its table: sentences, and the corrections to put into an experiment."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import polars as pl

from tracknoise.audit.joined import joined
from tracknoise.audit.parameters import NUMBERS, Family, Parameter
from tracknoise.audit.run_settings import NO_SETTINGS, present_corrections, recorded_step
from tracknoise.audit.wording import PARAMETER_NAMES
from tracknoise.findings.wording import listing
from tracknoise.tables.audit_schema import AuditVerdict

NO_FAULT = "No fault of the stated truth was found."
_REPORTED = (AuditVerdict.like_bias, AuditVerdict.disagreement, AuditVerdict.explained)
_KEYS: Mapping[str, tuple[str, bool]] = MappingProxyType(
    {
        Parameter.focal_length: ("focal_scale", True),
        Parameter.principal_point: ("principal_point_px", False),
        Parameter.k1: ("k1", False),
        Parameter.depth_scale: ("depth_scale", True),
        Parameter.depth_offset: ("depth_offset_m", False),
        Parameter.ray_depth: ("depth_along_ray", False),
        Parameter.mounting_rotation: ("mounting_rotation_deg", False),
        Parameter.mounting_translation: ("mounting_translation_m", False),
        Parameter.clock_offset: ("clock_offset_s", False),
        Parameter.readout: ("readout_s", False),
    }
)
"""Key of each parameter in the settings, and whether it is a factor rather than a change."""
_IN_FRAMES: Mapping[str, str] = MappingProxyType(
    {Parameter.clock_offset: "clock_offset_frames", Parameter.readout: "# needs timestamps: readout in frames"}
)
_MS = 1000.0


def audit_sentences(audit: pl.DataFrame, *, every: bool = False) -> list[str]:
    """What an audit says, the answer first: the faults in their order, then what cannot be determined.

    Parameters
    ----------
    audit
        Table `AUDIT`; may be empty.
    every
        Also a sentence for each parameter without a fault. Otherwise those that cannot be determined share one.

    Returns
    -------
    list of str
        Empty where there was no audit.
    """
    if audit.is_empty() or audit["family"][0] is None:
        return audit["text"].to_list()
    about = audit.filter(pl.col("family") == Family.alone).unique("parameter", keep="first", maintain_order=True)
    faults = about.filter(pl.col("rank").is_not_null()).sort("rank")["text"].to_list()
    others = pl.col("rank").is_null() & (pl.lit(every) | pl.col("verdict").is_in([str(one) for one in _REPORTED]))
    unknown = [] if every else _undetermined(about)
    return [*(faults or [NO_FAULT]), *about.filter(others)["text"].to_list(), *unknown]


def _undetermined(about: pl.DataFrame) -> list[str]:
    """A sentence that names the parameters that cannot be determined; none where there are none."""
    names = about.filter(verdict=str(AuditVerdict.undetermined))["parameter"].to_list()
    if not names:
        return []
    verb = "is" if len(names) == 1 else "are"
    return [
        f"Whether {listing(f'the {PARAMETER_NAMES[one]}' for one in names)} {verb} right cannot be determined here."
    ]


def corrections_toml(audit: pl.DataFrame, settings: Mapping[str, Any] = NO_SETTINGS) -> str | None:
    """The block ``[truth.corrections]`` that corrects the named faults; None where there is none.

    The values are those of all faults together. Corrections that the run has already are part of them, so that the
    block takes the place of that of the run.

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
    step = recorded_step(settings)
    found = dict(_correction(Parameter(row["parameter"]), row, step) for row in named.iter_rows(named=True))
    every = joined(present_corrections(settings), found)
    return "\n".join(["[truth.corrections]", *(f"{name} = {_text(value)}" for name, value in every.items())])


def _correction(parameter: Parameter, row: Mapping[str, Any], step: int) -> tuple[str, bool | float | list[float]]:
    """Key and value of a correction."""
    key, is_factor = _KEYS[parameter]
    if NUMBERS[parameter].is_kind:
        return key, True
    pairs = list(zip(row["value"], row["stated"], strict=True))
    values = [value / stated if is_factor else value - stated for value, stated in pairs]
    if row["unit"][0] == "ms":
        values = [value / _MS for value in values]
    elif row["unit"][0] == "frames":
        key, values = _IN_FRAMES[parameter], [value * step for value in values]
    return key, values if len(values) > 1 else values[0]


def _text(value: bool | float | list[float]) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"[{', '.join(map(_short, value))}]" if isinstance(value, list) else _short(value)


def _short(value: float) -> str:
    """Five digits, always with a point."""
    digits = 5 if value == 0.0 else max(1, 4 - math.floor(math.log10(abs(value))))
    return f"{value:.{digits}f}"
