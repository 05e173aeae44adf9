"""Corrections of an experiment file reach the measurement, and the run says so."""

import numpy as np
import pytest

import tracknoise as tn
from tracknoise.exceptions import SettingsError
from tracknoise.experiments.execute import execute
from tracknoise.experiments.settings import CorrectionSettings, parse_experiment
from tracknoise.geometry.corrections import Corrections
from tracknoise.tables.store import RunFolder

TEXT = """
name = "corrected"
[dataset]
reader = "simulated"
[dataset.options]
motions = ["sideways"]
frames = 6
width = 120
height = 90
[[trackers]]
kind = "lucas-kanade"
[statistics]
min_features = 2
"""
CORRECTED = (
    TEXT
    + """
[truth.corrections]
focal_scale = 0.9
mounting_rotation_deg = [0, 0.5, 0]
clock_offset_frames = 0.5
"""
)


class Silent:
    """Listens to a run and says nothing."""

    def __getattr__(self, name):
        return lambda *arguments: None


def test_a_run_applies_and_records_corrections(tmp_path):
    execute(parse_experiment(CORRECTED, place=""), RunFolder(tmp_path / "run"), listener=Silent())
    run = tn.open_run(tmp_path / "run")
    assert "[truth.corrections]\nfocal_scale = 0.9\n" in (tmp_path / "run" / "experiment.toml").read_text()
    notes = run.sequences()["notes"].to_list()[0]
    for sentence in (
        "correction: focal lengths are multiplied by 0.9",
        "correction: the pose of a frame is the one recorded 0.5 frames after it",
        "correction: the camera is rotated by (0, 0.5, 0) deg (rotation vector) in the frame of the poses",
    ):
        assert sentence in notes
    corrections = Corrections(focal_scale=0.9, mounting_rotation_deg=(0.0, 0.5, 0.0), clock_offset_frames=0.5)
    sequence = tn.open_sequence("simulated", motions=["sideways"], frames=6, width=120, height=90)
    measured = tn.measure(sequence, tn.LucasKanade(), corrections=corrections).observations
    as_stated = tn.measure(sequence, tn.LucasKanade()).observations
    errors, same, other = (table.select("du_px", "dv_px") for table in (run.observations(), measured, as_stated))
    np.testing.assert_array_equal(errors.to_numpy(), same.to_numpy())
    assert not errors.equals(other)


def test_settings_and_corrections_have_the_same_values():
    assert CorrectionSettings().as_corrections() == Corrections()
    assert set(CorrectionSettings.model_fields) == set(Corrections.__dataclass_fields__)


def test_corrections_change_the_digest():
    one, other = parse_experiment(TEXT, place=""), parse_experiment(CORRECTED, place="")
    assert one.digest() != other.digest()
    assert parse_experiment(other.to_toml(), place="") == other


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("focal_scale = 0", "truth.corrections: focal_scale is 0.0, expected a number above 0"),
        ("readout_s = 26", "truth.corrections: readout_s is 26.0, expected seconds between -1 and 1"),
        ("principal_point_px = [1]", "truth.corrections.principal_point_px: found [1], expected"),
        ("focal = 1.1", "unknown key 'focal'"),
        ('k1 = "big"', "truth.corrections.k1: found 'big', expected a valid number"),
    ],
)
def test_wrong_corrections_are_named(line, message):
    with pytest.raises(SettingsError) as caught:
        parse_experiment(f"{TEXT}[truth.corrections]\n{line}\n", place="x.toml")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
