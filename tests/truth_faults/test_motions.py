import numpy as np
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from tracknoise.truth_faults.pose_errors import adjoints


def matrix(motion):
    rho, phi = motion[:3], motion[3:]
    found = np.zeros((4, 4))
    found[:3, :3] = [[0.0, -phi[2], phi[1]], [phi[2], 0.0, -phi[0]], [-phi[1], phi[0], 0.0]]
    found[:3, 3] = rho
    return found


def test_a_motion_in_other_axes_is_the_same_motion():
    rng = np.random.default_rng(0)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.random(random_state=1).as_matrix(), rng.normal(size=3)
    motion = rng.normal(size=6)
    moved = adjoints(pose[None])[0] @ motion
    assert np.allclose(expm(matrix(moved)), pose @ expm(matrix(motion)) @ np.linalg.inv(pose))
