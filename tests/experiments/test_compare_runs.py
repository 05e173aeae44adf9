"""Runs of made-up measurements compared: what is refused, what is found, and what takes no part."""

import shutil

import numpy as np
import polars as pl
import pytest
from benchmarks.validity.compare import swapped
from tests.report.synthetic import World, write_run

import tracknoise
from tracknoise.analysis.gate import Gate
from tracknoise.analysis.run_changes import verdicts
from tracknoise.exceptions import SettingsError, StoreError, UnknownNameError
from tracknoise.experiments.compare_runs import OpenedRun, questions
from tracknoise.statistics.histograms import LOG_HISTOGRAM_BINS, bin_of
from tracknoise.tables.files import digest
from tracknoise.tables.schema import ORIGIN, WINDOW_NOISE
from tracknoise.tables.store import RunFolder
from tracknoise.topics.catalogue import ESTIMANDS

SCENES = tuple(f"scene-{number}" for number in range(8))
BASE = {"scenes": SCENES, "speeds": (1,), "n_frames": 14, "born": 25, "min_features": 20, "trackers": ("lk", "other")}


@pytest.fixture(scope="session")
def make(made_once):
    """Writes a run of a world that differs from the base in some settings."""

    def made(name, *, seed=0, **settings):
        world = World(**{**BASE, **settings}, told=False)
        return made_once(f"compare-{name}", lambda path: write_run(path, world, seed=seed))

    return made


@pytest.fixture
def change(make, tmp_path):
    """A copy of a run whose manifest is changed."""

    def changed(edit, name="base", **settings):
        folder = shutil.copytree(make(name, **settings), tmp_path / "changed")
        run = RunFolder(folder)
        manifest = run.manifest()
        edit(manifest)
        run.write_manifest(manifest)
        return folder

    return changed


def rows_of(comparison, tracker="lk"):
    return {row.statistic: row for row in comparison.rows if row.of.tracker == tracker}


def test_other_seeds_make_no_run_worse_or_better(make):
    found = tracknoise.compare(make("base"), make("seed", seed=1))
    assert {row.verdict for row in found.rows} <= {"no difference", "undecided"}
    assert {row.statistic for row in found.rows} <= set(ESTIMANDS)
    assert {"core", "second_moment", "bias", "tails", "growth", "lifetime", "outlier_ratio"} <= set(rows_of(found))


def test_a_run_is_like_itself_in_everything(make):
    found = tracknoise.compare(make("base"), make("base"))
    assert {row.verdict for row in found.rows} == {"no difference"}
    assert found.first.name == found.others[0].name == "compare-base"


def test_runs_of_the_same_name_are_named_by_the_folders_that_distinguish_them(make, tmp_path):
    copies = [shutil.copytree(make("base"), tmp_path / folder / "run") for folder in ("before/x", "after/x", "after/y")]
    found = tracknoise.compare(*copies, make("base"))
    assert [found.first.name, *(side.name for side in found.others)] == [
        "before/x/run", "after/x/run", "y/run", "compare-base",
    ]  # fmt: skip


def test_larger_errors_and_shorter_lives_are_worse(make):
    found = rows_of(tracknoise.compare(make("base"), make("worse", seed=1, sigma_px=0.3, loss=0.2)))
    for name in ("core", "second_moment", "lifetime"):
        assert found[name].verdict == "worse"
    assert found["core"].low < 2.0 < found["core"].high
    assert found["second_moment"].effect > 2.5
    back = rows_of(tracknoise.compare(make("worse", seed=1, sigma_px=0.3, loss=0.2), make("base")))
    assert back["core"].verdict == back["lifetime"].verdict == "better"
    assert back["core"].effect == pytest.approx(1 / found["core"].effect)


def test_a_bias_that_grows_is_worse(make):
    one = {"sigma_px": 0.05, "trackers": ("lk",)}
    quiet, biased = make("quiet", bias_px=0.0, **one), make("biased", seed=1, bias_px=0.2, **one)
    row = rows_of(tracknoise.compare(quiet, biased))["bias"]
    assert row.verdict == "worse"
    assert row.low < 0.2 * row.at * (1.0 if row.coordinate == "u" else 0.5) < row.high


