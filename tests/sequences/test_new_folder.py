import pytest

from tracknoise.exceptions import DataError
from tracknoise.sequences.writing import new_folder


def test_appears_when_complete(tmp_path):
    with new_folder(tmp_path / "below" / "made") as folder:
        (folder / "file").write_text("whole")
        assert not (tmp_path / "below" / "made").exists()
    assert [path.name for path in (tmp_path / "below").iterdir()] == ["made"]
    assert (tmp_path / "below" / "made" / "file").read_text() == "whole"


def test_an_empty_folder_is_as_good_as_none(tmp_path):
    (tmp_path / "made").mkdir()
    with new_folder(tmp_path / "made") as folder:
        (folder / "file").write_text("whole")
    assert (tmp_path / "made" / "file").exists()


def interrupted(path, then):
    with new_folder(path) as folder:
        (folder / "file").write_text("half")
        then(folder)


def test_vanishes_with_an_error(tmp_path):
    def fail(folder):
        raise KeyError

    with pytest.raises(KeyError):
        interrupted(tmp_path / "made", fail)
    assert not list(tmp_path.iterdir())


def test_errors_of_the_system_name_the_place(tmp_path):
    with pytest.raises(DataError) as caught:
        interrupted(tmp_path / "made", lambda folder: (folder / "missing" / "file").write_text("nowhere"))
    expected = "cannot be written (No such file or directory), expected a folder that can be written"
    assert str(caught.value) == f"{tmp_path / 'made'}: {expected}"


def test_what_is_there_stays(tmp_path):
    (tmp_path / "made").write_text("mine")
    with pytest.raises(DataError, match="already exists, expected a new or empty folder"):
        interrupted(tmp_path / "made", lambda folder: None)
    assert (tmp_path / "made").read_text() == "mine"
