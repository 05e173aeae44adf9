"""A small version of `python -m benchmarks.attack links`, and whether it would notice a link that is followed."""

from benchmarks.attack import links
from tests.lean import without_audit, without_models

from tracknoise.experiments import run_lock
from tracknoise.tables import store


def test_links_in_runs_are_refused(capsys, monkeypatch):
    with without_audit(), without_models():  # whose files are like the others
        assert links.main(["--count", "12", "--seed", "3"]) == 0
        assert capsys.readouterr().out == "12 links in place of 12 names, seed 3: 0 not dealt with\n"
        for module in (run_lock, store):
            monkeypatch.setattr(module, "require_no_links", lambda folder: None)
        assert links.main(["--count", "12", "--seed", "3"]) == 1
    assert ": accepted\n" in capsys.readouterr().out
