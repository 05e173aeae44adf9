"""Experiment files: what is read, and what is said about what cannot be."""

import json
import os
import re
import time
import tomllib
from dataclasses import fields
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.experiments.load import load_experiment, preset_names, resolve
from tracknoise.experiments.plan import plan
from tracknoise.experiments.settings import experiment_schema, parse_experiment
from tracknoise.sequences.reader_registry import READERS
from tracknoise.trackers.tracker_registry import TRACKERS, make_tracker

ROOT = Path(__file__).parents[2]

MINIMAL = """
name = "x"
[dataset]
reader = "simulated"
[[trackers]]
kind = "lucas-kanade"
"""


def test_defaults_are_those_of_the_paper():
    experiment = parse_experiment(MINIMAL, place="x.toml")
    assert experiment.speeds == [1]
    assert experiment.statistics.trim_percentile == 90
    assert experiment.statistics.min_features == 100


def test_resolved_settings_read_back_as_the_same_experiment():
    experiment = parse_experiment(MINIMAL + '[truth]\nkind = "raycast"\n', place="x.toml")
    assert parse_experiment(experiment.to_toml(), place="again") == experiment
    assert parse_experiment(experiment.to_toml(), place="again").digest() == experiment.digest()


@pytest.mark.parametrize("text", ["verify = true\n", 'check = "mine.check.json"\n'])
def test_digest_ignores_what_no_number_depends_on(text):
    one, other = (parse_experiment(before + MINIMAL, place="") for before in ("", text))
    assert one != other
    assert one.digest() == other.digest()
    assert one.with_findings_of(other) == other


def test_digest_ignores_where_the_data_lie_and_nothing_else():
    one, other = (parse_experiment(MINIMAL, place="").with_root(root) for root in (None, Path("/data")))
    assert one.digest() == other.digest()
    assert one.digest() != parse_experiment("seed = 1\n" + MINIMAL, place="").digest()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("spedes = [1]\n" + MINIMAL, "x.toml: unknown key 'spedes' (did you mean 'speeds'?)"),
        (MINIMAL + "[statistics]\ntrim_percentle = 80\n", "did you mean 'trim_percentile'?"),
        (MINIMAL + "[statistics]\ntrim_percentle = 80\n", "(in section 'statistics')"),
        (
            MINIMAL + "colour = 1\n",
            "unknown key 'colour'; known: kind, name, options, preset (in section 'trackers[0]')",
        ),
        ('speeds = [1, "fast"]\n' + MINIMAL, "x.toml: speeds[1]: found 'fast', expected a valid integer"),
        ("speeds = [0]\n" + MINIMAL, "x.toml: speeds[0]: found 0, expected greater than or equal to 1"),
        ("speeds = 3\n" + MINIMAL, "x.toml: speeds: found 3, expected a valid list"),
        ("seed = true\n" + MINIMAL, "x.toml: seed: found True, expected a valid integer"),
        ("speeds = [2, 2]\n" + MINIMAL, "x.toml: speeds must differ, found [2, 2]"),
        (MINIMAL + '[[trackers]]\nkind = "lucas-kanade"\n', "x.toml: trackers need different names"),
        (MINIMAL.replace('name = "x"', ""), "x.toml: name: missing"),
        (MINIMAL + "[truth]\nkind = 3\n", "x.toml: truth.kind: found 3, expected a valid string"),
        (MINIMAL + "[truth]\nkind = \n", "x.toml: Invalid value"),
        (MINIMAL.replace("[[", "frames = [9, 3]\n[["), "x.toml: dataset.frames: frames = [9, 3], expected first, last"),
        (
            MINIMAL.replace("[[", 'frames = "few"\n[['),
            "x.toml: dataset.frames: frames = few: expected a number from 2, or FIRST:LAST or FIRST:LAST:STEP",
        ),
        (MINIMAL.replace("[[", 'frames = "9:3"\n[['), "x.toml: dataset.frames: frames = [9, 3], expected first, last"),
        (MINIMAL.replace("[[", "frames = 9\n[["), "x.toml: dataset.frames: found 9, expected a valid list"),
        (
            MINIMAL.replace('"x"', '"../x"'),
            "x.toml: name: found '../x', expected a name without / and \\ that is not all dots",
        ),
        (MINIMAL.replace('"x"', '".."'), "x.toml: name: found '..', expected a name without"),
        ("speeds = []\n" + MINIMAL, "x.toml: speeds: found [], expected at least 1 value"),
        (MINIMAL + "[truth.corrections]\nprincipal_point_px = [1, 2, 3]\n", "expected at most 2 values"),
        (MINIMAL.replace("[[", "root = 1\n[["), "x.toml: dataset.root: found 1, expected a path"),
        (MINIMAL + 'name = ""\n', "x.toml: trackers[0].name: found '', expected a text that is not empty"),
        (
            MINIMAL + "[truth.accuracy]\nrotation_deg_per_sqrt_frames = 0.03\n",
            "(did you mean 'rotation_deg_per_sqrt_frame'?); known: clock_ms, ",
        ),
        (MINIMAL + "[truth.corrections]\ndepht_scale = 1.0\n", "(did you mean 'depth_scale'?)"),
        (MINIMAL + "[truth.second]\ntrajektory = 'a'\n", "(did you mean 'trajectory'?)"),
        (MINIMAL.replace("reader =", "raeder ="), "unknown key 'raeder' (did you mean 'reader'?)"),
        (MINIMAL.replace("reader =", "raeder ="), "(in section 'dataset')"),
    ],
)
def test_mistakes_name_file_key_found_and_expected(text, message):
    with pytest.raises(SettingsError, match=re.escape(message)) as caught:
        parse_experiment(text, place="x.toml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (MINIMAL + 'name = "a\\u001b[31m"\n', r"x.toml: trackers[0].name: found 'a\x1b[31m', expected UTF-8 without"),
        (MINIMAL.replace('"x"', '"x\\ny"'), r"x.toml: name: found 'x\ny', expected UTF-8 without control characters"),
        (MINIMAL + 'options = { "a\\u0001" = 1 }\n', "expected UTF-8 without control characters"),
        (MINIMAL.replace("[[", 'scenes = ["a", "b\\u202e"]\n[['), r"dataset.scenes: found ['a', 'b\u202e'], expected"),
    ],
)
def test_control_characters_are_refused(text, message):
    with pytest.raises(SettingsError, match=re.escape(message)):
        parse_experiment(text, place="x.toml")


