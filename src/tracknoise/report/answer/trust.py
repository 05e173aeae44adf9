"""How far the numbers of a run can be trusted: how sure they are, and whether the truth is right."""

import math
from typing import Any

import polars as pl

from tracknoise.audit.parameters import Family
from tracknoise.audit.summary import NO_FAULT
from tracknoise.findings.wording import count, interval_text, percent, pixels, sentence_case
from tracknoise.report.answer.subject import answer
from tracknoise.report.answer.summary import Judgement
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.statistics.populations import POPULATIONS
from tracknoise.tables.audit_schema import AuditVerdict
from tracknoise.tables.enumerations import Resampled, Verdict

_HOLD: dict[str, tuple[str, Verdict]] = {
    Resampled.scenes: ("They hold for similar scenes", Verdict.yes),
    Resampled.groups: ("They hold for similar groups of scenes", Verdict.yes),
    Resampled.within: ("They hold for these groups of scenes only", Verdict.undecided),
    Resampled.blocks: ("They hold for these scenes only", Verdict.undecided),
}
_FEW = 8
"""With fewer scenes than this, intervals contain the true value less often than their level says."""
_MOST_SHARE = 0.5
"""Share of the second moment from which on it is the truth's rather than the tracker's."""
_MOSTLY = 0.5
"""Share of observations without a true position from which on it is stated."""
_GENERAL, _RIGHT = "other scenes", "trusted"


def certainty(data: ReportData) -> Judgement:
    """What intervals were made from, and what they hold for."""
    known = data.nominal(data.intervals).drop_nulls(["level", "resampled", "n_scenes"])
    if known.is_empty():
        text = "No intervals were computed: the numbers hold for these scenes only."
        return Judgement(answer(_GENERAL, Verdict.undecided, wished=Verdict.yes), text, "measured")
    kinds = known.group_by("resampled", "level").agg(pl.len(), pl.col("n_scenes").max())
    kinds = kinds.sort("len", "resampled", "level")
    row = kinds.row(-1, named=True)
    hold, verdict = _HOLD[row["resampled"]]
    few = row["n_scenes"] < _FEW and row["resampled"] != Resampled.blocks
    text = f"{sentence_case(interval_text(row['level'], row['resampled'], [row['n_scenes']]))}. {hold}"
    text += "; with few scenes they are less reliable." if few else "."
    return Judgement(answer(_GENERAL, verdict, wished=Verdict.yes), text, "measured")


def truth(data: ReportData) -> Judgement:
    """Whether the true positions can be trusted: doubts about the data, faults that were found, and the floor."""
    verdict, text = _doubts(data) or _fitted(data) or _faults(data) or _floor(data)
    return Judgement(answer(_RIGHT, verdict, wished=Verdict.yes), f"{text}{_unknown(data)}", "truth")


def _unknown(data: ReportData) -> str:
    """How many observations have no true position, where these are most; begins with a space."""
    statuses = data.nominal(data.counts).filter(kind="truth")
    total = int(statuses["n"].sum())
    without = total - int(statuses.filter(pl.col("name").is_in(POPULATIONS["projected"]))["n"].sum())
    if without <= _MOSTLY * total:
        return ""
    rest = "no error could be measured" if without == total else "errors are those of the rest"
    return f" {percent(without / total)} of the observations have no true position; {rest}."


def _doubts(data: ReportData) -> tuple[Verdict, str] | None:
    doubtful = [entry for entry in data.manifest.sequences.values() if entry.doubts]
    if not doubtful:
        return None
    noun = "sequence looks" if len(doubtful) == 1 else "sequences look"
    return Verdict.no, f"The data of {len(doubtful)} {noun} wrong. Errors may not be those of the trackers."


def _fitted(data: ReportData) -> tuple[Verdict, str] | None:
    if not data.truth_is_fitted:
        return None
    return Verdict.undecided, "True positions are fitted to the tracks, which hides drift along epipolar lines."


def _faults(data: ReportData) -> tuple[Verdict, str] | None:
    """The first fault of the audit."""
    faults = data.audit.filter(pl.col("rank").is_not_null()).unique("rank", keep="first")
    texts = faults.sort("rank")["text"].drop_nulls().to_list()
    if not texts:
        return None
    first = texts[0].partition(" (")[0].partition(":")[0].rstrip(".")
    others = f"; {count(len(texts) - 1, 'other fault')} as well" if len(texts) > 1 else ""
    return Verdict.no, f"{first}{others}. Correct this before using the numbers."


def _floor(data: ReportData) -> tuple[Verdict, str]:
    """Whether known errors of the truth are small beside the errors of the trackers."""
    audited, opening = _checked(data)
    points = data.nominal(data.points).filter(
        pl.col("since").is_between(1, REFERENCE_AGE),
        role="second",
        trimming=data.trimming,
        population=data.population,
    )
    known = points.drop_nulls(["floor_u", "floor_v"]).sort("since")
    if known.is_empty():
        return Verdict.undecided, f"{opening} Its accuracy is not stated."
    share, floor_px, row = max(
        (_share(known.filter(tracker=name)) for name in known["tracker"].unique().sort()), key=lambda found: found[:2]
    )
    if floor_px == 0.0:
        return Verdict.yes if audited else Verdict.undecided, f"{opening} It is stated to be exact."
    error_px = math.hypot(row["u"], row["v"])
    of = f"{pixels(error_px)} px RMS error of {row['tracker']} {data.axis.place(row['since'])}"
    text = f"{opening} Its errors can cause {pixels(min(floor_px, error_px))} of the {of}."
    return Verdict.no if share > _MOST_SHARE else Verdict.yes, text


def _checked(data: ReportData) -> tuple[bool, str]:
    """Whether the audit could have found a fault, and what it says where it found none."""
    about = data.audit.filter(pl.col("family") == Family.alone).unique("parameter", keep="first")
    if about.is_empty():
        return False, "The truth was not checked for faults."
    unknown = about.filter(verdict=str(AuditVerdict.undetermined)).height
    if unknown == about.height:
        return False, "The audit could determine no parameter of the truth."
    return True, f"{NO_FAULT} {unknown} of {about.height} parameters cannot be determined." if unknown else NO_FAULT


def _share(points: pl.DataFrame) -> tuple[float, float, dict[str, Any]]:
    """Share of the second moment that the floor can cause at the last age, its length in px, and that point."""
    row = points.row(-1, named=True)
    error_px, floor_px = math.hypot(row["u"], row["v"]), math.hypot(row["floor_u"], row["floor_v"])
    return min((floor_px / error_px) ** 2 if error_px else 1.0, 1.0), floor_px, row
