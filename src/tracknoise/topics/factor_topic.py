"""Which factors have an effect, which have none, and which tracker is more accurate."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl

from tracknoise.analysis.factors import DEPENDENCE, LEAST_TRACKERS, RANKS, ROLES, dependence, ranking
from tracknoise.analysis.paired_tests import DISAGREE
from tracknoise.analysis.run_inputs import RunInputs
from tracknoise.analysis.scene_values import run_values
from tracknoise.inference.estimates import Estimate
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.statistics.yardstick import FACTORS
from tracknoise.tables.enumerations import Verdict
from tracknoise.tables.findings_schema import CURVES, EFFECTS
from tracknoise.tables.schema import empty
from tracknoise.topics.answer_summary import Answer, Judgement, Measure
from tracknoise.topics.headline import Headline, ReportedConditions, RunTables, TrackerPart, ids_of, leading
from tracknoise.topics.measures import answer, shown_size
from tracknoise.topics.run_data import RunData
from tracknoise.topics.sentences import because, joined
from tracknoise.topics.topic import ABOUT_TRACKS, Analysis, Topic
from tracknoise.words import (
    STATISTICS,
    bounded_sentences,
    count,
    difference_sentences,
    factor_name,
    listing,
    pixels,
    ratio,
    rms_of_tracks,
    sentence_case,
)

_MOST_NAMED = 3


def asked(dependence: pl.DataFrame, conditions: ReportedConditions) -> pl.DataFrame:
    """The questions that the headline is about: of each factor that was varied, at the lowest speed.

    Returns rows of `dependence` with a column `role`, in the order of the factors, trackers and statistics. Options of
    trackers follow the other factors. Trackers that differ in one option alone are compared by that option only.
    """
    nominal = pl.col("speed").is_null() | (pl.col("speed") == conditions.reference.speed)
    known = pl.col("statistic").is_in(list(ROLES))
    rows = dependence.filter(nominal, known, pl.col("n_levels") > 1)
    rows = _without_repeated(rows)
    options = [name for name in rows["factor"].unique(maintain_order=True) if name not in FACTORS]
    orders = {"factor": [*FACTORS, *options], "tracker": [*conditions.trackers], "role": list(STATISTICS)}
    rows = rows.with_columns_seq(role=pl.col("statistic").replace_strict(ROLES, return_dtype=pl.String))
    places = [
        pl.col(name).replace_strict(order, range(len(order)), default=-1, return_dtype=pl.Int64)
        for name, order in orders.items()
    ]
    return rows.sort(*places, maintain_order=True)


def _without_repeated(rows: pl.DataFrame) -> pl.DataFrame:
    """Rows without those about trackers that are all compared by one option, or whose largest effect is an option's."""
    of_options = rows.filter(~pl.col("factor").is_in([*FACTORS]))
    of_trackers = rows.filter(pl.col("factor") == "tracker")
    known = of_trackers.join(of_options, on="n_levels", how="anti", maintain_order="left")
    new = known.join(of_options, on=["dataset", "statistic", "effect"], how="anti", maintain_order="left")
    return pl.concat([new, rows.filter(pl.col("factor") != "tracker")])


