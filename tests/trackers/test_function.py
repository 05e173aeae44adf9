"""Functions of one's own as trackers."""

import cv2
import numpy as np
import pytest

import tracknoise as tn
from tracknoise.exceptions import SettingsError, TrackerError
from tracknoise.trackers.function import Function
from tracknoise.trackers.lucas_kanade import LucasKanade
from tracknoise.trackers.refinement import Refinement
from tracknoise.trackers.rejection import Model, Rejection


def lucas_kanade(previous, image, points):
    options = {"winSize": (15, 15), "maxLevel": 4, "criteria": (3, 30, 0.01)}
    found, ok, _ = cv2.calcOpticalFlowPyrLK(previous, image, points.astype(np.float32), None, **options)
    return found, ok[:, 0] == 1


@pytest.fixture(scope="module")
def sequence():
    return tn.open_sequence("simulated", motions=["forward"], frames=4, width=200, height=150, supersampling=1)


def test_a_function_is_measured_as_a_tracker_of_its_name(sequence):
    measured = tn.measure(sequence, [lucas_kanade, "lucas-kanade"])
    assert set(measured.tracks["tracker"].unique()) == {"lucas_kanade", "lucas-kanade"}
    rms = np.sqrt(
        (measured.observations.filter(measured.observations["tracker"] == "lucas_kanade")["du_px"] ** 2).mean()
    )
    assert 0 < rms < 5


def test_it_does_what_a_tracker_with_the_same_steps_does(sideways, setting):
    detection = tn.Detection(detector="gftt", spacing="circles", distance_px=12)
    same = {"detection": detection, "min_features": 80, "max_features": 90}
    ours = Function(lucas_kanade, **same).start(setting())
    theirs = LucasKanade(rejection=Rejection(model=Model.none), max_displacement_px=10000.0, **same).start(setting())
    for frame in sideways:
        one, other = ours.step(frame), theirs.step(frame)
        assert one.uv.tolist() == other.uv.tolist()
        assert one.ended.tolist() == other.ended.tolist()


def test_what_is_not_finite_or_not_ok_is_lost(sideways, setting):
    def half(previous, image, points):
        moved, ok = points + np.array([3, -2]), np.arange(len(points)) % 2 == 0
        moved[0] = np.nan
        return moved, ok

    tracker = Function(half, min_features=50, max_features=60).start(setting())
    tracker.step(sideways[0])
    second = tracker.step(sideways[1])
    assert (second.offered, second.matched) == (60, 29)


def test_a_function_that_changes_its_images_changes_no_other_measurement():
    images = [np.random.default_rng(0).integers(0, 256, (60, 80), np.uint8)] * 3

    def blurring(previous, image, points):
        cv2.GaussianBlur(image, (0, 0), 3, dst=image)
        previous[:] = 0
        return points, np.ones(len(points), bool)

    camera, depths = [[60.0, 0.0, 39.5], [0.0, 60.0, 29.5], [0.0, 0.0, 1.0]], np.full((3, 60, 80), 2.0)
    made = tn.Sequence.from_arrays(images, np.tile(np.eye(4), (3, 1, 1)), camera, depths)
    settings = {"min_features": 5, "max_features": 20}
    alone = tn.measure(made, {"lk": LucasKanade(**settings)}).observations
    together = tn.measure(made, {"mine": Function(blurring, **settings), "lk": LucasKanade(**settings)}).observations
    assert together.filter(tracker="lk").equals(alone)


