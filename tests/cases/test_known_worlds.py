"""A gallery of worlds small enough to work out by hand, each through the whole measurement."""

from dataclasses import dataclass, field

import numpy as np
import polars as pl
import pytest

import tracknoise
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.sequence import TruthKind
from tracknoise.tables.identity import SequenceId

CAMERA = Camera(100, 80, 200.0, 200.0, 49.5, 39.5)
PLANE_M = 2.0


@dataclass
class Plane:
    """A camera looking along z at a wall 2 m away; what stands before the wall is drawn into the depth maps."""

    world_from_camera: np.ndarray
    foreground: dict = field(default_factory=dict)  # frame: (rows, columns, depth; 0 for none)
    id = SequenceId("case", "plane")
    source = "the plane"
    camera = CAMERA
    truths = (TruthKind.birth,)
    notes = ()
    surface = None

    def __len__(self):
        return len(self.world_from_camera)

    def image(self, index):
        return np.zeros((CAMERA.height, CAMERA.width), np.uint8)

    def depth(self, index):
        depth = np.full((CAMERA.height, CAMERA.width), PLANE_M - self.world_from_camera[index, 2, 3])
        for rows, columns, value in self.foreground.get(index, []):
            depth[rows, columns] = value
        return DepthMap(depth, depth > 0)


def poses(n, *, step_m=(0.0, 0.0, 0.0)):
    result = np.tile(np.eye(4), (n, 1, 1))
    result[:, :3, 3] = np.arange(n)[:, None] * np.array(step_m)
    return result


@pytest.fixture
def errors(tmp_path):
    """Measure tracks given as {track: [(frame, u, v), ...]}; returns rows of (track, frame, truth, du, dv)."""

    def go(sequence, tracks, **options):
        rows = [(track, frame, u, v) for track, path in tracks.items() for frame, u, v in path]
        table = pl.DataFrame(rows, schema=["track", "frame", "u_px", "v_px"], orient="row")
        table.write_csv(tmp_path / "tracks.csv")
        imported = tracknoise.Imported(path=str(tmp_path / "tracks.csv"))
        return tracknoise.measure(sequence, imported, trim_percentile=100, **options)

    return go


def values(measured, column):
    return measured.observations.sort("track", "frame")[column].to_list()


def test_static_camera_the_error_is_how_far_the_track_wandered(errors):
    measured = errors(Plane(poses(3)), {7: [(0, 40.25, 30.5), (1, 40.5, 30.5), (2, 40.25, 29.0)]})
    assert values(measured, "du_px") == pytest.approx([0, 0.25, 0], abs=1e-12)
    assert values(measured, "dv_px") == pytest.approx([0, 0, -1.5], abs=1e-12)
    assert values(measured, "truth") == ["valid"] * 3


def test_sideways_camera_the_wall_moves_one_pixel_a_frame(errors):
    # f * step / depth = 200 px * 0.01 m / 2 m = 1 px a frame, to the left when the camera moves right
    path = [(k, 60.5 - 1.25 * k, 30.25) for k in range(5)]
    measured = errors(Plane(poses(5, step_m=(0.01, 0, 0))), {0: path})
    assert values(measured, "u_true_px") == pytest.approx([60.5 - k for k in range(5)], abs=1e-12)
    assert values(measured, "du_px") == pytest.approx([-0.25 * k for k in range(5)], abs=1e-12)
    assert values(measured, "dv_px") == pytest.approx([0] * 5, abs=1e-12)


def test_forward_camera_the_wall_grows_about_the_principal_point(errors):
    # from 2 m to 1 m the distance from the principal point doubles: 10 px become 20 px
    measured = errors(Plane(poses(2, step_m=(0, 0, 1.0))), {0: [(0, 59.5, 34.5), (1, 69.5, 29.5)]})
    assert values(measured, "u_true_px") == pytest.approx([59.5, 69.5], abs=1e-12)
    assert values(measured, "v_true_px") == pytest.approx([34.5, 29.5], abs=1e-12)
    assert values(measured, "du_px") == pytest.approx([0, 0], abs=1e-12)


