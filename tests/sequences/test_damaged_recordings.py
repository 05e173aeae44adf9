"""Whatever the bytes of a bag, of COLMAP's files or of transforms.json are: only our own exceptions come out."""

import json
from contextlib import suppress
from pathlib import Path

import pytest
from benchmarks.attack import recordings
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tracknoise.exceptions import TracknoiseError
from tracknoise.sequences.reader_registry import make_reader

WRITERS = {
    "one.bag": ("rosbag", recordings.bags),
    "sqlite3/sqlite3.db3": ("rosbag", recordings.bags),
    "mcap/mcap.mcap": ("rosbag", recordings.bags),
    "mcap/metadata.yaml": ("rosbag", recordings.bags),
    "text/cameras.txt": ("colmap", recordings.colmap),
    "text/images.txt": ("colmap", recordings.colmap),
    "binary/cameras.bin": ("colmap", recordings.colmap),
    "binary/images.bin": ("colmap", recordings.colmap),
    "binary/stereo/depth_maps/0.png.geometric.bin": ("colmap", recordings.colmap),
    "transforms.json": ("nerfstudio", recordings.nerfstudio),
}
CHANGES = st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.binary(max_size=9), st.integers(0, 9)), max_size=3)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)
FEW = settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(params=WRITERS)
def written(request, tmp_path):
    """The reader's name, and a valid file."""
    reader, write = WRITERS[request.param]
    write(tmp_path / "data")
    return reader, tmp_path / "data" / request.param


def read(reader: str, path: Path) -> None:
    """All that a reader reads of the scene that the file belongs to; its own exceptions are expected."""
    root = path if path.suffix in (".bag", ".db3", ".mcap") else path.parents[2 if "stereo" in path.parts else 0]
    with suppress(TracknoiseError):
        made = make_reader(reader, root)
        for scene in made.sequences():
            sequence = made.open(scene)
            sequence.image(0)
            sequence.depth(0)


@FEW
@given(changes=CHANGES, kept=st.floats(0, 1))
def test_changed_and_shortened_files(written, changes, kept):
    reader, path = written
    valid = path.read_bytes()
    try:
        content = bytearray(valid)
        for place, new, length in changes:
            at = int(place * len(content))
            content[at : at + length] = new
        path.write_bytes(content if changes else content[: int(kept * len(content))])
        read(reader, path)
    finally:
        path.write_bytes(valid)


@settings(FEW, max_examples=150)
@given(value=JSON, where=st.integers(0, 10**6))
def test_any_value_in_transforms_json(tmp_path, value, where):
    root = tmp_path / "data"
    if not root.exists():
        recordings.nerfstudio(root)
        (root / "valid").write_bytes((root / "transforms.json").read_bytes())
    document = json.loads((root / "valid").read_text())
    holder = [document, *document["frames"]][where % 3]
    holder[sorted(holder)[where // 3 % len(holder)]] = value
    (root / "transforms.json").write_text(json.dumps(document))
    read("nerfstudio", root / "transforms.json")
