"""What may be asked of finished poses beyond their arrays; `hmc.pose.follow.PosedPeople` has these as methods."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from hmc.errors import InputError
from hmc.io.results import PoseStates, PoseTable

if TYPE_CHECKING:
    from hmc.motion.trajectory import Trajectory

__all__ = ["FinishedPeople"]


class FinishedPeople:
    """Methods of poses of several people over time."""

    poses: PoseTable
    states: PoseStates
    fps: float | None

    def trajectories(self, fps: float | None = None) -> list[Trajectory]:
        """A trajectory a person, without a missing row (`hmc.motion.trajectory.Trajectory`).

        Parameters
        ----------
        fps : float, optional
            Frames a second; by default those of the recording.

        Raises
        ------
        InputError
            When they are not known.
        """
        from hmc.motion.trajectory import trajectories

        return trajectories(self.poses, self.states, self._known_fps(fps))

    def smoothed(
        self,
        kind: Literal["butterworth", "polynomial"] = "butterworth",
        cutoff_hz: float = 6.0,
        window_s: float = 0.4,
        fps: float | None = None,
    ) -> Any:
        """The same people with smooth trajectories; seconds, as nothing is estimated again.

        Parameters
        ----------
        kind, cutoff_hz, window_s
            As `hmc.motion.smoothing.Smoothing`.
        fps : float, optional
            As for `trajectories`.

        Returns
        -------
        PosedPeople
            Gaps are where they were.

        Raises
        ------
        InputError
            When the frame rate is not known, or too low for the cutoff.
        """
        from hmc.motion.smoothing import Smoothing, smooth_trajectory

        how = Smoothing(kind, cutoff_hz, window_s)
        positions, states = self.poses.positions.copy(), self.states.states.copy()
        for one in self.trajectories(fps):
            smooth = smooth_trajectory(one, how)
            rows = np.flatnonzero((self.poses.persons == one.person) & np.isfinite(positions).any(axis=(1, 2)))
            places = self.poses.frames[rows] - one.frames[0]
            positions[rows] = smooth.positions[places]
            # Only states of today's body are told back; older ones have fewer entries and are left.
            if smooth.states is not None and states.shape[1] == smooth.states.shape[1]:
                states[rows] = smooth.states[places]
        changes = {"poses": replace(self.poses, positions=positions), "states": replace(self.states, states=states)}
        return replace(self, **changes)  # type: ignore[type-var]

    def _known_fps(self, fps: float | None) -> float:
        known = fps or self.fps
        if not known:
            raise InputError("how many frames a second is not known of these poses; give fps")
        return known