@pytest.mark.parametrize("root", ["/da\nta", "/data\udcff"])
def test_a_folder_that_cannot_be_recorded_is_refused(root):
    experiment = parse_experiment(MINIMAL, place="x.toml").with_root(Path(root))
    with pytest.raises(SettingsError, match=r"dataset\.root: found .*, expected UTF-8 without control characters"):
        resolve(experiment)


def test_an_unknown_kind_of_truth_lists_the_known_ones():
    experiment = parse_experiment(MINIMAL + '[truth]\nkind = "raycats"\n', place="x.toml")
    expected = r"^truth\.kind: unknown kind of truth 'raycats' \(did you mean 'raycast'\?\); known: birth"
    with pytest.raises(SettingsError, match=expected):
        resolve(experiment)


def test_neither_file_nor_preset_lists_the_presets():
    with pytest.raises(UnknownNameError, match=r"'dmeo' \(did you mean 'demo'\?\)"):
        load_experiment("dmeo")


def test_paths_are_taken_from_the_files_folder_and_root_can_be_replaced(tmp_path):
    text = MINIMAL.replace('reader = "simulated"', 'reader = "folder"\nroot = "images"')
    text += '[[trackers]]\nkind = "imported"\noptions = { path = "tracks/{scene}.csv" }\n'
    (tmp_path / "x.toml").write_text(text)
    experiment = load_experiment(tmp_path / "x.toml")
    assert experiment.dataset.root == tmp_path / "images"
    assert experiment.trackers[1].options["path"] == str(tmp_path / "tracks" / "{scene}.csv")
    assert load_experiment(tmp_path / "x.toml", root=Path("/elsewhere")).dataset.root == Path("/elsewhere")


@pytest.mark.parametrize("name", ["demo", "gazebo-arvr", "gazebo-linear"])
def test_every_preset_that_needs_no_data_can_be_planned(name):
    assert plan(load_experiment(name))