def test_rotating_camera_moves_the_image_whatever_the_depth(errors):
    # turning right by atan(0.1) about y moves the principal ray's point 0.1 f = 20 px to the left
    turned = poses(2)
    c, s = 1 / np.sqrt(1.01), 0.1 / np.sqrt(1.01)
    turned[1, :3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    measured = errors(Plane(turned), {0: [(0, 49.5, 39.5), (1, 29.5, 39.5)]})
    assert values(measured, "u_true_px") == pytest.approx([49.5, 29.5], abs=1e-12)
    assert values(measured, "du_px") == pytest.approx([0, 0], abs=1e-12)


def test_age_counts_nominal_frames_and_lifetime_the_trackers_own(errors):
    path = [(k, 60.0 - k, 30.0) for k in range(7)]
    measured = errors(Plane(poses(7, step_m=(0.01, 0, 0))), {0: path}, speeds=[3])
    assert values(measured, "frame") == [0, 3, 6]
    assert values(measured, "age") == [0, 3, 6]
    assert measured.tracks["lifetime"].to_list() == [3]
    assert measured.tracks["end"].to_list() == ["sequence_end"]
    assert values(measured, "du_px") == pytest.approx([0, 0, 0], abs=1e-12)


def test_a_feature_without_depth_at_birth_has_no_error(errors):
    hole = {0: [(slice(20, 30), slice(20, 30), 0.0)]}
    measured = errors(Plane(poses(2), hole), {0: [(0, 25, 25), (1, 26, 25)], 1: [(0, 60, 60)]})
    assert values(measured, "truth") == ["no_depth", "no_depth", "valid"]
    assert values(measured, "du_px")[:2] == [None, None]
    assert measured.tracks["depth_m"].to_list() == [None, PLANE_M]
    assert measured.tracks["max_error_px"][0] is None


def test_a_feature_born_on_a_depth_edge_has_no_error(errors):
    box = {0: [(slice(0, 80), slice(50, 100), 1.0)]}
    measured = errors(Plane(poses(2), box), {0: [(0, 49.5, 30), (1, 49.5, 30)], 1: [(0, 30, 60)]})
    assert values(measured, "truth") == ["edge", "edge", "valid"]
    assert values(measured, "u_true_px")[:2] == [None, None]


def test_a_hidden_feature_is_occluded_but_its_true_position_is_known(errors):
    box = {1: [(slice(20, 40), slice(20, 40), 1.0)]}
    measured = errors(Plane(poses(3), box), {0: [(k, 30.0 + 0.5 * k, 30.0) for k in range(3)]})
    assert values(measured, "truth") == ["valid", "occluded", "valid"]
    assert values(measured, "du_px") == pytest.approx([0, 0.5, 1.0], abs=1e-12)


def test_a_box_within_the_tolerance_of_the_wall_hides_nothing(errors):
    box = {1: [(slice(20, 40), slice(20, 40), PLANE_M * 0.985)]}
    measured = errors(Plane(poses(2), box), {0: [(0, 30.0, 30.0), (1, 30.0, 30.0)]})
    assert values(measured, "truth") == ["valid", "valid"]


def test_a_truth_outside_the_image_is_said_to_be(errors):
    # 5 px a frame to the left: true u is 8, 3, -2; the tracker stays behind at 8
    measured = errors(Plane(poses(3, step_m=(0.05, 0, 0))), {0: [(k, 8.0, 30.0) for k in range(3)]})
    assert values(measured, "truth") == ["valid", "valid", "out_of_image"]
    assert values(measured, "du_px") == pytest.approx([0, 5, 10], abs=1e-12)


def test_a_point_behind_the_camera_has_no_true_position(errors):
    measured = errors(Plane(poses(2, step_m=(0, 0, 3.0))), {0: [(0, 60.0, 30.0), (1, 60.0, 30.0)]})
    assert values(measured, "truth") == ["valid", "behind_camera"]
    assert values(measured, "du_px")[1] is None


def test_a_point_beyond_what_the_lens_can_show_has_no_true_position(errors):
    wide = Plane(poses(3, step_m=(2.1, 0, 0)))
    wide.camera = Camera(100, 80, 60.0, 60.0, 49.5, 39.5, (-0.2, 0.0, 0.0, 0.0))  # no image beyond 52 degrees
    measured = errors(wide, {0: [(k, 40.0, 39.5) for k in range(3)]})
    assert values(measured, "truth") == ["valid", "out_of_image", "behind_camera"]
    assert [value is None for value in values(measured, "du_px")] == [False, False, True]


def test_every_statistic_of_two_tracks_by_hand(errors):
    # errors at age 1: (1, 0) and (3, 2); at age 2 one track is left, with (2, -2)
    tracks = {0: [(0, 40, 30), (1, 41, 30), (2, 42, 28)], 1: [(0, 60, 30), (1, 63, 32)]}
    measured = errors(Plane(poses(3)), tracks)
    table = tracknoise.curves(measured.moments, min_features=2).filter(
        pl.col("population") == "visible", pl.col("trimming") == "untrimmed", pl.col("weighting") == "features"
    )

    def at(statistic, age):
        return table.filter(pl.col("statistic") == statistic, pl.col("at") == age).select("u", "v", "uv").row(0)

    assert at("nu", 1)[:2] == pytest.approx((2.0, 1.0))
    assert at("eta", 2)[:2] == pytest.approx((2.0, 2.0))
    assert at("Phi", 1) == pytest.approx((5.0, 2.0, 3.0))  # (1 + 9) / 2, (0 + 4) / 2, (0 + 6) / 2
    assert at("central", 1) == pytest.approx((2.0, 2.0, 2.0))
    assert at("central", 2) == (None, None, None)
    assert table.filter(pl.col("at") == 2)["cut"].all()
    assert measured.tracks["max_error_px"].to_list() == pytest.approx([np.sqrt(8), np.sqrt(13)])
