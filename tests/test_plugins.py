"""Other packages' trackers and readers, found by their entry points and used as those of the package are."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import KW_ONLY, dataclass, field, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import polars as pl
import pytest
from tests.lean import measured_by_command, without_figure_files

import tracknoise as tn
from tracknoise.cli.app import main
from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.experiments.load import load_experiment
from tracknoise.experiments.plan import plan
from tracknoise.experiments.resume import due
from tracknoise.experiments.settings import parse_experiment
from tracknoise.options import DataPath, PathTemplate, change_paths, find_paths
from tracknoise.plugins import Plugins, plugin_defaults
from tracknoise.report.page import write_report
from tracknoise.sequences.reader_registry import READERS
from tracknoise.tables.schema import TRUE_COVARIANCE
from tracknoise.tables.store import RunFolder
from tracknoise.trackers.tracker_registry import TRACKERS

FOREIGN = Path(__file__).parent / "foreign" / "tapes.py"


@pytest.fixture
def plugins(tmp_path, monkeypatch):
    """A group to which an installed package adds one class that can be loaded, and what cannot be used."""
    decorated = "@dataclass\nclass {}:\n    description = 'does little'\n"
    (tmp_path / "foreign_trackers.py").write_text(
        "from dataclasses import dataclass\nnumber = 5\nclass Plain:\n    kind = 'plain'\n    description = 'x'\n"
        + decorated.format("Foreign")
        + "    kind = 'foreign'\n"
        + decorated.format("Unnamed")
    )
    info = tmp_path / "foreign_trackers-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: foreign-trackers\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[tracknoise.test]\nforeign = foreign_trackers:Foreign\nbroken = foreign_trackers:Missing\n"
        "number = foreign_trackers:number\nplain = foreign_trackers:Plain\nunnamed = foreign_trackers:Unnamed\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    needs = ("kind", "description")
    yield Plugins(what="thing", group="tracknoise.test", built_in={"own": "fractions:Fraction"}, needs=needs)
    sys.modules.pop("foreign_trackers", None)


def test_own_and_foreign_names_are_known(plugins):
    assert plugins.names() == ["broken", "foreign", "number", "own", "plain", "unnamed"]


def test_a_foreign_class_is_loaded(plugins):
    assert plugins.load("foreign").kind == "foreign"
    assert plugins.load("own").__name__ == "Fraction"


def test_a_foreign_class_that_cannot_be_loaded_is_named(plugins):
    with pytest.raises(SettingsError, match="thing 'broken': foreign_trackers:Missing cannot be loaded"):
        plugins.load("broken")


def test_an_unknown_name_lists_the_known_ones(plugins):
    with pytest.raises(UnknownNameError, match=r"unknown thing 'foriegn' \(did you mean 'foreign'\?\)"):
        plugins.load("foriegn")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("number", "thing 'number': found 5, expected a dataclass$"),
        ("plain", r"thing 'plain': found <class .*Plain'>, expected a dataclass$"),
        ("unnamed", r"thing 'unnamed': found <class .*> without kind, expected one with kind, description$"),
    ],
)
def test_what_is_no_such_class_is_refused(plugins, name, message):
    for ask in (plugins.load, plugins.make, lambda name: plugin_defaults(plugins, name)):
        with pytest.raises(SettingsError, match=message):
            ask(name)


def test_what_cannot_be_used_is_listed_with_the_others(plugins):
    listed = replace(plugins, built_in={}).descriptions()
    assert listed["foreign"] == "does little"
    assert listed["number"] == "cannot be used: thing 'number': found 5, expected a dataclass"
    assert sorted(listed) == ["broken", "foreign", "number", "plain", "unnamed"]


def test_the_version_of_the_package_that_offers_a_name_is_known(plugins):
    assert plugins.versions("foreign") == {"foreign-trackers": "1.0"}
    assert plugins.versions("own") == plugins.versions("unknown") == {}


TEMPLATE = PathTemplate("{scene}.csv")


@dataclass(frozen=True, slots=True)
class Weights:
    file: Path = Path("weights.bin")
    scale: float = 1.0


@dataclass(frozen=True, slots=True)
class Learned:
    """Settings with paths in every place where there can be some."""

    kind: ClassVar[str] = "learned"

    root: Path
    _: KW_ONLY
    label: str = "plain"
    tracks: PathTemplate = TEMPLATE
    masks: tuple[Path, ...] = ()
    weights: Weights = field(default_factory=Weights)
    fallback: Weights | None = None
    cache: Path | None = None


@pytest.fixture
def learned(monkeypatch) -> Plugins[Learned]:
    monkeypatch.setitem(sys.modules, "learned", sys.modules[__name__])
    return Plugins(what="tracker", group="none", built_in={"learned": "learned:Learned"}, given=frozenset({"root"}))


OPTIONS = {
    "label": "a/b",
    "tracks": "out/{scene}.csv",
    "masks": ["m0.png", "m1.png"],
    "weights": {"file": "w.bin", "scale": 2.0},
    "fallback": {"file": "f.bin"},
    "cache": "c",
}


def test_paths_are_found_from_the_types_of_the_fields():
    paths = find_paths(Learned, OPTIONS)
    assert [str(path) for path in paths] == ["out/{scene}.csv", "m0.png", "m1.png", "w.bin", "f.bin", "c"]
    assert [isinstance(path, Path) for path in paths] == [False, True, True, True, True, True]


def test_paths_are_replaced_and_nothing_else():
    changed = change_paths(Learned, {**OPTIONS, "unknown": "x", "cache": 3}, lambda path: f"/there/{path}")
    assert changed == {
        "label": "a/b",
        "tracks": "/there/out/{scene}.csv",
        "masks": ["/there/m0.png", "/there/m1.png"],
        "weights": {"file": "/there/w.bin", "scale": 2.0},
        "fallback": {"file": "/there/f.bin"},
        "cache": 3,
        "unknown": "x",
    }
    assert OPTIONS["cache"] == "c"


@dataclass(frozen=True, slots=True)
class Recorded:
    images: DataPath | None = None
    others: tuple[DataPath, ...] = ()


def test_paths_that_start_from_the_data_stay_and_are_found_there():
    options = {"images": "a", "others": ["b", "/c"]}
    assert change_paths(Recorded, options, lambda path: f"/there/{path}") == options
    assert find_paths(Recorded, options, Path("/data")) == [Path("/data/a"), Path("/data/b"), Path("/c")]


def test_all_kinds_of_fields_are_made(learned):
    made = learned.make("learned", OPTIONS, given={"root": Path("data")})
    assert made == Learned(
        Path("data"),
        label="a/b",
        tracks=PathTemplate("out/{scene}.csv"),
        masks=(Path("m0.png"), Path("m1.png")),
        weights=Weights(Path("w.bin"), 2.0),
        fallback=Weights(Path("f.bin")),
        cache=Path("c"),
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fallback": {"scale": 1.0, "fiel": "x"}}, r"fallback.fiel: unknown setting \(did you mean 'file'"),
        ({"fallback": {"fil": "x"}}, r"fallback.fil: unknown setting \(did you mean 'file'\?\); known: file, scale$"),
        ({"root": "x"}, "root: unknown setting; known: cache, fallback, label, masks, tracks, weights$"),
        ({"masks": "m0.png"}, "masks: expected a valid array, found 'm0.png'$"),
        ({"cache": 3}, "cache: expected .*, found 3$"),
        ({"weights": {"scale": "2"}}, "weights.scale: expected a valid number, found '2'$"),
    ],
)
def test_wrong_options_are_named(learned, options, message):
    with pytest.raises(SettingsError, match=f"^tracker 'learned': {message}"):
        learned.make("learned", options, given={"root": Path("data")})


def test_a_missing_field_is_named(learned):
    with pytest.raises(SettingsError, match=r"^tracker 'learned': root: missing, expected a value$"):
        learned.make("learned")


def test_defaults_are_shown_without_what_is_no_option(learned):
    assert plugin_defaults(learned, "learned") == "\n".join(
        [
            "# fallback = ... (optional)",
            "# cache = ... (optional)",
            'label = "plain"',
            'tracks = "{scene}.csv"',
            "masks = []",
            "",
            "[weights]",
            'file = "weights.bin"',
            "scale = 1.0",
        ]
    )


@pytest.fixture
def lean() -> Iterator[None]:
    """Runs are measured, and nothing is computed of them."""
    with measured_by_command():
        yield


@pytest.fixture
def installed(tmp_path, monkeypatch) -> Iterator[None]:
    """The package of `tests/foreign` is installed: its module, and a ``dist-info`` with its entry points."""
    info = tmp_path / "site" / "tapes-1.0.dist-info"
    info.mkdir(parents=True)
    shutil.copy(FOREIGN, tmp_path / "site" / "tapes.py")
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: tapes\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[tracknoise.sequences]\ntape = tapes:Tape\n[tracknoise.trackers]\nfixed = tapes:Fixed\n"
        "[tracknoise.truths]\nstated = tapes:Stated\n"
    )
    monkeypatch.syspath_prepend(tmp_path / "site")
    yield
    sys.modules.pop("tapes", None)


@pytest.fixture
def experiment(tmp_path, installed) -> Path:
    """An experiment of the package's reader and tracker, with all that they read."""
    rng = np.random.default_rng(0)
    (tmp_path / "data").mkdir()
    frames = {f"image{index}": rng.integers(0, 200, (48, 64), dtype=np.uint8) for index in range(4)}
    frames |= {f"depth{index}": np.full((48, 64), 2.0) for index in range(4)}
    np.savez(tmp_path / "data" / "a.npz", poses=np.broadcast_to(np.eye(4), (4, 4, 4)), times=np.arange(4.0), **frames)
    (tmp_path / "brightness.txt").write_text("50")
    np.savetxt(tmp_path / "points.txt", rng.uniform(5, 40, (20, 2)))
    file = tmp_path / "experiment.toml"
    file.write_text(
        'name = "tapes"\n[dataset]\nreader = "tape"\nroot = "data"\noptions = { brightness = "brightness.txt" }\n'
        '[[trackers]]\nkind = "fixed"\noptions = { points = "points.txt" }\n[statistics]\nmin_features = 2\n'
    )
    return file


