"""The noise to set in an estimator, what makes depths of points as certain as they are, and what residuals say."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from math import sqrt
from typing import Any

import polars as pl

from tracknoise.analysis.estimand import OVER_SCENES, Estimand, TableValues, Wording
from tracknoise.analysis.paired_tests import Family
from tracknoise.analysis.run_inputs import RunInputs
from tracknoise.estimators.exports import PURPOSES, estimator, short_tracks, windows_text
from tracknoise.estimators.model import Purpose
from tracknoise.estimators.window_noise import WINDOW_SIGMAS, scene_quantities, window_sigmas
from tracknoise.inference.estimates import Estimate
from tracknoise.inference.units import MIN_SCENES
from tracknoise.statistics.yardstick import shared_places
from tracknoise.tables.enumerations import Trimming, Trust
from tracknoise.tables.trust import AssessedTruth
from tracknoise.topics.headline import Headline, Part, ReportedConditions, RunTables, in_brackets
from tracknoise.topics.measures import first, short
from tracknoise.topics.run_data import RunData
from tracknoise.topics.sentences import joined
from tracknoise.topics.topic import ABOUT_TRACKS, Analysis, Topic
from tracknoise.words import SPACE, format_as, format_estimate, intervals_at, listing, number, pixels, px, ratio

LONGEST_WINDOW = 15
"""Longest window that is reported, in observations."""
LEAST_WINDOWS = 100
"""With fewer windows than this, or fewer that show the depth of their point, a number is not reported."""
_ALIKE = 1.1
"""An uncertainty that is at most this many times another one counts as the same."""
_UNITS = dict.fromkeys(("consistent_sigma", "residual_core", "sigma", "state_sigma", "innovations"), "px")
_ABOUT_DEPTH = ("consistent_sigma", "core_overconfidence")
Quantities = Mapping[str, Estimate]


def estimator_noise(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """What to set in the estimator of the experiment: sigma, gates, robust loss."""
    rows = conditions.reported(tables["advice"])
    if rows.is_empty():
        return None
    common = rows.row(0, named=True)
    title = estimator(common["estimator"]).title
    windows = _windows_of_all(own.to_dicts() for _, own in rows.group_by("tracker"))

    def described(tracker: str) -> Part | None:
        lifetime = _median_lifetime(tables, conditions, tracker)
        return _advised(conditions.of(rows, tracker), tables, tracker, lifetime, with_windows=not windows)

    return conditions.headline(
        described,
        opening=f"Noise to set in {', '.join(filter(None, [title, windows]))} {conditions.where(tables)}.",
        closing=f"{_right(common['purpose'], rows)}{_simulated(common)}{_between_scenes(rows)}",
        figure="estimator",
        table="advice",
    )


def _median_lifetime(tables: RunTables, conditions: ReportedConditions, tracker: str) -> int | None:
    summary = first(conditions.of(tables["summary"], tracker))
    return None if summary is None else summary["median_lifetime"]


def _windows(rows: Sequence[Mapping[str, Any]]) -> str:
    """In which windows the sigma of an advice is right."""
    features = next((int(row["value"]) for row in rows if row["quantity"] == "features"), None)
    return windows_text(rows[0]["landmark"], rows[0]["window"], features, simulated=rows[0]["why"] is not None)


def _windows_of_all(advice: Iterable[Sequence[Mapping[str, Any]]]) -> str:
    """The same of the advice for several trackers, where it is alike; else empty."""
    windows = {_windows(rows) for rows in advice}
    return windows.pop() if len(windows) == 1 else ""


def _right(purpose: str, rows: pl.DataFrame) -> str:
    """What sigma makes right: with a gate, only where nothing is rejected."""
    has_gate = rows["quantity"].str.ends_with("_gate").any()
    makes = f"Sigma makes {PURPOSES[Purpose(purpose)]} right"
    return f"{makes} where the gates reject nothing. {ABOUT_GATES}." if has_gate else f"{makes}."


def _simulated(row: Mapping[str, Any]) -> str:
    return "" if row["why"] is None else f" Windows are simulated: {row['why']}."


def _between_scenes(rows: pl.DataFrame) -> str:
    levels = rows.filter(quantity="sigma")["level"].drop_nulls()
    return "" if levels.is_empty() else f" Numbers in brackets are {intervals_at(levels[0])}."


def _advised(
    rows: pl.DataFrame, tables: RunTables, tracker: str, lifetime: int | None, *, with_windows: bool
) -> Part | None:
    if rows.is_empty():
        return None
    advice = {row["quantity"]: Estimate.of_row(row, "value", "low", "high", _UNITS.get(row["quantity"], ""))
             for row in rows.to_dicts()}  # fmt: skip
    sigma, innovations = advice["sigma"], advice["innovations"]
    caveat = _caveat(sigma.value, tables, tracker)
    most = _most(caveat)
    together = _together(rows["kernel"][0], advice)
    where = f" in {_windows(rows.to_dicts())}" if with_windows else ""
    text = joined([f"{tracker}: set {most}{format_estimate(sigma)}{where}.", caveat]) + together
    text = joined(
        [text, f"Innovations will suggest {px(innovations.value)}.", short_tracks(lifetime, rows["window"][0])]
    )
    if is_for_both(advice):
        position, rotation = advice["position_of_both"], advice["rotation_of_both"]
        text += (
            " The sigma is for positions in both cameras. With both cameras, errors of the newest position are "
            f"{format_estimate(position)} times those with the first alone. Errors of the newest rotation are "
            f"{format_estimate(rotation)} times those with the first alone."
        )
    stated = {**advice, "innovations": replace(innovations, low=None, high=None)}
    return Part(text, [stated[name] for name in _SAID if name in stated], f"{tracker}: set {most}{short(sigma)}.")


def is_for_both(advice: Collection[str]) -> bool:
    """Whether sigma is for positions in two cameras. `advice`: quantities of table `ADVICE` for a tracker."""
    return "position_of_both" in advice


def _together(kernel: str | None, advice: Quantities) -> str:
    """What belongs to sigma: a robust loss, or gates."""
    if kernel is not None:
        return f" Set the knee of the {kernel.title()} loss to {number(advice['knee'].value)} sigma."
    gates = {gate: advice[f"{gate}_gate"] for gate in _GATES if f"{gate}_gate" in advice}
    state = f" Set {px(advice['state_sigma'].value)} for features in the state." if "state_sigma" in advice else ""
    to_set = listing([f"{_article(gate)} {gate} gate of {number(factor.value)}" for gate, factor in gates.items()])
    nees = format_estimate(advice["gated_nees"]) if "gated_nees" in advice else ""
    tried = f" With this track gate, the NEES of the newest pose is {nees}." if nees else ""
    return f"{state} Set {to_set}.{tried}" if gates else ""


def _article(noun: str) -> str:
    return "an" if noun[0] in "aeiou" else "a"


_GATES = ("track", "observation")
ABOUT_GATES = "Gates are factors on chi-square quantiles at .95"
"""What the numbers of gates are, without full stop."""
_OF_BOTH = ("position_of_both", "rotation_of_both")
_SAID = ("sigma", "knee", "state_sigma", *(f"{gate}_gate" for gate in _GATES), "gated_nees", "innovations", *_OF_BOTH)
"""Quantities in the order of the sentences."""


def depth_noise(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """The noise that makes depths of points right for windows of tracks, and how wrong they are by residuals."""
    windows = tables["window_sigmas"].filter(trimming=conditions.trimming)
    length = shown_window(windows, conditions)
    shown = windows.filter(pl.col("n") >= LEAST_WINDOWS, pl.col("window").eq_missing(length))
    told = (_bracketed(conditions.of(shown, tracker)) for tracker in conditions.trackers)
    brackets = in_brackets(pl.concat([windows.clear(), *told]))
    errors = "" if conditions.percentile is None else f", from {conditions.trimming} errors"
    of_length = "" if length is None else f" Windows have {length} frames."
    return conditions.headline(
        lambda tracker: _noise_of(windows, length, tables, conditions, tracker),
        opening=f"Sigma for the depths of points {conditions.where(tables)}{errors}.{of_length}",
        closing=f"{_ABOUT_DEPTHS} Windows begin at birth; numbers are medians over those of all scenes.{brackets}",
        figure="findings" if conditions.fitted else "estimator",
        table="window_sigmas",
    )


_ABOUT_DEPTHS = "The sigma for depths makes depths as uncertain as an estimator with true poses claims."


def shown_window(windows: pl.DataFrame, conditions: ReportedConditions) -> int | None:
    """Length of the windows that sentences are about, the same for all trackers; None where no length has enough.

    It is the longest up to `LONGEST_WINDOW` of those at which most trackers have `LEAST_WINDOWS` windows that show the
    depth of their point, or where none has, as many windows. Where all lengths are longer, it is the shortest.

    Parameters
    ----------
    windows
        Schema `WINDOW_SIGMAS`.
    conditions
        Which trackers, and which errors.
    """
    rows = conditions.reported(windows).filter(trimming=conditions.trimming)
    counts = rows.select("tracker", "window", "quantity", "n", enough=pl.col("n") * pl.col("value") >= LEAST_WINDOWS)
    deep = counts.filter("enough", quantity="depth_share").join(
        counts.filter(quantity="consistent_sigma"), on=["tracker", "window"], how="semi"
    )
    usable = deep if deep.height else counts.filter(pl.col("n") >= LEAST_WINDOWS, quantity="residual_core")
    near = usable.filter(pl.col("window") <= max(LONGEST_WINDOW, int(usable["window"].min() or 0)))  # type: ignore[arg-type]
    lengths = shared_places(near, [], "window")["window"].to_list()
    return lengths[0] if lengths else None


def _noise_of(
    windows: pl.DataFrame, length: int | None, tables: RunTables, conditions: ReportedConditions, tracker: str
) -> Part | None:
    rows = conditions.of(windows, tracker)
    if length is None or rows.is_empty():
        return None
    quantities = _quantities(rows.filter(pl.col("n") >= LEAST_WINDOWS, window=length))
    if "residual_core" not in quantities:
        text = f"{tracker}: {_too_few(length)}."
        return Part(text, [], text)
    if "consistent_sigma" in quantities:
        return _with_depth(quantities, tracker, tables)
    return _without_depth(quantities, tracker, conditions)


def _bracketed(rows: pl.DataFrame) -> pl.DataFrame:
    """Rows of one length of window whose intervals are stated."""
    told = _ABOUT_DEPTH if "consistent_sigma" in _by_quantity(rows) else ("residual_core",)
    return rows.filter(pl.col("quantity").is_in(told))


def _too_few(length: int) -> str:
    """Why a tracker has no number where others have one."""
    return f"too few windows of {length} frames show the depth of a point"


def _quantities(rows: pl.DataFrame) -> Quantities:
    """Quantities of one length of window."""
    return {
        name: Estimate.of_row(row, "value", "low", "high", _UNITS.get(name, ""))
        for name, row in _by_quantity(rows).items()
    }


def _by_quantity(rows: pl.DataFrame) -> dict[str, dict[str, Any]]:
    """Rows of one length of window; those about depth only where enough windows show it."""
    by_quantity = {row["quantity"]: row for row in rows.to_dicts()}
    shares = by_quantity.get("depth_share")
    if shares is None or shares["n"] * shares["value"] < LEAST_WINDOWS:
        return {name: row for name, row in by_quantity.items() if name not in _ABOUT_DEPTH}
    return by_quantity


def _with_depth(quantities: Quantities, tracker: str, tables: RunTables) -> Part:
    consistent, residual, factor = (
        quantities[name] for name in ("consistent_sigma", "residual_core", "core_overconfidence")
    )
    caveat = _caveat(consistent.value, tables, tracker)
    residuals = f"The residual core is {px(residual.value)}. {_certainty(factor)}."
    most = _most(caveat)
    text = joined([f"{tracker}: the sigma for depths is {most}{format_estimate(consistent)}.", caveat, residuals])
    brief = f"{tracker}: the sigma for depths is {most}{short(consistent)}."
    return Part(text, [consistent, residual, factor], brief)


def _caveat(sigma_px: float | None, tables: RunTables, tracker: str) -> str:
    """Where the truth is not trusted, or this is unknown, how small the noise of the tracker alone may be; else empty.

    One or two sentences. If the truth explains the share s of the squared errors, sigma sqrt(1 - s) is left.
    """
    truth = AssessedTruth.of(tables)
    verdict, share = truth.verdict, truth.explained_share(tracker)
    if verdict.is_usable or sigma_px is None:
        return ""
    opening = _UNTRUSTED if verdict.verdict is Trust.not_trusted else _UNKNOWN
    if share is None or share >= 1.0:
        return opening
    return f"{opening} The noise of the tracker alone may be as small as {px(sigma_px * sqrt(1.0 - share))}."


def _most(caveat: str) -> str:
    """What stands before a number that is an upper bound, where there is a caveat."""
    return "at most " if caveat else ""


_UNTRUSTED, _UNKNOWN = "The truth is not trusted.", "Whether the truth can be trusted is unknown."


def _certainty(factor: Estimate) -> str:
    """How uncertain depths are beside what an estimator claims that is tuned to its residuals."""
    text = format_as(factor, lambda value: "unknown" if value is None else ratio(value), unit=f"{SPACE}times")
    alike = ", which counts as equal" if factor.above(1 / _ALIKE) and factor.below(_ALIKE) else ""
    return f"With the residual core as sigma, depths are {text} as uncertain as claimed{alike}"


def _without_depth(quantities: Quantities, tracker: str, conditions: ReportedConditions) -> Part:
    residual = quantities["residual_core"]
    why = "true positions are fitted to the tracks" if conditions.fitted else "few windows show the depth of a point"
    text = (
        f"{tracker}: the residual core is {format_estimate(residual)}. Whether it makes depths as certain as claimed "
        f"is unknown, because {why}."
    )
    brief = f"The residual core in windows of tracks is {short(residual)}; how certain depths are is unknown."
    return Part(text, [residual], brief)


def advised(data: RunData, tracker: str) -> dict[str, dict[str, Any]]:
    """What to set in the estimator of the experiment, rows of `ADVICE` by quantity; none where it is unknown."""
    rows = data.conditions().of(data["advice"], tracker)
    return {row["quantity"]: row for row in rows.to_dicts()}


def windows_of_advice(data: RunData) -> str:
    """In which windows the sigmas to set are right, where they are those of all trackers; else empty."""
    advice = (advised(data, tracker) for tracker in data.trackers)
    return _windows_of_all([*rows.values()] for rows in advice if rows)


def has_gates(data: RunData) -> bool:
    """Whether a track gate is among what is to be set: none is where the truth forbids it."""
    return data.truth.is_usable and any("track_gate" in advised(data, tracker) for tracker in data.trackers)


def sigma_sentence(data: RunData, tracker: str) -> str:
    """What to set in the estimator of the experiment, and what its innovations suggest. Empty where it is unknown.

    Where the truth is not trusted, what to set is an upper bound, and further sentences say so.
    """
    advice = advised(data, tracker)
    if not advice:
        return ""
    sigma, innovations = advice["sigma"], advice["innovations"]
    lifetime = _median_lifetime(data.tables, data.conditions(), tracker)
    caveat = _caveat(sigma["value"], data.tables, tracker)
    most = _most(caveat)
    more = f" and a track gate of {number(advice['track_gate']['value'])}" if "track_gate" in advice else ""
    more = f" and a knee of {number(advice['knee']['value'])} sigma" if "knee" in advice else more
    more = "" if caveat else more  # it is for this sigma, and errors of the truth are no outliers
    both = ", for both cameras" if is_for_both(advice) else ""
    return joined(
        [
            f"Set {most}{pixels(sigma['value'])} px{more} in {estimator(sigma['estimator']).title}{both}; "
            f"innovations suggest {pixels(innovations['value'])} px.",
            f"These settings are for {_windows([*advice.values()])}.",
            short_tracks(lifetime, sigma["window"]),
            caveat,
        ]
    )


def depth_noise_sentence(data: RunData, tracker: str) -> str:
    """The sigma for depths; empty where it is not known."""
    sigma = _at_window(data, tracker).get("consistent_sigma")
    if sigma is None:
        return ""
    most = _most(_caveat(sigma["value"], data.tables, tracker))
    window = f"in windows of {sigma['window']} frames"
    return f"{tracker}: the sigma for depths is {most}{pixels(sigma['value'])} px {window}."


def estimator_sentence(data: RunData, tracker: str) -> str:
    """The sigma for depths, and what follows for an estimator. Empty where windows were not measured."""
    quantities = _at_window(data, tracker)
    if "consistent_sigma" not in quantities:
        return ""
    sigma = quantities["consistent_sigma"]
    bounds = "" if sigma["low"] is None else f" ({pixels(sigma['low'])} to {pixels(sigma['high'])})"
    caveat = _caveat(sigma["value"], data.tables, tracker)
    most = _most(caveat)
    opening = f"The sigma for depths of {tracker} is {most}{pixels(sigma['value'])} px{bounds}."
    return joined([opening, f"Windows have {sigma['window']} frames.", caveat, _certain(quantities)])


def sigma_message(data: RunData) -> str:
    """Sigma for depths over the residual core, of the tracker that this misleads most; empty if none is shown to."""
    rows = [_at_window(data, tracker).get("core_overconfidence") for tracker in data.trackers]
    shown = [row for row in rows if row is not None and row["low"] is not None and row["low"] > 1.0]
    if not shown:
        return ""
    row = max(shown, key=lambda factor: factor["low"])
    times = f"{ratio(row['value'])} times the residual core of {row['tracker']}"
    return f"In windows of {row['window']} frames, depths need {times}"


def _certain(quantities: dict[str, dict[str, Any]]) -> str:
    """What an estimator that is tuned to its residuals gets wrong."""
    row = quantities.get("core_overconfidence")
    if row is None or row["low"] is None or row["high"] is None:
        return ""
    size = f"{number(row['value'])} times ({number(row['low'])} to {number(row['high'])}) as uncertain as claimed"
    if row["low"] <= 1.0 <= row["high"]:
        return f"The residual core as sigma is not shown to be wrong: depths are {size}."
    return f"With the residual core as sigma, depths are {size}."


def _at_window(data: RunData, tracker: str) -> dict[str, dict[str, Any]]:
    """Quantities of the windows that sentences are about, by name; none where points are fitted to whole tracks."""
    conditions = data.conditions()
    length = None if data.truth_is_fitted else shown_window(data["window_sigmas"], conditions)
    if length is None:
        return {}
    return _by_quantity(conditions.of(data["window_sigmas"], tracker).filter(trimming=data.trimming, window=length))


def _window_sigmas(inputs: RunInputs) -> list[pl.DataFrame]:
    noise, blocks = (inputs.run.stored_tables(name) for name in ("window_noise", "window_blocks"))
    return [window_sigmas(noise, blocks, inputs.sampling)]


_LEAST_OF_SCENE = 10
"""Fewest windows that a quantity of a scene rests on."""


def _of_windows(quantity: str) -> TableValues:
    """One of the quantities of windows of every scene."""

    def numbers(windows: pl.DataFrame) -> pl.DataFrame:
        enough = pl.col("n") >= _LEAST_OF_SCENE
        return scene_quantities(windows).filter(enough, quantity=quantity).rename({"window": "at"})

    return TableValues("window_noise", numbers, {"trimming": Trimming.untrimmed}, "window")


def _at_the_reported_window(first: pl.DataFrame, second: pl.DataFrame) -> Sequence[pl.DataFrame]:
    """Rows of the longest windows that findings report and enough scenes of both runs have.

    The sigma for depths depends on the length of windows, so that a mean over lengths is no sigma that anyone sets.
    """
    both = first.join(second, on=["scene", "at"]).filter(pl.col("at") <= LONGEST_WINDOW)
    counts = both.group_by("at").len()
    most = counts.select(pl.col("len").max()).item() or 0
    enough = counts.filter(pl.col("len") >= max(most / 2, min(most, MIN_SCENES))).sort("at")["at"]
    longest = pl.col("at").is_in(enough.tail(1).to_list())
    return first.filter(longest), second.filter(longest)


ESTIMATOR = Topic("estimator", headline=estimator_noise)
DEPTH_NOISE = Topic(
    "depth noise",
    (Analysis((WINDOW_SIGMAS,), _window_sigmas),),
    headline=depth_noise,
    holds=ABOUT_TRACKS,
    sentence=depth_noise_sentence,
    compared=(
        Estimand(
            "consistent_sigma",
            "Consistent sigma, which makes depths of points right, of the longest windows up to 15 observations that "
            f"enough scenes of both runs have: {OVER_SCENES}.",
            replace(_of_windows("consistent_sigma"), paired=_at_the_reported_window, family=Family.sizes),
            Wording("is better for depths", "sigma for depths is"),
            called="sigma for depths",
        ),
        Estimand(
            "residual_sigma",
            f"Residual core of windows of observations: {OVER_SCENES} and lengths of windows.",
            _of_windows("residual_core"),
            Wording("has only smaller residuals", "residuals are", is_secondary=True),
            called="residual core",
        ),
        Estimand(
            "overconfidence",
            f"Consistent sigma of windows, divided by their residual core: {OVER_SCENES} and lengths.",
            _of_windows("core_overconfidence"),
            Wording(
                "has less overconfident residuals",
                "an estimator tuned to residuals is",
                *("more overconfident", "less overconfident", "overconfident"),
                is_secondary=True,
            ),
        ),
    ),
)
