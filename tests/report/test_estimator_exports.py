"""What the page offers for each estimator is what the command line writes."""

import base64
import json
import zlib
from types import SimpleNamespace
from typing import Any

import pytest

from tracknoise.cli.app import main
from tracknoise.estimators.exports import Target, estimators, refused
from tracknoise.estimators.run_models import RunModels, run_models
from tracknoise.report.estimator_exports import Exports, exported, exports
from tracknoise.report.settings_picker import Picker
from tracknoise.report.templates import template
from tracknoise.tables.store import RunFolder
from tracknoise.words import pixels, px


@pytest.fixture(scope="module")
def fits(fitted_run: RunFolder) -> RunModels:
    return run_models(fitted_run)


@pytest.fixture(scope="module")
def content(fits: RunModels) -> dict[str, dict[str, Any]]:
    return exported(fits.models["oracle"], fits.paths["oracle"])


def test_every_estimator_has_an_export_or_a_reason(content: dict[str, dict[str, Any]]) -> None:
    assert list(content) == [*estimators(), *refused()]
    without = {name: one["why"] for name, one in content.items() if "files" not in one}
    assert set(without) == {"rovio", "csv", *refused()}
    assert "no rate" in without["rovio"]
    assert without["dso"] == refused()["dso"].why


def test_files_are_those_of_the_command_line(
    content: dict[str, dict[str, Any]], fitted_run: RunFolder, tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(fitted_run.path)
    with pytest.raises(SystemExit) as exit_:
        main(["export", "statistics/noise/oracle@1.noise.json", "--to", "openvins", "-o", str(tmp_path)])
    assert exit_.value.code == 0
    written = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert written == {**dict(content["openvins"]["files"]), "openvins.txt": content["openvins"]["text"]}


def test_the_shown_command_writes_what_the_page_cannot(
    content: dict[str, dict[str, Any]],
    fitted_run: RunFolder,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(fitted_run.path)
    name, *arguments = content["rovio"]["command"].replace("HZ", "20").split()
    assert name == "tracknoise"
    with pytest.raises(SystemExit) as exit_:
        main(arguments)
    assert exit_.value.code == 0
    assert "UpdateNoise" in capsys.readouterr().out
    assert "command" not in content["dso"]


def picker(fits: RunModels, first: str = "gtsam") -> Picker:
    return Picker(fits.models, {"oracle": "#000000"}, are_bounds=False, first=first, target=Target(), board=None)


def test_the_page_holds_all_exports(fits: RunModels, content: dict[str, dict[str, Any]]) -> None:
    made = exports(picker(fits), missing=fits.missing, paths=fits.paths)
    unpacked = json.loads(zlib.decompress(base64.b64decode(made.packed)))
    assert unpacked["files"] == {"oracle": json.loads(json.dumps(content))}
    assert made.trackers == ("oracle",)
    assert [name for choice in made.choices for name in choice.estimators] == [*estimators(), *refused()]
    assert made.first in estimators()
    assert len(made.packed) < 60_000


@pytest.mark.parametrize("name", ["filter", "openvins", "gtsam", "colmap", "xivo", "pnp", "kimera"])
def test_what_is_picked_is_what_each_estimator_is_advised(fits: RunModels, name: str) -> None:
    found, model = picker(fits).choices(), fits.models["oracle"]
    first, *others = found["settings"][found["kinds"][name]]
    assert first["window"] == estimators()[name].advise(model).window
    for entry, features in ((first, None), *((other, other["features"]) for other in others)):
        for window, words in entry["windows"].items():
            advice = estimators()[name].advise(model, window=window, features=features)
            sigma, interval, limit, _ = words["rows"]["oracle"]
            assert (sigma, interval.partition(" ")[0]) == (px(advice.sigma.value), pixels(advice.sigma.low))
            assert bool(limit) == bool(advice.gates or advice.knee)
            assert sigma in words["heading"]


def test_estimators_that_take_components_have_nothing_to_pick(fits: RunModels) -> None:
    kinds = picker(fits).choices()["kinds"]
    assert set(estimators()) - set(kinds) == {"rovio", "csv", "json"}


def test_a_choice_is_the_name_of_the_tracker_as_it_is() -> None:
    """The text of an option loses repeated spaces, and its exports would not be found."""
    shown = Exports(trackers=("two  <words>",), missing={}, choices=(), packed="", first="filter")
    summary = SimpleNamespace(measured="", certainty=SimpleNamespace(text=""))
    page = template("sections/estimator.html.j2").render(
        noise_exports=shown, data=SimpleNamespace(slowest=1), summary=summary, picture=None
    )
    assert '<option value="two  &lt;words&gt;">' in page
