"""A run that is made of the observations of another equals one that was measured with its settings."""

from pathlib import Path

import pytest

from tracknoise.exceptions import SettingsError, StoreError
from tracknoise.experiments.execute import execute, remake
from tracknoise.experiments.load import resolve
from tracknoise.experiments.settings import Experiment, parse_experiment
from tracknoise.tables.enumerations import TrimAmong, Trimming
from tracknoise.tables.findings_schema import TRIMS
from tracknoise.tables.store import OBSERVED, RunFolder

TEXT = """
name = "small"
speeds = [1, 2]
[dataset]
reader = "simulated"
[dataset.options]
motions = ["sideways"]
frames = 5
width = 120
height = 90
supersampling = 1
[[views]]
[[views]]
direction = "backward"
speeds = [1]
[[trackers]]
kind = "lucas-kanade"
[statistics]
min_features = 5
trim_among = "all"
[findings]
trimming = "trimmed"
"""


def with_settings(experiment: Experiment, section: str, **changes: object) -> Experiment:
    return experiment.model_copy(update={section: getattr(experiment, section).model_copy(update=changes)})


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return resolve(parse_experiment(TEXT, place="small.toml"))


@pytest.fixture(scope="module")
def measured(experiment: Experiment, tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    run = RunFolder(tmp_path_factory.mktemp("measured") / "run")
    assert len(execute(experiment, run, listener=Quiet()).measured) == 2
    return run


class Quiet:
    """Listens to a run."""

    def planned(self, keys: list[str], done: int) -> None: ...

    def frame(self, key: str, done: int, total: int, first: int) -> None: ...

    def measured(self, key: str, entry: object) -> None: ...

    def failed(self, keys: list[str], cause: str) -> None: ...

    def remark(self, text: str) -> None: ...


def test_it_equals_a_measured_run(experiment: Experiment, measured: RunFolder, tmp_path: Path) -> None:
    changed = with_settings(experiment, "statistics", trim_among=TrimAmong.followed, trim_percentile=60.0)
    changed = with_settings(changed, "findings", trimming=Trimming.untrimmed)
    direct, remade = RunFolder(tmp_path / "direct"), RunFolder(tmp_path / "remade")
    execute(changed, direct, listener=Quiet())
    remake(measured, changed, remade)
    assert remade.experiment_toml() == direct.experiment_toml()
    expected, found = direct.manifest(), remade.manifest()
    assert {key: entry.sha256 for key, entry in found.sequences.items()} == {
        key: entry.sha256 for key, entry in expected.sequences.items()
    }
    assert found.statistics == expected.statistics
    assert found.statistics != measured.manifest().statistics


def test_a_run_that_was_remade_is_replaced_and_may_keep_statistics_alone(
    experiment: Experiment, measured: RunFolder, tmp_path: Path
) -> None:
    folder = RunFolder(tmp_path / "remade")
    small = experiment.model_copy(update={"keep": "statistics"})
    for changed in (small, with_settings(small, "statistics", trim_among=TrimAmong.followed)):
        remake(measured, changed, folder)
        assert not set(OBSERVED) & set(folder.names_of_tables("sideways-00@default"))
        assert set(folder.statistics(TRIMS)["among"]) == {changed.statistics.trim_among}
    with pytest.raises(StoreError, match="keeps no observations"):
        remake(folder, experiment, RunFolder(tmp_path / "again"))


def test_other_seeds_cannot_be_trimmed_again(experiment: Experiment, measured: RunFolder, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="observations of one seed"):
        remake(measured, experiment.model_copy(update={"seeds": 3}), RunFolder(tmp_path / "seeds"))
