import numpy as np
import pytest

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.sequences.reader_registry import make_reader
from tracknoise.sequences.sequence import TruthKind
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.truth_registry import make_truth


def test_the_best_kind_is_taken_by_default(make_room, at):
    assert make_truth(make_room(at())).kind is TruthKind.raycast
    assert make_truth(make_room(at(), truths=(TruthKind.birth,))).kind is TruthKind.birth


def test_a_kind_that_is_not_offered(make_room, at):
    with pytest.raises(SettingsError) as caught:
        make_truth(make_room(at(), truths=(TruthKind.birth,)), TruthKind.raycast)
    assert str(caught.value) == "made room: found truth = 'raycast', expected one of: birth"


@pytest.mark.parametrize("kind", [None, TruthKind.birth])
def test_a_sequence_without_truth(make_room, at, kind):
    with pytest.raises(DataError, match="made room: no depth, scan or exact surface, expected one of them"):
        make_truth(make_room(at(), truths=()), kind)


def test_positions_by_hand_as_the_camera_moves(make_room, at):
    """The board's point (0, 0, 2 m) moves by 40 px * 0.1 m / 2 m to the left as the camera goes 0.1 m to the right."""
    truth = make_truth(make_room(at(), at(x=0.1), at(z=1.0), at(turned=True)))
    points, _ = truth.anchor(0, np.array([[31.5, 23.5], [35.5, 19.5]]))
    np.testing.assert_allclose(truth.project(1, points), [(29.5, 23.5), (33.5, 19.5)], atol=1e-12)
    np.testing.assert_allclose(truth.project(2, points), [(31.5, 23.5), (39.5, 15.5)], atol=1e-12)
    assert np.isnan(truth.project(3, points)).all()
    assert truth.project(1, np.empty((0, 3))).shape == (0, 2)


def test_the_depth_of_a_frame_is_read_once(make_room, at):
    room = make_room(at(), at(x=0.1), at(x=0.2))
    truth = make_truth(room, TruthKind.birth)
    uv = np.array([[31.5, 23.5]])
    for index in range(3):
        points, _ = truth.anchor(index, uv)
        truth.locate(index, points)[1]
        truth.anchor(index, uv)
        truth.project(0, points)
    assert room.reads == [0, 1, 2]


def test_features_are_treated_each_for_itself(make_room, at, pixel_grid):
    room = make_room(at(x=-0.2), at(x=0.4))
    uv = pixel_grid(room.camera, 4.3)
    for kind in (TruthKind.birth, TruthKind.raycast):
        truth = make_truth(room, kind)
        points, status = truth.anchor(0, uv)
        one_by_one = [truth.anchor(0, position[None]) for position in uv]
        np.testing.assert_allclose(points, np.concatenate([point for point, _ in one_by_one]), rtol=1e-14)
        np.testing.assert_array_equal(status, np.concatenate([state for _, state in one_by_one]))


def test_dense_depth_and_ray_casts_agree_on_simulated_worlds(pixel_grid):
    """Ten frames after birth the two differ by far less than trackers err; at birth neither has any error."""
    reader = make_reader("simulated", options={"width": 128, "height": 96, "frames": 11})
    for listed in reader.sequences():
        sequence = reader.open(listed)
        birth, raycast = make_truth(sequence, TruthKind.birth), make_truth(sequence, TruthKind.raycast)
        uv = pixel_grid(sequence.camera, 2.3)
        (dense, dense_status), (exact, exact_status) = birth.anchor(0, uv), raycast.anchor(0, uv)
        valid = (dense_status == TruthStatus.valid) & (exact_status == TruthStatus.valid)
        assert valid.mean() > 0.4
        for truth, points in ((birth, dense), (raycast, exact)):
            assert np.abs(truth.project(0, points) - uv)[valid].max() < 1e-9
        seen = birth.locate(10, dense[valid])[1] == TruthStatus.valid
        apart = np.linalg.norm(birth.project(10, dense[valid]) - raycast.project(10, exact[valid]), axis=1)
        moved = np.linalg.norm(birth.project(10, dense[valid]) - uv[valid], axis=1)
        assert seen.mean() > 0.5
        assert moved[seen].max() > 2.0
        assert np.median(apart[seen]) <= 0.02
        assert np.percentile(apart[seen], 95) <= 0.05
