import pytest

from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.sequences.reader_registry import READERS, make_reader, open_sequence, open_together, select
from tracknoise.sequences.sevenscenes import SevenScenes
from tracknoise.sequences.simulated import Simulated
from tracknoise.sequences.views import View
from tracknoise.tables.identity import SequenceId


def test_names():
    assert {"folder", "sevenscenes", "simulated", "tartanair"} <= set(READERS.names())
    assert READERS.names() == sorted(READERS.names())


@pytest.mark.parametrize("name", READERS.names())
def test_each_reader_says_what_it_is(name):
    kind = READERS.load(name)
    assert kind.name == name
    assert kind.description
    assert isinstance(kind.needs_root, bool)


def test_an_unknown_reader_lists_the_known():
    with pytest.raises(UnknownNameError) as caught:
        make_reader("sevenscene")
    assert str(caught.value).startswith("unknown reader 'sevenscene' (did you mean 'sevenscenes'?); known: ")
    with pytest.raises(UnknownNameError, match="unknown reader None; known: "):
        open_sequence(None)


def test_a_root_is_a_path():
    with pytest.raises(SettingsError, match="root is 5, expected a path"):
        open_sequence("folder", 5)


def test_options_are_checked(tmp_path):
    with pytest.raises(SettingsError) as caught:
        make_reader("tartanair", tmp_path, {"camra": "left"})
    expected = "reader 'tartanair': camra: unknown setting (did you mean 'camera'?); known: camera"
    assert str(caught.value) == expected
    with pytest.raises(SettingsError, match=r"reader 'tartanair': root: unknown setting; known: camera$"):
        make_reader("tartanair", tmp_path, {"root": "elsewhere"})
    with pytest.raises(SettingsError, match="reader 'sevenscenes' needs the folder of its data"):
        make_reader("sevenscenes")


class Listed(SevenScenes):
    def sequences(self):
        return [
            SequenceId("x", "a", "dim"),
            SequenceId("x", "a", "lit"),
            SequenceId("x", "b", "lit"),
        ]


def test_select_takes_the_first_that_matches(tmp_path):
    reader = Listed(tmp_path)
    assert select(reader) == SequenceId("x", "a", "dim")
    assert select(reader, "b") == SequenceId("x", "b", "lit")
    assert select(reader, None, "lit") == SequenceId("x", "a", "lit")
    with pytest.raises(UnknownNameError, match="unknown scene 'c'; known: a, b"):
        select(reader, "c")
    with pytest.raises(UnknownNameError, match="unknown lighting 'dim'; known: lit"):
        select(reader, "b", "dim")


def test_open_sequence_takes_names_and_paths(tmp_path, write_sevenscenes):
    for scene in ("a", "b"):
        write_sevenscenes(tmp_path / scene, frames=1)
    assert open_sequence("sevenscenes", str(tmp_path)).id.scene == "a"
    assert open_sequence("sevenscenes", tmp_path, scene="b").id.scene == "b"


class Foreign(View):
    """A sequence of another package."""

    _helper = None

    @property
    def group(self):
        return "a place"


class Misspelt(Foreign):
    @property
    def shuter(self):
        return None


def test_a_fact_that_nothing_reads_is_refused_with_the_known_ones():
    def opened(kind):
        class Reader(Simulated):
            def open(self, sequence):
                return kind(Simulated.open(self, sequence))

        reader = Reader(motions=("forward",), frames=2, width=64, height=48)
        return open_together(reader, reader.sequences())

    assert len(opened(Foreign)) == 1
    expected = "^unknown fact of Misspelt 'shuter' .did you mean 'shutter'..; known: body, camera_at, .*, z_depth_from$"
    with pytest.raises(UnknownNameError, match=expected):
        opened(Misspelt)