@pytest.mark.parametrize("name", ["dtu", "kitti"])
def test_every_other_preset_asks_for_its_data(name):
    with pytest.raises(SettingsError, match=f"preset {name}: dataset: reader '{name}' needs the folder of its data"):
        load_experiment(name)
    assert load_experiment(name, root=Path("/data")).paper == name


def test_the_presets_are_the_demo_the_papers_four_experiments_and_the_tournament():
    assert preset_names() == ["demo", "dtu", "effects", "gazebo-arvr", "gazebo-linear", "kitti", "tournament"]


@pytest.mark.parametrize(
    ("text", "frames"),
    [("0:59", [0, 59]), ("10:59:3", [10, 59, 3]), (" 0 : 59 ", [0, 59]), ("60", [0, 59])],
)
def test_frames_of_a_file_are_written_as_on_the_command_line_too(text, frames):
    experiment = parse_experiment(MINIMAL.replace("[[", f'frames = "{text}"\n[['), place="x.toml")
    assert experiment.dataset.frames == frames
    listed = parse_experiment(MINIMAL.replace("[[", f"frames = {frames}\n[["), place="x.toml")
    assert experiment.digest() == listed.digest()


def test_frames_speeds_and_trackers_take_the_place_of_what_the_preset_says():
    changed = load_experiment("demo", frames=[4, 20, 2], speeds=[3, 1], trackers=["correspondence", "oracle"])
    assert (changed.dataset.frames, changed.speeds) == ([4, 20, 2], [3, 1])
    assert [tracker.label for tracker in changed.trackers] == ["correspondence", "oracle"]
    assert changed.trackers[0] in load_experiment("demo").trackers
    assert load_experiment("demo", trackers=["lucas_kanade"]).trackers[0].label == "lucas-kanade"
    assert load_experiment("demo", frames=7).dataset.max_frames == 7
    for wrong, message in (
        ({"speeds": [0]}, "speeds = [0], expected different whole numbers from 1"),
        ({"speeds": [2, 2]}, "speeds = [2, 2], expected different whole numbers from 1"),
        ({"trackers": []}, "expected different names"),
        ({"trackers": ["lucas-kande"]}, "unknown tracker 'lucas-kande' (did you mean 'lucas-kanade'?)"),
        ({"frames": [3, 2, 1]}, "frames = [3, 2, 1], expected first, last and step"),
    ):
        with pytest.raises(SettingsError, match=re.escape(message)):
            load_experiment("demo", **wrong)


def test_limits_and_options_take_the_place_of_what_the_preset_says():
    experiment = load_experiment("gazebo-arvr", scenes=2, frames=30, options={"seed": 7})
    assert (experiment.dataset.max_scenes, experiment.dataset.max_frames) == (2, 30)
    assert experiment.dataset.options["seed"] == 7
    assert {task.sequence.scene for task in plan(experiment)} == {"arvr-00", "arvr-01"}


@pytest.mark.parametrize(
    "path", sorted((Path(__file__).parents[2] / "examples").glob("*.toml")), ids=lambda path: path.stem
)
def test_every_example_is_a_valid_experiment(path):
    assert load_experiment(path, root=Path("/data")).trackers


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ("lucas-kanade", "lukas-kanade"),
            "trackers[0]: unknown tracker 'lukas-kanade' (did you mean 'lucas-kanade'?)",
        ),
        (('"simulated"', '"simulate"'), "dataset: unknown reader 'simulate' (did you mean 'simulated'?)"),
        (
            ('"simulated"', '"simulated"\noptions = { frame = 3 }'),
            "dataset: reader 'simulated': frame: unknown setting (did you mean 'frames'?); known: ",
        ),
        (('"simulated"', '"sevenscenes"'), "dataset: reader 'sevenscenes' needs the folder of its data"),
        (
            ('"lucas-kanade"', '"lucas-kanade"\noptions = { window_px = 2 }'),
            "trackers[0]: tracker 'lucas-kanade': window_px",
        ),
    ],
)
def test_what_trackers_and_readers_refuse_is_said_with_the_files_name(tmp_path, change, message):
    (tmp_path / "x.toml").write_text(MINIMAL.replace(*change))
    with pytest.raises(SettingsError, match=re.escape(f"{tmp_path / 'x.toml'}: {message}")):
        load_experiment(tmp_path / "x.toml")


