"""What is said about recordings whose points are not where depths and poses predict them."""

from dataclasses import replace

import numpy as np
import pytest
from tests.truth_faults.planted import Planted, scaled_positions

from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.views import chosen_frames
from tracknoise.truth_faults import clock_check
from tracknoise.truth_faults.check_recording import check_sequence
from tracknoise.truth_faults.check_report import Severity
from tracknoise.truth_faults.image_evidence import Evidence
from tracknoise.truth_faults.motion_checks import moving_scene, warping


@pytest.fixture(scope="module")
def tartanair(sample):
    return Evidence.measured(open_sequence("tartanair", sample("tartanair_v2")))


def with_traffic(evidence, share):
    """Some points of each pair move by themselves, in the same direction as the others but three times as far."""

    rng = np.random.default_rng(5)

    def changed(pair):
        moves = rng.random(len(pair.uv_first)) < share
        motion = pair.uv_second - pair.uv_first
        return replace(pair, uv_second=pair.uv_first + np.where(moves[:, None], 3.0, 1.0) * motion)

    flow = replace(evidence.flow, steps=tuple(map(changed, evidence.flow.steps)), wide=())
    return Evidence.of(flow, evidence.poses, evidence.camera)


def test_a_recording_that_is_right_fits(tartanair):
    assert warping(tartanair).severity is Severity.ok


def test_parts_of_the_scene_that_move_are_distinguished_from_wrong_poses(tartanair):
    item = warping(with_traffic(tartanair, 0.65))
    assert item.severity is Severity.caveat
    assert "Parts of the scene probably move" in item.text


def test_the_share_of_points_that_fit_is_measured(tartanair):
    assert moving_scene(with_traffic(tartanair, 0.6), least_others=0.0).share == pytest.approx(0.4, abs=0.1)


@pytest.mark.parametrize(("share", "is_named"), [(0.05, False), (0.4, True)])
def test_parts_that_move_are_named_where_most_points_stand_still(tartanair, share, is_named):
    item = warping(with_traffic(tartanair, share))
    assert ("probably move" in item.text) == is_named
    assert item.severity is (Severity.caveat if is_named else Severity.ok)


def test_wrong_poses_are_no_moving_parts(tartanair):
    wrong = replace(tartanair, poses=scaled_positions(3)(tartanair.poses))
    item = warping(wrong)
    assert item.severity in (Severity.caveat, Severity.fatal)
    assert "probably move" not in item.text


def test_the_traffic_of_kitti_is_named(sample):
    item = warping(Evidence.measured(open_sequence("kitti", sample("kitti"))))
    assert item.severity is Severity.caveat
    assert "such as traffic" in item.text


def test_no_focal_length_is_fitted_to_a_mistake(sample, monkeypatch):
    monkeypatch.setattr(clock_check, "measured_offset", lambda _: None)  # takes half the time of a check
    sequence = chosen_frames(open_sequence("tartanair", sample("tartanair_v2")), (0, 15))
    right, wrong = (check_sequence(one) for one in (sequence, Planted(sequence, poses=np.linalg.inv)))
    assert "focal length" in {item.topic for item in right.items}
    assert "focal length" not in {item.topic for item in wrong.items}
