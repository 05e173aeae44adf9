"""Second moments of the oracle's errors are those that were planted, carried along by the magnification."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import tracknoise as tn
from tracknoise.exceptions import SettingsError
from tracknoise.sequences.simulated import Simulated
from tracknoise.tables.schema import TruthStatus
from tracknoise.trackers.gradient import min_eigenvalue
from tracknoise.trackers.oracle import USUAL_TEXTURE, Oracle
from tracknoise.trackers.tracker import Frame, SequenceContext

SIZE = (320, 240)
GROWTH = 1.02
NONE = ((0.0, 0.0), (0.0, 0.0))
Setting = Callable[..., SequenceContext]


class Approached:
    """Points on a plane that is approached: frame k is magnified by `GROWTH`^k about the corner of the image."""

    def anchor(self, index: int, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.pad(uv / GROWTH**index, ((0, 0), (0, 1))), np.full(len(uv), TruthStatus.valid, np.int8)

    def project(self, index: int, points_world: np.ndarray) -> np.ndarray:
        return points_world[:, :2] * GROWTH**index

    def displaced(self, index: int, points_world: np.ndarray, by_px: np.ndarray) -> np.ndarray:
        return points_world + np.pad(by_px / GROWTH**index, ((0, 0), (0, 1)))


def tracks(settings: Oracle, context: SequenceContext, indices: range) -> dict[int, dict[int, np.ndarray]]:
    """Errors about the first position of each track, by frames after it."""
    tracker, truth = settings.start(context), context.truth
    points: dict[int, tuple[int, np.ndarray]] = {}
    errors: dict[int, dict[int, np.ndarray]] = {}
    for index in indices:
        step = tracker.step(Frame(index, np.zeros((SIZE[1], SIZE[0]), np.uint8)))
        for identity, uv, born in zip(step.ids.tolist(), step.uv, step.born, strict=True):
            if born:
                points[identity] = (index, truth.anchor(index, uv[None])[0])
            birth, point = points[identity]
            errors.setdefault(identity, {})[index - birth] = uv - truth.project(index, point)[0]
    return errors


def moment(errors: dict[int, dict[int, np.ndarray]], one: int, other: int) -> float:
    """Mean product of the errors at two ages, both coordinates together."""
    pairs = [track[one] * track[other] for track in errors.values() if one in track and other in track]
    assert len(pairs) > 1000
    return float(np.mean(pairs))


@pytest.mark.parametrize(("one", "other"), [(1, 1), (8, 8), (3, 8)])
def test_error_of_the_first_position_is_carried_along(one, other, setting: Setting):
    settings = Oracle(n_features=2000, covariance_px2=NONE, birth_px=0.3)
    errors = tracks(settings, setting(truth=Approached()), range(12))
    assert moment(errors, 0, 0) == pytest.approx(0.0, abs=1e-20)
    assert moment(errors, one, other) == pytest.approx(0.09 * GROWTH ** (one + other), rel=0.06)


@pytest.mark.parametrize(("one", "other"), [(2, 2), (10, 10), (4, 10)])
@pytest.mark.parametrize("speed", [1, 2])
def test_walk_is_carried_along_and_grows_with_frames_of_the_sequence(one, other, speed, setting: Setting):
    settings = Oracle(n_features=2000, covariance_px2=NONE, walk_px_per_sqrt_frame=0.1)
    errors = tracks(settings, setting(truth=Approached(), speed=speed), range(0, 13, speed))
    steps = [speed * GROWTH ** (one + other - 2 * at) for at in range(speed, min(one, other) + 1, speed)]
    assert moment(errors, one, other) == pytest.approx(0.01 * sum(steps), rel=0.1)


def test_birth_white_and_walk_add_up(setting: Setting):
    white = ((0.04, 0.0), (0.0, 0.04))
    settings = Oracle(n_features=3000, covariance_px2=white, birth_px=0.2, walk_px_per_sqrt_frame=0.1)
    errors = tracks(settings, setting(), range(9))
    assert moment(errors, 8, 8) == pytest.approx(0.04 + 0.04 + 8 * 0.01, rel=0.06)
    assert moment(errors, 4, 8) == pytest.approx(0.04 + 4 * 0.01, rel=0.1)


def test_common_noise_is_the_same_in_all_features_of_a_frame_but_new_ones(setting: Setting):
    context = setting()
    context.truth.velocity[:] = 0.0
    tracker = Oracle(n_features=50, covariance_px2=NONE, common_px=0.4, loss_rate=0.01).start(context)
    first: dict[int, np.ndarray] = {}
    errors, n_new = [], 0
    for index in range(400):
        step = tracker.step(Frame(index, np.zeros((SIZE[1], SIZE[0]), np.uint8)))
        n_new += step.new
        first |= {one: uv for (one, uv), born in zip(_pairs(step), step.born, strict=True) if born}
        found = np.array([uv - first[one] for one, uv in _pairs(step)])[~step.born]
        assert index == 0 or np.ptp(found, axis=0).max() < 1e-9
        errors += [found[0]] if index else []
    assert n_new > 150
    assert np.cov(np.array(errors).T) == pytest.approx(0.16 * np.eye(2), abs=0.04)
    assert np.corrcoef(errors[1:], errors[:-1], rowvar=False)[0, 2] == pytest.approx(0.0, abs=0.15)


def _pairs(step):
    return zip(step.ids.tolist(), step.uv, strict=True)


@pytest.mark.parametrize("planted", [{"covariance_px2": ((0.25, 0.0), (0.0, 0.25))}, {"birth_px": 0.5}])
def test_student_errors_keep_their_covariance_and_have_the_planted_tails(planted, setting: Setting):
    nu = 6.0
    settings = Oracle(n_features=20_000, **{"covariance_px2": NONE, **planted}, student_nu=nu)
    errors = np.array([track[1] for track in tracks(settings, setting(), range(2)).values() if 1 in track])
    assert np.mean(errors**2) == pytest.approx(0.25, rel=0.04)
    # mean fourth power over that of a Gaussian: (nu - 2) / (nu - 4); far tails make it noisy, the median does not
    squared = (errors**2).sum(axis=1)
    median = (nu - 2) * (0.5 ** (-2 / nu) - 1)  # of |x|^2 / variance, for t in two dimensions
    assert np.median(squared) / 0.25 == pytest.approx(median, rel=0.04)


def test_one_kind_of_error_does_not_change_the_random_numbers_of_another(setting: Setting):
    indices = range(3)
    white = tracks(Oracle(n_features=20), setting(), indices)
    both = tracks(Oracle(n_features=20, birth_px=0.2, walk_px_per_sqrt_frame=0.1, common_px=0.1), setting(), indices)
    again = tracks(Oracle(n_features=20, birth_px=0.2, walk_px_per_sqrt_frame=0.1), setting(), indices)
    added = both[3][2] - again[3][2]
    others = [both[one][2] - again[one][2] for one in both if 2 in both[one]]
    np.testing.assert_allclose(others, np.broadcast_to(added, (len(others), 2)), atol=1e-9)
    assert not np.allclose(white[3][2], both[3][2])


def test_errors_are_the_same_whenever_the_seed_and_the_sequence_are(setting: Setting):
    settings = Oracle(n_features=30, birth_px=0.2, walk_px_per_sqrt_frame=0.1, common_px=0.1, student_nu=4.0)

    def last(settings: Oracle, **where: object) -> bytes:
        tracker = settings.start(setting(**where))
        return [tracker.step(Frame(k, np.zeros((SIZE[1], SIZE[0]), np.uint8))) for k in range(4)][-1].uv.tobytes()

    assert last(settings) == last(settings)
    assert len({last(settings), last(replace(settings, seed=1)), last(settings, scene="b")}) == 3


def test_noise_depends_on_texture_as_planted(setting: Setting):
    rng = np.random.default_rng(0)
    contrast = np.where(np.arange(SIZE[0]) < 160, 4.0, 40.0)
    image = np.clip(128 + contrast * rng.standard_normal(SIZE[::-1]), 0, 255).astype(np.uint8)
    white = ((0.04, 0.0), (0.0, 0.04))
    settings = Oracle(n_features=3000, covariance_px2=white, texture_exponent=0.5, margin_px=0)
    context = setting()
    tracker = settings.start(context)
    first, second = (tracker.step(Frame(index, image)) for index in range(2))
    start = dict(_pairs(first))
    kept = ~second.born
    errors = np.array([uv - start[one] - context.truth.velocity for one, uv in _pairs(second) if one in start])
    strength = second.quality["min_eigenvalue"][kept]
    known = np.isfinite(strength)
    assert np.ptp(np.log(strength[known])) > 2
    whitened = errors[known] * np.sqrt(strength[known] / USUAL_TEXTURE)[:, None] / 0.2
    weak = strength[known] < np.median(strength[known])
    assert np.mean(whitened[weak] ** 2) == pytest.approx(1.0, rel=0.07)
    assert np.mean(whitened[~weak] ** 2) == pytest.approx(1.0, rel=0.07)
    assert np.mean(errors[~known] ** 2) == pytest.approx(0.04, rel=0.3)


@pytest.mark.parametrize("speed", [1, 3])
def test_noise_depends_on_motion_as_planted(speed, setting: Setting):
    """Points move by 0.02 of their distance to the corner per frame: magnified, so that far ones move faster."""
    settings = Oracle(n_features=4000, covariance_px2=((0.04, 0.0), (0.0, 0.04)), motion_exponent=1.5)
    context = setting(truth=Approached(), speed=speed)
    tracker = settings.start(context)
    image = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    first, second = (tracker.step(Frame(index, image)) for index in (0, speed))
    start = dict(_pairs(first))
    begun = np.array([start[one] for one, _ in _pairs(second) if one in start])
    errors = np.array([uv for one, uv in _pairs(second) if one in start]) - begun * GROWTH**speed
    motion_px = np.linalg.norm(begun, axis=1) * (GROWTH**speed - 1) / speed
    whitened = errors / (0.2 * motion_px[:, None] ** 1.5)
    slow = motion_px < np.median(motion_px)
    assert np.mean(whitened[slow] ** 2) == pytest.approx(1.0, rel=0.08)
    assert np.mean(whitened[~slow] ** 2) == pytest.approx(1.0, rel=0.08)


def test_texture_strength_is_that_of_a_wave():
    """A wave of amplitude a and wavelength l along both axes: mean squared derivative 2 (pi a / l)^2."""
    amplitude, length = 40.0, 15.0
    row, column = np.indices((80, 80))
    waves = np.sin(2 * np.pi * row / length) + np.sin(2 * np.pi * column / length)
    image = np.round(128 + amplitude * waves).astype(np.uint8)
    found = min_eigenvalue(Frame(0, image), np.array([[40.0, 40.0], [3.0, 40.0]]))
    assert found[0] == pytest.approx(2 * (np.pi * amplitude / length) ** 2, rel=0.12)  # differences flatten the wave
    assert np.isnan(found[1])


@pytest.fixture(scope="module")
def forward() -> Callable[[Oracle], pl.DataFrame]:
    """Observations in a simulated world, and the magnification since birth of the points that they are of."""
    reader = Simulated(motions=("forward",), frames=12, width=320, height=240, supersampling=1)
    sequence = reader.open(reader.sequences()[0])

    def measured(settings: Oracle) -> pl.DataFrame:
        found = tn.measure(sequence, settings)
        table = found.observations.join(found.tracks.select("track", "first_frame", "depth_m"), on="track")
        table = table.filter((pl.col("age") > 0) & (pl.col("truth") == "valid"))
        camera, pose = sequence.camera, sequence.world_from_camera
        birth, now = table["first_frame"].to_numpy(), table["frame"].to_numpy()
        rays = np.column_stack(
            [(table["u_true_px"] - camera.cx) / camera.fx, (table["v_true_px"] - camera.cy) / camera.fy]
        )
        rays = np.column_stack([rays, np.ones(len(rays))])
        # the true point is where its ray has, in its first frame, the depth of the track
        turn = np.swapaxes(pose[birth, :3, :3], 1, 2)
        along = np.einsum("nij,njk,nk->ni", turn, pose[now, :3, :3], rays)[:, 2]
        moved = np.einsum("nij,nj->ni", turn, pose[now, :3, 3] - pose[birth, :3, 3])[:, 2]
        depth_now = (table["depth_m"].to_numpy() - moved) / along
        return table.with_columns(magnification=table["depth_m"].to_numpy() / depth_now)

    return measured


def _whitened(table: pl.DataFrame, sigma: pl.Expr) -> list[float]:
    """Root mean square of each coordinate of the errors of magnified points at age 9, over its standard deviation."""
    far = (
        table.sort("track", "age").with_columns(sigma=sigma).filter(pl.col("age") == 9, pl.col("magnification") > 1.05)
    )
    assert far.height > 1000
    return [np.sqrt(((far[error] / far["sigma"]) ** 2).mean()) for error in ("du_px", "dv_px")]


def test_in_a_simulated_world_the_error_of_the_first_position_is_magnified_by_the_ratio_of_depths(forward):
    found = forward(Oracle(n_features=4000, covariance_px2=NONE, birth_px=0.3))
    assert _whitened(found, 0.3 * pl.col("magnification")) == pytest.approx([1.0, 1.0], rel=0.05)


def test_in_a_simulated_world_each_step_of_a_walk_is_magnified_by_the_ratio_of_depths_since(forward):
    found = forward(Oracle(n_features=4000, covariance_px2=NONE, walk_px_per_sqrt_frame=0.1))
    magnification = pl.col("magnification")
    variance = magnification**2 * (magnification**-2).cum_sum().over("track")
    assert _whitened(found, 0.1 * variance.sqrt()) == pytest.approx([1.0, 1.0], rel=0.05)


@pytest.mark.parametrize("options", [{"birth_px": 0.1}, {"walk_px_per_sqrt_frame": 0.1}])
def test_a_truth_that_cannot_move_points_is_refused(options, setting: Setting):
    class Fixed:
        anchor, project = Approached.anchor, Approached.project

    context = setting(truth=Fixed())
    Oracle().start(context)
    with pytest.raises(SettingsError, match="move points"):
        Oracle(**options).start(context)


@pytest.mark.parametrize(
    "wrong",
    [
        {"birth_px": -0.1},
        {"walk_px_per_sqrt_frame": np.inf},
        {"common_px": np.nan},
        {"student_nu": 2.0},
        {"texture_exponent": np.nan},
        {"motion_exponent": np.inf},
    ],
)
def test_impossible_sizes_are_refused_by_name(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Oracle(**wrong)
