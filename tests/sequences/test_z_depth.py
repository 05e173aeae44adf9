"""Which sequences know by construction that their depths are along the optical axis."""

import numpy as np
import pytest
from tests.truth_faults.planted import Planted, along_ray

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.corrections import Corrections
from tracknoise.sequences.arrays import Sequence
from tracknoise.sequences.corrected import corrected
from tracknoise.sequences.faults import DepthFaults, Faults
from tracknoise.sequences.kitti import z_depth_from as kitti_depth_from
from tracknoise.sequences.other_poses import OtherPoses
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.sequence import z_depth_from
from tracknoise.sequences.stereo import with_stereo_depth
from tracknoise.sequences.views import view
from tracknoise.tables.identity import Direction

FAULTS = {"depth": Faults(depth=DepthFaults(scale=1.1)), "focal length": Faults(focal=0.1)}
STEREO = "stereo matching of two cameras"


def simulated(**options):
    return open_sequence("simulated", motions=("sideways",), frames=4, width=64, height=48, baseline_m=0.2, **options)


def test_a_simulated_world_and_stereo_matching_give_depths_along_z() -> None:
    assert z_depth_from(simulated()) == "the surfaces of a simulated world"
    assert z_depth_from(with_stereo_depth(simulated())) == STEREO


@pytest.mark.parametrize("faults", FAULTS)
def test_with_planted_faults_nothing_is_known_unless_depth_is_computed_anew(faults) -> None:
    faulty = simulated(faults=FAULTS[faults])
    assert z_depth_from(faulty) is None
    assert z_depth_from(with_stereo_depth(faulty)) == STEREO


def test_views_know_what_their_sequence_knows() -> None:
    stereo = with_stereo_depth(simulated())
    seen = view(stereo, n_frames=2, direction=Direction.backward, rotation=90, frames=(1, 3, 1))
    assert z_depth_from(seen) == STEREO
    assert z_depth_from(OtherPoses(stereo, stereo.world_from_camera, "other")) == STEREO


def test_a_view_that_changes_depths_knows_nothing() -> None:
    planted = Planted(simulated(), depths=along_ray)
    assert z_depth_from(planted) is None
    assert z_depth_from(view(planted, n_frames=2, direction=Direction.forward, rotation=0)) is None


def test_corrections_keep_the_kind_of_depth_unless_they_change_it() -> None:
    assert z_depth_from(corrected(simulated(), Corrections(depth_scale=1.1))) is not None
    assert z_depth_from(corrected(simulated(), Corrections(depth_along_ray=True))) is None


def test_what_a_format_or_a_user_states_is_not_known_by_construction() -> None:
    made = Sequence.from_arrays(
        [np.zeros((48, 64), np.uint8)] * 2, np.tile(np.eye(4), (2, 1, 1)), Camera(64, 48, 60.0, 60.0, 31.5, 23.5),
        [np.ones((48, 64))] * 2,
    )  # fmt: skip
    assert z_depth_from(made) is None


def test_kitti_knows_it_where_every_depth_is_a_scan_that_it_projects(tmp_path) -> None:
    scan, depth_map = tmp_path / "0000000000.bin", tmp_path / "0000000000.png"
    assert kitti_depth_from((scan, None, scan)) == "projected Velodyne scans"
    assert kitti_depth_from((scan, depth_map)) is None
    assert kitti_depth_from((None, depth_map)) is None
    assert kitti_depth_from((None, None)) is None
