"""Sentences of a check and of others about one thing, and about numbers of 100 and more."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.estimators.models import made as made_model

from tracknoise.estimators.model import Purpose
from tracknoise.geometry.cameras import Camera
from tracknoise.report.noise_cells import model_sentences
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.tables.enumerations import Trust
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.trust import TruthVerdict
from tracknoise.truth_faults.audit_summary import fault_brief
from tracknoise.truth_faults.recording_checks import counts, pose_jumps, timestamps
from tracknoise.words import SPACE


def sequence(n, **changes):
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, 0, 3] = 0.1 * np.arange(n)
    settings = {"world_from_camera": poses, **changes}
    camera = Camera(64, 48, 50.0, 50.0, 31.5, 23.5)
    return RecordedSequence(id=SequenceId("test", "a"), source="a", camera=camera, images=str, **settings)


def test_one_jump_is_in_one_place():
    made = sequence(40)
    made.world_from_camera[20:, 0, 3] += 5000.0
    text = pose_jumps(made).text
    assert "Poses jump in 1 place. The largest jump follows frame 19: 5000 m" in text


@pytest.mark.parametrize("wrong", [slice(20, 21), slice(20, 22)])
def test_wrong_poses_among_right_ones_are_one_jump(wrong):
    made = sequence(40)
    made.world_from_camera[wrong, 1, 3] += 3.0
    text = pose_jumps(made).text
    assert "Poses jump in 1 place. The largest jump follows frame 19: 3 m and 0 deg, and back." in text
    turned = sequence(40)
    turned.world_from_camera[wrong, :3, :3] = Rotation.from_euler("z", 20.0, degrees=True).as_matrix()
    assert "follows frame 19: 0.1 m and 20 deg, and back." in pose_jumps(turned).text


def test_a_hand_that_shakes_does_not_jump():
    made = sequence(40)
    made.world_from_camera[:, 1, 3] = 0.3 * np.sin(1.3 * np.arange(40.0))
    assert "no step is far larger" in pose_jumps(made).text


def test_one_interval_and_one_pose():
    assert "0 of 1 interval exceed" in timestamps(sequence(2, timestamps_s=np.array([0.0, 0.05]))).text
    poses = np.full((3, 4, 4), np.nan)
    poses[:2] = np.eye(4)
    assert "3 images of 64x48 px; 2 of them have a pose." in counts(sequence(3, world_from_camera=poses)).text


def test_a_slow_recording_whose_unit_is_stated_is_no_fault():
    item = timestamps(sequence(5, timestamps_s=np.arange(5) * 250.0, time_unit_stated=True))
    assert item.text.startswith("Images come at 0.004 Hz. 0 of 4 intervals exceed")
    assert item.severity == "ok"


def test_all_are_100_percent():
    said = " ".join(model_sentences(made_model(0.1, 0.2, outlier_share=1.0), "filter"))
    assert "100 % of the observations are outliers" in said


@pytest.mark.parametrize(
    ("verdict", "most"),
    [(Trust.trusted, ""), (Trust.limited, ""), (Trust.not_trusted, "at most "), (Trust.unknown, "at most ")],
)
def test_sigma_is_an_upper_bound_where_the_truth_is_not_usable(verdict, most):
    equivalents = made_model().equivalents
    innovations = replace(equivalents[0], purpose=Purpose.INNOVATIONS)
    model = made_model(0.1, 0.2, equivalents=(*equivalents, innovations), truth=TruthVerdict(verdict))
    assert f"set sigma {most}0.3 px (0.2 to 0.4)" in " ".join(model_sentences(model, "filter"))


def test_a_fault_whose_name_says_no_direction_is_said_with_its_size() -> None:
    row = {"parameter": "readout", "component": "", "stated": 0.0, "value": 26.98, "low": 21.3, "high": 32.6}
    said = fault_brief({**row, "unit": "ms"}).replace(SPACE, " ")
    assert said == "The readout time of the shutter is wrong (27 ± 6 ms instead of 0)"
