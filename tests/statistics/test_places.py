"""Sums of errors by place, on tracks whose place and errors are set."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from tracknoise.statistics.definitions import MAP_COLUMNS, MAP_ROWS, PLACE_AGES
from tracknoise.statistics.places import image_map, image_speeds, surroundings
from tracknoise.statistics.prepared import prepare_sequence
from tracknoise.tables.schema import IMAGE_MAP, ORIGIN

N_TRACKS, AGES = 32, 21


@pytest.fixture
def made(observations, tracks):
    """Tables of tracks that live for 21 frames; arrays (tracks, ages) or single values replace what they have."""

    def make(*, speed: int = 1, lived: dict[str, object] | None = None, **columns: object):
        shape = (N_TRACKS, AGES)
        age = np.broadcast_to(np.arange(AGES) * speed, shape)
        values = {name: np.broadcast_to(value, shape).ravel().tolist() for name, value in columns.items()}
        seen = observations(
            track=np.repeat(np.arange(N_TRACKS), AGES).tolist(), age=age.ravel().tolist(),
            frame=age.ravel().tolist(), speed=speed, **values,
        )  # fmt: skip
        return seen, tracks(track=list(range(N_TRACKS)), speed=speed, lifetime=AGES, **(lived or {}))

    return make


def pooled(table: pl.DataFrame, *by: str) -> pl.DataFrame:
    names = [name for name in table.columns if name == "n" or name.startswith(("n_", "sum_"))]
    return table.group_by(by).agg(pl.col(names).sum()).sort(by)


def test_cells_have_the_sums_of_the_errors_whose_true_position_is_in_them(made) -> None:
    rng = np.random.default_rng(1)
    u, v = rng.uniform(-0.5, 639.5, (N_TRACKS, AGES)), rng.uniform(-0.5, 479.5, (N_TRACKS, AGES))
    du, dv = rng.normal(size=(2, N_TRACKS, AGES))
    u[0], v[0] = 639.49, -0.5  # the last column, and the first row
    truth = np.where(np.arange(N_TRACKS)[:, None] == 3, "occluded", "valid")
    seen, lived = made(u_true_px=u, v_true_px=v, du_px=du, dv_px=dv, truth=truth)
    table = image_map(prepare_sequence(seen, lived), width=640, height=480)
    assert table.schema == pl.Schema(IMAGE_MAP)
    assert table.select(pl.exclude(*ORIGIN, "n", "^sum_.*$")).is_unique().all()
    found = pooled(table, "at", "row", "column")
    assert found["at"].unique().to_list() == list(PLACE_AGES)
    every = [(k, t) for k in PLACE_AGES for t in range(N_TRACKS) if t != 3]
    cells: dict[tuple[int, int, int], list[tuple[float, float]]] = {}
    for k, t in every:
        place = k, int((v[t, k] + 0.5) / 480 * MAP_ROWS), int((u[t, k] + 0.5) / 640 * MAP_COLUMNS)
        cells.setdefault(place, []).append((du[t, k], dv[t, k]))
    assert found.select("at", "row", "column").rows() == sorted(cells)
    assert any(place == (20, 0, MAP_COLUMNS - 1) for place in cells)
    for row in found.to_dicts():
        own = np.array(cells[row["at"], row["row"], row["column"]])
        assert row["n"] == len(own)
        assert (row["sum_u"], row["sum_uv"]) == pytest.approx((own[:, 0].sum(), own.prod(axis=1).sum()), abs=1e-5)


def test_ages_are_those_that_the_lowest_speed_has(made) -> None:
    seen, lived = made(speed=3, u_true_px=5.0)
    prepared = prepare_sequence(seen, lived)
    assert image_map(prepared, width=20, height=14)["at"].unique().to_list() == [3, 9, 18]
    assert image_map(replace(prepared, slowest=1), width=20, height=14).is_empty()


def test_frames_count_from_the_key_frame(made) -> None:
    seen, lived = made(u_true_px=5.0)
    table = image_map(prepare_sequence(seen, lived, key_frame=8), width=20, height=14)
    assert table["at"].unique().to_list() == [9, 13, 18]
    assert table["axis"].unique().to_list() == ["frame"]


def test_errors_along_the_motion_are_by_its_speed_per_frame(made) -> None:
    step = np.where(np.arange(N_TRACKS) < 8, 3.0, 0.3)[:, None]  # px per frame of the sequence
    place = step * np.arange(AGES) * 2.0
    seen, lived = made(speed=2, u_true_px=100.0 - place, v_true_px=7.0, du_px=-0.5, dv_px=0.25)
    found = pooled(image_speeds(prepare_sequence(seen, lived)), "at", "low", "high")
    assert found["at"].unique().to_list() == [2, 4, 10, 20]
    slow, fast = found.filter(at=10).to_dicts()
    assert slow["low"] <= 0.3 < slow["high"]
    assert fast["low"] <= 3.0 < fast["high"]
    assert (fast["n"], fast["sum_along"], fast["sum_across"]) == pytest.approx((8, 8 * 0.5, 8 * -0.25))
    assert (slow["n"], slow["sum_along_2"], slow["sum_across_2"]) == pytest.approx((24, 24 * 0.25, 24 * 0.0625))


def test_classes_hold_their_tracks_and_add_up_to_all_of_them(made) -> None:
    edge = [-15.0, -7.6, -7.4, -0.5, 0.5, 3.9, 4.1, 14.9] + [None] * (N_TRACKS - 8)
    side = [*["far"] * 4, *["near"] * 4, *["none"] * (N_TRACKS - 10), None, None]
    angle = [0.0, 14.9, 15.1, 90.0, *[40.0] * (N_TRACKS - 5), None]
    depth = [0.3, 1.0, 1.9, *[2.5] * (N_TRACKS - 4), None]
    lived = {"edge_px": edge, "edge_side": side, "incidence_deg": angle, "depth_m": depth}
    seen, lived = made(du_px=np.arange(N_TRACKS)[:, None], lived=lived)
    table = pooled(surroundings(prepare_sequence(seen, lived)).filter(at=5), "surrounding", "low", "high")
    counts = {
        kind: [(row["low"], row["high"], row["n"]) for row in table.filter(surrounding=kind).to_dicts()]
        for kind in ("depth", "edge", "incidence")
    }
    assert counts["edge"] == [
        (None, None, N_TRACKS - 10), (-15.0, -7.5, 2), (-7.5, -4.0, 1), (-2.0, 0.0, 1),
        (0.0, 2.0, 1), (2.0, 4.0, 1), (4.0, 7.5, 1), (7.5, 15.0, 1),
    ]  # fmt: skip
    assert counts["incidence"] == [(0.0, 15.0, 2), (15.0, 30.0, 1), (30.0, 45.0, N_TRACKS - 5), (75.0, 90.0, 1)]
    root = 2**0.5
    expected = [(0.25, 0.25 * root, 1), (1.0, root, 1), (root, 2.0, 1), (2.0, 2 * root, N_TRACKS - 4)]
    assert [n for _, _, n in counts["depth"]] == [n for _, _, n in expected]
    assert np.array(counts["depth"]) == pytest.approx(np.array(expected))
    near = table.filter(surrounding="edge", low=0.0)
    assert near.select("sum_u", "sum_uu").row(0) == (4.0, 16.0)


def test_occlusion_is_told_before_it_comes_and_while_it_lasts(made) -> None:
    truth = np.full((N_TRACKS, AGES), "valid", dtype="U12")
    truth[0, 7:9] = "occluded"
    truth[1, 10] = "occluded"
    truth[2, 5] = "out_of_image"
    seen, lived = made(truth=truth, lived={"depth_m": 3.0})
    table = surroundings(prepare_sequence(seen, lived)).filter(surrounding="depth")
    table = pooled(table, "at", "occlusion")
    found = {(at, occlusion): n for at, occlusion, n in table.select("at", "occlusion", "n").rows()}
    assert found == {
        (1, "later"): 2, (1, "never"): N_TRACKS - 2,
        (5, "later"): 2, (5, "never"): N_TRACKS - 3,
        (10, "now"): 1, (10, "never"): N_TRACKS - 1,
        (20, "never"): N_TRACKS,
    }  # fmt: skip


def test_parallax_is_motion_relative_to_the_median_of_all_features(made) -> None:
    age = np.arange(AGES)
    u = np.tile(5.0 * age, (N_TRACKS, 1))  # a rotation moves all features by 5 px per frame
    u[0] += 3.0 * age  # in front of the others
    u[1] += 0.1 * age
    seen, lived = made(u_true_px=u + 100.0, v_true_px=50.0, lived={"depth_m": 3.0})
    table = surroundings(prepare_sequence(seen, lived)).filter(surrounding="parallax")
    found = pooled(table, "at", "low", "high").select("at", "low", "high", "n").rows()
    assert found == [
        (1, 0.0, 1.0, N_TRACKS - 1), (1, 2.0, 4.0, 1),
        (5, 0.0, 1.0, N_TRACKS - 1), (5, 8.0, 16.0, 1),
        (10, 0.0, 1.0, N_TRACKS - 2), (10, 1.0, 2.0, 1), (10, 16.0, 32.0, 1),
        (20, 0.0, 1.0, N_TRACKS - 2), (20, 2.0, 4.0, 1), (20, 32.0, 64.0, 1),
    ]  # fmt: skip


def test_parallax_needs_true_positions_of_enough_features_in_both_frames(made) -> None:
    truth = np.full((N_TRACKS, AGES), "valid", dtype="U12")
    truth[9:, 5] = "no_depth"
    u = np.where(truth == "valid", 100.0, None)
    error = np.where(truth == "valid", 0.0, None)
    seen, lived = made(u_true_px=u, v_true_px=u, du_px=error, dv_px=error, truth=truth, lived={"depth_m": 3.0})
    table = surroundings(prepare_sequence(seen, lived)).filter(surrounding="parallax")
    assert table["at"].unique().sort().to_list() == [1, 10, 20]


def test_parallax_is_counted_from_the_key_frame(made) -> None:
    u = np.tile(100.0 + 5.0 * np.arange(AGES), (N_TRACKS, 1))
    u[0] += 3.0 * np.arange(AGES)
    seen, lived = made(u_true_px=u, v_true_px=50.0, lived={"depth_m": 3.0})
    table = surroundings(prepare_sequence(seen, lived, key_frame=8)).filter(surrounding="parallax")
    found = pooled(table, "at", "low").filter(n=1).select("at", "low").rows()
    assert found == [(9, 2.0), (13, 8.0), (18, 16.0)]
