"""Runs that were measured before trackers had an option."""

import pytest

from tracknoise.exceptions import StoreError
from tracknoise.experiments.execute import execute
from tracknoise.experiments.load import load_experiment
from tracknoise.tables.store import RunFolder

pytestmark = pytest.mark.usefixtures("lean")
DETECTOR = 'detector = "agast"\n'


@pytest.fixture
def earlier(experiment_file, tmp_path, told):
    """A run whose settings lack the detector, and its experiment file."""
    file = experiment_file(1)
    file.write_text(
        file.read_text().replace(
            'kind = "oracle"\noptions = { n_features = 20, margin_px = 2 }', 'kind = "lucas-kanade"'
        )
    )
    run = RunFolder(tmp_path / "run")
    execute(load_experiment(file), run, listener=told())
    manifest, text = run.manifest(), run.experiment_toml()
    assert DETECTOR in text
    run.replace_experiment(text.replace(DETECTOR, ""), manifest)
    run.write_manifest(manifest)
    return run, file


def test_a_run_from_before_an_option_is_resumed_with_its_default(earlier, told):
    run, file = earlier
    listener = told()
    execute(load_experiment(file), run, listener=listener)
    assert (listener.done, listener.keys) == (1, [])


def test_it_is_not_resumed_with_another_value(earlier, told):
    run, file = earlier
    other = file.read_text().replace(
        'kind = "lucas-kanade"', 'kind = "lucas-kanade"\noptions = { detection = { detector = "fast" } }'
    )
    file.write_text(other)
    with pytest.raises(StoreError, match=r"detection\.detector = 'agast', expected 'fast'"):
        execute(load_experiment(file), run, listener=told())