def test_three_runs_are_compared_with_the_first(make):
    found = tracknoise.compare(make("base"), make("seed", seed=1), make("worse", seed=1, sigma_px=0.3, loss=0.2))
    assert [side.name for side in found.others] == ["compare-seed", "compare-worse"]
    worse = {row.of.run for row in found.rows if row.verdict == "worse"}
    assert worse == {"compare-worse"}


def test_two_scenes_leave_everything_undecided(make):
    few = {"scenes": SCENES[:2]}
    found = tracknoise.compare(make("two", **few), make("two worse", seed=1, sigma_px=0.9, **few))
    assert {row.verdict for row in found.rows} == {"undecided"}
    assert all("only 2 scenes" in row.why for row in found.rows)


def test_trackers_of_other_names_are_compared_if_named(make):
    found = tracknoise.compare(make("base"), make("base"), trackers=("lk", "other"))
    assert {(row.of.tracker, row.of.other_tracker) for row in found.rows} == {("lk", "other")}
    assert rows_of(found)["core"].verdict == "worse"
    assert found.others[0].notes == ()
    with pytest.raises(UnknownNameError, match=r"tracker of .* 'sift'"):
        tracknoise.compare(make("base"), make("base"), trackers=("lk", "sift"))


def test_trackers_without_a_partner_take_no_part(make):
    few = {"scenes": SCENES[:2]}
    found = tracknoise.compare(make("two", **few), make("renamed", trackers=("lk", "mine"), **few))
    assert {row.of.tracker for row in found.rows} == {"lk"}
    assert "Tracker other of compare-two takes no part." in found.others[0].notes
    with pytest.raises(SettingsError, match="trackers lk, other and a, b"):
        tracknoise.compare(make("two", **few), make("strangers", trackers=("a", "b"), **few))


def test_only_common_scenes_are_compared(make):
    found = tracknoise.compare(make("base"), make("seven", seed=1, scenes=SCENES[1:]))
    assert {row.n_scenes for row in found.rows} == {7}
    assert "scene-0@default" in found.others[0].notes[0]
    with pytest.raises(SettingsError, match=r"other data: sequences .* of the same name"):
        tracknoise.compare(make("base"), make("strange scenes", scenes=("a", "b")))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"n_frames": 15}, "other data: n_frames of scene-0@default is 14 and 15"),
        ({"truth": "birth"}, "other truth: truth of scene-0@default is raycast and birth"),
        ({"population": "projected"}, "other truth: truth.population is visible and projected"),
        ({"snapshot": False}, "other data: frame 7 of scene-0@default differs"),
    ],
)
def test_other_data_and_other_truths_are_refused(make, settings, message):
    (name,), few = settings, {"scenes": SCENES[:2]}
    with pytest.raises(SettingsError, match=message):
        tracknoise.compare(make("two", **few), make(f"refused {name}", **few, **settings))


def test_other_libraries_are_refused(make, change):
    folder = change(lambda manifest: manifest.versions.update({"opencv-contrib-python-headless": "4.9"}))
    with pytest.raises(SettingsError, match=r"another library: opencv.* of unknown version and 4.9"):
        tracknoise.compare(make("base"), folder)


def test_other_packages_of_trackers_are_named_as_a_difference(make, change):
    folder = change(lambda manifest: manifest.versions.update({"my-tracker": "2.0", "python": "3.12"}))
    differs = tracknoise.compare(make("base"), folder).others[0].differs
    assert ("version of my-tracker", "not set", "2.0") in differs


