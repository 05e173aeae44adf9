import numpy as np
import pytest

from tracknoise.sequences.sequence import Scan, TruthKind
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.scan import ScanAnchoring, ScanRule
from tracknoise.truth.truth_registry import make_truth, make_truths

# The camera of the room has f = 40 px and c = (31.5, 23.5); a point at (x, y, 2) is seen at 31.5 + 20 x, 23.5 + 20 y.
POINTS = np.array([[0.0, 0.0, 2.0], [0.1, 0.0, 2.0], [0.0, 0.1, 2.2], [0.0, 0.0, -1.0]])


@pytest.fixture
def scanned(make_room, at):
    def make(key_frame: int = 1, points: np.ndarray = POINTS):
        return make_room(at(), at(x=0.1), truths=(TruthKind.scan,), scan=Scan(points, key_frame))

    return make


def test_a_feature_takes_the_depth_of_the_nearest_point_along_its_own_ray(scanned) -> None:
    truth = make_truth(scanned())
    points, status = truth.anchor(0, np.array([[31.7, 23.4], [33.5, 23.5]]))
    assert status.tolist() == [TruthStatus.valid] * 2
    np.testing.assert_allclose(points, [[0.01, -0.005, 2.0], [0.1, 0.0, 2.0]], atol=1e-12)
    np.testing.assert_allclose(truth.project(0, points), [[31.7, 23.4], [33.5, 23.5]], atol=1e-12)


def test_a_feature_may_take_the_point_itself(scanned) -> None:
    truth = make_truth(scanned(), scan_rule=ScanRule(anchoring=ScanAnchoring.point))
    points, _ = truth.anchor(0, np.array([[31.7, 23.4]]))
    np.testing.assert_array_equal(points, POINTS[:1])


def test_no_point_within_the_radius_is_no_depth(scanned) -> None:
    uv = np.array([[31.5 + 0.26, 23.5], [31.5 + 0.24, 23.5]])
    points, status = make_truth(scanned()).anchor(0, uv)
    assert status.tolist() == [TruthStatus.no_depth, TruthStatus.valid]
    assert np.isnan(points[0]).all()
    _, status = make_truth(scanned(), scan_rule=ScanRule(radius_px=0.3)).anchor(0, uv)
    assert status.tolist() == [TruthStatus.valid] * 2


def test_association_is_by_the_image_of_the_frame_asked_for(scanned) -> None:
    """In frame 1 the camera stands 0.1 m to the right: the first point is seen 2 px farther left."""
    truth = make_truth(scanned())
    _, status = truth.anchor(1, np.array([[29.5, 23.5], [33.5, 23.5]]))
    assert status.tolist() == [TruthStatus.valid, TruthStatus.no_depth]


def test_the_nearest_point_is_found_among_many(make_room, at) -> None:
    rng = np.random.default_rng(4)
    points = np.column_stack([rng.uniform(-3, 3, (20000, 2)), rng.uniform(1.5, 2.5, 20000)])
    truth = make_truth(make_room(at(), truths=(TruthKind.scan,), scan=Scan(points, 0)))
    uv = rng.uniform(-0.5, [63.5, 47.5], (300, 2))
    image = 40 * points[:, :2] / points[:, 2:] + (31.5, 23.5)
    inside = (np.abs(image - (31.5, 23.5)) < (32, 24)).all(axis=1)
    distance = np.linalg.norm(image[inside][None] - uv[:, None], axis=2)
    found, status = truth.anchor(0, uv)
    near = distance.min(axis=1) <= 0.25
    assert 0.2 < near.mean() < 0.98
    np.testing.assert_array_equal(status == TruthStatus.valid, near)
    np.testing.assert_allclose(found[near, 2], points[inside][distance.argmin(axis=1)[near], 2])


def test_a_scan_out_of_sight_and_no_features_at_all(scanned) -> None:
    truth = make_truth(scanned(points=POINTS[3:]))
    assert truth.anchor(0, np.array([[31.5, 23.5]]))[1].tolist() == [TruthStatus.no_depth]
    assert truth.anchor(0, np.empty((0, 2)))[0].shape == (0, 3)


def test_sequences_of_one_scan_share_their_truth_and_others_do_not(make_room, at, scanned) -> None:
    scan = Scan(POINTS, 0)
    rooms = [make_room(at(), truths=(TruthKind.scan,), scan=scan) for _ in range(2)]
    moved = make_room(at(x=1.0), truths=(TruthKind.scan,), scan=scan)
    one, two, other, another = make_truths([*rooms, moved, scanned()], scan_rule=ScanRule())
    assert one is two
    assert len({id(truth) for truth in (one, other, another)}) == 3