def test_no_tracker_can_change_the_image_of_a_frame(sideways):
    with pytest.raises(ValueError, match="read-only"):
        sideways[0].image[0, 0] = 1


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (None, "wrong returned of type NoneType, expected points and ok"),
        (np.zeros((60, 2)), r"wrong returned float64 of shape \(60, 2\), expected points and ok"),
        (
            (np.zeros((59, 2)), np.ones(59, bool)),
            r"points float64 of shape \(59, 2\), expected numbers of shape \(60, 2",
        ),
        ((np.zeros((60, 2)), np.ones((60, 1), bool)), r"ok bool of shape \(60, 1\), expected bool of shape \(60,\)"),
        ((np.zeros((60, 2)), np.ones(60)), r"ok float64 of shape \(60,\), expected bool"),
        (
            (np.zeros((60, 2)), np.ones(60, bool), np.ones((60, 2))),
            r"covariances float64 of shape \(60, 2\), expected numbers of shape \(60, 2, 2\)",
        ),
        (
            (np.zeros((60, 2)), np.ones(60, bool), np.tile([[2.0, 0.5], [0.4, 1.0]], (60, 1, 1))),
            r"covariances that are not symmetric",
        ),
        ((["a"] * 60, np.ones(60, bool)), r"points <U1 of shape \(60,\), expected numbers"),
        (
            ([[1, 2], [3]], np.ones(60, bool)),
            r"^wrong returned no array of points \(.*\), expected numbers of shape \(60, 2\)$",
        ),
        (
            ([None] + [[1, 2]] * 59, np.ones(60, bool)),
            r"no array of points \(.*\), expected numbers of shape \(60, 2\)$",
        ),
        ((np.zeros((60, 2)), [[True], True]), r"no array of ok \(.*\), expected bool of shape \(60,\)$"),
        (
            (np.zeros((60, 2)), np.ones(60, bool), [[[1, 0], [0]]] * 60),
            r"no array of covariances \(.*\), expected numbers of shape \(60, 2, 2\)$",
        ),
        (
            (np.zeros((60, 2)), np.ones(60, bool), np.full((60, 2, 2), 1e39)),
            r"^wrong returned a covariance of 1e\+39 px\^2, expected numbers within the range of float32$",
        ),
        (
            (np.ma.array(np.zeros((60, 2)), mask=np.arange(120).reshape(60, 2) == 3), np.ones(60, bool)),
            r"^wrong returned points with masked elements, expected numbers of shape \(60, 2\) without a mask$",
        ),
        (([np.ma.array([1.0, 2.0], mask=[0, 1])] * 60, np.ones(60, bool)), r"points with masked elements"),
        (([[np.ma.masked, 2.0]] * 60, np.ones(60, bool)), r"no array of points \(.*converting a masked element to nan"),
        ((np.zeros((60, 2)), np.ma.array(np.ones(60, bool), mask=True)), r"ok with masked elements, expected bool"),
    ],
)
def test_what_cannot_be_used_is_said_in_one_line(sideways, setting, returned, message):
    def wrong(previous, image, points):
        return returned

    tracker = Function(wrong, min_features=50, max_features=60).start(setting())
    tracker.step(sideways[0])
    with pytest.raises(TrackerError, match=message):
        tracker.step(sideways[1])


def test_stop_iteration_ends_no_generator(sequence):
    def exhausted(previous, image, points):
        return next(iter(()))

    with pytest.raises(TrackerError, match=r"^exhausted raised StopIteration, expected points and ok$"):
        tn.measure(sequence, exhausted)


@pytest.mark.parametrize("refine", ["none", "first"])
@pytest.mark.parametrize("far", [1.7e308, -1.7e308, 1e39, np.longdouble("1e4000")])
def test_a_position_that_is_too_large_is_dropped_without_a_warning(sideways, setting, far, refine):
    def leaping(previous, image, points):
        moved = points.astype(np.longdouble) + np.array([3, -2])
        moved[0] = far
        return moved, np.ones(len(points), bool)

    tracker = Function(leaping, min_features=50, max_features=60, refine=Refinement(refine)).start(setting())
    tracker.step(sideways[0])
    assert tracker.step(sideways[1]).ended_ids[0] == 0


def test_covariances_that_are_infinite_or_of_what_is_lost_are_no_error(sideways, setting):
    def unsure(previous, image, points):
        covariance = np.full((len(points), 2, 2), np.inf)
        covariance[0] = 1e300
        return points + np.array([3, -2]), np.arange(len(points)) > 0, covariance

    tracker = Function(unsure, min_features=50, max_features=60).start(setting())
    tracker.step(sideways[0])
    step = tracker.step(sideways[1])
    assert np.isinf(step.quality["cov_uv"]).any()


def test_covariances_that_a_function_predicts_are_judged(sequence):
    def certain(previous, image, points):
        return *lucas_kanade(previous, image, points), np.tile([[1e-6, 0.0], [0.0, 4e-6]], (len(points), 1, 1))

    measured = tn.measure(sequence, certain)
    later = measured.observations.filter(measured.observations["age"] > 0)
    assert later["quality_cov_vv"].to_list() == pytest.approx([4e-6] * later.height)
    assert measured.observations.filter(age=0)["quality_cov_uu"].is_null().all()
    tables = tn.summarise_sequence(measured.observations, measured.tracks, measured.frames)
    of_all = tables["covariance_sums"].filter(tables["covariance_sums"]["at"].is_null(), trimming="untrimmed")
    assert of_all["squares"].sum() > 100 * of_all["n"].sum() > 0  # far too certain


@pytest.mark.parametrize("matrix", [-0.1 * np.eye(2), [[0.1, 0.2], [0.2, 0.1]]])
def test_covariances_with_a_negative_eigenvalue_are_refused(sequence, matrix):
    def sure(previous, image, points):
        return points, np.ones(len(points), bool), np.tile(matrix, (len(points), 1, 1))

    with pytest.raises(TrackerError, match=r"reported cov_uu, cov_uv, cov_vv as .*, expected no negative eigenvalue"):
        tn.measure(sequence, Function(sure))


def test_what_is_no_function_is_refused(sequence):
    with pytest.raises(ValueError, match="function is 3, expected a function of two images and points"):
        Function(3)
    with pytest.raises(SettingsError, match="found the class Function, expected an instance"):
        tn.measure(sequence, Function)
    with pytest.raises(SettingsError, match="two trackers of one name"):
        tn.measure(sequence, [lucas_kanade, lucas_kanade])
