"""What the second pass knows of a recording, the same for all people and frames, and what frames show by it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from hmc.body.model import BodyModel
from hmc.io.masks import MaskStep, kept_frames
from hmc.io.recording import Frame, Recording, iterate_frames
from hmc.io.results import PoseStates, TrackTable
from hmc.pose.back_settings import BackwardSettings
from hmc.pose.contacts import Footing
from hmc.pose.follow import FollowOptions
from hmc.pose.keypoint_cues import with_keypoints
from hmc.pose.method import Capture
from hmc.pose.objectives.symmetric import body_distance
from hmc.pose.occluders import HiddenPlaces, unseen_voxels
from hmc.pose.person import PersonTrack
from hmc.pose.views.person_view import PersonView, views_of
from hmc.processes import each_ahead
from hmc.tracking.resumable import person_grid
from hmc.voxels.carving import shared_tables
from hmc.voxels.hulls import stream_hulls
from hmc.voxels.run_options import RunOptions

__all__ = ["SecondPass", "with_own_rays"]

T = TypeVar("T")

#: Of the random numbers of a frame: those of the backward pass.
BACKWARD = 3
#: A ray that passes another's body as near as this may be of that one, metres: as wide as clothes are.
OTHERS_M = 0.03


@dataclass(frozen=True)
class SecondPass:
    """What is the same for all people and frames."""

    recording: Recording
    tracks: TrackTable
    persons: Mapping[int, PersonTrack]
    settings: BackwardSettings
    options: FollowOptions
    run: RunOptions
    capture: Capture
    states: PoseStates
    bodies: Mapping[int, BodyModel]
    places: HiddenPlaces | None
    footing: Mapping[int, Footing]

    def each(self, make: Callable[[Sequence[int]], Iterator[T]], frames: Sequence[int]) -> Iterator[T]:
        """What is made of each of some frames, made ahead by processes."""
        shared_tables(person_grid(self.recording, self.options.voxel_size_m), self.recording.rig)  # once, for all processes
        return each_ahead(make, frames, self.run.workers)

    def views_of(self, frames: Sequence[int]) -> Iterator[tuple[int, dict[int, PersonView]]]:
        """What some frames show of all people, in any order, by what the first pass tells of the scene and of the others' poses."""
        made = self._made([frame for frame in frames if self.recent(frame) is None])
        for frame in frames:
            recent = self.recent(frame)
            views = self._on_their_way(frame, next(made) if recent is None else recent)
            if not self.settings.own_rays:
                yield frame, views
                continue
            rows = np.flatnonzero(self.states.frames == frame)
            rows = rows[np.isfinite(self.states.states[rows]).all(axis=1)]
            poses = {
                person: (self.bodies[person], self.states.states[row])
                for person, row in zip(self.states.persons[rows].tolist(), rows, strict=True)
            }
            yield frame, {person: with_own_rays(view, person, poses) for person, view in views.items()}

    def _on_their_way(self, frame: int, views: dict[int, PersonView]) -> dict[int, PersonView]:
        """The same with what is known of who goes where, who stands, and on what."""

        def on_feet(person: int, view: PersonView) -> PersonView:
            known = self.footing.get(person)
            view = replace(view, velocity=self.persons[person].velocity(frame))
            if view.target is None or known is None:
                return view
            return replace(view, target=replace(view.target, floor_z=known.ground_z, standing=known.feet.get(frame, (False,) * 4)))

        return {person: on_feet(person, view) for person, view in views.items()}

    def recent(self, frame: int) -> dict[int, PersonView] | None:
        """What the first pass saw in a frame, if that is still there and nothing has been learnt of the scene since."""
        recent = self.options.recent
        if recent is None or self.places is not None or frame not in recent.views:
            return None
        views = recent.views[frame]
        return {person: view if self.options.keypoints else replace(view, keypoints=None) for person, view in views.items()}

    def _made(self, frames: Sequence[int]) -> Iterator[dict[int, PersonView]]:
        """The same of each of some frames, by its silhouettes."""
        grid = person_grid(self.recording, self.options.voxel_size_m)
        masks = kept_frames(self.run.masks or "", self.run.key, frames)
        for hull in stream_hulls(self.recording, grid, self.run.frontend, masks=masks):
            unseen = None if self.places is None else unseen_voxels(self.places, hull.masks)
            views = views_of(self.recording, grid, self.tracks, hull, unseen=unseen)
            yield with_keypoints(views, self.recording.rig, self.tracks, self.options.keypoints, hull.masks)

    def pictures(self, frames: Sequence[int]) -> Iterator[tuple[Frame, MaskStep]]:
        """Images and silhouettes of some frames, rising; what cannot be read was told when silhouettes were made."""
        masks = kept_frames(self.run.masks or "", self.run.key, frames) or ()
        # Read in one go: to open a video in the middle takes as long as to pass over what is before.
        images = iterate_frames(self.recording, frames[0], frames[-1] + 1, on_problem=lambda _: None, only=set(frames))
        return zip(images, masks, strict=True)

    def rng(self, person: int, frame: int) -> np.random.Generator:
        """The random numbers of a person's frame."""
        return np.random.default_rng([self.options.seed, person, frame, BACKWARD])


def with_own_rays(view: PersonView, person: int, poses: Mapping[int, tuple[BodyModel, np.ndarray]]) -> PersonView:
    """A person's view without the rays that another's pose covers: what another may be of asks nothing."""
    if view.target is None or view.target.rays is None or not len(view.target.rays):
        return view
    rays = view.target.rays
    for other, (body, state) in poses.items():
        if other != person and len(rays):
            rays = rays[body_distance(body, state[None], rays)[0] > OTHERS_M]
    return replace(view, target=replace(view.target, rays=rays))
