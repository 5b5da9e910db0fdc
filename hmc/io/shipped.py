"""Where the recipes and the small recording are that come with the package: in a checkout, else where an installation put them."""

from __future__ import annotations

import functools
import sysconfig
from pathlib import Path

from hmc.errors import InputError
from hmc.io.recording import Recording, open_recording

__all__ = ["DISTRIBUTION", "sample", "shipped_folder"]

#: The name under which the package is installed; `hmc`, under which it is imported, is another project's on the package index.
DISTRIBUTION = "hmc-mocap"
_CHECKOUT = Path(__file__).resolve().parents[2] / "data" / "synthetic"
#: Below an installation's data (pyproject.toml).
_INSTALLED = "share/hmc/synthetic"
_SAMPLE = "tiny"


@functools.cache
def shipped_folder() -> Path:
    """The folder of recipes (``NAME.toml``) and of the recording ``tiny``.

    The files of an installation are found by its own list of them, as `pip install --user` and `--target` put data elsewhere than
    `sysconfig` says. A folder that is not there is returned too: nothing is in it.
    """
    if _CHECKOUT.is_dir():
        return _CHECKOUT
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        listed = distribution(DISTRIBUTION).files or []
    except PackageNotFoundError:
        listed = []
    for file in listed:
        if file.as_posix().endswith(f"{_INSTALLED}/{_SAMPLE}/calibration.toml"):
            found = Path(str(file.locate())).resolve().parents[1]
            if found.is_dir():
                return found
    return Path(sysconfig.get_path("data")) / _INSTALLED


def sample(frames: int | None = None) -> Recording:
    """The recording that comes with the package: a man walks, rendered; 7 cameras, 320 x 240 pixels, 30 frames at 15 a second, with truth.

    Parameters
    ----------
    frames : int, optional
        The first so many frames; all where left out.

    Raises
    ------
    InputError
        When the installation has no such recording.

    Examples
    --------
    >>> import hmc
    >>> recording = hmc.sample(frames=8)
    >>> len(recording.rig), recording.n_frames
    (7, 8)
    """
    folder = shipped_folder() / _SAMPLE
    if not folder.is_dir():
        raise InputError(
            f"{folder}: the sample is missing from this installation; install {DISTRIBUTION} anew, from its wheel or a checkout"
        )
    return open_recording(folder, frames=frames)