def run(experiment: Path) -> tuple[int, RunFolder]:
    out = experiment.parent / "run"
    with pytest.raises(SystemExit) as ended:
        main(["run", str(experiment), "--out", str(out), "--workers", "1", "--quiet", "--no-report"])
    return int(ended.value.code or 0), RunFolder(out)


def test_a_foreign_reader_is_listed_and_opened(experiment):
    assert "tape" in READERS.names()
    assert "fixed" in TRACKERS.names()
    sequence = tn.open_sequence("tape", experiment.parent / "data", brightness=experiment.parent / "brightness.txt")
    assert (sequence.id.dataset, sequence.id.scene, len(sequence)) == ("tape", "a", 4)
    assert sequence.image(2).min() >= 50
    assert sequence.timestamps_s.tolist() == [0.0, 1.0, 2.0, 3.0]
    with pytest.raises(SettingsError, match=r"reader 'tape': brightnes: unknown setting \(did you mean 'brightness'"):
        tn.open_sequence("tape", experiment.parent / "data", brightnes="x")
    assert plugin_defaults(TRACKERS, "fixed").splitlines()[0] == "# points = ... (required)"
    assert "most" not in plugin_defaults(TRACKERS, "fixed")


@pytest.mark.usefixtures("lean")
def test_files_of_foreign_options_readers_and_code_are_inputs(experiment, restored):
    """Options are named relative to the experiment file."""
    folder = experiment.parent
    code, data = folder / "site" / "tapes.py", folder / "data" / "a.npz"
    assert run(experiment)[0] == 0
    assert measured_again(experiment) == []
    with np.load(data) as tape:
        other = {**tape, "image3": tape["image2"]}
    for file, write in (
        (folder / "points.txt", lambda: (folder / "points.txt").write_text("7 8\n9 10\n")),
        (folder / "brightness.txt", lambda: (folder / "brightness.txt").write_text("20")),
        (data, lambda: np.savez(data, **other)),
    ):
        with restored(file):
            write()
            assert measured_again(experiment) == [f"a@default is measured again: {file} changed"]
        assert measured_again(experiment) == []
    code.write_text(code.read_text() + "\n")
    said = said_by_a_new_process(experiment)
    assert said == "a@default is measured again: the source file tapes.py of a plug-in changed"


