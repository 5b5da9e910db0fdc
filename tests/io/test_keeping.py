"""What is written into a user's recording: the new beside the old, or, where the disk is full, all as it was."""

import builtins
import errno
import os
from pathlib import Path

import numpy as np
import pytest

from hmc.errors import InputError
from hmc.io import files, keeping
from hmc.io.calibration import read_calibration, write_calibration
from hmc.io.keeping import write_keeping
from hmc.io.new_timing import write_new_timing
from hmc.io.new_world import write_new_world, write_session_world


def contents(folder):
    return {str(file.relative_to(folder)): file.is_file() and file.read_bytes() for file in folder.rglob("*")}


def fill_disk(monkeypatch, names):
    """From now on, files whose name has one of these in it can be made, and nothing be written into them."""

    def opened(path, mode="r", **options):
        file = builtins.open(path, mode, **options)
        if "w" in mode and any(name in Path(path).name for name in names):

            def write(text):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

            monkeypatch.setattr(file, "write", write, raising=False)
        return file

    for module in (files, keeping):
        monkeypatch.setattr(module, "open", opened, raising=False)
    plain = Path.write_text
    monkeypatch.setattr(Path, "write_text", lambda path, text, **options: opened(path, "w").write(text) or plain(path, text, **options))


@pytest.fixture
def folder(tmp_path, ring):
    write_calibration(tmp_path / "calibration.toml", ring)
    (tmp_path / "recording.toml").write_text("fps = 30\nroom = [[0, 0, 0], [1, 1, 2]]\nfirst_frame = { a = 1 }\n")
    (tmp_path / "times").mkdir()
    (tmp_path / "times" / "c.csv").write_text("frame,time_s\n0,1\n")
    return tmp_path


WRITERS = {
    "timing": lambda folder, rig: write_new_timing(folder, {"a": 2}, {"c": np.array([0.0, 0.1]), "d": np.array([0.0, 0.1])}),
    "world": write_new_world,
    "session": lambda folder, rig: write_session_world(folder / "session.toml", rig, {}),
    "calibration": lambda folder, rig: write_calibration(folder / "calibration.toml", rig),
    "a new folder": lambda folder, rig: write_keeping({folder / "a" / "b" / "recording.toml": "fps = 30\n"}),
}


@pytest.mark.parametrize(
    ("writer", "full"),
    [
        ("timing", "recording"),
        ("timing", ".c."),
        ("timing", ".d."),
        ("world", "calibration"),
        ("world", "recording"),
        ("session", "calibration"),
        ("calibration", "calibration"),
        ("a new folder", "recording"),
    ],
)
def test_a_full_disk_takes_nothing_away(folder, ring, monkeypatch, writer, full):
    """What was there had another name before the new was written, and a calibration was half of one."""
    before = contents(folder)
    with monkeypatch.context() as patch:
        fill_disk(patch, [full])
        with pytest.raises(InputError, match=r"^\S+: cannot be written \(No space left on device\)$"):
            WRITERS[writer](folder, ring)
    assert contents(folder) == before
    WRITERS[writer](folder, ring)


@pytest.mark.parametrize("failing", ["link", "replace"])
@pytest.mark.parametrize("writer", ["timing", "world"])
def test_what_cannot_be_kept_or_put_in_its_place_leaves_all_as_it_was(folder, ring, monkeypatch, writer, failing):
    """The second of several files fails: by then the first has its second name, or is in its place."""
    before, calls = contents(folder), []
    real = getattr(os, failing)

    def fails(*args, **options):
        calls.append(args)
        if len(calls) == 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(*args, **options)

    def no_copy(file, kept, **options):
        Path(kept).write_text("half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(os, failing, fails)
        patch.setattr("shutil.copy2", no_copy)
        with pytest.raises(InputError, match="No space left on device"):
            WRITERS[writer](folder, ring)
    assert len(calls) >= 2 and contents(folder) == before


@pytest.mark.parametrize("links", [True, False])
def test_what_was_there_has_another_name(tmp_path, monkeypatch, links):
    """By a link or, where the file system has none, as a copy; names that are taken are left."""
    if not links:
        monkeypatch.setattr(os, "link", lambda *args, **options: (_ for _ in ()).throw(OSError(errno.EPERM, "no links")))
    file, other = tmp_path / "a.toml", tmp_path / "new" / "b.toml"
    file.write_text("one")
    assert write_keeping({file: "two", other: "b"}) == {file: tmp_path / "a_before.toml", other: None}
    assert write_keeping({file: "three"}) == {file: tmp_path / "a_before_2.toml"}
    texts = {"a.toml": b"three", "a_before.toml": b"one", "a_before_2.toml": b"two", "new": False, "new/b.toml": b"b"}
    assert contents(tmp_path) == texts


@pytest.mark.skipif(os.name == "nt", reason="links need rights there")
def test_a_link_is_kept_as_a_link(tmp_path):
    """Whom the link leads to may be another recording's too."""
    shared, link = tmp_path / "shared.toml", tmp_path / "recording.toml"
    shared.write_text("one")
    link.symlink_to("shared.toml")
    write_keeping({link: "two"})
    assert shared.read_text() == "one" and link.read_text() == "two" and not link.is_symlink()
    assert os.readlink(tmp_path / "recording_before.toml") == "shared.toml"


def test_a_calibration_that_is_written_is_read(tmp_path, ring):
    write_calibration(tmp_path / "new" / "calibration.toml", ring)
    assert read_calibration(tmp_path / "new").names == ring.names
