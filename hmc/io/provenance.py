"""Which code made a result: the versions of the libraries, a digest of the package, and the commit where it is a git checkout."""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from hmc import __version__

__all__ = ["code_digest", "code_state", "commit", "library_versions", "machine"]

PACKAGE = Path(__file__).resolve().parents[1]


def library_versions() -> dict[str, str]:
    """Versions of Python, of this package and of the libraries that its numbers depend on."""
    versions = {"python": platform.python_version(), "hmc": __version__}
    for name in ("numpy", "scipy", "scikit-learn", "opencv-python-headless"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:  # OpenCV built by hand
            continue
    return versions


@cache
def code_digest(package: Path = PACKAGE) -> str:
    """A digest of every source file of the package, 16 hexadecimal digits: the same code has the same, whatever its version says."""
    total = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        total.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return total.hexdigest()[:16]


@cache
def commit(package: Path = PACKAGE) -> str | None:
    """The commit of the checkout that the package lies in, with a plus sign where the package differs from it; None: there is none."""
    head = _git(package, "rev-parse", "--short=12", "HEAD")
    if head is None or _git(package, "ls-files", "--error-unmatch", "__init__.py") is None:
        return None
    return head + ("+" if _git(package, "status", "--porcelain", "--", ".") else "")


def code_state() -> dict[str, str]:
    """What tells the code: ``code``, the digest, and ``commit`` where there is one."""
    known = commit()
    return {"code": code_digest()} | ({} if known is None else {"commit": known})


def machine() -> str:
    """The kind of machine, for what depends on its speed: processor, cores and system, no name."""
    return f"{platform.machine()}, {os.cpu_count()} cores, {platform.system()}"


def _git(folder: Path, *arguments: str) -> str | None:
    try:
        done = subprocess.run(["git", *arguments], cwd=folder, capture_output=True, text=True, timeout=10, check=False)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
