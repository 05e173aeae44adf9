"""Two kinds of truth that other packages add: one that needs all observations of a track, one with a covariance.

Neither touches a file of the package: each is a class, and an entry point that names it.
"""

from dataclasses import dataclass, replace
from importlib.metadata import EntryPoint
from typing import ClassVar

import numpy as np
import polars as pl
import pytest

import tracknoise
from tracknoise.exceptions import DataError, SettingsError, UnknownNameError
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.birth import BirthDepth
from tracknoise.truth.truth import TruePositions
from tracknoise.truth.truth_registry import make_truth

POINTS_NEED = 3
NEAR_M = 10.0


@dataclass(frozen=True)
class Triangulated:
    """The point nearest to all rays of a track, from the poses and the observations alone."""

    kind: ClassVar[str] = "triangulated-toy"
    key_frame: ClassVar[None] = None
    sequence: object = None

    def open(self, sequence):
        return Triangulated(sequence)

    def start(self):
        return TriangulatedSession(self.sequence)


class TriangulatedSession:
    def __init__(self, sequence):
        self.sequence, self.seen = sequence, []

    def observe(self, index, tracks, uv, born):
        self.seen.append((np.full(len(tracks), index), tracks, uv, born))

    def resolve(self):
        frame, track, uv, born = (np.concatenate(parts) for parts in zip(*self.seen, strict=True))
        poses, camera = self.sequence.world_from_camera[frame], self.sequence.camera
        rays = np.einsum("nij,nj->ni", poses[:, :3, :3], camera.bearings(uv))
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        across = np.eye(3) - rays[:, :, None] * rays[:, None, :]  # what of a vector is not along the ray
        normal, right = np.zeros((track.max() + 1, 3, 3)), np.zeros((track.max() + 1, 3))
        np.add.at(normal, track, across)
        np.add.at(right, track, np.einsum("nij,nj->ni", across, poses[:, :3, 3]))
        enough = np.bincount(track) >= POINTS_NEED
        points = np.full(right.shape, np.nan)
        points[enough] = np.linalg.solve(normal[enough], right[enough][:, :, None])[:, :, 0]
        here = transform(invert(poses), points[track])
        seen = np.where(here[:, 2] > 0, TruthStatus.valid, TruthStatus.behind_camera)
        status = np.where(enough[track], seen, TruthStatus.no_depth).astype(np.int8)
        return TruePositions(camera.project(here), status, here[born, 2])


@dataclass(frozen=True)
class Uncertain:
    """Depth at birth, with a covariance that grows by 1 px^2 in v with every observation."""

    kind: ClassVar[str] = "uncertain-toy"
    key_frame: ClassVar[None] = None
    birth: object = None

    def open(self, sequence):
        return Uncertain(BirthDepth().open(sequence))

    def start(self):
        session = self.birth.start()
        return UncertainSession(session)


class UncertainSession:
    def __init__(self, session):
        self.observe, self.session = session.observe, session

    def resolve(self):
        found = self.session.resolve()
        covariance = np.tile([[0.25, -0.125], [-0.125, 0.0]], (len(found.uv), 1, 1))
        covariance[:, 1, 1] = np.arange(len(found.uv))
        covariance[np.isnan(found.uv[:, 0])] = np.nan
        return replace(found, covariance=covariance)


@pytest.fixture
def installed(monkeypatch):
    """Both kinds, as if another package were installed that has entry points for them."""
    kinds = (Triangulated, Uncertain)
    points = [EntryPoint(kind.kind, f"{__name__}:{kind.__name__}", "tracknoise.truths") for kind in kinds]
    monkeypatch.setattr("tracknoise.plugins.entry_points", lambda group: points if group == "tracknoise.truths" else [])


@pytest.fixture
def sequence():
    options = {"motions": ["sideways"], "frames": 10, "width": 160, "height": 120}
    return open_sequence("simulated", **options)


