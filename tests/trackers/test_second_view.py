"""Features of a tracker in the images of a second camera."""

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError, SettingsError, TrackerError
from tracknoise.experiments.measure import measure
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import invert, transform
from tracknoise.geometry.stereo_pair import StereoPair
from tracknoise.sequences.kept_frames import KeptFrames
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.tables.schema import PAIR, of_first_camera, of_second_camera
from tracknoise.trackers.correspondence import describe
from tracknoise.trackers.descriptor_search import DescriptorSearch
from tracknoise.trackers.detection import Detection
from tracknoise.trackers.line_search import LineSearch
from tracknoise.trackers.second_view import PatchSettings, SecondView
from tracknoise.trackers.tracker import Frame
from tracknoise.trackers.tracker_registry import make_tracker
from tracknoise.truth.beside import beside
from tracknoise.truth.truth_registry import make_truth
from tracknoise.truth.visibility import SequenceGeometry

FRAMES = 10
ERROR = pl.col("du_px").abs().median(), pl.col("dv_px").abs().median()


def sequence(baseline_m: float = 0.12):
    options = {"motions": ["sideways"], "frames": FRAMES, "width": 320, "height": 240, "baseline_m": baseline_m}
    return KeptFrames(open_sequence("simulated", seed=2, imaging={"rate_hz": 30.0}, **options))


@pytest.fixture(scope="module")
def measured():
    trackers = {"first": "lucas-kanade", "anew": SecondView(), "last": SecondView(search="last")}
    trackers["patches"] = SecondView(method="patch")
    trackers["patches-last"] = SecondView(search="last", method="patch", patch=PatchSettings(warp="shift"))
    return measure(sequence(), trackers, truth="raycast")


def test_features_are_found_where_their_points_are(measured):
    for name in ("anew", "last", "patches", "patches-last"):
        seen = measured.observations.filter(tracker=name, truth="valid")
        assert seen.height > 1000
        assert max(seen.select(ERROR).row(0)) < 0.2


def test_what_a_tracker_of_the_first_camera_does_is_the_same_beside_one_of_the_second(measured):
    alone = measure(sequence(0.0), {"first": "lucas-kanade"}, truth="raycast")
    beside = of_first_camera(measured.observations).select(alone.observations.columns)
    assert beside.equals(alone.observations)
    assert of_second_camera(measured.observations) == ["anew", "last", "patches", "patches-last"]


def test_observations_have_the_errors_of_the_first_camera_and_both_depths(measured):
    first = measured.observations.filter(tracker="first").select("frame", "u_px", "v_px", "du_px", "dv_px")
    second = measured.observations.filter(tracker="anew").drop_nulls(list(PAIR))
    assert second.filter(age=0).select(pl.col("first_du_px", "first_dv_px").abs().max()).row(0) == (0.0, 0.0)
    errors = {tuple(np.round(row, 9)) for row in first.select("du_px", "dv_px").drop_nulls().rows()}
    assert all(tuple(np.round(row, 9)) in errors for row in second.select("first_du_px", "first_dv_px").rows()[:200])
    ratio = (second["pair_depth_m"] / second["first_depth_m"]).log().abs()
    assert ratio.median() < 0.05
    assert second["across_px"].abs().median() < 0.05


def test_errors_grow_only_where_features_are_followed_from_image_to_image(measured):
    late = measured.observations.filter(truth="valid", age=FRAMES - 1)
    cores = {name: late.filter(tracker=name)["across_px"].abs().median() for name in ("anew", "last")}
    assert cores["last"] > 1.3 * cores["anew"]


def test_a_feature_ends_where_it_is_not_found(measured):
    of_first, of_second = (measured.tracks.filter(tracker=name).height for name in ("first", "anew"))
    assert 0.5 * of_first < of_second < of_first
    share = f"{100.0 * of_second / of_first:.1f}"
    assert any(f"{share} % of {of_first:,} features" in note.replace("\u00a0", " ") for note in measured.notes)
    ends = measured.tracks.filter(tracker="anew")["end"].cast(pl.String)
    assert {"lost", "outlier", "sequence_end"} >= {*ends.drop_nulls()} - {"masked", "displaced"}


