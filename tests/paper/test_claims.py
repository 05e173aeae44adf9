"""The paper's claims as data: none without a source, and all of a kind that can be judged."""

from collections import Counter

import pytest

from tracknoise.experiments.load import preset_names
from tracknoise.paper.claim_verdicts import JUDGES, Claim, cells, claims
from tracknoise.report import paper

SOURCES = {"abstract", "text", "captions", "text or captions", "figure"}


def named(experiment: str, name: str) -> Claim:
    (found,) = [one for one in (*claims(), *cells()) if (one.experiment, one.id) == (experiment, name)]
    return found


def test_every_claim_has_a_source_and_a_judge() -> None:
    assert {one.source for one in claims()} <= SOURCES
    assert {one.kind for one in (*claims(), *cells())} == set(JUDGES)
    assert all(one.text.endswith(".") for one in (*claims(), *cells()))
    assert {one.experiment for one in claims()} == set(paper.findings()) <= set(preset_names())


def test_claims_of_an_experiment_differ() -> None:
    stated = Counter((one.experiment, one.id, one.stated.get("tracker")) for one in claims())
    assert set(stated.values()) == {1}
    assert set(Counter((one.experiment, one.id) for one in cells()).values()) == {1}


def test_the_summary_tables_have_70_cells() -> None:
    counts = Counter(one.experiment for one in cells())
    assert counts == {"dtu": 25, "kitti": 15, "gazebo-linear": 15, "gazebo-arvr": 15}


@pytest.mark.parametrize(
    ("experiment", "name", "said", "rises"),
    [
        ("gazebo-linear", "speed-absolute-lucas-kanade", "yes", True),
        ("gazebo-linear", "speed-absolute-correspondence", "yes", True),
        ("dtu", "speed-absolute-correspondence", "yes", True),
        ("dtu", "speed-absolute-lucas-kanade", "no", None),
        ("dtu", "lighting-second-correspondence", "no", None),
        ("kitti", "tracker-absolute", "yes", None),
    ],
)
def test_a_cell_has_the_direction_that_text_or_captions_give(
    experiment: str, name: str, said: str, rises: bool | None
) -> None:
    stated = named(experiment, name).stated
    assert (stated["said"], stated["rises"]) == (said, rises)


def test_the_paper_contradicts_itself_where_it_is_said_so() -> None:
    contradictions = [one for one in claims() if "contradicts" in one.stated]
    assert contradictions
    for one in contradictions:
        cell = named(one.experiment, "-".join([one.stated[key] for key in ("factor", "role", "tracker")]))
        assert cell.stated["said"] != one.stated["said"]
        assert "contradict" in one.note
