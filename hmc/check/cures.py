"""Commands that findings name as a cure, as a shell takes them."""

from __future__ import annotations

from shlex import quote

from hmc.io.places import AnyPlaces, to_places

__all__ = ["check_command", "pose_command", "sync_command", "world_command"]


def check_command(recording: AnyPlaces) -> str:
    """Looks the recording over."""
    return _command("check", recording)


def pose_command(recording: AnyPlaces, result: str, *more: str) -> str:
    """Finds all poses."""
    return _command("pose", recording, "--out", result, *more)


def sync_command(recording: AnyPlaces) -> str:
    """Finds when each camera took its frames."""
    return _command("sync", recording)


def world_command(recording: AnyPlaces) -> str:
    """Finds up, the floor and the scale."""
    return _command("world", recording)


def _command(name: str, recording: AnyPlaces, *more: str) -> str:
    places = to_places(recording)
    session = [] if places.session is None else ["--session", str(places.session)]
    absent = "" if places.there else " (once these images lie in a recording's folder)"  # they are in memory
    return " ".join(["hmc", name, *map(quote, [str(places.path), *session, *more])]) + absent
