"""One run at a time in a folder."""

import os
import signal
import subprocess
import sys

import pytest

from hmc.errors import InputError
from hmc.io.lock import only_run

HOLDER = (
    "import sys, time\nfrom hmc.io.lock import only_run\nwith only_run(sys.argv[1]):\n    print('held', flush=True)\n    time.sleep(60)\n"
)


def test_the_second_run_says_so_and_leaves_nothing(tmp_path):
    folder = tmp_path / "result"
    with only_run(folder), pytest.raises(InputError, match="result: another run is at work there"), only_run(folder, wait_s=0):
        pass
    with only_run(folder, wait_s=0):
        assert list(folder.iterdir()) == []


def test_a_killed_run_holds_nothing(tmp_path):
    process = subprocess.Popen([sys.executable, "-c", HOLDER, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "held\n"
    with pytest.raises(InputError, match="another run"), only_run(tmp_path, wait_s=0):
        pass
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    process.stdout.close()
    with only_run(tmp_path, wait_s=0):
        pass


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"), only_run(tmp_path / "file" / "result"):
        pass