def test_other_poses_are_refused_and_other_files_of_equal_poses_are_not(make, tmp_path):
    for name, factor in (("same", 1.0), ("moved", 1.01)):
        folder = shutil.copytree(make("base"), tmp_path / name)
        run = RunFolder(folder)
        key = sorted(run.manifest().sequences)[0]
        poses = run.sequence_table("poses", key).with_columns(pl.col("x_m") * factor)
        path = folder / "poses" / f"{key}.parquet"
        poses.write_parquet(path, compression="gzip")
        manifest = run.manifest()
        manifest.sequences[key].sha256["poses"] = digest(path.read_bytes())
        run.write_manifest(manifest)
    assert tracknoise.compare(make("base"), tmp_path / "same").rows
    with pytest.raises(SettingsError, match="other truth: poses of scene-0@default differ"):
        tracknoise.compare(make("base"), tmp_path / "moved")


def windows_of(scene, residual_px, consistent_px):
    """Windows of one scene whose residuals and depths are those of Gaussian noise, `WINDOW_NOISE`.

    The size of the noise of depths is given by the length of the windows.
    """
    rng = np.random.default_rng(int(scene.removeprefix("scene-")))
    origin = dict(zip(ORIGIN, ["simulated", scene, "default", 0, "forward", "", "lk", 1], strict=True))
    rows = []
    for window, size_px in consistent_px.items():
        freedom = 2 * window - 3
        residuals = residual_px * np.sqrt(rng.chisquare(freedom, 4000) / freedom)
        z = size_px * np.abs(rng.standard_normal(4000))
        sums = {f"{name}_{axis}": freedom * 2000.0 for name in ("squares", "freedom") for axis in "uv"}
        counts = {
            f"{name}_counts": np.bincount(bin_of(of), minlength=LOG_HISTOGRAM_BINS).tolist()
            for name, of in (("residual", residuals), ("z", z))
        }
        about = {
            "trimming": "untrimmed",
            "window": window,
            "n": 4000,
            "n_depth": 4000,
            "squares_z": float((z**2).sum()),
        }
        rows.append({**origin, **about, **sums, **counts})
    return pl.DataFrame(rows, schema=dict(WINDOW_NOISE))


def with_windows(folder, residual_px, consistent_px, last_scenes=SCENES):
    """A run with made-up windows; those of the greatest length in some scenes only."""
    run = RunFolder(folder)
    manifest = run.manifest()
    for key, entry in manifest.sequences.items():
        path = folder / "window_noise" / f"{key}.parquet"
        windows = windows_of(entry.sequence.scene, residual_px, consistent_px)
        if entry.sequence.scene not in last_scenes:
            windows = windows.filter(pl.col("window") < max(consistent_px))
        windows.write_parquet(path, compression="gzip")
        entry.sha256["window_noise"] = digest(path.read_bytes())
    run.write_manifest(manifest)
    return folder


def test_the_sigma_to_set_can_be_better_where_residuals_are_worse(make, tmp_path):
    sizes = {"before": (0.04, {5: 0.1, 15: 0.2, 20: 0.1}), "after": (0.06, {5: 0.1, 15: 0.145, 20: 0.2})}
    runs = [with_windows(shutil.copytree(make("base"), tmp_path / name), *size) for name, size in sizes.items()]
    gate = Gate({"consistent_sigma": 0.1, "residual_sigma": 0.1})
    comparison = tracknoise.compare(*runs, gate=gate)
    found = rows_of(comparison)
    # the sigma for depths is that of windows of 15, as in the findings; the others are means over the three lengths
    expected = {"consistent_sigma": 0.145 / 0.2, "residual_sigma": 1.5}
    assert {name: found[name].verdict for name in expected} == {"consistent_sigma": "better", "residual_sigma": "worse"}
    assert [found[name].at for name in expected] == [15, None]
    for name, ratio in expected.items():
        assert found[name].effect == pytest.approx(ratio, rel=0.03)
        assert (found[name].of.tracker, found[name].n_scenes) == ("lk", 8)
    assert [ESTIMANDS[name].title for name in ("consistent_sigma", "residual_sigma")] == [
        "sigma for depths",
        "residual core",
    ]
    outcomes = {row.statistic: row.outcome for row in comparison.gate.rows}
    assert outcomes == {"consistent_sigma": "pass", "residual_sigma": "worse"}


