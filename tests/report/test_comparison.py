"""Words, tables, Markdown and the page of a comparison."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from tracknoise.analysis.run_changes import (
    Compared,
    Comparison,
    GateResult,
    GateRow,
    Row,
    RunSide,
    comparison_json,
)
from tracknoise.report.comparison_page import (
    WIDTH,
    answers,
    clearest,
    comparison_markdown,
    comparison_page,
    effect_words,
    plot_of,
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


def test_the_answer_names_the_statistics_of_each_verdict():
    assert answers([CORE, LIFETIME, OPEN]) == [
        "Worse: core of the errors.",
        "No difference: lifetime.",
        "Undecided: outlier ratio.",
    ]
    sentence, weighting = clearest([CORE, LIFETIME, OPEN])
    assert weighting == "Factors and percentages are geometric means over scenes."
    assert clearest([LIFETIME]) == []
    assert sentence.startswith("Core of the errors is worse: +21")
    assert sentence.endswith("at age 7 in v.")


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


def test_the_answer_about_several_conditions_names_what_changed_and_counts_the_rest():
    fast = replace(OF, speed=4)
    rows = [CORE, LIFETIME, replace(CORE, of=fast), replace(LIFETIME, of=fast)]
    worse, same = answers(rows)
    assert worse == "Worse: core of the errors (speed 1) and core of the errors (speed 4)."
    assert same == "No difference: 2 of 4 rows."
    other = replace(OF, tracker="sift", other_tracker="sift")
    assert answers([CORE, replace(LIFETIME, of=other)])[0] == "Worse: core of the errors (lk)."


def test_what_is_worse_lies_to_the_right_whichever_way_is_better():
    core, lifetime = plot_of(CORE), plot_of(replace(LIFETIME, effect=0.7, low=0.6, high=0.8))
    assert core is not None
    assert lifetime is not None
    for plot in (core, lifetime):
        assert WIDTH / 2 < plot.low < plot.effect < plot.high <= WIDTH
        assert plot.inner[0] < WIDTH / 2 < plot.inner[1]
    assert plot_of(OPEN) is None
    huge = plot_of(replace(CORE, effect=1e9, low=1e-9, high=1e12))
    assert huge is not None
    assert 0.0 < huge.low == WIDTH - huge.high < WIDTH / 20


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
    for part in ("The gate fails", "Worse: core of the errors.", "too few", "Tracker b takes no part.", "window_px"):
        assert part in text
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
    assert text.count("org/team") == 3
    assert re.findall(r"[@#][\w/]|://|www\.|mailto:x|GH-4", text.replace("&#8203;", "\u200b")) == []
    in_html = [line for line in text.splitlines() if line.startswith("<summary>")]
    assert re.findall(r"(?<!\\)[~$]\w", "".join(line for line in text.splitlines() if line not in in_html)) == []


def test_markdown_has_the_outcome_first_and_a_folded_table():
    lines = comparison_markdown(comparison(gate=GATE)).splitlines()
    assert lines[2] == "**The gate fails: something is worse than its tolerance.**"
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
