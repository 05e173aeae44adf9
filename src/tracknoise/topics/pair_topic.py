"""What positions in two cameras say together."""

from tracknoise.analysis.pair_intervals import PAIRS, pair_intervals
from tracknoise.inference.estimates import Estimate
from tracknoise.tables.run_table import RunTable
from tracknoise.topics.headline import Headline, Part, ReportedConditions, RunTables
from tracknoise.topics.topic import NO_ROWS, Topic, pooled
from tracknoise.words import format_estimate

_CLOSING = (
    "If errors in both cameras are correlated, the two positions of a feature are not independent measurements. "
    "z is the depth in metres. Occlusion in the second camera alone is not known."
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
    said = [(found[name], text) for name, text in _CORES.items() if name in found]
    cores = ", and ".join(f"{text} {format_estimate(estimate)}" for estimate, text in said)
    sentences = [f"{tracker}: {cores}."] if said else []
    named = [estimate for estimate, _ in said]
    shared = {axis: found[f"correlation_{axis}"] for axis in "uv" if f"correlation_{axis}" in found}
    if shared:
        values = " and ".join(f"{format_estimate(estimate)} in {axis}" for axis, estimate in shared.items())
        sentences.append(f"Errors in both cameras have a correlation of {values}.")
    if "depth_sd_square" in found:
        constant, square = found["depth_sd_constant"], found["depth_sd_square"]
        sentences.append(
            f"Depths by both cameras have a standard deviation of a + b z^2: a is {format_estimate(constant)}, "
            f"b is {format_estimate(square)}."
        )
        named += [constant, square]
    return Part(" ".join(sentences), [*named, *shared.values()], sentences[0]) if sentences else None


_CORES = {
    "disparity_core": "errors along epipolar lines have a core of",
    "epipolar_core": "distances from these lines one of",
}
"""Where all positions lie on the lines, they have no distance."""


SECOND_CAMERA = Topic(
    "second camera",
    (pooled(PAIRS, "pair_sums", pair_intervals, if_fitted=NO_ROWS),),
    headline=pairs,
    of_these_scenes=True,
)