@pytest.mark.parametrize(("last_scenes", "length"), [(SCENES[:6], 15), (SCENES[:5], 10)])
def test_the_sigma_to_set_is_that_of_the_longest_windows_that_enough_scenes_have(make, tmp_path, last_scenes, length):
    runs = [
        with_windows(shutil.copytree(make("base"), tmp_path / name), 0.1, {5: 0.1, 10: 0.2, 15: 0.3}, last_scenes)
        for name in ("before", "after")
    ]
    row = rows_of(tracknoise.compare(*runs))["consistent_sigma"]
    assert (row.verdict, row.at, row.effect) == ("no difference", length, 1.0)


def test_runs_without_short_windows_have_no_sigma_to_compare(make, tmp_path):
    runs = [
        with_windows(shutil.copytree(make("base"), tmp_path / name), 0.1, {20: 0.3}) for name in ("before", "after")
    ]
    row = rows_of(tracknoise.compare(*runs))["consistent_sigma"]
    assert (row.verdict, row.effect) == ("undecided", None)


def test_wrong_arguments_are_refused(make, tmp_path):
    base = make("base")
    for arguments, message in (
        ({"margin": 0.0}, "margin is 0.0"),
        ({"margin": "0.1"}, "margin is '0.1', expected a number above 0"),
        ({"trackers": "lk"}, "trackers is 'lk', expected two names"),
        ({"gate": "gate.toml"}, "gate is 'gate.toml', expected what `read_gate` returns"),
        ({"level": 1.5}, "level is 1.5"),
        ({"ages": "some"}, "ages is 'some'"),
    ):
        with pytest.raises(SettingsError, match=message):
            tracknoise.compare(base, base, **arguments)
    with pytest.raises(SettingsError, match="expected at least two"):
        tracknoise.compare(base)
    with pytest.raises(SettingsError, match="run is None, expected a path"):
        tracknoise.compare(base, None)
    with pytest.raises(StoreError, match="nothing"):
        tracknoise.compare(base, tmp_path / "nothing")


def test_runs_that_are_swapped_by_chance_are_seldom_worse_or_better(make):
    """What is left of their differences is chance, as large as the differences that they have.

    `python -m benchmarks.validity compare` does this to more pairs, and more often.
    """
    paths = make("base"), make("worse", seed=1, sigma_px=0.3, loss=0.2)
    opened = [OpenedRun.of(RunFolder(path), path.name) for path in paths]
    asked = questions(*opened, None).asked
    rng = np.random.default_rng(0)
    wrong = 0
    for _ in range(20):
        signs = dict(zip(SCENES, rng.choice([-1.0, 1.0], len(SCENES)), strict=True))
        rows = verdicts(swapped(asked, signs))
        wrong += any(row.verdict in ("worse", "better") for row in rows)
    assert wrong <= 2


def test_numbers_are_those_of_the_tables(make):
    """The core and the feature count, worked out from the tables of both runs in another way."""
    base, worse = make("base"), make("worse", seed=1, sigma_px=0.3, loss=0.2)
    found = rows_of(tracknoise.compare(base, worse, ages="mean"))
    runs = [tracknoise.open_run(path) for path in (base, worse)]
    counts = [run.table("frames", tracker="lk").group_by("scene").agg(pl.col("alive").mean()) for run in runs]
    both = counts[0].join(counts[1], on="scene")
    expected = np.exp(np.log(both["alive_right"] / both["alive"]).mean())
    assert found["feature_count"].effect == pytest.approx(expected)
    scales = [
        run.table("scales", tracker="lk", population="visible", trimming="untrimmed").filter(pl.col("n") >= 30)
        for run in runs
    ]
    both = scales[0].join(scales[1], on=["scene", "at"])
    first = both.filter(at=1).select("core_u_px", "core_u_px_right").to_numpy()
    assert np.exp(np.log(first[:, 1] / first[:, 0]).mean()) == pytest.approx(found["core"].effect, rel=0.15)