def factors(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """How many effects of factors exceed the margin, the clearest of these, and the smallest of the others."""
    rows = asked(tables["dependence"], conditions)
    if rows.is_empty():
        return None
    counts = [f"{n} {verdict}" for verdict in Verdict if (n := rows.filter(verdict=verdict).height)]
    yes, no = _clearest(rows, Verdict.yes, "low")[::-1][:_MOST_NAMED], _clearest(rows, Verdict.no, "most")[:_MOST_NAMED]
    opening = [
        f"Verdicts on whether {_names(rows)} changes a statistic: {listing(counts)}.",
        *_margins(rows),
        f"Factors other than speed are compared at speed {conditions.reference.speed}.",
    ]
    parts = [
        TrackerPart(row["tracker"], joined(difference_sentences(row, row["role"])), ids_of(_effects([row])))
        for row in yes
    ]
    if no:
        smallest = ["The smallest effects follow.", *(joined(bounded_sentences(row, row["role"])) for row in no)]
        parts.append(TrackerPart(None, joined(smallest), ids_of(_effects(no))))
    closing = [] if yes or no else _undecided(rows)
    text = " ".join([*opening, *(part.text for part in parts), *closing])
    return Headline(
        text,
        "factor-effects",
        "dependence",
        leading(_effects(yes or no)),
        opening=" ".join(opening),
        closing=" ".join(closing),
        parts=tuple(parts),
    )


def _effects(rows: Sequence[Mapping[str, Any]]) -> list[Estimate]:
    return [Estimate.of_row(row, "effect", "low", "high", row["unit"]) for row in rows]


def _names(rows: pl.DataFrame) -> str:
    """Names of factors; of many the first ones."""
    names = [f"the {factor_name(name)}" for name in rows["factor"].unique(maintain_order=True)]
    named = names if len(names) <= _MOST_NAMED + 1 else [*names[:_MOST_NAMED], "another factor"]
    return listing(named, joint="or")


def _margins(rows: pl.DataFrame) -> list[str]:
    """The margins, in words."""
    ratios = rows.filter(unit="ratio")["margin"].drop_nulls().to_list()
    return [f"The margin is a ratio of {ratio(ratios[0])}."] if ratios else []


def _clearest(rows: pl.DataFrame, verdict: Verdict, bound: str) -> list[dict[str, Any]]:
    """Rows with a verdict, from the one whose bound is the smallest relative to its margin."""
    return sorted(rows.filter(verdict=verdict).to_dicts(), key=lambda row: _excess(row, bound))


def _excess(row: Mapping[str, Any], column: str) -> float:
    """A size relative to the margin, on the scale of its interval."""
    scale = float if row["unit"] == "px" else math.log
    return scale(row[column]) / scale(row["margin"])


def _undecided(rows: pl.DataFrame) -> list[str]:
    """Why all answers are undecided, in the words of the table, and the largest effect that was measured."""
    reasons = rows["why"].drop_nulls().unique(maintain_order=True).to_list()
    known = sorted(rows.drop_nulls("effect").to_dicts(), key=lambda row: -_excess(row, "effect"))[:1]
    sentences = [because("No effect is shown", reasons[0])] if len(reasons) == 1 else []
    largest = [
        joined(["The largest measured effect may be chance.", *difference_sentences(row, row["role"])]) for row in known
    ]
    return [*sentences, *largest]


_SECTION = "factor-effects"
_QUESTION = "shown"


def comparisons(data: RunData, factor: str, role: str) -> pl.DataFrame:
    """Comparisons of several levels of a factor by one statistic: schema `DEPENDENCE`."""
    names = [name for name, of in ROLES.items() if of == role]
    return data["dependence"].filter(pl.col("statistic").is_in(names), pl.col("n_levels") > 1, factor=factor)


def compared(data: RunData, role: str) -> dict[str, Any] | None:
    """Row of the comparison of trackers at the lowest speed by one statistic; None where there is none."""
    rows = comparisons(data, "tracker", role)
    rows = rows.filter(pl.col("speed").is_null() | (pl.col("speed") == data.slowest))
    return rows.row(0, named=True) if rows.height else None


def best(data: RunData, tracker: str, role: str, question: str) -> Answer | None:
    """Whether a tracker is the best by a statistic; None where trackers are not compared.

    Of three and more trackers, the ranks tell. It is not known where two differ at a single age (or frame) only.
    """
    if ranked := _best_ranks(data, role):
        first = _first(ranked)
        is_worse = tracker in ranked and tracker not in first
        verdict = Verdict.no if is_worse else Verdict.yes if first == [tracker] else Verdict.undecided
        return answer(question, verdict, wished=Verdict.yes)
    row = compared(data, role)
    if row is None:
        return None
    if row["verdict"] != Verdict.yes or row["better"] is None or row["at"] is not None:
        return answer(question, Verdict.undecided, wished=Verdict.yes)
    pair = {row["level_a"], row["level_b"]}
    if tracker in pair - {row["better"]}:
        return answer(question, Verdict.no, wished=Verdict.yes)
    only_two = row["n_levels"] == len(pair)
    return answer(question, Verdict.yes if only_two else Verdict.undecided, wished=Verdict.yes)


def accuracy(data: RunData, errors: dict[str, Measure | None]) -> Judgement:
    """Which tracker is more accurate, and by how much: by the core, and by the RMS over tracks where that differs."""
    if (truth := data.truth).are_tracks_wrong:
        return Judgement(answer(_QUESTION, Verdict.undecided, wished=Verdict.yes), truth.text, _SECTION)
    if len(data.trackers) < 2:
        return _alone(errors)
    ranked = _best_ranks(data, "core")
    if 0 < len(_first(ranked)) < len(ranked):
        found = Judgement(
            answer(_QUESTION, Verdict.yes, wished=Verdict.yes), _leaders(data, ranked), "error-by-tracker"
        )
        return _said_of_truth(data, found)
    row = compared(data, "core")
    if row is None or row["effect"] is None:
        return _said_of_truth(data, _unproven(data, errors))
    verdict = Verdict(row["verdict"]) if row["at"] is None else Verdict.undecided
    text = _sentence(data, row, verdict) if row["at"] is None else _at_one_place(data, row)
    return _said_of_truth(data, Judgement(answer(_QUESTION, verdict, wished=Verdict.yes), text, _SECTION))


def ranks_by_role(data: RunData) -> pl.DataFrame:
    """Ranks at the lowest speed, with the role of each statistic; none where fewer than three trackers are compared."""
    roles = pl.col("statistic").replace_strict(dict(ROLES), default=None, return_dtype=pl.String)
    return data.nominal(data["ranks"]).with_columns(role=roles)


def _best_ranks(data: RunData, role: str) -> dict[str, int]:
    """Best rank of each tracker by a statistic."""
    return dict(ranks_by_role(data).filter(role=role).select("tracker", "best").iter_rows())


def _first(ranked: Mapping[str, int]) -> list[str]:
    """The trackers that none is shown to be better than."""
    return [name for name, best in ranked.items() if best == 1]


def _leaders(data: RunData, ranked: Mapping[str, int]) -> str:
    """Which trackers are first by the core, and by the RMS over tracks where these are others."""
    first, by_rms = _first(ranked), _first(_best_ranks(data, "second"))
    differs = 0 < len(by_rms) < min(len(ranked), _MOST_NAMED + 1) and set(by_rms) != set(first)
    leads = "is" if len(by_rms) == 1 else "are"
    rest = f"; by {rms_of_tracks(data.trimming)}, {_some(by_rms)} {leads} first" if differs else ""
    apart = disputed_ranks(ranks_by_role(data).filter(role="core"))
    if len(first) == 1:
        return f"{first[0]} has the smallest typical error of {len(ranked)} trackers{rest}.{apart}"
    return f"{len(first)} of {len(ranked)} trackers share the first rank in typical error: {_some(first)}{rest}.{apart}"


def _some(names: Sequence[str]) -> str:
    """Names, or the first of them and how many others there are."""
    return listing(names if len(names) <= _MOST_NAMED else [*names[:2], f"{len(names) - 2} others"])


def _said_of_truth(data: RunData, found: Judgement) -> Judgement:
    """The same, with what is left of it where the truth is not trusted, or this is unknown.

    Errors of the truth are the same for all trackers: they add to the squared errors of each, so that ratios are nearer
    to 1 than those of the trackers alone, and the order stays. In differences at the same corners they cancel.
    """
    if data.truth.is_usable:
        return found
    is_better = found.answer.verdict == Verdict.yes
    alike = "Errors of the truth are the same for all trackers: the order holds, and the ratio is at least this large."
    left = alike if is_better else "Errors of the truth can hide a difference."
    return replace(found, text=f"{found.text} {left}{_apart(data)}")


def _apart(data: RunData) -> str:
    """How far two trackers are apart at the same corners, up to the reference age; begins with a space."""
    near = data.nominal(data["tracker_differences"]).filter(pl.col("age") <= REFERENCE_AGE)
    last = near.filter(pl.col("age") == pl.col("age").max())
    if last.is_empty():
        return ""
    one, other = last.select("tracker", "other").row(0)
    pair = last.filter(pl.col("coordinate").is_in(["u", "v"]), tracker=one, other=other)
    variance, mean = (pair.filter(statistic=name)["value"].to_numpy() for name in ("central", "mean"))
    square = float(variance.sum() + np.square(mean).sum())
    return f" At the same corners, {one} and {other} are {pixels(math.sqrt(square))} px apart (RMS)."


def _sentence(data: RunData, row: dict[str, Any], verdict: Verdict) -> str:
    """The verdict on all ages (or frames) that both trackers have, and both coordinates, together."""
    pair = [row["level_a"], row["level_b"]]
    bounds = "" if row["low"] is None else f" ({ratio(row['low'])} to {ratio(row['high'])})"
    size, everywhere = f"{ratio(row['effect'])} times", f"over shared {data.axis.name}s"
    disputed = _disputed(row["why"], row["level_a"], row["level_b"])
    rms = rms_of_tracks(data.trimming)
    if verdict == Verdict.yes and row["better"] in pair:
        better, worse = row["better"], pair[1 - pair.index(row["better"])]
        if _is_more(_rms_ratio(data, better, worse)):
            core = f"Typical errors (core) of {worse} are {size}{bounds} those of {better}"
            return f"{core}; large errors give {better} the larger {rms}."
        than = f" than {worse}" if row["n_levels"] > len(pair) else ""
        core = f"typical errors (core) of {worse} are {size}{bounds} as large"
        return f"{better} is more accurate{than}: {core} {everywhere}."
    if verdict == Verdict.no:
        return _equal(data, row, pair)
    larger, smaller = row["larger"] or pair[0], _smaller(row)
    core = f"typical errors (core) of {larger} are {size}{bounds} those of {smaller}"
    if _is_more(row["effect"]) and _is_more(_rms_ratio(data, smaller, larger)):
        return f"Undecided: {core}, but large errors give {smaller} the larger {rms}.{disputed}"
    return f"It is undecided which is more accurate: {core} {everywhere}.{disputed}"


def _disputed(why: str | None, *trackers: str) -> str:
    """That references of the two kinds disagree about trackers, if that is the reason; begins with a space."""
    return f" {sentence_case(DISAGREE)} {_some(trackers)}." if (why or "").startswith(DISAGREE) else ""


def disputed_ranks(ranks: pl.DataFrame) -> str:
    """The same of all trackers of a table of ranks."""
    about = ranks.drop_nulls("why")["tracker"].unique(maintain_order=True).to_list()
    return _disputed(DISAGREE, *about) if about else ""


def _equal(data: RunData, row: dict[str, Any], pair: Sequence[str]) -> str:
    """No difference in the core; one in the RMS over tracks is named where it is larger than the margin."""
    first, second = pair
    times = {larger: _rms_ratio(data, larger, smaller) for larger, smaller in ((first, second), (second, first))}
    larger = max(times, key=lambda name: times[name])
    if times[larger] > row["margin"]:
        of = f"{rms_of_tracks(data.trimming)} of {larger} {ratio(times[larger])} times as large"
        return f"Typical errors of {first} and {second} are equal within {_margin(row)}; large errors make the {of}."
    return f"{first} and {second} are equally accurate: core errors differ by less than {_margin(row)}."


def _rms_ratio(data: RunData, one: str, other: str) -> float:
    """RMS of a tracker over that of another at their shared age (or frame), u and v together; 1 where unknown."""
    rows = {row["tracker"]: row for row in data.nominal(data["summary"]).drop_nulls("at").to_dicts()}
    if {one, other} - set(rows) or rows[one]["at"] != rows[other]["at"]:
        return 1.0
    length, beside = (
        math.hypot(*(rows[name][f"{data.trimming}_rms_{axis}_px"] for axis in "uv")) for name in (one, other)
    )
    return length / beside if beside else 1.0


def _is_more(times: float) -> bool:
    """Whether a ratio is above one as it is written."""
    return times > 1.0 and ratio(times) != ratio(1.0)


def _at_one_place(data: RunData, row: dict[str, Any]) -> str:
    """Where the trackers differ most clearly, if only a single age (or frame) and coordinate shows it."""
    bound = "" if row["low"] is None else f" ({ratio(row['low'])} or more)"
    where = f"in {row['coordinate']} {data.axis.place(row['at'])}"
    larger = row["larger"] or row["level_a"]
    core = f"typical errors (core) of {larger} are {ratio(row['effect'])} times{bound} those of {_smaller(row)}"
    return f"Undecided overall; {where}, {core}."


def _smaller(row: dict[str, Any]) -> str:
    """The tracker with the smaller error."""
    return str(row["level_b"] if row["larger"] in (None, row["level_a"]) else row["level_a"])


def _margin(row: dict[str, Any]) -> str:
    return f"a factor of {ratio(row['margin'])}"


def _alone(errors: dict[str, Measure | None]) -> Judgement:
    """One tracker has nothing to be compared with: its error is the answer."""
    found = [measure for measure in errors.values() if measure is not None]
    text = found[0].sentence if found else "No error could be measured."
    return Judgement(answer("measured", Verdict.yes if found else Verdict.no, wished=Verdict.yes), text, "findings")


def _unproven(data: RunData, errors: dict[str, Measure | None]) -> Judgement:
    """No comparison: errors of these scenes, without a claim about others."""
    sizes = {name: one.number.value for name, one in errors.items() if one is not None and one.number.value}
    undecided = answer(_QUESTION, Verdict.undecided, wished=Verdict.yes)
    if len(sizes) < 2:
        return Judgement(undecided, "Too few trackers have a measured error to compare them.", _SECTION)
    scenes = count(len({entry.sequence.scene for entry in data.sequences.values()}), "scene")
    if data.nominal(data["summary"]).filter(pl.col("tracker").is_in(list(sizes)))["at"].n_unique() > 1:
        text = f"Undecided from {scenes}: the errors are not known at the same {data.axis.name}."
        return Judgement(undecided, text, _SECTION)
    low, *_, high = sorted(sizes, key=lambda name: sizes[name] or 0.0)  # of equal ones, not the same twice
    what = "noise" if data.truth_is_fitted else _core_or_rms(data)
    size = (sizes[high] or 0.0) / (sizes[low] or 1.0)
    text = f"Undecided from {scenes}: the {what} of {high} is {ratio(size)} times"
    of_core = not data.truth_is_fitted and shown_size(data)[0] == "core"
    reverse = of_core and _is_more(size) and _is_more(_rms_ratio(data, low, high))
    end = f", but large errors give {low} the larger {rms_of_tracks(data.trimming)}." if reverse else "."
    text += f" that of {low}{end}"
    return Judgement(undecided, text, _SECTION)


def _core_or_rms(data: RunData) -> str:
    """The size of errors that is compared."""
    name, axis = shown_size(data)
    return f"{'typical error (core)' if name == 'core' else rms_of_tracks(data.trimming)} in {axis}"


def changes(data: RunData) -> list[str]:
    """What each factor changes, and what is undecided, in a sentence; none where no question was asked."""
    rows = asked(data["dependence"], data.conditions())
    groups = list(rows.group_by("factor", maintain_order=True))
    told = [_changed(f"The {factor_name(str(name))}", of_factor) for (name,), of_factor in groups[:_MOST_NAMED]]
    return [*told, "More factors are in the table of effects."] if len(groups) > len(told) else told


def _changed(factor: str, rows: pl.DataFrame) -> str:
    """Which statistics a factor changes for every tracker, which for some, and which are undecided."""
    verdicts = {STATISTICS[str(role)]: set(of["verdict"]) for (role,), of in rows.group_by("role", maintain_order=True)}
    every = [name for name, found in verdicts.items() if found == {Verdict.yes}]
    some = [name for name, found in verdicts.items() if Verdict.yes in found and name not in every]
    open_ = [name for name, found in verdicts.items() if Verdict.yes not in found and Verdict.undecided in found]
    whose = " of every tracker" if rows["tracker"].n_unique() > 1 else ""
    changed = [f"{listing(every)}{whose}"] if every else []
    changed += [f"{listing(some)} of some"] if some else []
    left = f"; undecided: {listing(open_)}" if open_ else ""
    if not changed:
        return f"{factor} is not shown to change any statistic."
    return f"{factor} changes {', and '.join(changed)}{left}."


def _dependence(inputs: RunInputs, *, pairs: bool = False) -> pl.DataFrame:
    run = run_values(
        inputs.moments,
        inputs.scales,
        inputs.ends,
        inputs.frames,
        inputs[CURVES],
        by_kind=inputs.by_kind,
        key_frames=inputs.key_frames,
        population=inputs.population,
        trimming=inputs.trimming,
    )
    return dependence(
        run,
        inputs[EFFECTS],
        options=inputs.options,
        groups=inputs.sampling.groups,
        margin=inputs.margin,
        level=inputs.sampling.level,
        pairs=pairs,
    )


def _ranks(inputs: RunInputs) -> list[pl.DataFrame]:
    are_few = len(inputs.trackers) < LEAST_TRACKERS
    return [empty(RANKS) if are_few else ranking(_dependence(inputs, pairs=True))]


EFFECTS_OF_FACTORS = Topic(
    "factors",
    (
        Analysis(
            (DEPENDENCE,),
            lambda inputs: [_dependence(inputs)],
            needs=(CURVES, EFFECTS),
            if_fitted=pl.col("axis").is_null(),  # of lifetimes and outlier ratios
        ),
        Analysis((RANKS,), _ranks, needs=(CURVES, EFFECTS)),
    ),
    headline=factors,
    holds=ABOUT_TRACKS,
)