@pytest.fixture
def restored() -> Callable[[Path], AbstractContextManager[None]]:
    """A file that is as it was before, when the block ends."""

    @contextmanager
    def kept(file: Path) -> Iterator[None]:
        content, times = file.read_bytes(), file.stat()
        yield
        file.write_bytes(content)
        os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))

    return kept


NEXT_START = """
import sys
from pathlib import Path

from tracknoise.experiments.load import load_experiment
from tracknoise.experiments.plan import plan
from tracknoise.experiments.resume import due
from tracknoise.tables.store import RunFolder

folder = RunFolder(Path(sys.argv[2]))
due(plan(load_experiment(Path(sys.argv[1]))), folder, folder.manifest(), verify=False, remark=print)
"""


def measured_again(experiment: Path) -> list[str]:
    """What the next start would say about input files."""
    folder, said = RunFolder(experiment.parent / "run"), []
    due(plan(load_experiment(experiment)), folder, folder.manifest(), verify=False, remark=said.append)
    return said


def said_by_a_new_process(experiment: Path) -> str:
    """What the next start in a new process, which loads the code of a package anew, would say about input files."""
    site, out = str(experiment.parent / "site"), str(experiment.parent / "run")
    done = subprocess.run(
        [sys.executable, "-c", NEXT_START, str(experiment), out],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([site, os.environ.get("PYTHONPATH", "")])},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


