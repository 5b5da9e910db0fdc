"""What may be asked of finished poses beyond their arrays; `hmc.pose.follow.PosedPeople` has these as methods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from hmc.errors import InputError
from hmc.io.results import PoseStates, PoseTable

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation
    from matplotlib.figure import Figure

    from hmc.body.joints import JointLimits
    from hmc.motion.trajectory import Trajectory

__all__ = ["FinishedPeople"]


class FinishedPeople:
    """Methods of poses of several people over time."""

    poses: PoseTable
    states: PoseStates
    costs: np.ndarray
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
            When they are not known, or no number above 0.
        """
        from hmc.motion.trajectory import trajectories

        return trajectories(self.poses, self.states, self._known_fps(fps))

    def smoothed(
        self,
        kind: Literal["butterworth", "polynomial"] = "butterworth",
        cutoff_hz: float = 6.0,
        window_s: float = 0.4,
        fps: float | None = None,
        limits: JointLimits | None = None,
    ) -> Any:
        """The same people with smooth trajectories; seconds, as nothing is estimated again.

        Parameters
        ----------
        kind, cutoff_hz, window_s
            As `hmc.motion.smoothing.Smoothing`.
        fps : float, optional
            As for `trajectories`.
        limits : JointLimits, optional
            Within which the angles stay (`hmc.pose.method.PoseMethod.limits`); by default those of `trajectories`.

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
            if limits is not None and one.body is not None:
                one = replace(one, body=replace(one.body, limits=limits))
            smooth = smooth_trajectory(one, how)
            rows = np.flatnonzero((self.poses.persons == one.person) & np.isfinite(positions).any(axis=(1, 2)))
            places = self.poses.frames[rows] - one.frames[0]
            positions[rows] = smooth.positions[places]
            # Only states of today's body are told back; older ones have fewer entries and are left.
            if smooth.states is not None and states.shape[1] == smooth.states.shape[1]:
                states[rows] = smooth.states[places]
        changes = {"poses": replace(self.poses, positions=positions), "states": replace(self.states, states=states)}
        return replace(self, **changes)  # type: ignore[type-var]

    def clinical_angles(self, fps: float | None = None) -> Any:
        """Angles over time with clinical names and signs, degrees (docs/angles.md).

        Parameters
        ----------
        fps : float, optional
            As for `trajectories`.

        Returns
        -------
        pandas.DataFrame
            ``frame``, ``time_s``, ``person`` and the names of `hmc.motion.clinical.CLINICAL_ANGLES`; NaN where an angle is not shown. Where
            trust is known, a column an angle more (``..._trust``): the least of the landmarks that it rests on.

        Raises
        ------
        InputError
            When the frame rate is not known, or nobody has a pose.
        """
        import pandas as pd

        return pd.DataFrame(self._angle_table(fps))

    def plot_angles(self, names: Sequence[str] | None = None, fps: float | None = None) -> Figure:
        """A figure of the angles over time, left and right in one panel.

        Parameters
        ----------
        names : sequence of str, optional
            Such as ``["knee_flexion", "trunk_flexion"]``; by default all.
        fps : float, optional
            As for `trajectories`.

        Raises
        ------
        InputError
            When there is no such angle, the frame rate is not known, or nobody has a pose.
        """
        from hmc.motion.clinical import doubtful_angles
        from hmc.view.motion_plots import draw_angles

        table = self._angle_table(fps)
        return draw_angles(table, names, doubtful_angles(table, self.poses))

    def animate(self, step: int = 1, fps: float | None = None) -> FuncAnimation:
        """Moving stick figures; in a notebook ``HTML(people.animate().to_jshtml())`` shows them.

        Parameters
        ----------
        step : int
            Each how many frames one is shown; more where there would be more than 300.
        fps : float, optional
            As for `trajectories`.

        Raises
        ------
        InputError
            When there is no pose, or the frame rate is not known.
        """
        from hmc.view.motion_plots import animate_sticks

        return animate_sticks(self.poses.frames, self.poses.persons, self.poses.positions, self._known_fps(fps), step)

    def __repr__(self) -> str:
        """A line a person: what a terminal shows."""
        heads, *rows = self._summary()
        lines = [", ".join(f"{head} {cell}" for head, cell in zip(heads, row, strict=True)) for row in rows]
        return "\n  ".join([f"{type(self).__name__}:", *lines])

    def _repr_html_(self) -> str:
        """A small table for notebooks: a row a person."""
        heads, *rows = self._summary()
        lines = [_html_row("th", heads), *(_html_row("td", row) for row in rows)]
        return f"<table>{''.join(lines)}</table>"

    def _summary(self) -> list[list[str]]:
        """Heads, then a row a person."""
        heads = ["person", "frames", "with a pose", "stature (m)", "mean cost", "mean views", "mean trust"]
        rows = []
        for person in np.unique(self.poses.persons).tolist():
            own = self.poses.persons == person
            fitted = own & np.isfinite(self.poses.positions).any(axis=(1, 2))
            frames = self.poses.frames[own]
            of_landmarks = [None if values is None else values[fitted] for values in (self.poses.views, self.poses.trust)]
            rows.append([
                str(person), f"{frames.min()}–{frames.max()}", str(fitted.sum()),
                _mean(self.states.bodies.get(person, {}).get("height")), _mean(self.costs[fitted], "3g"),
                *(_mean(values) for values in of_landmarks),
            ])  # fmt: skip
        return [heads, *rows]

    def _angle_table(self, fps: float | None) -> dict[str, np.ndarray]:
        from hmc.motion.clinical import angle_table

        found = self.trajectories(fps)
        if not found:
            raise InputError("nobody has a pose")
        return angle_table(found)

    def _known_fps(self, fps: float | None) -> float:
        from hmc.motion.trajectory import above_zero

        known = self.fps if fps is None else above_zero("fps", fps)
        if not known:
            raise InputError("how many frames a second is not known of these poses; give fps")
        return known


def _mean(values: Any, form: str = "2f") -> str:
    """Of the known ones; a dash where there are none."""
    values = np.atleast_1d(np.asarray(np.nan if values is None else values, float))
    known = values[np.isfinite(values)]
    return f"{known.mean():.{form}}" if len(known) else "–"


def _html_row(tag: str, cells: list[str]) -> str:
    return "<tr>" + "".join(f"<{tag}>{cell}</{tag}>" for cell in cells) + "</tr>"
