"""Which table of noise predicts scenes that were left out, and what motion adds."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.analysis.run_inputs import RunInputs
from tracknoise.estimators.lookup_table import NOISE_LOOKUP, USED, noise_lookup
from tracknoise.inference.estimates import Estimate
from tracknoise.tables.enumerations import Lookup, Product
from tracknoise.topics.headline import Headline, ReportedConditions, RunTables
from tracknoise.topics.sentences import because
from tracknoise.topics.topic import Analysis, Topic
from tracknoise.words import SPACE, format_as, listing, ratio, thousandths

_BY = {Lookup.tracker: "tracker", Lookup.speed: "speed", Lookup.motion: "motion"}
_ADDED = {Lookup.tracker: "The tracker", Lookup.speed: "The speed", Lookup.motion: "The motion of the scene"}
_WHAT = {Product.error: "errors about the first position", Product.change: "changes of errors between observations"}


def noise_by_condition(tables: RunTables, _conditions: ReportedConditions) -> Headline | None:
    """Whether noise should be looked up by tracker, speed and motion, or be the same for all."""
    sentences = lookup_sentences(tables["noise_lookup"], Product.error)
    if not sentences:
        return None
    first = next(row for row in _finest_first(tables["noise_lookup"], Product.error) if row["against"] == Lookup.one)
    text, gain = " ".join(sentences), _gain(first)
    return Headline(text, "estimator", "noise_lookup", gain, brief=brief(tables["noise_lookup"]))


def lookup_sentences(lookups: pl.DataFrame, product: Product) -> list[str]:
    """What tables of second moments gain on scenes that were left out, the answer first; empty without any gain.

    Parameters
    ----------
    lookups
        Schema `NOISE_LOOKUP`, of one dataset.
    product
        What the second moments are of.
    """
    rows = _finest_first(lookups, product)
    over_one = [row for row in rows if row["against"] == Lookup.one]
    if all(row["gain_nats"] is None for row in over_one):
        return []
    best = _best(rows)
    return [_answer(best, product, over_one), *(_added(row) for row in _steps(rows, best))]


def brief(lookups: pl.DataFrame) -> str:
    """The answer about errors in one sentence of at most 25 words and three numbers."""
    rows = _finest_first(lookups, Product.error)
    over_one = [row for row in rows if row["against"] == Lookup.one]
    best = _best(rows)
    if best is None:
        return "Separate noise by condition is not shown to be better than one noise for all."
    return _advice(best, over_one)


def _best(rows: list[dict[str, Any]]) -> dict[str, Any] | None:
    """The table that is worth most; None where none is better than one for all."""
    better = [row for row in rows if row["against"] == Lookup.one and row["established"]]
    return next((row for row in better if _is_worth_it(row, rows)), better[-1] if better else None)


def _finest_first(lookups: pl.DataFrame, product: Product) -> list[dict[str, Any]]:
    return lookups.filter(pl.col("product") == product).to_dicts()[::-1]


def _is_worth_it(row: Mapping[str, Any], rows: list[dict[str, Any]]) -> bool:
    """Whether a table is better than one covariance for all, and than the next coarser one."""
    return all(comparison["established"] is True for comparison in rows if comparison["lookup"] == row["lookup"])


def _answer(best: Mapping[str, Any] | None, product: Product, over_one: list[dict[str, Any]]) -> str:
    if best is None:
        first = next(row for row in over_one if row["gain_nats"] is not None)
        return (
            f"Separate noise by {_by(first, over_one)} is not shown to be better than one noise for all. The gain on "
            f"unseen scenes is {_nats(first)} per error, for {_WHAT[product]}."
        )
    return f"{_advice(best, over_one)} The gain is {_nats(best)} per error, for {_WHAT[product]}."


def _advice(best: Mapping[str, Any], over_one: list[dict[str, Any]]) -> str:
    """By what to look noise up, and what it is off by on scenes that were left out."""
    off = f"off by a factor of {ratio(best['factor'])}, common noise by {ratio(best['factor_against'])}"
    return f"Use separate noise by {_by(best, over_one)}: on unseen scenes its second moment is {off}."


def _by(row: Mapping[str, Any], over_one: list[dict[str, Any]]) -> str:
    """Names of what a table is looked up by, of what the run varies."""
    names = list(Lookup)
    varied = {table["lookup"] for table in over_one}
    return listing(_BY[name] for name in names[1 : names.index(row["lookup"]) + 1] if name in varied)


def _steps(rows: list[dict[str, Any]], best: Mapping[str, Any] | None) -> list[dict[str, Any]]:
    """What each finer table adds to the one before, the coarsest first."""
    finer = [row for row in rows[::-1] if row["against"] != Lookup.one]
    if best is None:
        return finer
    names = list(Lookup)
    return [row for row in finer if names.index(row["lookup"]) > names.index(best["lookup"])]


def _added(row: Mapping[str, Any]) -> str:
    name = _ADDED[row["lookup"]]
    if row["gain_nats"] is None:
        return because(f"What {name[0].lower()}{name[1:]} adds is unknown", row["why"])
    if row["established"] is None:
        return because(f"{name} adds {_nats(row)}, without an interval", row["why"])
    return f"{name} adds {_nats(row)}: {'a gain' if row['established'] else 'no gain'} is established."


def _nats(row: Mapping[str, Any]) -> str:
    return format_as(_gain(row), thousandths, unit=f"{SPACE}nat")


def _gain(row: Mapping[str, Any]) -> Estimate:
    return Estimate.of_row(row, "gain_nats", "low", "high", "nat")


def _noise_lookup(inputs: RunInputs) -> list[pl.DataFrame]:
    sums = inputs.run.stored_tables("noise_sums", only=USED)
    return [noise_lookup(sums, groups=inputs.sampling.groups, level=inputs.sampling.level)]


NOISE_BY_CONDITION = Topic(
    "noise by condition", (Analysis((NOISE_LOOKUP,), _noise_lookup),), headline=noise_by_condition
)
