"""The commands, as a user types them."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import typer
from tests.lean import of_reader, without_figure_files

from tracknoise.api.finished_run import open_run
from tracknoise.cli.app import main
from tracknoise.cli.commands import app
from tracknoise.experiments.execute import Outcome
from tracknoise.experiments.load import preset_names
from tracknoise.sequences.reader_registry import READERS
from tracknoise.trackers import tracker_registry

EXAMPLES = {
    **{name: f"Example: tracknoise {name}" for name in ("demo", "trackers")},
    **{
        name: f"Examples: tracknoise {name}"
        for name in ("init", "check", "run", "report", "compare", "export", "tournament", "simulate", "datasets")
    },
    "replicate": "tracknoise replicate --data /data",
}
MOST_OPTIONS = 90
"""Of all commands together, with those of the program itself."""


def test_there_are_twelve_commands_with_few_options():
    program = typer.main.get_command(app)
    assert set(EXAMPLES) == set(program.commands)
    assert len(EXAMPLES) == 12
    every = [parameter for command in (program, *program.commands.values()) for parameter in command.params]
    assert 1 + sum(one.param_type_name == "option" for one in every) <= MOST_OPTIONS, "with --help"


@pytest.mark.parametrize(("command", "example"), EXAMPLES.items())
def test_every_command_has_help_with_an_example_and_without_types(tracknoise, command, example):
    code, out, _ = tracknoise(command, "--help")
    assert code == 0
    assert example in " ".join(out.replace("│", " ").split())
    assert "<" not in out


def test_every_option_has_one_clear_line():
    texts = {
        (name, option): parameter.help
        for name, command in commands()
        for option, parameter in options(command).items()
        if option.startswith("--")
    }
    assert [key for key, said in texts.items() if not said or len(said) > 110 or not said.endswith(".")] == []


@pytest.mark.parametrize(
    ("words", "instead"),
    [
        ("run --schema", "`docs/experiment.schema.json` in the repository"),
        ("simulate -o x --scenes=2", "`--option worlds=N`"),
        ("replicate --data /data --models /models", "`--data FOLDER`"),
    ],
)
def test_an_old_option_is_one_line_that_names_the_new_one(tracknoise, words, instead):
    code, out, err = tracknoise(*words.split())
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.endswith(f"is no option any more; expected {instead}\n")


@pytest.mark.parametrize(
    ("words", "instead"),
    [
        ("audit runs/x", "`tracknoise check RUN`"),
        ("findings runs/x --all", "`tracknoise report RUN --text`"),
        ("noise", "`tracknoise export RUN --to NAME`"),
        ("noise fit runs/x -o models", "`tracknoise export RUN --to text --model FILE`"),
        ("noise show m.json", "`tracknoise export MODEL --to text`"),
        ("noise export m.json --to openvins", "`tracknoise export MODEL --to NAME`"),
        ("noise check m.json --on runs/x", "`python -m benchmarks.noise.check` in the repository"),
        ("noise table runs/x", "`python -m benchmarks.noise.table` in the repository"),
        ("prove runs/x m.json", "`python -m benchmarks.noise.prove` in the repository"),
        ("effects --scenes 2", "`tracknoise run effects`"),
        ("selfcheck", "`python -m benchmarks.selfcheck` in the repository"),
    ],
)
def test_an_old_name_is_one_line_that_names_the_new_one(tracknoise, words, instead):
    code, out, err = tracknoise(*words.split())
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.endswith(f"is no command any more; expected {instead}\n")


def test_the_help_of_run_names_the_presets(tracknoise):
    _, out, _ = tracknoise("run", "--help")
    assert ", ".join(preset_names()) in " ".join(out.replace("│", " ").split())


@pytest.mark.parametrize("buffered", [True, False])
@pytest.mark.parametrize("arguments", [["--version"], ["datasets"]])
def test_results_that_cannot_be_written_are_one_line(arguments, buffered):
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    environment = kept if buffered else {**kept, "PYTHONUNBUFFERED": "1"}
    command = [sys.executable, "-c", "from tracknoise.cli.app import main; main()", *arguments]
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, env=environment, check=False)
    assert ended.stderr == "tracknoise: error: standard output cannot be written (No space left on device)\n"
    assert ended.returncode == 1


def commands():
    """Every command with its name."""
    return typer.main.get_command(app).commands.items()


def test_every_command_can_be_quiet():
    assert [name for name, command in commands() if "--quiet" not in options(command)] == []


def options(command):
    return {option: parameter for parameter in command.params for option in parameter.opts}


def test_json_is_a_flag_in_every_command_that_has_it():
    found = {name: options(command) for name, command in commands() if "--json" in options(command)}
    assert set(found) == {"check", "compare", "report"}
    for parameters in found.values():
        assert parameters["--json"].is_flag
        assert parameters["--json"].help == "Print the result as one JSON document, and nothing else."


@pytest.mark.parametrize("written", [("--json", "new.json"), ("--json=new.json",), ("--json", "out/report")])
@pytest.mark.parametrize("command", [("check", "."), ("compare", "a", "b"), ("report", "a")])
def test_a_file_after_json_is_told_its_option(tracknoise, tmp_path, monkeypatch, command, written):
    monkeypatch.chdir(tmp_path)
    name = written[-1].removeprefix("--json=")
    message = f"--json {name}: --json prints to standard output, expected --json > {name}"
    assert tracknoise(*command, *written) == (1, "", f"tracknoise: error: {message}\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("command", "place"),
    [
        (("compare", "a", "b", "--out", ""), "--out"),
        (("check", "a", "--out="), "--out"),
        (("run", "x.toml", "-o", ""), "-o"),
        (("report", ""), "report"),
    ],
)
def test_an_empty_value_is_one_line(tracknoise, command, place):
    message = f"{place}: found an empty value, expected a path, a name or a number after {place}"
    assert tracknoise(*command) == (1, "", f"tracknoise: error: {message}\n")


def test_a_recording_that_is_a_file_may_follow_json(tracknoise, tmp_path):
    (tmp_path / "x.bag").write_bytes(b"")
    code, _, err = tracknoise("check", "--json", str(tmp_path / "x.bag"))
    assert code in (1, 4)
    assert "--json >" not in err


@pytest.mark.parametrize(("words", "last", "found"), [("exp", 1, "export"), ("export --al", 2, "--allow")])
def test_the_shell_can_complete_commands(words, last, found):
    environment = {
        "COMP_WORDS": f"tracknoise {words}",
        "COMP_CWORD": str(last),
        "_TRACKNOISE_COMPLETE": "complete_bash",
    }
    command = [sys.executable, "-c", "from tracknoise.cli.app import main; main()"]
    ended = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **environment}, check=False)
    assert (ended.returncode, ended.stdout.split(), ended.stderr) == (0, [found], "")


def test_a_completion_that_is_asked_wrongly_prints_nothing():
    for environment in ({"COMP_WORDS": "tracknoise ru", "COMP_CWORD": "abc"}, {"COMP_CWORD": "1"}):
        asked = {**os.environ, **environment, "_TRACKNOISE_COMPLETE": "complete_bash"}
        command = [sys.executable, "-c", "from tracknoise.cli.app import main; main()"]
        ended = subprocess.run(command, capture_output=True, text=True, env=asked, check=False)
        assert (ended.returncode, ended.stdout, ended.stderr) == (1, "", "")


def test_too_little_virtual_memory_is_one_line_and_no_wait():
    """Under 1 GiB numerical libraries wait for ever; under less they are not loaded."""
    command = ["bash", "-c", 'ulimit -v 1000000; "$0" -c "from tracknoise.cli.app import main; main()" trackers']
    ended = subprocess.run([*command, sys.executable], capture_output=True, text=True, timeout=300, check=False)
    message = "virtual memory is limited to 1.0 GiB, expected at least 4 GiB (`ulimit -v unlimited`)"
    assert (ended.returncode, ended.stderr) == (1, f"tracknoise: error: {message}\n")


def test_the_script_of_the_completion_is_shown_and_installed(tmp_path):
    environment = {**os.environ, "HOME": str(tmp_path)}
    command = ["bash", "-c", '"$0" -c "from tracknoise.cli.app import main; main()" "$1"; exit $?', sys.executable]
    shown, installed = (
        subprocess.run([*command, option], capture_output=True, text=True, env=environment, check=False)
        for option in ("--show-completion", "--install-completion")
    )
    assert (shown.returncode, shown.stderr) == (0, "")
    assert "complete -o default -F _tracknoise_completion tracknoise" in shown.stdout
    assert installed.returncode == 0
    assert "_tracknoise_completion" in (tmp_path / ".bash_completions" / "tracknoise.sh").read_text()


def test_datasets_lists_the_readers(tracknoise):
    code, out, _ = tracknoise("datasets")
    assert code == 0
    names = [line.split()[0] for line in out.splitlines()]
    assert names == sorted(READERS.names())
    assert {"colmap", "folder", "rosbag", "tum"} <= set(names)


def test_datasets_shows_the_options_of_a_reader_as_an_experiment_file_has_them(tracknoise):
    code, out, _ = tracknoise("datasets", "kitti")
    assert code == 0
    assert out.splitlines()[0] == "# depth_root = ... (optional)"
    assert tomllib.loads(out) == {"radius_px": 1.0, "keep_still": False, "still_frames": 10, "still_m": 0.02}
    options = tomllib.loads(tracknoise("datasets", "sevenscenes")[1])
    assert options == {"calibration": "registered", "poses": "kinectfusion"}


def test_datasets_lists_the_options_and_sequences_of_a_reader_that_needs_no_data(tracknoise):
    code, out, _ = tracknoise("datasets", "simulated")
    options, _, sequences = out.rpartition("\n\n")
    assert code == 0
    assert tomllib.loads(options)["motions"] == ["sideways", "fixating", "forward", "arvr"]
    assert [line.split()[0] for line in sequences.splitlines()] == [
        "arvr-00",
        "fixating-00",
        "forward-00",
        "sideways-00",
    ]


def test_trackers_lists_the_trackers(tracknoise):
    code, out, _ = tracknoise("trackers")
    assert code == 0
    assert [line.split()[0] for line in out.splitlines() if line] == [
        "correspondence",
        "dense-flow",
        "external",
        "imported",
        "lucas-kanade",
        "oracle",
        "patch",
        "second-view",
        *tracker_registry.preset_names(),
    ]
    assert "preset of OpenVINS: FAST corners of a 5 x 5 grid" in out


def test_a_trackers_settings_are_shown_as_an_experiment_file_has_them(tracknoise):
    code, out, _ = tracknoise("trackers", "lucas-kanade")
    assert code == 0
    assert "window_px = 15" in out
    assert "[rejection]" in out


def test_a_presets_settings_are_shown_with_their_sources(tracknoise):
    code, out, _ = tracknoise("trackers", "vins-mono")
    assert code == 0
    assert 'system = "VINS-Mono"' in out
    assert "distance_px = 30 # config/euroc/euroc_config.yaml: min_dist" in out


def test_simulate_writes_what_the_folder_reader_measures(tracknoise, tmp_path):
    out = tmp_path / "data" / "forward"
    small = ["--frames", "4", *of_reader("width=160", "height=120", "supersampling=1"), "--quiet"]
    code, printed, _ = tracknoise("simulate", "--motion", "forward", "--out", str(out), *small)
    assert code == 0
    assert "4 frames" in printed
    (tmp_path / "x.toml").write_text(
        'name = "x"\n[dataset]\nreader = "folder"\nroot = "data"\n[[trackers]]\nkind = "lucas-kanade"\n'
    )
    run = tmp_path / "run"
    with without_figure_files():
        code, printed, err = tracknoise("run", str(tmp_path / "x.toml"), "--out", str(run), "--quiet", "-w", "1")
    assert (code, err) == (0, "")
    assert "lucas-kanade" in printed
    page = run / "report" / "index.html"
    assert f"report: {page.resolve()}" in printed
    assert page.exists()


def test_frames_speeds_and_trackers_are_chosen_on_the_command_line(tracknoise, tmp_path):
    settings = 'name = "x"\nspeeds = [5]\n[dataset]\nreader = "simulated"\n[dataset.options]\nmotions = ["sideways"]\n'
    settings += 'width = 80\nheight = 60\nframes = 9\n[[trackers]]\nkind = "oracle"\n'
    (tmp_path / "x.toml").write_text(settings)
    chosen = ["--frames", "2:8:2", "--speeds", "1,2", "--trackers", "lucas-kanade", "-w", "1", "--no-report"]
    code, _, err = tracknoise("run", str(tmp_path / "x.toml"), "--out", str(tmp_path / "run"), *chosen)
    assert code == 0
    assert "frames 2 to 8 in steps of 2 of 9 are used; here they are numbered from 0" in err
    run = open_run(tmp_path / "run")
    assert run.sequences()["n_frames"].unique().to_list() == [4]
    assert run.table("frames").select("tracker", "speed").unique().sort("speed").rows() == [
        ("lucas-kanade", 1),
        ("lucas-kanade", 2),
    ]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["run", "x.toml", "--speeed", "3"], "--speeed"),
        (["run", "x.toml", "--workers", "0"], "--workers"),
        (["run", "x.toml", "--workers", "many"], "--workers many: expected a whole number from 1"),
        (["simulate", "--out", "x", "--frames", "few"], "--frames few: expected a whole number from 1"),
        (["report", "x", "--text", "--figures"], "--figures: found a report that is printed"),
        (["report", "x", "--json", "--video", "x.gif"], "--video: found a report that is printed"),
        (["report", "x", "--video", "x.avi"], "--video x.avi: found a name that ends in '.avi', expected .gif or .mp4"),
        (["run", "demo", "--option", "wrlds=2"], "wrlds"),
        (["run", "demo", "--frames", "few"], "--frames few: expected a number from 2, or FIRST:LAST"),
        (["run", "demo", "--frames", "1"], "--frames 1: expected at least 2"),
        (["run", "demo", "--frames", "9:3"], "frames = [9, 3], expected first, last and step"),
        (["run", "demo", "--speeds", "1,fast"], "--speeds 1,fast: expected whole numbers such as 1,2,4"),
        (["run", "demo", "--speeds", "0"], "speeds = [0], expected different whole numbers from 1"),
        (["run", "demo", "--trackers", "lukas"], "unknown tracker 'lukas'"),
        (["demo", "extra"], "extra"),
        (["fly"], "fly"),
    ],
)
def test_wrong_usage_is_one_line_that_names_it(tracknoise, arguments, named):
    code, _, err = tracknoise(*arguments)
    assert code == 1
    assert named in err
    assert "internal" not in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("arguments", [[], ["run"], ["simulate"]])
def test_a_bare_command_shows_its_help(tracknoise, arguments):
    _, out, err = tracknoise(*arguments)
    assert "Usage" in out
    assert err == ""


@pytest.mark.parametrize("command", [("report",), ("report", "--text"), ("check",)])
def test_a_folder_that_is_no_run_is_one_line(tracknoise, tmp_path, command):
    code, _, err = tracknoise(*command, str(tmp_path / "nowhere"))
    assert (code, err.count("\n")) == (1, 1)
    assert "nowhere" in err


def test_debug_shows_the_traceback(tmp_path):
    with pytest.raises(Exception, match="nowhere"):
        main(["report", str(tmp_path / "nowhere"), "--debug"])


@pytest.mark.parametrize(("workers", "meant"), [("3", (3, None)), ("tls://10.0.0.5:8786", (1, "tls://10.0.0.5:8786"))])
def test_workers_are_a_number_or_those_of_a_scheduler(tracknoise, tmp_path, monkeypatch, workers, meant):
    found = []

    def remember(experiment, run, *, workers, scheduler, **others):
        found.append((workers, scheduler))
        return Outcome([], {})

    monkeypatch.setattr("tracknoise.experiments.execute.execute", remember)
    monkeypatch.setattr("tracknoise.cli.shared_options.usable_cores", lambda: 1)
    tracknoise("run", "demo", "--out", str(tmp_path / "run"), "--workers", workers)
    assert found == [meant]


def test_options_of_the_reader_can_be_given_and_their_paths_start_here(tracknoise, tmp_path, monkeypatch):
    found = []

    def remember(experiment, *arguments, **others):
        found.append(experiment.dataset.options)
        return Outcome([], {})

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tracknoise.experiments.execute.execute", remember)
    tracknoise("run", "gazebo-arvr", *of_reader("models=gazebo", "worlds=2"), "--out", "run")
    assert (found[0]["models"], found[0]["worlds"]) == (str(tmp_path / "gazebo"), 2)


def test_an_interrupted_run_says_how_to_resume(tracknoise, tmp_path, monkeypatch):
    def interrupt(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("tracknoise.experiments.execute.execute", interrupt)
    code, out, err = tracknoise("run", "demo", "--out", str(tmp_path / "run"))
    assert (code, out) == (130, "")
    assert err == "tracknoise: error: interrupted; run the same command again to resume\n"
