"""The ffmpeg program is found in the package, on PATH, or not at all."""

import subprocess
import sys
import types

import pytest

from hmc.io.ffmpeg import ffmpeg_path


def raising(error):
    def get_ffmpeg_exe():
        raise error

    return types.SimpleNamespace(get_ffmpeg_exe=get_ffmpeg_exe)


def test_the_package_comes_first(monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", types.SimpleNamespace(get_ffmpeg_exe=lambda: "/somewhere/ffmpeg"))
    assert ffmpeg_path() == "/somewhere/ffmpeg"


@pytest.mark.parametrize("package", [None, raising(RuntimeError("no exe"))])
def test_else_the_one_on_path(monkeypatch, tmp_path, package):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", package)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert ffmpeg_path() is None
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    assert ffmpeg_path() == str(program)


def test_what_is_found_runs():
    program = ffmpeg_path()
    if program is None:
        pytest.skip("no ffmpeg here")
    said = subprocess.run([program, "-version"], capture_output=True, text=True, check=True).stdout
    assert said.startswith("ffmpeg version")
