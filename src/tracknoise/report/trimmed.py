"""What the report says of trimming: of which tracks its percentile is, and where that comes to nothing."""

import polars as pl

from tracknoise.findings.wording import count, number, percent
from tracknoise.report.axis import FRAME
from tracknoise.report.evidence import Evidence
from tracknoise.report.measured import condition, condition_columns, in_order
from tracknoise.report.names import MOST_NAMED, together


def percentile_of(evidence: Evidence) -> str:
    """Of what the percentile is taken, as part of a sentence."""
    if "followed" not in evidence.trims["among"]:
        return "their scene and condition"
    return f"those of their scene and condition that were followed beyond {_anchor(evidence)}"


def cut_at_zero(evidence: Evidence) -> list[tuple[str, str]]:
    """Conditions in which errors that are zero by construction decide what trimming drops, each with a sentence.

    A track without an error but that at its anchor has a largest error of about 0 px. Where such tracks are as large a
    share as the percentile, it falls among them, and next to nothing is kept of the others.
    """
    trims = evidence.listed(evidence.trims)
    least = pl.col("percentile") / 100 * pl.col("n_measured")
    decided = trims.filter(pl.col("percentile") < 100, pl.col("n_anchor_only") >= least, pl.col("n_anchor_only") > 0)
    decided = decided.filter(among="all")
    names = in_order(evidence, decided.select(list(condition_columns(evidence))).unique()).to_dicts()
    if len(names) > MOST_NAMED:
        return [(together([condition(one) for one in names]), _sentence(evidence, decided, trims))]
    return [(condition(one), _sentence(evidence, decided.filter(**one), trims.filter(**one))) for one in names]


def _sentence(evidence: Evidence, decided: pl.DataFrame, trims: pl.DataFrame) -> str:
    """What is left in some scenes and conditions of `trims` whose percentile falls among errors that are zero."""
    n_measured, n_anchor_only, n_dropped = (
        int(decided[name].sum()) for name in ("n_measured", "n_anchor_only", "n_followed_dropped")
    )
    n_followed = n_measured - n_anchor_only
    scenes = f"in {number(decided['scene'].n_unique())} of {count(trims['scene'].n_unique(), 'scene')}"
    return (
        f"{scenes}, {percent(n_anchor_only / n_measured)} of the tracks with a known error have none but that in "
        f"{_anchor(evidence)}, which is zero by construction. The percentile falls among these, and trimming cuts at "
        f"about 0 px: of {count(n_followed, 'track')} that went on, {number(n_followed - n_dropped)} are kept. Trimmed "
        'errors tell little of them; statistics.trim_among = "followed" takes the percentile of them alone.'
    )


def _anchor(evidence: Evidence) -> str:
    return "the key frame" if evidence.axis is FRAME else "their first frame"