PRESET = MINIMAL.replace('kind = "lucas-kanade"', 'preset = "openvins"')


def test_a_preset_is_written_out_as_a_kind_with_all_options(tmp_path):
    (tmp_path / "x.toml").write_text(PRESET + "options = { window_px = 21, detection = { threshold = 30 } }\n")
    experiment = load_experiment(tmp_path / "x.toml")
    (choice,) = experiment.trackers
    assert (choice.kind, choice.name, choice.preset) == ("lucas-kanade", "openvins", None)
    assert (choice.options["window_px"], choice.options["detection"]["threshold"]) == (21, 30)
    assert make_tracker(choice.kind, choice.options) == make_tracker(
        "openvins", {"window_px": 21, "detection": {"threshold": 30}}
    )
    assert parse_experiment(experiment.to_toml(), place="again") == experiment


def test_presets_are_chosen_by_name_beside_the_trackers_of_a_file(tmp_path):
    (tmp_path / "x.toml").write_text(MINIMAL)
    chosen = load_experiment(tmp_path / "x.toml", trackers=["vins-mono", "lucas_kanade", "orb_slam3"]).trackers
    assert [choice.label for choice in chosen] == ["vins-mono", "lucas-kanade", "orb-slam3"]
    assert [choice.kind for choice in chosen] == ["lucas-kanade", "lucas-kanade", "correspondence"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (PRESET.replace("openvins", "open-vins"), "trackers[0]: unknown preset of a tracker 'open-vins' (did you mean"),
        (PRESET + 'kind = "oracle"', "trackers[0]: found a kind and a preset, expected one of them"),
        (MINIMAL.replace("lucas-kanade", "openvins"), "kind = 'openvins' is a preset, expected preset = 'openvins'"),
        (PRESET + "options = 3", "trackers[0].options: found 3, expected a valid dictionary"),
        (PRESET.replace('"openvins"', "3"), "trackers[0].kind: missing, expected a value"),
    ],
)
def test_a_wrong_preset_is_refused_in_one_line(text, message):
    with pytest.raises(SettingsError, match=re.escape(message)):
        parse_experiment(text, place="x.toml")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('scenes = ["nowhere-00"]', "unknown scene 'nowhere-00'; known: arvr-00"),
        ('lightings = ["moon"]', "unknown lighting 'moon'"),
    ],
)
def test_unknown_scenes_are_found_before_anything_is_read(line, message):
    text = MINIMAL.replace('"simulated"', f'"simulated"\n{line}')
    with pytest.raises(UnknownNameError, match=re.escape(message)):
        plan(parse_experiment(text, place="x.toml"))


def test_a_file_with_a_byte_order_mark_is_read(tmp_path):
    (tmp_path / "x.toml").write_text(MINIMAL, encoding="utf-8-sig")
    assert load_experiment(tmp_path / "x.toml").name == "x"


def test_bytes_that_are_no_text_are_found_by_their_line(tmp_path):
    (tmp_path / "x.toml").write_bytes(b'# one\nname = "caf\xe9"\n')
    with pytest.raises(SettingsError, match=r"x\.toml: cannot be read \(not UTF-8 in line 2\)"):
        load_experiment(tmp_path / "x.toml")


def test_the_documented_schema_is_that_of_the_program():
    documented = Path(__file__).parents[2] / "docs" / "experiment.schema.json"
    assert documented.read_text() == experiment_schema(), (
        "renew it: python -c 'from tracknoise.experiments.settings import experiment_schema; "
        'print(experiment_schema(), end="")\' > docs/experiment.schema.json'
    )


@pytest.fixture(scope="module")
def validator() -> Draft202012Validator:
    schema = json.loads(experiment_schema())
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def test_the_schema_describes_every_option_of_readers_and_trackers(validator):
    definitions = validator.schema["$defs"]
    for section, plugins in (("DatasetSettings", READERS), ("TrackerChoice", TRACKERS)):
        for rule in definitions[section]["allOf"]:
            ((value,),) = (condition.values() for condition in rule["if"]["properties"].values())
            options = definitions[rule["then"]["properties"]["options"]["$ref"].rpartition("/")[2]]
            named = {field.name for field in fields(plugins.load(value))} - plugins.given
            assert options["properties"].keys() == named
            assert all(option["description"] for option in options["properties"].values())
        assert len(definitions[section]["allOf"]) == len(plugins.built_in)


