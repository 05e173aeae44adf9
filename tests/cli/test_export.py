"""``tracknoise export`` of a noise model, as a user types it."""

import polars as pl
import pytest
import yaml
from tests.estimators.exports.models import detections, lucas_kanade

from tracknoise.estimators.exports import estimators
from tracknoise.tables.enumerations import Trust
from tracknoise.tables.store import RunFolder
from tracknoise.tables.trust import TruthVerdict

TOML = """
name = "small"
[dataset]
reader = "simulated"
[dataset.options]
motions = ["arvr"]
worlds = 2
frames = 3
width = 160
height = 120
supersampling = 1
[[trackers]]
kind = "correspondence"
options = { max_features = 20 }
"""


@pytest.fixture
def file(tmp_path):
    lucas_kanade().write(tmp_path / "lk.noise.json")
    return str(tmp_path / "lk.noise.json")


def test_files_are_printed(tracknoise, file):
    code, out, err = tracknoise("export", file, "--to", "openvins", "--focal", "458.6", "--rate", "20")
    assert (code, err) == (0, "")
    assert "==> openvins_noise.yaml <==\n# tracknoise" in out
    assert "lk.noise.json sha256" in out
    assert "up_msckf_sigma_px: 0.300" in out
    assert "==> openvins.patch <==" in out
    assert "Checked against: rpng/open_vins 6948812" in out


def test_the_source_is_named_as_its_file_is(tracknoise, tmp_path):
    lucas_kanade().write(tmp_path / "lucas-kanade@1.noise.json")
    _, out, _ = tracknoise("export", str(tmp_path / "lucas-kanade@1.noise.json"), "--to", "openvins")
    assert ": lucas-kanade@1.noise.json sha256" in out


def test_or_written(tracknoise, file, tmp_path):
    out = tmp_path / "config"
    code, printed, _ = tracknoise("export", file, "--to", "msckf_vio", "-o", str(out))
    assert code == 0
    assert printed.endswith("\nrate: 20 Hz, that of the model\n")
    assert sorted(path.name for path in out.iterdir()) == ["msckf_vio.patch", "msckf_vio.txt", "msckf_vio_noise.launch"]
    assert all(str(path) in printed for path in out.iterdir())


def test_files_of_another_model_are_not_replaced_unless_that_is_asked_for(tracknoise, file, tmp_path):
    other, out = tmp_path / "other.noise.json", tmp_path / "config"
    detections().write(other)
    export = ("export",), ("--to", "msckf_vio", "-o", str(out))
    assert tracknoise(*export[0], file, *export[1])[0] == 0
    written = {path: path.read_text() for path in out.iterdir()}
    code, _, err = tracknoise(*export[0], str(other), *export[1])
    assert (code, err.count("\n")) == (1, 1)
    assert f"--out {out}: found msckf_vio.txt of another model, expected another folder, or --force" in err
    assert {path: path.read_text() for path in out.iterdir()} == written
    assert tracknoise(*export[0], file, *export[1])[0] == 0, "the same model"
    assert tracknoise(*export[0], str(other), *export[1], "--force")[0] == 0
    assert "other.noise.json sha256" in (out / "msckf_vio.txt").read_text()


def test_files_are_named_by_the_estimator_however_it_is_spelled(tracknoise, file, tmp_path):
    code, _, err = tracknoise("export", file, "--to", "VINS-Mono", "-o", str(tmp_path / "config"))
    assert (code, err) == (0, "")
    names = sorted(path.name for path in (tmp_path / "config").iterdir())
    assert names == ["vins.txt", "vins_mono_noise.cpp"]


def test_the_list_has_those_without_an_export_too(tracknoise):
    code, out, _ = tracknoise("export")
    assert code == 0
    assert "openvins " in out
    assert "Without an export:" in out
    assert "dso " in out