COMPILED = """

import cv2
from dataclasses import fields, replace
from functools import partial


class Stating(RecordedSequence):
    @property
    def files(self):
        return [Path(self.source), Path(self.source).parent / "a" / "2.png"]


def _image(folder, index):
    return cv2.imread(str(folder / f"{index}.png"), cv2.IMREAD_GRAYSCALE)


def _compiled(reader, sequence, opened=Tape.open):
    (reader.root / "a").mkdir(exist_ok=True)
    found = opened(reader, sequence)
    for index in range(len(found)):
        if not (reader.root / "a" / f"{index}.png").exists():
            cv2.imwrite(str(reader.root / "a" / f"{index}.png"), found.image(index))
    LISTED
    return replace(found, images=partial(_image, reader.root / "a"), depths=found.depths)


Tape.open = _compiled
"""


STATES = "found = Stating(**{each.name: getattr(found, each.name) for each in fields(found)})"


@pytest.mark.usefixtures("lean")
@pytest.mark.parametrize("listed", ["sorted((reader.root / 'a').iterdir())", "pass", STATES])
def test_files_that_only_compiled_code_opens_are_inputs_too(experiment, restored, listed):
    """Python does not see what `cv2.imread` opens. A sequence that states its files depends on no other image."""
    code, image = experiment.parent / "site" / "tapes.py", experiment.parent / "data" / "a" / "2.png"
    code.write_text(code.read_text() + COMPILED.replace("LISTED", listed))
    assert run(experiment)[0] == 0
    assert measured_again(experiment) == []
    with restored(image.parent / "3.png"):
        (image.parent / "3.png").write_bytes((image.parent / "1.png").read_bytes())
        assert bool(measured_again(experiment)) is (listed != STATES)
    assert measured_again(experiment) == []
    image.write_bytes((image.parent / "1.png").read_bytes())
    assert measured_again(experiment) == [f"a@default is measured again: {image} changed"]


