"""What objects show of themselves: one line, and a small card in a notebook."""

import numpy as np
import pytest

import tracknoise as tn
from tracknoise.text import MOST_SHOWN, html_table


@pytest.fixture(scope="module")
def sequence():
    return next(
        iter(tn.open_sequences("simulated", motions=["forward"], frames=4, width=160, height=120, supersampling=1))
    )


def test_a_sequence_is_one_line_and_a_card(sequence):
    K = [[100.0, 0.0, 79.5], [0.0, 100.0, 59.5], [0.0, 0.0, 1.0]]
    images = [sequence.image(index) for index in range(4)]
    own = tn.Sequence.from_arrays(images, np.asarray(sequence.world_from_camera), K, scene="<b>mine")
    for shown, kind in ((sequence, "raycast"), (own, "triangulated")):
        assert len(repr(shown).splitlines()) == 1
        assert "frames: 4; size: 160 x 120 px" in repr(shown)
        assert kind in shown._repr_html_()
    assert "<b>mine" not in own._repr_html_()


def test_a_measurement_is_one_line_and_a_row_for_each_tracker(sequence):
    measured = tn.measure(
        sequence, {f"t{place}": tn.LucasKanade(min_features=4, max_features=9) for place in range(11)}
    )
    assert len(repr(measured).splitlines()) == 1
    assert "t0, t1" in repr(measured)
    card = measured._repr_html_()
    assert f"{MOST_SHOWN} of 11 rows" in card
    assert "<td>t9</td>" in card
    assert "<td>t10</td>" not in card
    assert "image" not in card


def test_results_show_at_most_ten_rows_and_how_many_there_are(run):
    results = run.results()
    shown = results._repr_html_()
    assert len(shown.split("<tr>")) - 1 <= MOST_SHOWN + 3
    assert f"shape: ({results.height:_}, " in shown


def test_short_tables_do_not_count_their_rows():
    assert "rows" not in html_table(["a"], [["1"], ["2"]])
