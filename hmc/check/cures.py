"""Commands that findings name as a cure, as a shell takes them."""

from __future__ import annotations

from pathlib import Path
from shlex import quote

__all__ = ["sync_command", "world_command"]


def sync_command(recording: Path) -> str:
    """Finds when each camera took its frames."""
    return f"hmc sync {quote(str(recording))}"


def world_command(recording: Path) -> str:
    """Finds up, the floor and the scale."""
    return f"hmc world {quote(str(recording))}"
