"""C3D files: one that another program wrote, the three processor types by the specification, and damaged ones."""

import struct
from pathlib import Path

import numpy as np
import pytest
from c3d_files import DEC, INTEL, MIPS, write_c3d
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.errors import InputError
from hmc.io.c3d import read_c3d

FILE = Path(__file__).resolve().parents[1] / "files" / "points.c3d"


def test_a_file_of_another_program():
    """Written by ezc3d 1.7.2 with NumPy's default_rng(0): 5 points, 7 frames, one point missing once, and an analogue channel."""
    data = read_c3d(FILE)
    expected = np.round(np.random.default_rng(0).normal(0, 800, (3, 5, 7)), 3).transpose(2, 1, 0) / 1000
    expected[3, 2] = np.nan
    assert data.labels == ("P00", "P01", "P02", "P03", "P04") and data.rate == 120
    assert np.allclose(data.positions, expected, atol=1e-6, equal_nan=True)
    assert (data.of("P03") == data.positions[:, 3]).all() and data.of("P05") is None


def test_numbers_of_a_vax():
    """1.0 and -13.625 as the VAX architecture handbook has them: 80 40 00 00 and 5A C2 00 00."""
    from hmc.io.c3d import _numbers

    assert _numbers(bytes.fromhex("804000005ac20000"), "float", "<", DEC).tolist() == [1.0, -13.625]


@pytest.mark.parametrize("processor", [INTEL, DEC, MIPS])
@pytest.mark.parametrize("scale", [-1.0, 0.25])
@settings(max_examples=15, deadline=None)
@given(st.integers(1, 4), st.integers(1, 6), st.integers(0, 3), st.integers(0, 2**31))
def test_every_kind_of_file(tmp_path_factory, processor, scale, n_points, n_frames, n_analog, seed):
    rng = np.random.default_rng(seed)
    points = rng.integers(1, 2000, (n_frames, n_points, 3)) * 0.25
    missing = rng.random((n_frames, n_points)) < 0.3
    path = tmp_path_factory.mktemp("c3d") / "file.c3d"
    labels = [f"Lee:M{k}" for k in range(n_points)]
    write_c3d(path, labels, points, 60.0, processor=processor, scale=scale, missing=missing, n_analog=n_analog, units="cm")
    data = read_c3d(path)
    assert data.labels == tuple(f"M{k}" for k in range(n_points)) and data.rate == 60
    assert np.allclose(data.positions, np.where(missing[..., None], np.nan, points / 100), equal_nan=True)


def test_a_point_in_the_origin_is_missing(tmp_path):
    points = np.ones((2, 2, 3))
    points[1, 0] = 0
    write_c3d(tmp_path / "file.c3d", ["a", "b"], points, 120.0)
    assert np.isnan(read_c3d(tmp_path / "file.c3d").positions).all(axis=-1).tolist() == [[False, False], [True, False]]


@pytest.mark.parametrize("processor", [INTEL, DEC, MIPS])
@pytest.mark.parametrize("first", [1, 32768, 65531, 70001, 131072])
def test_frames_are_numbered_as_the_group_trial_says(tmp_path, processor, first):
    """The header's words are those of a program that lets them run over."""
    last = first + 9
    path, header = tmp_path / "file.c3d", (first % 65536, last % 65536)
    write_c3d(path, ["a"], np.ones((10, 1, 3)), 120.0, processor=processor, header=header, trial=(first, last))
    data = read_c3d(path)
    assert data.first_frame == first - 1 and len(data.positions) == 10


def test_more_frames_than_the_header_can_say(tmp_path):
    write_c3d(tmp_path / "file.c3d", ["a"], np.ones((65540, 1, 3)), 120.0, header=(1, 65535), trial=(1, 65540))
    assert len(read_c3d(tmp_path / "file.c3d").positions) == 65540


def test_without_a_group_trial_the_header_says(tmp_path):
    write_c3d(tmp_path / "file.c3d", ["a"], np.ones((10, 1, 3)), 120.0, header=(41, 50))
    data = read_c3d(tmp_path / "file.c3d")
    assert data.first_frame == 40 and len(data.positions) == 10
    # One that ends before it begins says nothing.
    write_c3d(tmp_path / "file.c3d", ["a"], np.ones((10, 1, 3)), 120.0, header=(41, 50), trial=(41, 0))
    data = read_c3d(tmp_path / "file.c3d")
    assert data.first_frame == 40 and len(data.positions) == 10


@pytest.mark.parametrize("length", [0, 100, 512, 700, 1024, 1100])
def test_what_is_cut_off_is_told(tmp_path, length):
    path = tmp_path / "file.c3d"
    path.write_bytes(FILE.read_bytes()[:length])
    with pytest.raises(InputError, match=r"file\.c3d: not a C3D file, or a damaged one"):
        read_c3d(path)


def test_other_wrong_files(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_c3d(tmp_path / "none.c3d")
    write_c3d(tmp_path / "inch.c3d", ["a"], np.ones((2, 1, 3)), 120.0, units="inch")
    with pytest.raises(InputError, match="units 'inch'"):
        read_c3d(tmp_path / "inch.c3d")
    content = bytearray(FILE.read_bytes())
    struct.pack_into("<H", content, 2, 9)
    (tmp_path / "many.c3d").write_bytes(content)
    with pytest.raises(InputError, match="9 points and 5 labels"):
        read_c3d(tmp_path / "many.c3d")
