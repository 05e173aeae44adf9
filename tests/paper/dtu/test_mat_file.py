"""MATLAB files: what is read of them, and which are refused."""

import os
import random
import struct
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy.io import savemat

from tracknoise.exceptions import DataError
from tracknoise.paper.dtu import read_calibration, read_mat, write_mat

NUMBERS = arrays.arrays(
    st.sampled_from(["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", ">f8", ">i4"]),
    st.one_of(st.tuples(st.integers(0, 5), st.integers(0, 5)), st.tuples(*[st.integers(1, 3)] * 3)),
)
NAMES = st.from_regex(r"\A[a-zA-Z][a-zA-Z0-9_]{0,12}\Z")


@settings(max_examples=60, deadline=None)
@given(st.dictionaries(NAMES, NUMBERS, max_size=4), st.sampled_from(["4", "5", "5 compressed"]))
def test_numbers_are_those_that_were_saved(tmp_path_factory, variables, version):
    path = tmp_path_factory.mktemp("mat") / "x.mat"
    flat = {name: value for name, value in variables.items() if version != "4" or (value.ndim == 2 and value.size)}
    flat["always"] = np.arange(6.0).reshape(2, 3)
    savemat(path, flat, format=version[0], do_compression="compressed" in version)
    found = read_mat(path, list(flat))
    assert set(found) == set(flat)
    for name, value in found.items():
        assert value.shape == flat[name].shape
        np.testing.assert_array_equal(value, flat[name])
        if version != "4":  # which has no integers of 8 or 64 bits
            assert value.dtype.newbyteorder("=") == flat[name].dtype.newbyteorder("=")


@pytest.mark.parametrize("version", ["4", "5"])
@pytest.mark.parametrize("value", ["words", np.array([1 + 2j]), np.eye(2, dtype=complex)])
def test_what_is_not_real_numbers_is_marked(tmp_path, version, value):
    savemat(tmp_path / "x.mat", {"a": value, "b": 1.0}, format=version)
    found = read_mat(tmp_path / "x.mat", ["a", "b"])
    assert found["a"] is None
    assert found["b"] == 1.0


def test_cells_structures_and_logical_arrays(tmp_path):
    cell = np.empty((1, 2), object)
    cell[0] = ["x", 2.0]
    savemat(tmp_path / "x.mat", {"cell": cell, "structure": {"a": 1.0}, "yes": np.array([[True, False]])})
    found = read_mat(tmp_path / "x.mat", ["cell", "structure", "yes"])
    assert found["cell"] is found["structure"] is None
    assert found["yes"].tolist() == [[1, 0]]


def test_a_file_of_the_other_byte_order(tmp_path):
    """Made by hand: SciPy writes the order of the machine only."""

    def element(kind, data):
        return struct.pack(">II", kind, len(data)) + data + bytes(-len(data) % 8)

    numbers = struct.pack(">4d", 1.0, 2.0, 3.0, 4.0)
    parts = element(6, struct.pack(">II", 6, 0)) + element(5, struct.pack(">2i", 2, 2))
    matrix = element(14, parts + struct.pack(">HHcxxx", 1, 1, b"a") + element(9, numbers))
    header = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x01\x00MI"
    for content in (
        header + matrix,
        header + struct.pack(">II", 15, len(zlib.compress(matrix))) + zlib.compress(matrix),
    ):
        (tmp_path / "x.mat").write_bytes(content)
        np.testing.assert_array_equal(read_mat(tmp_path / "x.mat", ["a"])["a"], [[1.0, 3.0], [2.0, 4.0]])


@pytest.fixture(params=["plain", "compressed", "version 4"])
def whole(request, tmp_path, calibration):
    path = tmp_path / "Calib_Results_11.mat"
    if request.param == "plain":
        write_mat(path, calibration)
    else:
        options = {"do_compression": True} if request.param == "compressed" else {"format": "4"}
        savemat(path, calibration, **options)
    read_calibration(path)
    return path


@pytest.mark.filterwarnings("ignore::tracknoise.exceptions.DataWarning")
def test_a_damaged_calibration_is_read_or_refused_whichever_byte_is_changed(whole):
    """SciPy's reader ends its process at one of a hundred of these."""
    content, rng, refusals = whole.read_bytes(), random.Random(12), []
    places = [*range(0, 200, 3), *rng.sample(range(len(content)), 80)]
    for place in places:
        damaged = bytearray(content)
        damaged[place] = rng.choice([0, 1, 0x7F, 0x80, 0xFF, damaged[place] ^ 1 << rng.randrange(8)])
        whole.write_bytes(damaged)
        try:
            read_calibration(whole)
        except DataError as error:
            refusals.append(str(error))
    assert len(refusals) > 20
    assert all(text.startswith(str(whole)) and "\n" not in text for text in refusals)


@pytest.mark.filterwarnings("ignore::tracknoise.exceptions.DataWarning")
def test_a_calibration_that_is_cut_off_is_refused(whole):
    content = whole.read_bytes()
    for size in range(0, len(content), len(content) // 50):
        whole.write_bytes(content[:size])
        with pytest.raises(DataError):
            read_calibration(whole)


def test_an_array_larger_than_stated_is_not_unpacked(tmp_path):
    bomb = struct.pack("<II", 14, 0xFFFFFFF8) + struct.pack("<IIII", 6, 8, 6, 0) + bytes(1 << 24)
    packed = zlib.compress(bomb)
    content = b"MATLAB".ljust(124) + b"\x00\x01IM" + struct.pack("<II", 15, len(packed)) + packed
    (tmp_path / "x.mat").write_bytes(content)
    with pytest.raises(DataError, match="a damaged file"):
        read_mat(tmp_path / "x.mat", ["a"])


@pytest.mark.parametrize("rows", [0, 1, -1])
def test_sizes_beyond_every_array_are_refused(tmp_path, rows):
    def element(kind, data):
        return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

    sizes = struct.pack("<8i", rows, *[2**31 - 1] * 7)
    parts = element(6, struct.pack("<II", 6, 0)) + element(5, sizes) + element(1, b"a") + element(9, b"")
    (tmp_path / "x.mat").write_bytes(b"MATLAB".ljust(124) + b"\x00\x01IM" + element(14, parts))
    with pytest.raises(DataError, match="a damaged file"):
        read_mat(tmp_path / "x.mat", ["a"])


def test_what_is_not_a_regular_file_is_refused(tmp_path):
    os.mkfifo(tmp_path / "x.mat")
    with pytest.raises(DataError, match="not a regular file"):
        read_mat(tmp_path / "x.mat", ["a"])
    with pytest.raises(DataError, match="unreadable"):
        read_mat(tmp_path, ["a"])