@pytest.mark.parametrize(
    "path",
    [*(ROOT / "examples").glob("*.toml"), *(ROOT / "src" / "tracknoise" / "experiments").rglob("presets/*.toml")],
    ids=str,
)
def test_examples_and_presets_fit_the_schema(validator, path):
    validator.validate(tomllib.loads(path.read_text()))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("epsilon = 0", "0 is less than or equal to the minimum of 0"),
        ("max_features = 2000000", "2000000 is greater than the maximum of 1000000"),
        ("rejection = { threshold_px = -1 }", "-1 is less than or equal to the minimum of 0"),
        ("window = 3", "'window' was unexpected"),
        ('iterations = "30"', "'30' is not of type 'integer'"),
    ],
)
def test_the_schema_refuses_what_the_program_refuses(validator, options, message):
    text = f'name = "x"\ndataset.reader = "folder"\ntrackers = [{{ kind = "KIND", options = {{ {options} }} }}]\n'
    (error,) = validator.iter_errors(tomllib.loads(text.replace("KIND", "lucas-kanade")))
    assert message in error.message
    with pytest.raises(SettingsError):
        make_tracker("lucas-kanade", tomllib.loads(options))
    assert validator.is_valid(tomllib.loads(text.replace("KIND", "of-a-plugin")))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"seed = {'9' * 5000}", "attack.toml: "),
        (f"a = {'[' * 900}{']' * 900}", "attack.toml: lists and tables more than 16 deep, expected fewer levels"),
        (f"a = {'{b = ' * 20}1{'}' * 20}", "lists and tables more than 16 deep, expected fewer levels"),
        ("a." * 40_000 + "b = 1", "attack.toml: line 1: a key of 40001 parts, expected at most 16"),
        (f"seed = {2**64}", "attack.toml: a whole number of 65 bits, expected at most 64 bits"),
        ('name = "a\\u0000b"', r"expected a text without null characters"),
    ],
)
def test_toml_that_no_experiment_needs_is_refused_quickly(text, message):
    started = time.monotonic()
    with pytest.raises(SettingsError) as caught:
        parse_experiment(text, place="attack.toml")
    assert message in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
    assert time.monotonic() - started < 5


def test_long_lists_of_names_with_dots_are_fine():
    scenes = ", ".join(f'"a.b.c.{number}"' for number in range(100))
    numbers = ", ".join(f"{number}.5" for number in range(100))
    text = f'name = "x"\n[[trackers]]\nkind = "oracle"\noptions.x = [{numbers}]\n[dataset]\nreader = "folder"\n'
    assert len(parse_experiment(f"{text}scenes = [\n{scenes}\n]", place="x").dataset.scenes) == 100


def test_an_experiment_is_a_regular_file_of_moderate_size(tmp_path):
    os.mkfifo(tmp_path / "pipe.toml")
    with pytest.raises(UnknownNameError):
        load_experiment(tmp_path / "pipe.toml")
    (tmp_path / "large.toml").write_bytes(b"#" * (2 << 20))
    with pytest.raises(SettingsError, match=r"large\.toml: cannot be read"):
        load_experiment(tmp_path / "large.toml")
    with pytest.raises(SettingsError, match="expected the path of a file or folder"):
        load_experiment("demo", root=tmp_path / "a\0b")


def test_groups_of_scenes_are_declared_by_patterns():
    declared = MINIMAL.replace(
        'reader = "simulated"', 'reader = "simulated"\ngroups = { turning = ["fixating-*", "arvr-00"] }'
    )
    experiment = parse_experiment(declared, place="x.toml")
    assert experiment.dataset.groups == {"turning": ["fixating-*", "arvr-00"]}
    assert parse_experiment(experiment.to_toml(), place="again") == experiment
    assert plan(experiment)


def test_a_pattern_of_no_scene_is_named():
    declared = MINIMAL.replace('reader = "simulated"', 'reader = "simulated"\ngroups = { turning = ["fixing-*"] }')
    with pytest.raises(
        SettingsError, match=r"dataset.groups.turning: no scene is called 'fixing-\*', expected a pattern"
    ):
        plan(parse_experiment(declared, place="x.toml"))
