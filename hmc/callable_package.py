"""Packages that can be called: `hmc.pose` is the room of pose estimation, and ``hmc.pose(recording)`` estimates poses.

A package and a function of one name cannot both be attributes of `hmc`; whichever is imported last would hide the other. So the package
itself takes the call, and hands it to the function of `hmc.api`.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import Any

__all__ = ["make_callable"]


class _CallablePackage(ModuleType):
    """A package that hands a call to the function of its name in `hmc.api`."""

    def __call__(self, *args: Any, **named: Any) -> Any:
        function = getattr(importlib.import_module("hmc.api"), self.__name__.rpartition(".")[2])
        return function(*args, **named)


def make_callable(name: str) -> None:
    """Let a package take calls.

    Parameters
    ----------
    name : str
        Its full name; there is a function of the last part of it in `hmc.api`, whose docstring tells of the call.
    """
    sys.modules[name].__class__ = _CallablePackage
