"""Files that commands refuse to write, before they read anything."""

import os

import pytest


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder, with a run of files that are not read and a recording."""
    monkeypatch.chdir(tmp_path)
    for name in ("run/manifest.json", "run/experiment.toml", "rec/poses.txt", "g.toml", "m.noise.json"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text('{\n "format": "tracknoise.noise/2"')
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "hard.md").hardlink_to("g.toml")
    return tmp_path


COMPARE = "compare run run "


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("audit run --json-file run/manifest.json", "--json-file run/manifest.json: found a place in the run {}/run"),
        ("findings run --json-file run/report/new.json", "found a place in the run {}/run, expected one outside of it"),
        (COMPARE + "--html run/manifest.json", "found a place in the run"),
        (COMPARE + "--gate g.toml --markdown g.toml", "--markdown g.toml: found an input of this command"),
        (COMPARE + "--gate g.toml --markdown hard.md", "--markdown hard.md: found an input of this command"),
        (COMPARE + "--html a.html --markdown ./a.html", "--markdown a.html: found the file of --html too"),
        (COMPARE + "--html rec", "--html rec: found a folder, expected a file to write"),
        (COMPARE + "--html pipe", "--html pipe: found no regular file, expected a file to write"),
        (COMPARE + "--json-file g.toml", "--json-file g.toml: found a file of another kind, expected a new file or"),
        (COMPARE + "--json-file m.noise.json", "found a file of another kind, expected a new file or an earlier JSON"),
        (COMPARE + "--markdown rec/poses.txt", "found a file of another kind, expected a new file or earlier Markdown"),
        ("noise table run --json-file t/noise-table.json -o t", "--out t/noise-table.json: found the file of --json-f"),
        ("noise check m.noise.json --on run --figure run/a.svg", "--figure run/a.svg: found a place in the run"),
        ("prove run m.noise.json --out m.noise.json", "--out m.noise.json: found an input of this command"),
        ("report run --rerun run/manifest.json", "--rerun run/manifest.json: found a place in the run"),
    ],
)
def test_what_is_needed_is_not_replaced(command, message, folder, tracknoise):
    files = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    status, out, err = tracknoise(*command.split())
    assert (status, out, err.count("\n")) == (1, "", 1)
    assert message.format(folder) in err
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == files


@pytest.mark.parametrize(
    ("option", "name", "text"),
    [
        ("--json-file", "a.json", '{\n "format": 1,'),
        ("--json-file", "a.json", '{\n "format": "tracknoise.noise-table/1",'),
        ("--html", "a.html", "<!doctype html>\n<p>"),
        ("--markdown", "a", "## b compared with a"),
        ("--markdown", "empty", ""),
        ("--html", "rec/new.html", None),
    ],
)
def test_an_earlier_output_is_replaced(option, name, text, folder):
    from tracknoise.cli.output_files import require_outputs

    if text is not None:
        (folder / name).write_text(text)
    require_outputs([(option, folder / name)], inputs=[folder / "rec", None])
