import polars as pl
import pytest

from tracknoise.exceptions import SchemaError
from tracknoise.statistics.prepared import prepare_sequence
from tracknoise.statistics.track_counts import counts, merge_counts
from tracknoise.tables.findings_schema import COUNTS
from tracknoise.tables.schema import OBSERVATIONS, TRACKS, TrackEnd, TruthStatus, empty


def test_every_name_is_counted_and_what_is_missing_is_zero(observations, tracks) -> None:
    seen, lived = observations(truth=["valid", "valid", "edge"]), tracks(track=[0, 1], end=["lost", "sequence_end"])
    table = counts(prepare_sequence(seen, lived))
    found = {(kind, name): n for kind, name, n in table.select("kind", "name", "n").rows()}
    assert len(found) == table.height == len(TruthStatus) + len(TrackEnd)
    assert {key for key, n in found.items() if n} == {
        ("truth", "valid"), ("truth", "edge"), ("end", "lost"), ("end", "sequence_end"),
    }  # fmt: skip
    assert found["truth", "valid"] == 2


def test_conditions_are_counted_apart_and_dropped_tracks_too(observations, tracks) -> None:
    seen = observations(tracker=["lk", "match", "match"], kept=[True, False, True])
    lived = tracks(tracker=["lk", "match", "unused"], kept=[True, False, True])
    table = counts(prepare_sequence(seen, lived)).filter(pl.col("n") > 0)
    rows = [("lk", "end", 1), ("lk", "truth", 1), ("match", "end", 1), ("match", "truth", 2), ("unused", "end", 1)]
    assert table.select("tracker", "kind", "n").rows() == rows


def test_a_condition_without_observations_has_no_counts_of_them(observations, tracks) -> None:
    table = counts(prepare_sequence(observations(track=[0]), tracks(tracker=["lk", "unused"])))
    assert set(table.filter(tracker="unused")["kind"]) == {"end"}


def test_counts_of_scenes_add_up(observations, tracks) -> None:
    seen = observations(scene=["a", "b", "b"], truth=["valid", "valid", "occluded"])
    lived = tracks(scene=["a", "b"], end=["lost", "outlier"])
    parts = [counts(prepare_sequence(seen.filter(scene=scene), lived.filter(scene=scene))) for scene in "ba"]
    assert merge_counts(iter(parts)).equals(counts(prepare_sequence(seen, lived)))


def test_nothing_gives_nothing() -> None:
    assert counts(prepare_sequence(empty(OBSERVATIONS), empty(TRACKS))).equals(empty(COUNTS))
    assert merge_counts([]).equals(empty(COUNTS))


def test_the_wrong_tables_are_refused() -> None:
    with pytest.raises(SchemaError, match="observations"):
        counts(prepare_sequence(empty(TRACKS), empty(TRACKS)))
    with pytest.raises(SchemaError, match="tracks"):
        counts(prepare_sequence(empty(OBSERVATIONS), empty(OBSERVATIONS)))
    with pytest.raises(SchemaError, match="counts"):
        merge_counts([empty(TRACKS)])
