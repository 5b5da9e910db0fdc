"""Limbs that silhouettes leave open, settled by the colors of the person's own parts.

Both passes may have an arm folded before a thigh where it hangs beside it: hull and silhouettes bear out the one about as well as the
other. The person's colors do not (`hmc.pose.part_colors`). They are learnt from the limbs that are trusted (`hmc.pose.trust`) and asked of
the doubtful ones alone:

1. Where patches of a doubtful limb say less for it than its colors usually do, other poses of that limb are looked for: drawn at random,
   then about the best of these, closer and closer. What counts is what the frame asks of any pose
   (`hmc.pose.steps.polish.fine_objective`) less what colors say.
2. The best of them and the pose as it was make a path through time (Viterbi, 1967): what counts in each frame, and how far the limb moves.

Ours.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from hmc.body.kinematics import landmarks
from hmc.body.limbs import LIMBS
from hmc.body.model import BodyModel
from hmc.body.prior import POSTURE
from hmc.camera.model import Rig
from hmc.io.recording import Recording, spread_frames
from hmc.landmarks import TRUSTED
from hmc.motion.smoothing import stretches
from hmc.pose.clear_views import kept_borne_out
from hmc.pose.method import Subject, other_rng
from hmc.pose.part_colors import (
    ColorSettings,
    FrameColors,
    PartColors,
    Shown,
    Skin,
    count_colors,
    frame_colors,
    gains,
    learn_part_colors,
    no_counts,
    patch_sides,
    shown,
    skin_of,
)
from hmc.pose.steps.polish import fine_objective
from hmc.pose.steps.proposal import shows_enough
from hmc.pose.trust import trust_features, trust_of
from hmc.pose.views.color_patches import OUTSIDE
from hmc.pose.views.person_view import PersonView
from hmc.search.paths import cheapest_path
from hmc.search.truncated import truncated_normal

if TYPE_CHECKING:
    from hmc.pose.follow import PosedPeople
    from hmc.pose.second_pass import SecondPass

__all__ = ["Found", "OtherLimb", "limbs_by_color"]

#: Of the random numbers of a frame (`hmc.pose.method.other_rng`); the limb's chain is added.
PURPOSE = 3
#: Frames whose colors are in memory at a time.
LOT = 64


@dataclass(frozen=True)
class OtherLimb:
    """Poses of one limb of one person in one frame.

    Parameters
    ----------
    person : int
    limb : str
        Of `hmc.body.limbs.LIMBS`.
    angles : ndarray, shape (n, 4)
        Radians; the first is the pose that it had.
    costs : ndarray, shape (n,)
        Square metres, less what colors say; with the margin of new poses.
    """

    person: int
    limb: str
    angles: np.ndarray
    costs: np.ndarray


#: Of each frame in which a limb is doubtful, what was found.
Found = Mapping[int, Sequence[OtherLimb]]


def limbs_by_color(
    pass_: SecondPass,
    subjects: Mapping[int, Subject],
    people: PosedPeople,
    settings: ColorSettings,
    known: Found,
    keep: Callable[[int, Sequence[OtherLimb]], Any],
) -> PosedPeople:
    """The poses with limbs where colors say that they are.

    Parameters
    ----------
    pass_ : SecondPass
    subjects : mapping of int to Subject
        All people, with their own bodies.
    people : PosedPeople
        After the second pass.
    settings : ColorSettings
    known : mapping of int to sequence of OtherLimb
        By frame, what a run that was stopped had found.
    keep : callable
        Called with each frame and what was found in it, in order of time.

    Returns
    -------
    PosedPeople
        As they were where there are no images, or where no limb is doubtful. Costs stay those that the poses had before.
    """
    recording: Recording = pass_.recording
    borne_out = kept_borne_out(people, recording, replace(pass_.run, progress=None)) if recording.has_images else None
    if borne_out is None:
        return people
    trust = trust_of(trust_features(people.poses, borne_out, people.passes_apart, recording.fps))
    doubts = _doubts(people, trust, list(subjects), settings)
    frames = [frame for frame in np.unique(people.frames[doubts.asked.any(axis=0)]).tolist() if frame not in known]
    found = dict(known)
    if frames:
        skins = {number: skin_of(subject.body) for number, subject in subjects.items()}
        sides = patch_sides(recording.rig, np.nanmedian(people.positions[:, 0], axis=0))
        rows = _rows_of(people, list(subjects))
        asking = _Asking(replace(pass_, states=people.states), subjects, people, doubts, settings, rows, skins, sides)
        for frame, limbs in zip(frames, asking.search_all(frames, asking.learn()), strict=True):
            found[frame] = limbs
            keep(frame, limbs)
    return _along_paths(people, subjects, found, recording.fps, settings) if found else people


def _rows_of(people: PosedPeople, persons: Sequence[int]) -> dict[int, dict[int, int]]:
    """By frame, and by person, the row of everybody with a pose."""
    rows: dict[int, dict[int, int]] = {frame: {} for frame in people.frames.tolist()}
    known = np.isin(people.persons, persons) & np.isfinite(people.states.states).all(axis=1)
    for row in np.flatnonzero(known).tolist():
        rows[int(people.frames[row])][int(people.persons[row])] = row
    return rows


@dataclass(frozen=True)
class _Doubts:
    """Limbs in the rows of a table, bool, shape (4, n) each: which are asked for, and from which colors are learnt."""

    asked: np.ndarray
    sure: np.ndarray


def _doubts(people: PosedPeople, trust: np.ndarray, persons: Sequence[int], settings: ColorSettings) -> _Doubts:
    """Which limbs are in doubt, by the trust in their joints, shape (n, 15)."""
    asked, sure = np.zeros((2, len(LIMBS), len(people.frames)), bool)
    fitted = np.array([status == "fitted" for status in people.status]) & np.isfinite(trust).all(axis=1)
    for person in persons:
        rows = np.flatnonzero(fitted & (people.persons == person))
        rows = rows[np.argsort(people.frames[rows])]
        for k, limb in enumerate(LIMBS.values()):
            lowest = trust[rows][:, limb.landmarks].min(axis=1)
            for some in stretches(lowest < TRUSTED):
                asked[k, rows[some]] = lowest[some].min() < settings.worst
            sure[k, rows] = lowest >= min(TRUSTED, np.median(lowest)) if len(rows) else False
    return _Doubts(asked, sure)


@dataclass(frozen=True)
class _Asking:
    """What is the same for all frames that are asked.

    Parameters
    ----------
    pass_ : SecondPass
        Others' rays by the poses after it.
    subjects : mapping of int to Subject
    people : PosedPeople
    doubts : _Doubts
    settings : ColorSettings
    rows : mapping of int to mapping of int to int
        By frame, and by person, the row of everybody with a pose.
    skins : mapping of int to Skin
        Everybody's.
    sides : tuple of int
        Of the patches of each camera, pixels.
    """

    pass_: SecondPass
    subjects: Mapping[int, Subject]
    people: PosedPeople
    doubts: _Doubts
    settings: ColorSettings
    rows: Mapping[int, Mapping[int, int]]
    skins: Mapping[int, Skin]
    sides: tuple[int, ...]

    @property
    def rig(self) -> Rig:
        """The recording's cameras."""
        return self.pass_.recording.rig

    def colors_in(self, frames: Sequence[int]) -> Iterator[FrameColors]:
        """The patches of some frames, rising."""
        for frame, step in self.pass_.pictures(frames):
            yield frame_colors(self.rig, frame.images, step.masks, self.sides)

    def shown(self, frame: int, colors: FrameColors, person: int, without: int | None = None) -> dict[int, Shown]:
        """What each camera shows of one person, behind and before all others; without one of the chains."""
        everybody = []
        for other, row in self.rows[frame].items():
            skin = self.skins[other] if other == person else self.skins[other].of_another()
            if other == person and without is not None:
                skin = skin.where(skin.chain != without)
            everybody.append((skin, skin.placed(self.subjects[other].body, self.people.states.states[row])))
        return {k: shown(self.rig[k], side, everybody) for k, side in colors.sides.items()}

    def learn(self) -> dict[int, PartColors]:
        """Everybody's colors, from frames of the whole run: of the trunk and of limbs that are not doubtful or less so than usually."""
        counts = {person: no_counts(self.rig) for person in self.subjects}
        frames = spread_frames(np.unique(self.people.frames), self.settings.learn_frames)
        for frame, colors in zip(frames, self.colors_in(frames), strict=True):
            for person, row in self.rows[frame].items():
                sure = [0, *(1 + np.flatnonzero(self.doubts.sure[:, row])).tolist()]
                for camera, seen in self.shown(frame, colors, person).items():
                    count_colors(counts[person], camera, seen, colors.bins[camera], sure)
        return {person: learn_part_colors(own) for person, own in counts.items()}

    def search_all(self, frames: Sequence[int], colors: Mapping[int, PartColors]) -> Iterator[list[OtherLimb]]:
        """Of each frame what `search` finds; images are read by this process alone, lot by lot."""
        seen = self.colors_in(frames)
        for start in range(0, len(frames), LOT):
            some = frames[start : start + LOT]
            own = dict(zip(some, islice(seen, len(some)), strict=True))
            yield from self.pass_.each(partial(self.search, own, colors), some)

    def search(
        self, in_frame: Mapping[int, FrameColors], colors: Mapping[int, PartColors], frames: Sequence[int]
    ) -> Iterator[list[OtherLimb]]:
        """Of each of some frames the doubtful limbs that have not their own colors, with other poses of them."""
        for frame, views in self.pass_.views_of(frames):
            found, seen = [], in_frame[frame]
            for person, row in self.rows[frame].items():
                view, asked = views.get(person), [name for name in LIMBS if self.doubts.asked[_chain(name) - 1, row]]
                if view is None or not asked or not shows_enough(view.target):
                    continue
                with_all = self.shown(frame, seen, person)
                for name in asked:
                    if not self._has_its_colors(seen, with_all, _chain(name), colors[person]):
                        found.append(self._others(frame, seen, person, name, view, colors[person]))
            yield found

    def _has_its_colors(self, seen: FrameColors, with_all: Mapping[int, Shown], chain: int, colors: PartColors) -> bool:
        """Whether patches of a limb bear it out, or cannot tell."""
        said, usual, n = 0.0, 0.0, 0
        for camera, there in with_all.items():
            bins = seen.bins[camera][there.patch]
            own = (there.chain == chain) & (bins != OUTSIDE)
            said += float(colors.said(camera, there.kind[own], bins[own]).sum())
            usual += float(colors.usual[camera][there.kind[own]].sum())
            n += int(own.sum())
        tell = n >= self.settings.least_patches and usual >= self.settings.least_nats * n
        return not tell or said >= self.settings.own_share * usual

    def _others(self, frame: int, seen: FrameColors, person: int, name: str, view: PersonView, colors: PartColors) -> OtherLimb:
        settings, limb, subject, chain = self.settings, LIMBS[name], self.subjects[person], _chain(name)
        state = self.people.states.states[self.rows[frame][person]]
        rng = other_rng(self.pass_.rng(person, frame), PURPOSE + chain)
        polish = self.pass_.settings.polish
        polish = replace(polish, symmetric=replace(polish.symmetric, hand_cap_m=settings.hand_cap_m))
        objective = fine_objective(rng, subject, view, polish)
        rest, own = self.shown(frame, seen, person, without=chain), self.skins[person].where(self.skins[person].chain == chain)

        def cost(angles: np.ndarray) -> np.ndarray:
            states = _with_angles(state, name, angles)
            gained = gains(self.rig, colors, seen, rest, (own.placed(subject.body, states), own.kind))
            return objective.cost(states) - settings.weight_m2 * gained

        low, high = subject.body.limits.low[limb.dofs], subject.body.limits.high[limb.dofs]
        common, any_ = settings.draws // 2, settings.draws - settings.draws // 2
        drawn = np.concatenate(
            [
                state[None, limb.dofs],
                truncated_normal(rng, np.tile(POSTURE[0][limb.dofs], (common, 1)), POSTURE[1][limb.dofs], low, high),
                rng.uniform(low, high, (any_, len(limb.dofs))),
            ]
        )
        costs = cost(drawn)
        was, cost_was = drawn[0], costs[0]
        for spread in settings.spreads:
            best = np.argsort(costs, kind="stable")[: settings.best]
            about = drawn[best[np.arange(settings.about) % len(best)]]
            near = truncated_normal(rng, about, np.full(len(limb.dofs), spread), low, high)
            drawn, costs = np.concatenate([drawn[best], near]), np.r_[costs[best], cost(near)]
        picks = _apart(landmarks(subject.body, _with_angles(state, name, drawn))[:, limb.landmarks], costs, settings)
        return OtherLimb(person, name, np.concatenate([was[None], drawn[picks]]), np.r_[cost_was, costs[picks] + settings.margin_m2])


