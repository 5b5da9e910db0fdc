"""Which code made a result: digests of files, and commits of real checkouts."""

import subprocess
import tomllib

import pytest

from hmc.io.provenance import code_digest, code_state, commit, machine
from hmc.io.results import write_run


def git(folder, *arguments):
    done = subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b.c", *arguments], cwd=folder, capture_output=True, text=True)
    if done.returncode:
        pytest.skip("git does not work here")
    return done.stdout.strip()


@pytest.fixture
def package(tmp_path):
    folder = tmp_path / "checkout" / "tool"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text("")
    (folder / "part.py").write_text("A = 1\n")
    return folder


def fresh(function, package):
    function.cache_clear()
    return function(package)


def test_a_digest_is_of_names_and_contents(package):
    first = fresh(code_digest, package)
    assert len(first) == 16 and fresh(code_digest, package) == first
    (package / "part.py").write_text("A = 2\n")
    second = fresh(code_digest, package)
    (package / "part.py").rename(package / "other.py")
    third = fresh(code_digest, package)
    (package / "notes.txt").write_text("no code")
    assert len({first, second, third}) == 3 and fresh(code_digest, package) == third


def test_a_commit_is_told_with_a_plus_where_the_package_was_changed(package):
    assert fresh(commit, package) is None
    git(package.parent, "init", "-q")
    git(package.parent, "add", ".")
    git(package.parent, "commit", "-qm", "first")
    head = git(package, "rev-parse", "--short=12", "HEAD")
    assert fresh(commit, package) == head
    (package.parent / "notes.txt").write_text("beside the package")
    assert fresh(commit, package) == head
    (package / "part.py").write_text("A = 2\n")
    assert fresh(commit, package) == head + "+"


def test_a_package_that_lies_in_somebody_elses_checkout_has_no_commit(package):
    """As an installed one, in an environment within a checkout that ignores it."""
    git(package.parent, "init", "-q")
    (package.parent / ".gitignore").write_text("tool/\n")
    git(package.parent, "add", ".")
    git(package.parent, "commit", "-qm", "first")
    assert fresh(commit, package) is None


def test_a_run_says_which_code_it_was(tmp_path):
    commit.cache_clear()
    code_digest.cache_clear()
    write_run(tmp_path / "run.toml", "apf", {}, 0)
    versions = tomllib.loads((tmp_path / "run.toml").read_text())["versions"]
    assert versions["code"] == code_digest() and {**versions, **code_state()} == versions
    assert "cores" in machine()
