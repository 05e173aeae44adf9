"""One call makes every table of a sequence: those that each statistic makes alone, from tables that are checked."""

import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import SchemaError, UnknownNameError
from tracknoise.statistics.prepared import prepare_sequence
from tracknoise.statistics.summarise import STATISTICS, statistics_of, summarise_sequence
from tracknoise.statistics.trimming import trim
from tracknoise.tables.schema import COVARIANCE_SUMS, FRAME_COUNTS, OBSERVATIONS, RATIOS, TRACKS, check, empty
from tracknoise.tables.store import SEQUENCE_TABLES

N_TRACKS, AGES = 30, 12


@pytest.fixture(scope="module")
def measured(observations, tracks, frames) -> tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame]:
    """Tracks of two conditions that move and err at random; every fifth observation is occluded."""
    rng = np.random.default_rng(4)
    age = np.tile(np.arange(AGES), N_TRACKS)
    parts = []
    for speed in (1, 2):
        place, error = rng.normal(size=(2, len(age), 2))
        parts.append(
            observations(
                track=np.repeat(np.arange(N_TRACKS), AGES).tolist(), speed=speed,
                age=(speed * age).tolist(), frame=(speed * age).tolist(),
                truth=np.where(np.arange(len(age)) % 5 == 4, "occluded", "valid").tolist(),
                u_true_px=place[:, 0].tolist(), v_true_px=place[:, 1].tolist(),
                du_px=(age * error[:, 0]).tolist(), dv_px=(age * error[:, 1]).tolist(),
            )
        )  # fmt: skip
    numbers = list(range(N_TRACKS))
    lived = [tracks(track=numbers, speed=speed, lifetime=AGES, gradient_rad=0.3, depth_m=2.0) for speed in (1, 2)]
    return pl.concat(parts), pl.concat(lived), frames(frame=[0, 1])


def test_every_table_of_a_sequence_is_made_that_needs_no_camera(measured) -> None:
    found = summarise_sequence(*measured, population="projected", trim_percentile=80.0, slowest=1)
    measured_elsewhere = {
        "poses",
        "pose_differences",
        "image_map",
        "rigid",
        "pose_growth",
        "floors",
        "cameras",
        "audit_samples",
        "window_noise",
        "window_blocks",
    }
    of_later = {"ratio_sums": RATIOS, "covariance_sums": COVARIANCE_SUMS}
    assert {*found} == {*SEQUENCE_TABLES, *of_later} - measured_elsewhere
    for name, table in found.items():
        of_others = ("fitted_noise", "truth_differences", "between_trackers", "covariance_sums")  # truths or trackers
        assert check(table, {**SEQUENCE_TABLES, **of_later}[name], name).is_empty() == (name in of_others)
    assert found["blocks"]["population"].unique().sort().to_list() == ["visible", "projected"]
    assert found["aspect_blocks"]["speed"].unique().to_list() == [1]


@pytest.mark.parametrize("key_frame", [None, 6])
def test_each_table_is_that_of_its_statistic_alone(measured, key_frame: int | None) -> None:
    together = summarise_sequence(*measured, trim_percentile=80.0, key_frame=key_frame)
    trimmed = trim(*measured[:2], percentile=80.0, key_frame=key_frame)
    assert together["trims"].equals(trimmed.trims)
    for name in STATISTICS:
        alone = statistics_of(prepare_sequence(trimmed.observations, trimmed.tracks, key_frame=key_frame), [name])
        assert together[name].equals(alone[name])


def test_only_the_statistics_that_are_named_are_made(measured) -> None:
    found = summarise_sequence(*measured, statistics=["ends"])
    assert {*found} == {"observations", "tracks", "frames", "trims", "ends"}
    assert found["tracks"]["kept"].all()


def test_conditions_do_not_mix_and_the_order_of_tracks_does_not_matter(measured) -> None:
    seen, lived, frames = measured
    both = summarise_sequence(seen, lived.reverse(), frames, trim_percentile=80.0)
    for speed in (1, 2):
        one = summarise_sequence(seen.filter(speed=speed), lived.filter(speed=speed), frames, trim_percentile=80.0)
        for name in STATISTICS:
            assert both[name].filter(speed=speed).equals(one[name])


def test_wrong_tables_and_names_are_refused(measured) -> None:
    seen, lived, frames = measured
    with pytest.raises(SchemaError, match="frames: "):
        summarise_sequence(seen, lived, lived)
    with pytest.raises(SchemaError, match="not in the tracks table"):
        summarise_sequence(seen, lived.filter(speed=1), frames)
    with pytest.raises(UnknownNameError, match="unknown population 'all'"):
        summarise_sequence(seen, lived, frames, population="all")


def test_nothing_measured_gives_empty_tables() -> None:
    found = summarise_sequence(empty(OBSERVATIONS), empty(TRACKS), empty(FRAME_COUNTS))
    assert all(table.is_empty() for table in found.values())