def _chain(name: str) -> int:
    """The chain of a limb, as in `hmc.body.limbs.CHAIN_OF_PART`."""
    return 1 + list(LIMBS).index(name)


def _with_angles(state: np.ndarray, name: str, angles: np.ndarray) -> np.ndarray:
    """A pose, shape (37,), with a limb at other angles, shape (n, 4): shape (n, 37)."""
    states = np.repeat(state[None], len(angles), axis=0)
    states[:, LIMBS[name].dofs] = angles
    return states


def _apart(places: np.ndarray, costs: np.ndarray, settings: ColorSettings) -> list[int]:
    """The best of some poses of a limb that are apart, by where its joints are, shape (n, 2, 3), metres."""
    picks: list[int] = []
    for k in np.argsort(costs, kind="stable").tolist():
        if len(picks) < settings.kept and all(np.linalg.norm(places[k] - places[one], axis=1).max() > settings.apart_m for one in picks):
            picks.append(k)
    return picks


def _along_paths(people: PosedPeople, subjects: Mapping[int, Subject], found: Found, fps: float, settings: ColorSettings) -> PosedPeople:
    """The poses with every limb on its cheapest path."""
    states, positions = people.states.states.copy(), people.positions.copy()
    others = {(frame, one.person, one.limb): one for frame, limbs in found.items() for one in limbs}
    for person, subject in subjects.items():
        rows = np.flatnonzero((people.persons == person) & np.isfinite(people.states.states).all(axis=1))
        rows = rows[np.argsort(people.frames[rows])]
        frames = people.frames[rows]
        for name, limb in LIMBS.items():
            choices = [others.get((int(frame), person, name)) for frame in frames]
            if not any(choices):
                continue
            angles = [states[row, limb.dofs][None] if one is None else one.angles for row, one in zip(rows, choices, strict=True)]
            costs = [np.zeros(1) if one is None else one.costs for one in choices]
            posed = [_with_angles(states[row], name, some) for row, some in zip(rows, angles, strict=True)]
            picks = cheapest_path(costs, partial(_ways, frames, _limb_places(subject.body, posed, name), fps, settings))
            states[rows] = [some[pick] for some, pick in zip(posed, picks, strict=True)]
        positions[rows] = landmarks(subject.body, states[rows])
    return replace(people, poses=replace(people.poses, positions=positions), states=replace(people.states, states=states))


def _limb_places(body: BodyModel, posed: Sequence[np.ndarray], name: str) -> list[np.ndarray]:
    """Where a limb's joints are in each of some poses of each frame, shape (n_poses, 2, 3) each, metres."""
    places = landmarks(body, np.concatenate(posed))[:, LIMBS[name].landmarks]
    return np.split(places, np.cumsum([len(some) for some in posed])[:-1])


def _ways(frames: np.ndarray, places: Sequence[np.ndarray], fps: float, settings: ColorSettings, k: int) -> np.ndarray:
    """What the ways of a limb cost, from each of its poses before frame k to each in it."""
    way = ((places[k][None] - places[k - 1][:, None]) ** 2).sum(axis=-1).mean(axis=-1)
    return settings.step_weight * fps / (30.0 * (frames[k] - frames[k - 1])) * way