@pytest.mark.usefixtures("lean")
def test_code_that_changed_after_it_was_loaded_is_refused(experiment, capsys):
    """As in a worker that runs for days: its results would pass for those of the new code."""
    assert run(experiment)[0] == 0
    code = experiment.parent / "site" / "tapes.py"
    code.write_text(code.read_text() + "\n")
    status, _ = run(experiment)
    assert status == 1
    assert f"{code}: changed since this process loaded it, expected a new process" in capsys.readouterr().err


@pytest.mark.usefixtures("lean")
def test_a_run_uses_a_foreign_reader_and_tracker_and_is_resumed_with_their_version_only(experiment, capsys):
    status, folder = run(experiment)
    assert status == 0
    manifest = folder.manifest()
    assert manifest.versions["tapes"] == "1.0"
    (entry,) = manifest.sequences.values()
    assert entry.notes == ("frames come from an archive",)
    observations = folder.sequence_table("observations", entry.key)
    assert observations["tracker"].unique().to_list() == ["fixed"]
    assert observations.height == 4 * 20
    assert observations.filter(pl.col("age") > 0)["du_px"].abs().max() == pytest.approx(0.0, abs=1e-9)

    manifest.versions["tapes"] = "0.9"
    folder.write_manifest(manifest)
    shutil.copy(experiment.parent / "data" / "a.npz", experiment.parent / "data" / "b.npz")
    status, folder = run(experiment)
    assert status == 1
    assert "tapes 1.0 is installed, expected 0.9 as the run was begun with" in capsys.readouterr().err
    assert list(folder.manifest().sequences) == [entry.key]


def test_a_run_uses_a_foreign_truth_and_keeps_its_covariance(experiment):
    experiment.write_text(experiment.read_text() + '[truth]\nkind = "stated"\n')
    status, folder = run(experiment)
    assert status == 0
    (entry,) = folder.manifest().sequences.values()
    assert (entry.truth, entry.key_frame) == ("stated", None)
    observations = folder.sequence_table("observations", entry.key)
    assert observations.select(*TRUE_COVARIANCE).unique().rows() == [(0.25, 0.0, 0.25)]
    with without_figure_files():
        page = " ".join(write_report(folder).read_text(encoding="utf-8").split())
    assert "<td>stated</td>" in page
    assert "Poses, depth and calibration of this data are recorded." in page


def test_settings_within_settings_may_be_missing(experiment):
    """A file has no word for a value that is None: it is left out, and the default is used when it is read again."""
    text = load_experiment(experiment).to_toml()
    assert "most" not in text
    assert parse_experiment(text, place="again") == load_experiment(experiment)
    assert TRACKERS.make("fixed", {"points": "x", "limits": {"least": 2}}).limits.most is None


@dataclass(frozen=True, slots=True)
class Boundless:
    """A tracker whose quality and response are not always finite."""

    kind: ClassVar[str] = "boundless"

    def start(self, context):
        tracker = tn.LucasKanade().start(context)
        step = tracker.step

        class Steps:
            def step(self, frame):
                found = step(frame)
                values = np.resize(np.float32([np.inf, np.nan, 0.5, -np.inf]), len(found.ids))
                return replace(found, response=values, quality={"ratio": values})

        return Steps()


def test_numbers_of_a_tracker_that_are_not_finite_are_unknown():
    sequence = tn.open_sequence("simulated", motions=["forward"], frames=3, width=96, height=72, supersampling=1)
    measured = tn.measure(sequence, Boundless())
    for values in (measured.observations["quality_ratio"], measured.tracks["response"]):
        assert values.drop_nulls().unique().to_list() == [0.5]
        assert values.null_count() > 0
