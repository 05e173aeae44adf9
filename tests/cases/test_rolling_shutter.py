"""Images of a rolling shutter, from the renderer to the audit: what is stated, hidden and corrected."""

from dataclasses import dataclass

import numpy as np
import polars as pl
import pytest
from tests.lean import without_depths

import tracknoise as tn
from tracknoise.sequences.faults import Faults
from tracknoise.sequences.simulated import Simulated
from tracknoise.sequences.views import View
from tracknoise.simulation.imaging import Imaging

READOUT_S = 0.03


@dataclass(frozen=True, slots=True, eq=False)
class Remembered(View):
    """Images are rendered once: they are the same, whatever is stated about the shutter."""

    images: dict[int, np.ndarray]

    def image(self, index):
        if index not in self.images:
            self.images[index] = self.sequence.image(index)
        return self.images[index]


def opened(*, hidden: bool):
    imaging = Imaging(readout_s=READOUT_S, rate_hz=30.0)
    size = {"frames": 16, "width": 240, "height": 136, "supersampling": 1}
    reader = Simulated(motions=("arvr",), imaging=imaging, faults=Faults(hide_shutter=hidden), **size)
    return reader.open(reader.sequences()[0])


@pytest.fixture(scope="module")
def measured():
    images = {}

    def go(*, hidden: bool, **changes: object):
        return tn.measure(Remembered(opened(hidden=hidden), images), tn.LucasKanade(), truth="birth", **changes)

    return go


def typical_px(measurement) -> float:
    errors = measurement.observations.filter(pl.col("truth") == "valid", age=6)
    return errors.select(pl.col("du_px", "dv_px").abs().median()).sum_horizontal().item()


@pytest.fixture(scope="module")
def stated(measured):
    return measured(hidden=False)


@pytest.fixture(scope="module")
def hidden(measured):
    return measured(hidden=True)


def test_a_global_shutter_for_rolling_images_shows_in_the_errors_until_it_is_corrected(measured, stated, hidden):
    corrected = measured(hidden=True, corrections=tn.Corrections(readout_s=READOUT_S))
    assert typical_px(hidden) > 1.3 * typical_px(stated)
    assert typical_px(corrected) == pytest.approx(typical_px(stated), abs=1e-9)


def test_what_is_stated_changes_no_image():
    images = [opened(hidden=hidden).image(5) for hidden in (False, True)]
    assert np.array_equal(*images)


def test_the_audit_finds_the_readout_that_was_hidden_and_nothing_where_it_is_stated(stated, hidden):
    with without_depths():
        right, wrong = (tn.analyse([one]) for one in (stated, hidden))
    assert right.audit()[0] == "No constant fault of the stated truth was found."
    audit = wrong.table("audit").filter(family="named", parameter="readout")
    (row,) = audit.to_dicts()
    assert row["low"] < 1e3 * READOUT_S < row["high"]
