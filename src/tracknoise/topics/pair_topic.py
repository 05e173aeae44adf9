"""What positions in two cameras say together."""

from tracknoise.analysis.pair_intervals import PAIRS, pair_intervals
from tracknoise.inference.estimates import Estimate
from tracknoise.tables.run_table import RunTable
from tracknoise.topics.headline import Headline, Part, ReportedConditions, RunTables
from tracknoise.topics.topic import NO_ROWS, Topic, pooled
from tracknoise.words import format_estimate

_CLOSING = (
    "Where errors in both cameras correlate, both positions of a feature are no independent measurements. "
    "z is the depth in metres. What hides a point from the second camera alone is not known."
)


def pairs(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """How far positions in the second camera are off, what both share, and how exact depths by both are."""
    table: RunTable = PAIRS
    return conditions.headline(
        lambda tracker: _pair_of(conditions.of(tables[table.name], tracker).to_dicts(), tracker),
        opening=f"Second camera {conditions.where(tables)}.",
        closing=_CLOSING,
        figure="error-by-tracker",
        table=table.name,
    )


def _pair_of(rows: list[dict[str, object]], tracker: str) -> Part | None:
    if not rows:
        return None
    units = {name: "" if one.unit == "1" else one.unit or "" for name, one in PAIRS.quantities.items()}
    found = {
        str(row["quantity"]): Estimate.of_row(row, "value", "low", "high", units[f"pair_{row['quantity']}"])
        for row in rows
    }
    named = [found[name] for name in ("epipolar_core", "disparity_core") if name in found]
    sentences = [
        f"{tracker}: the core of the distances from epipolar lines is {format_estimate(found['epipolar_core'])}.",
        f"That of the errors along them is {format_estimate(found['disparity_core'])}.",
    ]
    brief = f"Errors of {tracker} along epipolar lines have a core of {format_estimate(found['disparity_core'])}."
    shared = [found[name] for name in ("correlation_u", "correlation_v") if name in found]
    if shared:
        sentences.append(
            f"Errors in both cameras have a correlation of {' in u and '.join(map(format_estimate, shared))} in v."
        )
    if "depth_sd_square" in found:
        constant, square = found["depth_sd_constant"], found["depth_sd_square"]
        sentences.append(
            f"Depths by both have a standard deviation of a + b z^2: a is {format_estimate(constant)}, "
            f"b is {format_estimate(square)}."
        )
        named += [constant, square]
    return Part(" ".join(sentences), [*named, *shared], brief)


SECOND_CAMERA = Topic(
    "second camera",
    (pooled(PAIRS, "pair_sums", pair_intervals, if_fitted=NO_ROWS),),
    headline=pairs,
    of_these_scenes=True,
)
