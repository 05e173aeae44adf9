"""The outputs of the tour are made by its commands."""

import pytest
from benchmarks.documents import tour

PAGE = """# Title

```sh
not --run
```

```console
$ first command
an old output
$ second
```

![Text](figures/error-by-age.svg)
"""


def test_outputs_are_replaced_and_all_else_stays():
    assert tour.outputs(PAGE) == {"first command": "an old output\n", "second": ""}
    assert tour.figures(PAGE) == ["error-by-age.svg"]
    new = {"first command": "new\n", "second": ""}
    assert tour.remade(PAGE, new.__getitem__) == PAGE.replace("an old output", "new")


def test_the_page_stays_as_it_is_if_its_commands_print_the_same():
    page = tour.PAGE.read_text(encoding="utf-8")
    printed = tour.outputs(page)
    assert len(printed) > 10
    assert sum(map(bool, printed.values())) > 7
    assert tour.remade(page, printed.__getitem__) == page


def test_a_command_prints_both_streams_or_ends_the_program(tmp_path):
    assert tour.run("echo yes $PWD/file; echo no >&2", tmp_path) == "yes file\nno\n"
    with pytest.raises(SystemExit, match="exit status 3"):
        tour.run("exit 3", tmp_path)


def test_the_page_and_its_figures_are_written(tmp_path, monkeypatch):
    page, run = tmp_path / "docs" / "tour.md", tmp_path / "work"
    (page.parent / "figures").mkdir(parents=True)
    page.write_text(PAGE.replace("first command", "echo one").replace("$ second", f"$ mkdir -p {tour.FIGURES}"))
    run.mkdir()
    monkeypatch.setattr(tour, "PAGE", page)
    monkeypatch.setattr(tour, "DRAW", "echo drawn")
    with pytest.raises(FileNotFoundError, match=r"error-by-age\.svg"):
        tour.main([str(run)])
    (run / tour.FIGURES / "error-by-age.svg").write_text("<svg/>")
    tour.main([str(run)])
    assert "$ echo one\none\n$ mkdir" in page.read_text()
    assert (page.parent / "figures" / "error-by-age.svg").read_text() == "<svg/>"
