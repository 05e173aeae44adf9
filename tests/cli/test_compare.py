"""``tracknoise compare``: exit statuses, files, and messages."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from tests.report.synthetic import World, write_run

from tracknoise.tables.manifest import PoseFit
from tracknoise.tables.store import RunFolder

SCENES = tuple(f"scene-{number}" for number in range(8))
BASE = {"scenes": SCENES, "speeds": (1,), "n_frames": 14, "born": 25, "min_features": 20, "trackers": ("lk", "other")}
WORSE = {"seed": 1, "sigma_px": 0.3, "loss": 0.2}


@pytest.fixture
def make(made_once):
    def made(name, *, seed=0, **settings):
        world = World(**{**BASE, **settings}, told=False)
        return str(made_once(f"compare-{name}", lambda path: write_run(path, world, seed=seed)))

    return made


@pytest.fixture
def gate(tmp_path):
    def written(text='ages = "mean"\n[tolerances]\ncore = 0.25\nlifetime = 0.25\n'):
        path = tmp_path / "gate.toml"
        path.write_text(text)
        return str(path)

    return written


def test_without_a_gate_the_status_is_0_whatever_the_verdicts_are(tracknoise, make):
    status, out, _ = tracknoise("compare", make("base"), make("worse", **WORSE))
    assert status == 0
    assert out.startswith("compare-base has smaller typical errors, ")
    assert "compare-worse compared with compare-base: other" in out


def test_a_gate_that_passes(tracknoise, make, gate):
    status, out, _ = tracknoise("compare", make("base"), make("seed", seed=1), "--gate", gate())
    assert status == 0
    outcome, _, conclusion, *_ = out.splitlines()
    assert outcome == "The gate passes."
    assert conclusion.startswith("Neither compare-base nor compare-seed is shown to be better: ")


def test_with_two_scenes_a_gate_is_undecided(tracknoise, make, gate):
    few = {"scenes": SCENES[:2]}
    runs = make("two", **few), make("two worse", seed=1, sigma_px=0.9, **few)
    status, out, _ = tracknoise("compare", *runs, "--gate", gate())
    assert status == 4
    assert "The gate is undecided: this is neither a pass nor a failure." in out
    assert "only 2 scenes" in out


def test_a_run_that_failed_to_measure_a_scene_does_not_pass(tracknoise, make, gate, tmp_path):
    run = RunFolder(Path(shutil.copytree(make("seven", seed=1, scenes=SCENES[1:]), tmp_path / "after")))
    manifest = run.manifest()
    manifest.failures["scene-0@default"] = "damaged image"
    run.write_manifest(manifest)
    status, out, err = tracknoise("compare", make("base"), str(run.path), "--gate", gate())
    assert status == 4
    assert "After could not measure scene-0@default, which compare-base measured." in out
    assert "after: after could not measure scene-0@default" in err


def with_leading_poses(run, folder, fit):
    """A copy of a run in which poses of all sequences lead as given."""
    copy = RunFolder(Path(shutil.copytree(run, folder)))
    manifest = copy.manifest()
    manifest.sequences = {key: replace(entry, pose_fit=fit) for key, entry in manifest.sequences.items()}
    copy.write_manifest(manifest)
    return str(copy.path)


def test_runs_with_different_leading_poses_are_refused(tracknoise, make, tmp_path):
    refined = with_leading_poses(make("seed", seed=1), tmp_path / "refined", PoseFit(True, 300.0, 0.1, 1.0, 10))
    status, out, err = tracknoise("compare", make("base"), refined)
    assert (status, out) == (1, "")
    assert "other truth: poses of scene-0@default are stated and refined, expected the same" in err
    kept = with_leading_poses(make("seed", seed=1), tmp_path / "kept", PoseFit(False, reason="They are exact."))
    assert tracknoise("compare", make("base"), kept)[0] == 0


@pytest.mark.parametrize(("wanted", "expected"), [("stated", 0), ("refined", 4)])
def test_a_gate_names_which_poses_have_to_lead(tracknoise, make, gate, wanted, expected):
    tolerances = 'ages = "mean"\n[tolerances]\ncore = 0.25\nlifetime = 0.25\n'
    file = gate(f'poses = "{wanted}"\n{tolerances}')
    status, out, _ = tracknoise("compare", make("base"), make("seed", seed=1), "--gate", file)
    assert status == expected
    assert ("are stated, not refined" in out) == (expected == 4)


@pytest.mark.parametrize(
    ("name", "less", "missing"),
    [
        ("seven", {"scenes": SCENES[1:]}, "Compare-seven has no scene-0@default, which compare-base measured."),
        ("one tracker", {"trackers": ("lk",)}, "Tracker other is not in both runs."),
    ],
)
def test_a_run_that_measured_less_does_not_pass_and_one_that_measured_more_does(
    tracknoise, make, gate, name, less, missing
):
    smaller = make(name, seed=1, **less)
    status, out, _ = tracknoise("compare", make("base"), smaller, "--gate", gate())
    assert (status, missing in out) == (4, True)
    status, out, _ = tracknoise("compare", smaller, make("base"), "--gate", gate())
    assert (status, missing in out) == (0, False)


def test_a_gate_that_fails_is_the_status_and_all_files_are_written(tracknoise, make, gate, tmp_path):
    """And the document is all that is printed, where it is asked for."""
    paths = {name: tmp_path / "out" / f"compare.{name}" for name in ("html", "md", "json")}
    options = [part for path in paths.values() for part in ("--out", str(path))]
    arguments = ("compare", make("base"), make("worse", **WORSE), "--gate", gate(), "--json")
    status, out, _ = tracknoise(*arguments, *options)
    assert status == 3
    assert "<h1>compare-worse compared with compare-base</h1>" in paths["html"].read_text()
    assert "**The gate fails: something is worse than its tolerance.**" in paths["md"].read_text()
    assert json.loads(out) == json.loads(paths["json"].read_text())
    assert json.loads(out)["gate"]["outcome"] == "worse"


def test_trackers_are_named_by_a_pair(tracknoise, make):
    status, out, _ = tracknoise("compare", make("base"), make("base"), "--trackers", "lk", "other")
    assert status == 0
    assert out.startswith("lk has ")
    assert "other compared with lk (95" in out.replace("\N{NO-BREAK SPACE}", " ")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["base"], "found one run to compare, expected at least two"),
        (["base", "nothing"], "nothing"),
        (["two", "base", "base"], "found a run twice among those that are compared with the first"),
        (
            ["base", "base", "-o", "a.pdf"],
            "found a name that ends in '.pdf', expected .html, .json or .md",
        ),
        (
            ["base", "base", "-o", "a.md", "-o", "b.md"],
            "found a second .md file, expected one of each kind",
        ),
        (["base", "base", "--trackers", "lk", "sift"], "unknown tracker of"),
        (["base", "base", "--gate", "none.toml"], "none.toml: cannot be read"),
    ],
)
def test_mistakes_end_with_status_1_and_one_line(tracknoise, make, arguments, message):
    status, _, err = tracknoise("compare", *(make(part) if part in ("base", "two") else part for part in arguments))
    assert status == 1
    assert message in err
    assert len(err.splitlines()) == 1


def test_other_data_are_refused_with_the_reason(tracknoise, make):
    few = {"scenes": SCENES[:2]}
    status, _, err = tracknoise("compare", make("two", **few), make("refused n_frames", n_frames=15, **few))
    assert status == 1
    assert "compare-refused n_frames cannot be compared: other data: n_frames of scene-0@default is 14 and 15" in err


def test_other_depth_maps_are_refused(tracknoise, make, tmp_path):
    for name, depth_m in (("base", 2.0), ("fused", 2.03), ("rounded", 2.001)):
        run = RunFolder(Path(shutil.copytree(make("two", scenes=SCENES[:2]), tmp_path / name)))
        manifest = run.manifest()
        manifest.sequences = {key: replace(entry, first_depth_m=depth_m) for key, entry in manifest.sequences.items()}
        run.write_manifest(manifest)
    status, _, err = tracknoise("compare", str(tmp_path / "base"), str(tmp_path / "fused"))
    assert status == 1
    assert "other truth: median depth of the first frame of scene-0@default is 2 m and 2.03 m" in err
    assert tracknoise("compare", str(tmp_path / "base"), str(tmp_path / "rounded"))[0] == 0
