"""Files of a run that were changed by something other than a run."""

import pytest

from tracknoise.exceptions import StoreError
from tracknoise.experiments.execute import execute
from tracknoise.report.report_data import ReportData


def edit(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_edited_settings_do_not_make_a_run_that_of_another_experiment(finished, told, files):
    experiment, run = finished(2)
    before = files(run)
    other = experiment.model_copy(update={"seed": experiment.seed + 1})
    edit(run.path / "experiment.toml", f"seed = {experiment.seed}", f"seed = {other.seed}")
    with pytest.raises(StoreError, match=r"experiment\.toml: damaged .*the same experiment writes them again"):
        execute(other, run, listener=told())
    with pytest.raises(StoreError, match=r"experiment\.toml: damaged"):
        ReportData.of(run)
    listener = told()
    execute(experiment, run, listener=listener)
    assert listener.keys == []
    assert any("experiment.toml: damaged" in text for text in listener.remarks)
    assert files(run) == before


def test_missing_settings_are_written_again(finished, told, files):
    experiment, run = finished(2)
    before = files(run)
    (run.path / "experiment.toml").unlink()
    execute(experiment, run, listener=told())
    assert files(run) == before


def test_a_damaged_manifest_is_replaced_by_a_fresh_start_alone(finished, told, files):
    experiment, run = finished(2)
    before = files(run)
    edit(run.path / "manifest.json", '"sequences"', '"sequencez"')
    with pytest.raises(StoreError, match=r"manifest\.json: damaged .*measure again with --fresh"):
        execute(experiment, run, listener=told())
    execute(experiment, run, listener=told(), fresh=True)
    assert files(run) == before


@pytest.mark.usefixtures("found")
def test_edited_findings_are_noticed_and_made_again(finished, told, files):
    experiment, run = finished(2)
    path = run.path / "statistics" / "findings.json"
    before = path.read_bytes()
    edit(path, '"format": ', '"format": 1')
    with pytest.raises(StoreError, match=r"findings\.json: damaged .*`tracknoise run` makes it again"):
        ReportData.of(run)
    execute(experiment, run, listener=told())
    assert path.read_bytes() == before
