"""What the report says about trimming: the tracks that its percentile includes, and where it drops nearly all."""

import polars as pl

from tracknoise.findings.wording import count, number, percent
from tracknoise.report.axis import FRAME
from tracknoise.report.names import MOST_NAMED, condition_name, together
from tracknoise.report.report_data import ReportData


def percentile_of(data: ReportData) -> str:
    """The tracks over which the percentile is taken, as part of a sentence."""
    if "followed" not in data.trims["among"]:
        return "all tracks of the same scene and condition"
    return f"those tracks of the same scene and condition that were followed beyond {_anchor(data)}"


def cut_at_zero(data: ReportData) -> list[tuple[str, str]]:
    """Conditions whose trimming is decided by errors that are zero by construction, each with its warning.

    A track whose only error is that at its anchor has a largest error of about 0 px. Where the share of such tracks
    reaches the percentile, the cut falls among them, and nearly all of the other tracks are dropped.
    """
    trims = data.listed(data.trims)
    least = pl.col("percentile") / 100 * pl.col("n_measured")
    decided = trims.filter(pl.col("percentile") < 100, pl.col("n_anchor_only") >= least, pl.col("n_anchor_only") > 0)
    decided = decided.filter(among="all")
    names = data.in_order(decided.select(list(data.condition_columns)).unique()).to_dicts()
    if len(names) > MOST_NAMED:
        return [(together([condition_name(one) for one in names]), _warning(data, decided, trims))]
    return [(condition_name(one), _warning(data, decided.filter(**one), trims.filter(**one))) for one in names]


def _warning(data: ReportData, decided: pl.DataFrame, trims: pl.DataFrame) -> str:
    """What is left in the scenes and conditions of `trims` whose percentile falls among errors that are zero."""
    n_measured, n_anchor_only, n_dropped = (
        int(decided[name].sum()) for name in ("n_measured", "n_anchor_only", "n_followed_dropped")
    )
    n_followed = n_measured - n_anchor_only
    scenes = f"{number(decided['scene'].n_unique())} of {count(trims['scene'].n_unique(), 'scene')}"
    return (
        f"{percent(n_anchor_only / n_measured)} of the tracks with a known error were seen only in {_anchor(data)}, "
        f"where the error is zero by construction. This affects {scenes}. The percentile falls among these tracks, so "
        f"trimming cuts at about 0 px. Of the {count(n_followed, 'track')} seen for longer, "
        f"{number(n_followed - n_dropped)} are kept. The trimmed errors mean little here. Set "
        'statistics.trim_among = "followed" to take the percentile over the tracks seen for longer.'
    )


def _anchor(data: ReportData) -> str:
    return "the key frame" if data.axis is FRAME else "their first frame"