def test_matches_far_from_their_epipolar_line_are_outliers(measured):
    strict = measure(sequence(), {"strict": SecondView(epipolar_px=0.05)}, truth="raycast")
    assert strict.frames["outliers"].sum() > measured.frames.filter(tracker="anew")["outliers"].sum()
    assert strict.observations["across_px"].abs().max() <= 0.05 + 1e-9


def test_one_camera_is_refused():
    with pytest.raises(DataError, match="one camera"):
        measure(sequence(0.0), {"second": SecondView()}, truth="raycast")


def test_truth_that_is_fitted_to_tracks_is_refused():
    with pytest.raises(SettingsError, match="second camera"):
        measure(sequence(), {"second": SecondView()}, truth="triangulated")


def test_a_tracker_of_the_second_camera_of_itself_is_refused():
    with pytest.raises(SettingsError, match="one camera"):
        measure(sequence(), {"second": SecondView(of="second-view")}, truth="raycast")


def test_positions_in_the_first_camera_are_one_for_each_feature():
    class Wrong:
        kind, description, of_second_camera = "wrong", "reports too few positions", True

        def start(self, context):
            tracker = SecondView().start(context)

            class Cut:
                def step(self, frame):
                    step = tracker.step(frame)
                    object.__setattr__(step, "first_uv", step.first_uv[1:])
                    return step

            return Cut()

    with pytest.raises(TrackerError, match="first_uv of shape"):
        measure(sequence(), {"wrong": Wrong()}, truth="raycast")


@pytest.mark.parametrize(
    ("name", "most_px"),
    [
        ("vins-fusion-stereo", 0.15),
        ("openvins-stereo", 0.15),
        ("msckf-vio-stereo", 0.15),
        ("kimera-stereo", 0.8),
        ("orb-slam3-stereo", 0.6),
        ("okvis2-stereo", 0.6),
        ("basalt-stereo", 0.15),
    ],
)
def test_presets_find_features_in_the_second_camera(name, most_px):
    found = measure(sequence(), {name: make_tracker(name)}, truth="raycast")
    seen = found.observations.filter(truth="valid")
    assert seen.height > 100
    assert max(seen.select(ERROR).row(0)) < most_px


def test_features_are_found_by_their_descriptors():
    found = measure(sequence(), {"by descriptors": SecondView(search="descriptor")}, truth="raycast")
    seen = found.observations.filter(truth="valid")
    assert seen.height > 1000
    assert max(seen.select(ERROR).row(0)) < 0.2


def test_along_lines_there_are_no_errors_across_but_those_of_the_first_camera():
    found = measure(sequence(), {"line": SecondView(search="line")}, truth="raycast")
    seen = found.observations.filter(truth="valid")
    assert seen.height > 1000
    assert seen["across_px"].abs().max() < 1e-6
    assert max(seen.select(ERROR).row(0)) < 0.2


def test_whole_pixels_are_as_wrong_as_pixels_are_large():
    whole = SecondView(search="line", line=LineSearch(precision="pixel"))
    seen = measure(sequence(), {"whole": whole}, truth="raycast").observations.filter(truth="valid")
    assert (seen["u_px"] - seen["u_px"].round()).abs().max() < 1e-6
    assert 0.2 < seen["du_px"].abs().median() < 0.6