def test_a_run_gives_a_covariance_for_each_observation(tracknoise, tmp_path):
    (tmp_path / "small.toml").write_text(TOML)
    made = tracknoise("run", str(tmp_path / "small.toml"), "-o", str(tmp_path / "run"), "-q", "--no-report", "-w", "1")
    assert made[0] == 0
    run = RunFolder(tmp_path / "run")
    detections().write(tmp_path / "model.json")
    code, _, err = tracknoise(
        "export", str(tmp_path / "model.json"), "--to", "csv", "--tracks", str(run.path), "-o", str(tmp_path)
    )
    assert (code, err) == (0, "")
    found = pl.read_csv(tmp_path / "observations.csv")
    observed = pl.concat(run.sequence_tables("observations"))
    assert len(found) == len(observed)
    assert found["sequence"].unique().sort().to_list() == sorted(run.manifest().sequences)
    assert found["cov_uu"].unique().round(6).to_list() == [0.16]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--to", "openvins", "--focal", "900"), "focal length is 900 px, expected that of the model"),
        (("--to", "openvins", "--rate", "30"), "rate is 30 Hz, expected that of the model, 20 Hz"),
        (("--to", "dso"), "DSO: Its residuals are intensities"),
        (("--to", "openvinz"), "unknown estimator 'openvinz' (did you mean 'openvins'?)"),
        (("--to", "csv"), "no observations, expected tracks"),
        (("--to", "csv", "--tracks", "nowhere.csv"), "nowhere.csv"),
        (("--to", "openvins", "--allow", "anything"), "unknown value of --allow 'anything'"),
        (("--to", "openvins", "--allow", "lens", "--allow", "resampled"), "found resampled and lens, expected one"),
        (("--to", "openvins", "--window", "1"), "--window 1: expected a whole number from 2"),
        (("--to", "openvins", "--focal", "long"), "--focal long: expected a number"),
        (("--to", "openvins", "--speed", "1"), "--speed: found a noise model, expected the option with a run alone"),
        (("--to", "openvins", "--tracks", "runs/demo"), "found --to openvins, expected the option with --to csv alone"),
        ((), "no --to, expected an estimator"),
    ],
)
def test_bad_input_gives_one_line(tracknoise, file, arguments, message):
    code, out, err = tracknoise("export", file, *arguments)
    assert (code, out) == (1, "")
    assert len(err.strip().splitlines()) == 1
    assert message in err


@pytest.mark.parametrize("verdict", ["not trusted", "unknown"])
def test_a_model_from_an_untrusted_truth_is_refused_and_marked_where_it_is_accepted(tracknoise, tmp_path, verdict):
    truth = TruthVerdict(Trust(verdict), "Poses explain 89 %.", "Use other poses.")
    path = tmp_path / "lk.noise.json"
    lucas_kanade(truth=truth).write(path)
    for name, about in estimators().items():
        wanted = ["export", str(path), "--to", name]
        code, out, err = tracknoise(*wanted)
        assert (code, out) == (1, "")
        assert f"Truth: {verdict}. Poses explain 89 %. Next: Use other poses." in err
        assert "--allow untrusted" in err
        if "observations" in about.needs:
            continue
        code, out, _ = tracknoise(
            *wanted, "--allow", "untrusted", "--focal", "458.6", "--rate", "20", "-o", str(tmp_path / name)
        )
        assert code == 0, name
        for written in (tmp_path / name).iterdir():
            assert f"{verdict}" in written.read_text(), written


def test_a_fragment_can_be_pasted_and_says_nothing_of_a_trusted_truth(tracknoise, file, tmp_path):
    tracknoise("export", file, "--to", "openvins", "-o", str(tmp_path / "config"))
    text = (tmp_path / "config/openvins_noise.yaml").read_text()
    comments, keys = ([line for line in text.splitlines() if line.startswith("#") is own] for own in (True, False))
    assert max(map(len, comments)) <= 120
    assert "Truth" not in text
    assert list(yaml.safe_load("max_slam: 50\n" + text)) == ["max_slam", *(line.split(":")[0] for line in keys)]