def test_triangulated_truth_agrees_with_the_exact_one_where_tracks_are_good(installed, sequence):
    trackers = tracknoise.LucasKanade(min_features=100, max_features=150)
    found = tracknoise.measure(sequence, trackers, truth="triangulated-toy")
    exact = tracknoise.measure(sequence, trackers, truth="raycast")
    assert (found.truth, found.key_frame) == ("triangulated-toy", None)
    both = found.observations.join(exact.observations, on=["track", "frame"], suffix="_exact", maintain_order="left")
    long = both.filter(pl.col("truth_exact") == "valid", pl.len().over("track") == len(sequence))
    assert long["track"].n_unique() > 20
    apart = np.hypot(*(long[f"{axis}_true_px"] - long[f"{axis}_true_px_exact"] for axis in "uv"))
    assert np.median(apart) < 0.1
    near = found.tracks.join(exact.tracks, on="track").filter(
        pl.col("track").is_in(long["track"].implode()), pl.col("depth_m_right") < NEAR_M
    )
    assert len(near) > 10
    assert (near["depth_m"] / near["depth_m_right"] - 1).abs().median() < 0.05
    short = found.observations.filter(pl.len().over("track") < POINTS_NEED)
    assert short["truth"].unique().to_list() == ["no_depth"]
    assert short["du_px"].null_count() == len(short) > 0


def test_triangulation_of_exact_observations_gives_the_exact_points(make_room, at, pixel_grid):
    room = make_room(*(at(x=0.1 * k) for k in range(4)))
    exact = make_truth(room, "raycast")
    uv = pixel_grid(room.camera, 7.0)
    points, status = exact.anchor(0, uv)
    points = points[status == TruthStatus.valid]
    session = Triangulated(room).start()
    for index in range(4):
        tracks = np.arange(len(points), dtype=np.uint32)
        session.observe(index, tracks, exact.project(index, points), np.full(len(points), index == 0))
    found = session.resolve()
    np.testing.assert_allclose(found.depth_m, points[:, 2], rtol=1e-9)
    np.testing.assert_allclose(found.uv[-len(points) :], exact.project(3, points), atol=1e-9)


def test_a_covariance_is_kept_where_the_truth_states_one(installed, sequence):
    trackers = tracknoise.Oracle(n_features=30, loss_rate=0.1)
    plain = tracknoise.measure(sequence, tracknoise.LucasKanade(min_features=50, max_features=80), truth="birth")
    assert not [name for name in plain.observations.columns if name.startswith("cov_")]
    with pytest.raises(SettingsError, match="tracker 'oracle': a kind of truth that cannot place points, expected one"):
        tracknoise.measure(sequence, trackers, truth="uncertain-toy")
    settings = tracknoise.LucasKanade(min_features=50, max_features=80)
    found = tracknoise.measure(sequence, settings, truth="uncertain-toy").observations
    assert found.select(plain.observations.columns).equals(plain.observations)
    known = found.with_row_index().filter(pl.col("u_true_px").is_not_null())
    assert known["cov_true_uu"].unique().to_list() == [0.25]
    assert known["cov_true_uv"].unique().to_list() == [-0.125]
    assert known["cov_true_vv"].to_list() == known["index"].cast(pl.Float64).to_list()
    unknown = found.filter(pl.col("u_true_px").is_null())
    assert unknown["cov_true_vv"].null_count() == len(unknown) > 0


def test_a_kind_that_no_package_adds_is_unknown_and_lists_the_others(installed, sequence):
    with pytest.raises(UnknownNameError, match="unknown kind of truth 'stereo'") as caught:
        make_truth(sequence, "stereo")
    assert str(caught.value).endswith(
        "known: birth, raycast, scan, swept, triangulated, triangulated-toy, uncertain-toy"
    )


def test_a_declared_kind_without_its_data_is_an_error_and_never_another_kind(make_room, at):
    class Bare(type(make_room(at()))):
        surface = None

    room = Bare(np.stack([at()]), truths=("raycast", "scan", "birth"))
    with pytest.raises(DataError, match=r"^made room: no exact surface, expected one, as the sequence offers"):
        make_truth(room)
    with pytest.raises(DataError, match=r"^made room: no scan, expected one, as the sequence offers the truth 'scan'$"):
        make_truth(room, "scan")
    assert make_truth(room, "birth").kind == "birth"
