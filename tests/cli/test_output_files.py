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
    os.mkfifo(tmp_path / "pipe.html")
    (tmp_path / "rec.md").mkdir()
    (tmp_path / "other.md").write_text("1 2 3")
    (tmp_path / "hard.md").hardlink_to("g.toml")
    return tmp_path


COMPARE = "compare run run "


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("check run -o run/manifest.json", "--out run/manifest.json: found a place in the run {}/run"),
        ("check run -o run/report/new.json", "found a place in the run {}/run, expected one outside of it"),
        (COMPARE + "-o run/a.html", "found a place in the run"),
        (COMPARE + "--gate g.toml -o hard.md", "--out hard.md: found an input of this command"),
        (COMPARE + "-o a.html -o ./a.html", "--out a.html: found a second .html file, expected one of each kind"),
        (COMPARE + "-o rec.md", "--out rec.md: found a folder, expected a file to write"),
        (COMPARE + "-o pipe.html", "--out pipe.html: found no regular file, expected a file to write"),
        (COMPARE + "-o m.noise.json", "found a file of another kind, expected a new file or an earlier JSON"),
        (COMPARE + "-o other.md", "found a file of another kind, expected a new file or earlier Markdown"),
        ("report run --video run/report/a.gif", "--video run/report/a.gif: found a place in the run {}/run"),
        ("export run --to text --model run/a.noise.json", "--model run/a.noise.json: found a place in the run"),
        ("export run --to csv --tracks g.toml --model g.toml", "--model g.toml: found an input of this command"),
    ],
)
def test_what_is_needed_is_not_replaced(command, message, folder, tracknoise):
    files = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    status, out, err = tracknoise(*command.split())
    assert (status, out, err.count("\n")) == (1, "", 1)
    assert message.format(folder) in err
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == files


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.json", '{\n "format": 1,'),
        ("a.html", "<!doctype html>\n<p>"),
        ("a.md", "## b compared with a"),
        ("empty.md", ""),
        ("rec/new.html", None),
    ],
)
def test_an_earlier_output_is_replaced(name, text, folder):
    from tracknoise.cli.output_files import require_outputs

    if text is not None:
        (folder / name).write_text(text)
    require_outputs([("--out", folder / name)], inputs=[folder / "rec", None], are_reports=True)
