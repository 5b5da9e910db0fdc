"""Completion of command lines: the scripts are read by the shells themselves, which are then asked."""

import shlex
import shutil
import subprocess

import pytest

from hmc.cli import COMMANDS, main
from hmc.pose.registry import METHODS


def script_of(shell, folder):
    path = folder / f"hmc.{shell}"
    with path.open("w", encoding="utf-8") as file, pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.stdout", file)
        assert main(["completion", shell]) == 0
    return path


def run(program, folder):
    done = subprocess.run(program, capture_output=True, text=True, cwd=folder, check=True)
    assert not done.stderr
    return done.stdout.splitlines()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("completion")
    (folder / "my session.toml").touch()
    return folder


def needs(shell):
    return pytest.mark.skipif(shutil.which(shell) is None, reason=f"there is no {shell} here")


@pytest.fixture(scope="module")
def bash(folder):
    if shutil.which("bash") is None:
        pytest.skip("there is no bash here")
    path = script_of("bash", folder)

    def ask(*words):
        line = f'COMP_WORDS=({shlex.join(words)}); COMP_CWORD={len(words) - 1}; _hmc; printf "%s\\n" "${{COMPREPLY[@]}}"'
        return run(["bash", "--norc", "-c", f"source {path}; complete -p hmc >/dev/null; {line}"], folder)

    return ask


@pytest.fixture(scope="module")
def zsh(folder):
    path = script_of("zsh", folder)

    def ask(*words):
        # the builtins of a completion need the line editor: what they would be given is printed in their place
        stubs = 'compdef() { :; }; _describe() { print -l -- "${(@)${(P)2}%%:*}"; }; _files() { print -l -- *; }'
        line = f"words=({shlex.join(words)}); CURRENT={len(words)}; _hmc"
        return run(["zsh", "-f", "-c", f"{stubs}; source {path}; {line}"], folder)

    return ask


@pytest.fixture(scope="module")
def fish(folder):
    path = script_of("fish", folder)

    def ask(*words, described=False):
        line = f"source {path}; complete -C {shlex.quote(shlex.join(words[:-1]) + ' ' + words[-1])}"
        return [row.rstrip() if described else row.split("\t")[0] for row in run(["fish", "--no-config", "-c", line], folder)]

    return ask


def test_bash_completes_commands_options_values_and_files(bash):
    assert bash("hmc", "tr") == ["track"]
    assert set(bash("hmc", "")) == set(COMMANDS)
    assert bash("hmc", "pose", "--smo") == ["--smooth"]
    assert bash("hmc", "pose", "somewhere", "--method", "shbm") == [name for name in METHODS if name.startswith("shbm")]
    assert bash("hmc", "pose", "--passes", "=", "") == ["1", "2"]
    assert bash("hmc", "run", "my") == ["my session.toml"]
    assert bash("hmc", "pose", "--like", "m") == ["my session.toml"]
    assert bash("hmc", "track", "--voxel", "") == [""]  # a number: nothing to offer
    assert "tiny" in bash("hmc", "synth", "t")
    assert bash("hmc", "experiments", "run", "fig-2") == ["fig-2.4"]
    assert bash("hmc", "experiments", "sta") == ["status"]


@needs("zsh")
def test_zsh_completes_the_same(zsh):
    assert set(zsh("hmc", "")) == set(COMMANDS)
    assert "--smooth" in zsh("hmc", "pose", "--smo") and "--threshold" not in zsh("hmc", "pose", "--smo")
    assert zsh("hmc", "pose", "--method", "") == list(METHODS)
    assert "my session.toml" in zsh("hmc", "run", "")
    assert zsh("hmc", "pose", "--passes", "") == ["1", "2"]


@needs("fish")
def test_fish_completes_the_same(fish):
    assert fish("hmc", "tr") == ["track"]
    assert fish("hmc", "pose", "--smo") == ["--smooth"]
    assert fish("hmc", "pose", "--method", "shbm") == sorted(name for name in METHODS if name.startswith("shbm"))
    assert "my session.toml" in " ".join(fish("hmc", "run", "my")).replace("\\ ", " ")
    assert fish("hmc", "experiments", "sta") == ["status"]
    assert fish("hmc", "pose", "--method", "smd", described=True) == ["smd"]  # what the option is says nothing of one value
    assert fish("hmc", "pose", "--pass", described=True)[0].startswith("--passes\t")
