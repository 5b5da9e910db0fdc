"""Silhouettes kept between two passes: what comes back is what was kept, whatever happened to the run that kept them."""

import os

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.io.masks import MaskStep, keep_masks, kept_masks


def steps(first, last, seed=0, shapes=((12, 17), (5, 8))):
    """Random masks; every camera lacks some, and most frames have no doubts."""
    for index in range(first, last):
        rng = np.random.default_rng((seed, index))
        masks = tuple(None if rng.random() < 0.2 else rng.random(shape) < 0.3 for shape in shapes)
        doubtful = tuple(rng.random(shape) < 0.3 if rng.random() < 0.2 else None for shape in shapes)
        yield MaskStep(index, tuple(np.zeros((*shape, 3), np.uint8) for shape in shapes), masks, doubtful)


def keep(path, first, last, key="k", problems=None, **more):
    return list(keep_masks(path, key, first, steps(first, last, **more), [].append if problems is None else problems.append))


def same(kept, made):
    for a, b in zip(kept, made, strict=True):
        assert a.index == b.index and a.images == (None, None)
        for one, other in zip((*a.masks, *a.doubtful), (*b.masks, *b.doubtful), strict=True):
            assert (one is None) == (other is None)
            if one is not None:
                assert one.dtype == bool
                np.testing.assert_array_equal(one, other)


def test_what_was_kept_comes_back(tmp_path):
    path = tmp_path / "new" / ".masks"
    assert [step.index for step in keep(path, 3, 20)] == list(range(3, 20))
    same(kept_masks(path, "k", 3, 20), steps(3, 20))
    same(kept_masks(path, "k", 9, 11), steps(9, 11))


@settings(max_examples=20, deadline=None)
@given(size=st.tuples(st.integers(1, 40), st.integers(1, 40)), seed=st.integers(0, 9))
def test_any_size(tmp_path_factory, size, seed):
    path = tmp_path_factory.mktemp("any") / "masks"
    keep(path, 0, 3, seed=seed, shapes=(size, size[::-1]))
    same(kept_masks(path, "k", 0, 3), steps(0, 3, seed, (size, size[::-1])))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes")
@pytest.mark.parametrize("make", ["pipe", "link to itself", "link to nothing"])
def test_what_is_no_file_is_not_waited_for(tmp_path, make):
    path = tmp_path / ".masks"
    if make == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to(path if make == "link to itself" else tmp_path / "nothing")
    keep(path, 0, 3)
    assert path.is_file() and not path.is_symlink()
    same(kept_masks(path, "k", 0, 3), steps(0, 3))


def test_all_or_nothing(tmp_path):
    path = tmp_path / "masks"
    assert kept_masks(path, "k", 0, 1) is None
    keep(path, 3, 8)
    assert kept_masks(path, "other", 3, 8) is None
    assert kept_masks(path, "k", 2, 8) is None and kept_masks(path, "k", 3, 9) is None


@pytest.mark.parametrize("lost_bytes", [0, 1, 40])
def test_a_killed_run_goes_on(tmp_path, lost_bytes):
    """Frames from the one on that the journal says is next are made anew, and half a frame is cut off."""
    path = tmp_path / "masks"
    keep(path, 0, 8)
    path.write_bytes(path.read_bytes()[: path.stat().st_size - lost_bytes])
    keep(path, 5, 12, seed=7)
    same(kept_masks(path, "k", 0, 12), [*steps(0, 5), *steps(5, 12, seed=7)])


def test_another_run_s_silhouettes_are_thrown_away(tmp_path):
    path = tmp_path / "masks"
    keep(path, 0, 8, key="old")
    keep(path, 5, 8)
    assert kept_masks(path, "k", 0, 8) is None and kept_masks(path, "old", 0, 5) is None
    same(kept_masks(path, "k", 5, 8), steps(5, 8))


def test_a_full_disk_only_costs_time(tmp_path, monkeypatch):
    problems = []
    (tmp_path / "file").write_text("")
    assert len(keep(tmp_path / "file" / "masks", 0, 4, problems=problems)) == 4
    assert len(problems) == 1 and "cannot be kept" in problems[0]
