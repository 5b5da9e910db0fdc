"""One frame on, whatever filter says where people are: a fold over the rules of `hmc.tracking.rules`.

Source: Canton (2009), Figure 4.1 (filters in the middle, creation and deletion around them). A filter is a function that moves the
persons' particles; without one, each person is at the centroid of their voxels (`hmc.tracking.naive`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import reduce

import numpy as np

from hmc.errors import InputError
from hmc.tracking.blobs import Observation
from hmc.tracking.rules import RULE_SETS
from hmc.tracking.rules.birth import confirm
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.state import TrackerInfo, TrackerState, TrackRow, coasted
from hmc.tracking.update import Filter, Rule, begin_update

__all__ = ["advance", "finish", "init", "original_number"]


def init(fps: float, most: int | None = None) -> TrackerState:
    """The state before the first frame: without tracks.

    Parameters
    ----------
    fps : float
        Frames a second.
    most : int, optional
        People who are there at once at most.

    Raises
    ------
    InputError
        When `fps` is not positive.
    """
    if not np.isfinite(fps) or fps <= 0:
        raise InputError(f"`fps` must be a positive number of frames a second; got {fps}")
    return TrackerState(float(fps), most=most)


def advance(
    state: TrackerState,
    frame: int,
    observation: Observation | None,
    settings: FollowingSettings,
    filter: Filter | None = None,
    rules: Iterable[Rule] | None = None,
) -> tuple[TrackerState, TrackerInfo]:
    """The state after a frame, and what was found in it.

    Parameters
    ----------
    state : TrackerState
    frame : int
        Absolute number; frames come in order.
    observation : Observation or None
        None where the frame tells nothing: every track waits. An observation without voxels means that no person is there.
    settings : FollowingSettings
    filter : callable, optional
        Says where each person is. Where left out, each is at the centroid of the voxels that they own.
    rules : iterable of callable
        What is done with the frame, in this order; where left out, as the settings say.
    """
    if observation is None:
        waiting = tuple(replace(coasted(track, state.fps), last_frame=track.last_frame + 1) for track in state.tracks)
        return replace(state, tracks=waiting), TrackerInfo(())
    chosen = RULE_SETS[settings.rules] if rules is None else rules
    update = reduce(lambda update, rule: rule(update, settings), chosen, begin_update(state, frame, observation, filter))
    return update.after(), update.info()


def original_number(reidentified: tuple[tuple[int, int], ...], person: int) -> int:
    """The number that a person who may have come back had at first.

    Parameters
    ----------
    reidentified : tuple of (int, int)
        Of the last state.
    person : int
    """
    return dict(reidentified).get(person, person)


def finish(state: TrackerState, n_frames: int, settings: FollowingSettings | None = None) -> tuple[TrackRow, ...]:
    """Rows still to come when the recording is over.

    In a recording too short for any candidate to be confirmed, those seen in every frame are persons.

    Parameters
    ----------
    state : TrackerState
    n_frames : int
        Frames in the recording.
    settings : FollowingSettings, optional
    """
    settings = FollowingSettings() if settings is None else settings
    withheld = tuple(replace(row, person=track.person) for track in state.tracks for row in track.withheld)
    if n_frames > max(settings.lifecycle.confirm_frames, round(settings.lifecycle.confirm_s * state.fps)):
        return withheld
    seen = [one for one in state.candidates if len(one.rows) >= n_frames][: state.most]
    return withheld + confirm(seen, state.next_person, state.fps)[1]
