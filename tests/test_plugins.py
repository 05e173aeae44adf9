"""Other packages' trackers and readers, found by their entry points."""

import sys

import pytest

from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.plugins import Plugins


@pytest.fixture
def plugins(tmp_path, monkeypatch):
    """A group to which an installed package adds one class that can be loaded and one that cannot."""
    (tmp_path / "foreign_trackers.py").write_text("class Foreign:\n    kind = 'foreign'\n")
    info = tmp_path / "foreign_trackers-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: foreign-trackers\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[tracknoise.test]\nforeign = foreign_trackers:Foreign\nbroken = foreign_trackers:Missing\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    yield Plugins(what="thing", group="tracknoise.test", built_in={"own": "fractions:Fraction"})
    sys.modules.pop("foreign_trackers", None)


def test_own_and_foreign_names_are_known(plugins):
    assert plugins.names() == ["broken", "foreign", "own"]


def test_a_foreign_class_is_loaded(plugins):
    assert plugins.load("foreign").kind == "foreign"
    assert plugins.load("own").__name__ == "Fraction"


def test_a_foreign_class_that_cannot_be_loaded_is_named(plugins):
    with pytest.raises(SettingsError, match="thing 'broken': foreign_trackers:Missing cannot be loaded"):
        plugins.load("broken")


def test_an_unknown_name_lists_the_known_ones(plugins):
    with pytest.raises(UnknownNameError, match=r"unknown thing 'foriegn' \(did you mean 'foreign'\?\)"):
        plugins.load("foriegn")
