"""Words, tables, Markdown and the page of a comparison."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from tracknoise.analysis.comparison import Comparison, RunSide, comparison_json
from tracknoise.analysis.run_changes import Compared, GateResult, GateRow, Row
from tracknoise.report.comparison_page import (
    WIDTH,
    change_sentences,
    comparison_markdown,
    comparison_page,
    effect_words,
    plot_of,
    title_words,
    tolerance_words,
    where_words,
)
from tracknoise.tables.enumerations import ChangeVerdict, ComparedAges
from tracknoise.topics.catalogue import ESTIMANDS

OF = Compared("after", "lk", "lk", "simulated", "default", 0, "forward", "", 1)
CORE = Row(
    OF, ESTIMANDS["core"], ChangeVerdict.worse, None, effect=1.21, low=1.1, high=1.33, margin=1.1, at=7, coordinate="v",
    at_low=1, at_high=9, axis="age", horizon=None, p_change=1e-3, p_adjusted=2e-3, p_none=0.9, n_scenes=8,
    resampled="scenes", scenes={"one": 1.2, "two": 1.3},
)  # fmt: skip
LIFETIME = replace(
    CORE, estimand=ESTIMANDS["lifetime"], verdict=ChangeVerdict.none, effect=0.98, low=0.96, high=1.01, at=None,
    coordinate=None,
)  # fmt: skip
OPEN = replace(
    LIFETIME, estimand=ESTIMANDS["outlier_ratio"], verdict=ChangeVerdict.undecided, why="too few", effect=None,
    low=None, high=None, scenes={},
)  # fmt: skip
GATE = GateResult(
    "worse",
    (
        GateRow(OF, ESTIMANDS["core"], 0.1, "worse", None, 1.21, 1.1, 1.33),
        GateRow(OF, ESTIMANDS["bias"], 0.02, "undecided", "the interval contains the tolerance", 0.01, -0.02, 0.04),
    ),
    ("after could not measure scene-3.",),
)
ODD = '<script>alert("x")</script>|`*_\U0001f600' + "n" * 300


def comparison(*rows, gate=None, name="after"):
    named = [replace(row, of=replace(row.of, run=name)) for row in rows or (CORE, LIFETIME, OPEN)]
    side = RunSide(name, f"runs/{name}", (("trackers[0].options.window_px", "15", "7"),), ("Tracker b takes no part.",))
    return Comparison(RunSide("before", "runs/before"), (side,), tuple(named), 0.1, 0.95, ComparedAges.every, gate)


@pytest.mark.parametrize(
    ("row", "text"),
    [
        (CORE, "+21 % (+10 to +33)"),
        (replace(CORE, effect=4.7, low=3.9, high=5.6), "factor 4.70 (3.90 to 5.60)"),
        (replace(CORE, estimand=ESTIMANDS["bias"], effect=-0.05, low=-0.1, high=0.0), "−0.050 px (−0.100 to 0)"),
        (replace(CORE, estimand=ESTIMANDS["tap_delta_avg"], effect=0.012, low=-0.003, high=0.027),
         "+1.2 percentage points (−0.3 to +2.7)"),
        (OPEN, "–"),
        (replace(OPEN, effect=1.21), "+21 %"),
    ],
)  # fmt: skip
def test_effects_in_words(row, text):
    assert effect_words(row).replace("\N{NO-BREAK SPACE}", " ") == text


def test_tolerances_in_words():
    assert [tolerance_words(row).replace("\N{NO-BREAK SPACE}", " ") for row in GATE.rows] == ["10.0 %", "0.020 px"]


def said_of(*rows, **settings):
    """Sentences about rows, as they are printed."""
    found = comparison(*rows, **settings)
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in change_sentences(found, found.others[0])]


@pytest.mark.parametrize(
    ("statistic", "numbers", "sentence"),
    [
        ("core", (1.21, 1.1, 1.33), "Typical errors (core) are 21 % larger in after (10 to 33)."),
        ("consistent_sigma", (0.58, 0.47, 0.72), "Sigma for depths is 42 % smaller in after (28 to 53)."),
        ("lifetime", (2.5, 2.0, 3.0), "Tracks live 2.5 times as long in after (2.0 to 3.0)."),
        ("lifetime", (0.4, 0.32, 0.5), "Tracks live 2.5 times as long in before (2.0 to 3.1)."),
        ("lifetime", (0.8, 0.7, 0.9), "Tracks live 20 % shorter in after (10 to 30)."),
        ("outlier_ratio", (3.0, 2.0, None), "Outliers are 3.0 times as frequent in after (2.0 or more)."),
        ("outlier_ratio", (0.25, None, 0.4), "Outliers are 4.0 times as frequent in before (2.5 or more)."),
        ("outlier_ratio", (0.7, None, 0.8), "Outliers are 30 % less frequent in after (20 or more)."),
        ("outlier_ratio", (1.5, 1.2, None), "Outliers are 50 % more frequent in after (20 or more)."),
        ("residual_sigma", (1.42, 1.34, 1.51), "Residuals are 42 % larger in after (34 to 51)."),
        ("overconfidence", (0.6, 0.5, 0.7),
         "An estimator tuned to residuals is 40 % less overconfident in after (30 to 50)."),
        ("growth", (0.005, 0.004, 0.01), "Squared errors grow 200 times as much in before (100 to 250)."),
        ("bias", (-0.05, -0.1, 0.01), "The mean error (bias) is 0.050 px smaller in after (−0.010 to 0.100)."),
        ("tap_delta_avg", (0.05, 0.03, 0.07),
         "Position accuracy (TAP) is 5.0 percentage points higher in after (3.0 to 7.0)."),
        ("core", (1e5, 1e4, 1e6),
         "Typical errors (core) are more than 1000 times as large in after (more than 1000 to more than 1000)."),
    ],
)  # fmt: skip
def test_sentences_say_which_run_has_more_with_bounds_in_order(statistic, numbers, sentence):
    effect, low, high = numbers
    row = replace(CORE, estimand=ESTIMANDS[statistic], effect=effect, low=low, high=high, at=None, coordinate=None)
    assert said_of(row)[0] == sentence


def test_sentences_name_what_changed_where_and_then_what_is_open():
    assert said_of(CORE, LIFETIME, OPEN) == [
        "Typical errors (core) are 21 % larger in after (10 to 33), at age 7 in v.",
        "No difference: lifetime.",
        "Undecided: outlier ratio.",
        "Factors and percentages are geometric means over scenes.",
    ]
    assert said_of(LIFETIME) == []


@pytest.mark.parametrize(
    ("axis", "at", "text"),
    [
        ("frame", 1, "1 frame after the key frame in v"),
        ("frame", -4, "4 frames before the key frame in v"),
        ("window", 5, "in windows of 5 in v"),
    ],
)
def test_places_around_a_key_frame_are_on_the_right_side_of_it(axis, at, text):
    assert where_words(replace(CORE, axis=axis, at=at)) == text
    assert where_words(replace(CORE, axis=axis, at=None)) == "in v"


def test_sentences_about_several_conditions_name_them_and_count_what_the_tables_have():
    fast = replace(OF, speed=4)
    first, second, mean = said_of(CORE, LIFETIME, replace(CORE, of=fast), replace(LIFETIME, of=fast))
    assert (first[:12], second[:12]) == ("At speed 1, ", "At speed 4, ")
    assert mean.startswith("Factors")
    many = said_of(*(replace(CORE, of=replace(OF, speed=speed)) for speed in range(1, 12)))
    assert many[8] == "The tables have 3 more changes."


def test_titles_name_trackers_where_two_are_paired():
    paired = replace(CORE, of=replace(OF, other_tracker="mine"))
    found = comparison(paired)
    assert title_words(found, *found.others) == "mine of after compared with lk of before"
    assert said_of(paired)[0].startswith("Typical errors (core) are 21 % larger with mine of after")
    same = comparison(paired, name="before")
    assert title_words(same, *same.others) == "mine compared with lk"
    assert title_words(comparison(), *comparison().others) == "after compared with before"


def test_what_is_worse_lies_to_the_right_whichever_way_is_better():
    core, lifetime = plot_of(CORE), plot_of(replace(LIFETIME, effect=0.7, low=0.6, high=0.8))
    assert core is not None
    assert lifetime is not None
    for plot in (core, lifetime):
        assert WIDTH / 2 < plot.low.place < plot.effect.place < plot.high.place <= WIDTH
        assert {plot.low.beyond, plot.effect.beyond, plot.high.beyond} == {0}
        assert plot.inner[0] < WIDTH / 2 < plot.inner[1]
    assert plot_of(OPEN) is None
    huge = plot_of(replace(CORE, effect=1e9, low=1e-9, high=1e12))
    assert huge is not None
    assert 0.0 < huge.low.place == WIDTH - huge.high.place < WIDTH / 20


@pytest.mark.parametrize(
    ("statistic", "numbers", "beyond"),
    [
        ("core", (1e9, 1e-9, 1e12), (-1, 1, 1)),
        ("lifetime", (0.7, 0.6, 1e9), (-1, 0, 0)),
        ("outlier_ratio", (3.0, 2.0, None), (0, 0, 1)),
        ("outlier_ratio", (0.5, None, 0.8), (-1, 0, 0)),
        ("bias", (0.1, -90.0, 0.2), (-1, 0, 0)),
    ],
)
def test_what_lies_beyond_the_line_is_an_arrow_at_its_end(statistic, numbers, beyond):
    effect, low, high = numbers
    row = replace(CORE, estimand=ESTIMANDS[statistic], effect=effect, low=low, high=high, scenes={"one": 1e9})
    plot = plot_of(row)
    assert plot is not None
    assert (plot.low.beyond, plot.effect.beyond, plot.high.beyond) == beyond
    assert abs(plot.scenes[0][1].beyond) == 1
    drawn = Elements(comparison_page(comparison(row)))
    assert drawn.names.count("path") == 1 + sum(map(abs, beyond))


class Elements(HTMLParser):
    """Names of all elements, and the text of the page."""

    def __init__(self, page):
        super().__init__()
        self.names, self.text = [], ""
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.names.append(tag)
        assert not [name for name, value in attrs if name in ("src", "href") and value]

    def handle_data(self, data):
        self.text += data


def test_the_page_has_the_answer_every_row_and_no_script():
    page = Elements(comparison_page(comparison(gate=GATE)))
    assert "script" not in page.names
    assert page.names.count("svg") == 2
    text = " ".join(page.text.split())
    conclusion = "before at single ages has smaller typical errors; 1 of 3 statistics is undecided."
    for part in ("The gate fails", "too few", "Tracker b takes no part.", "window_px"):
        assert part in text
    assert text.index("after compared with before") < text.index("The gate fails") < text.index(conclusion)
    assert "After could not measure scene-3." in text


def test_odd_names_are_harmless_in_page_and_markdown():
    odd = comparison(CORE, gate=GATE, name=ODD)
    page = Elements(comparison_page(odd))
    assert "script" not in page.names
    assert ODD in page.text
    text = comparison_markdown(odd)
    assert "<script" not in text
    for line in text.splitlines():
        if line.startswith("|"):
            assert len(re.findall(r"(?<!\\)\|", line)) in (6, 7)


def test_names_notify_and_link_nothing():
    """GitHub makes links of these; only ``~`` and ``$`` can be escaped by a backslash."""
    name = "@org/team someone@host.org #12 org/tool#3 GH-4 https://host.org www.host.org mailto:x ~~a~~ $b$"
    text = comparison_markdown(comparison(gate=GATE, name=name))
    assert text.count("org/team") == 4
    assert re.findall(r"[@#][\w/]|://|www\.|mailto:x|GH-4", text.replace("&#8203;", "\u200b")) == []
    in_html = [line for line in text.splitlines() if line.startswith("<summary>")]
    assert re.findall(r"(?<!\\)[~$]\w", "".join(line for line in text.splitlines() if line not in in_html)) == []


def test_markdown_has_the_outcome_first_and_a_folded_table():
    lines = comparison_markdown(comparison(gate=GATE)).splitlines()
    assert lines[2] == "**The gate fails: something is worse than its tolerance.**"
    assert lines[5] == "**before at single ages has smaller typical errors; 1 of 3 statistics is undecided.**"
    assert "| core of the errors | worse | +21\N{NO-BREAK SPACE}% (+10 to +33) | at age 7 in v | 8 |  |" in lines
    assert lines.count("<details>") == lines.count("</details>") == 1


def test_the_document_has_every_row_and_what_it_estimates():
    import json

    found = json.loads(comparison_json(comparison(gate=GATE)))
    assert [row["verdict"] for row in found["rows"]] == ["worse", "no difference", "undecided"]
    assert [row["statistic"] for row in found["rows"]] == ["core", "lifetime", "outlier_ratio"]
    assert found["rows"][0]["scenes"] == {"one": 1.2, "two": 1.3}
    assert found["estimands"]["lifetime"]["larger_is_better"]
    assert found["gate"]["outcome"] == "worse"
    assert found["conclusions"] == ["before at single ages has smaller typical errors; 1 of 3 statistics is undecided."]