def turned_pair():
    """A second camera that is turned and has another lens, both images of a plane, and where it shows positions."""

    def image(camera, pose):
        grid = np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), axis=-1)
        rays = camera.bearings(grid.reshape(-1, 2)) @ pose[:3, :3].T
        scale = (4.0 - pose[2, 3]) / rays[:, 2]
        x, y = (pose[:2, 3, None] + rays[:, :2].T * scale) * 9.0
        waves = np.sin(x) * np.cos(1.3 * y) + np.sin(0.37 * x * y) + np.cos(2.1 * x + y)
        return np.clip(128.0 + 40.0 * waves, 0, 255).astype(np.uint8).reshape(240, 320)

    first, second = (
        Camera(320, 240, 250.0, 250.0, 159.5, 119.5),
        Camera(320, 240, 260.0, 255.0, 150.0, 122.0, (-0.1, 0.02, 0.0, 0.0)),
    )
    place = np.eye(4)
    place[:3, :3] = Rotation.from_rotvec([0.01, -0.03, 0.04]).as_matrix()
    place[:3, 3] = (0.3, 0.02, 0.01)
    pair = StereoPair(first, second, place)

    def true(uv):
        return second.project(transform(invert(place), first.unproject(uv, np.full(len(uv), 4.0))))

    return pair, (image(first, np.eye(4)), image(second, place)), true


def test_a_turned_camera_with_another_lens_is_searched_on_its_lines():
    pair, images, true = turned_pair()
    uv = np.random.default_rng(3).uniform((120.0, 60.0), (260.0, 180.0), (60, 2))
    found = LineSearch(most_difference=0.2).of(pair).found(images, uv)
    good = np.isfinite(found).all(axis=1)
    assert good.mean() > 0.8
    assert np.median(np.linalg.norm(found - true(uv), axis=1)[good]) < 0.25


@pytest.mark.parametrize(("refined_px", "most_px"), [(5, 0.25), (0, 0.75)])
def test_a_turned_camera_with_another_lens_is_searched_by_descriptors(refined_px, most_px):
    pair, (first, second), true = turned_pair()
    search = DescriptorSearch(Detection(detector="gftt"), refined_px=refined_px, max_distance=9.0)
    uv = describe(Frame(0, first), search.detection, search.descriptor).uv
    uv = uv[((uv > (120.0, 60.0)) & (uv < (260.0, 180.0))).all(axis=1)]
    found = search.of(pair).found((Frame(0, first), Frame(0, second)), uv)
    good = np.isfinite(found).all(axis=1)
    assert good.sum() > 20
    assert np.median(np.linalg.norm(found - true(uv), axis=1)[good]) < most_px


def test_cameras_one_ahead_of_the_other_have_no_lines_to_search():
    ahead = np.eye(4)
    ahead[2, 3] = 0.2
    with pytest.raises(DataError, match="beside"):
        LineSearch().of(
            StereoPair(Camera(32, 24, 30.0, 30.0, 15.5, 11.5), Camera(32, 24, 30.0, 30.0, 15.5, 11.5), ahead)
        )


def test_imported_positions_in_both_cameras_are_joined_by_the_names_of_tracks(tmp_path):
    made = sequence()
    points = np.random.default_rng(5).uniform((90.0, 60.0), (240.0, 180.0), (40, 2))
    truth = make_truth(made, "raycast")
    world, _ = truth.anchor(0, points)
    side = SequenceGeometry(beside(made))
    rows = []
    for frame in range(FRAMES):
        for camera, uv in ((0, truth.project(frame, world)), (1, side.project(frame, world) + np.array([0.25, 0.0]))):
            rows += [
                {"track": 3 * name + 7, "frame": frame, "camera": camera, "u": u, "v": v}
                for name, (u, v) in enumerate(uv.tolist())
                if not (camera == 1 and name % 4 == 0 and frame > 4) and np.isfinite(u)
            ]
    file = tmp_path / "tracks.csv"
    pl.DataFrame(rows).write_csv(file)
    options = {"path": str(file), "camera": 0}
    tracker = SecondView(of="imported", options=options, second={"camera": 1}, search="imported")
    seen = measure(made, {"mine": tracker}, truth="raycast").observations.filter(truth="valid")
    assert seen["du_px"].median() == pytest.approx(0.25, abs=1e-6)
    assert seen["first_du_px"].abs().max() < 1e-6
    assert seen.filter(pl.col("frame") > 4).height < 0.8 * seen.filter(pl.col("frame") <= 4).height
    with pytest.raises(SettingsError, match="imported, as search"):
        SecondView(search="imported")
