"""The second pass: backward in time, with each person's own body, over poses that a first pass found.

A filter knows only the frames before: a limb that it loses stays lost until the silhouettes show it again, and the body was fitted to the
first second and a half. When the recording is over more is known:

1. Who was followed the wrong way round, by shapes and by the colors of heads, is turned about (`hmc.pose.turned`).
2. What the scene hides from single cameras is learnt from the first pass's poses (`hmc.pose.occluders`); and what another's pose
   covers asks nothing of a person. Feet that stand, as their motion tells, are held to the floor, or to what is on it
   (`hmc.pose.contacts`).
3. The person's dimensions are fitted anew, to frames of the whole run (`hmc.pose.starts.own_body`).
4. Each person is followed from the last frame to the first. Nothing is drawn at random but limbs that are lost: the pose of the frame after
   and the first pass's are refined side by side, so that a limb that was found again is followed back to where it was lost. Where a
   person was lost for long, so is a pose that is found anew (`hmc.pose.anew`).
5. Limbs that are still in doubt are looked for by the colors of the person's own parts (`hmc.pose.limb_colors`).
6. Each frame's pose was found by itself, with an error of its own; what differs from frame to frame is smoothed (`hmc.motion.smoothing`).

The third, fourth and fifth go on where they were when a run was stopped; the others take a moment. Ours; the papers follow forward only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np

from hmc.body.dimensions import FITTED
from hmc.body.exchange import swapped_pose
from hmc.body.kinematics import landmarks
from hmc.body.model import BodyModel
from hmc.body.proportions import make_bodies
from hmc.io.journal import append_journal, open_journal
from hmc.io.masks import kept_frames
from hmc.io.recording import Recording, spread_frames
from hmc.io.results import TrackTable
from hmc.pose.anew import doubtful_frames, pose_anew
from hmc.pose.back_settings import BackwardSettings
from hmc.pose.contacts import ground_notes, standing_feet
from hmc.pose.follow import FollowOptions, PosedPeople, persons_of
from hmc.pose.head_colors import turned_by_heads
from hmc.pose.keypoint_cues import beside_body, learn_beside
from hmc.pose.limb_colors import Found, OtherLimb, limbs_by_color
from hmc.pose.method import SURFACE_POINTS, Capture, PoseMethod, Subject, make_subject, other_rng
from hmc.pose.objectives.objective import Objective
from hmc.pose.occluders import learn_hidden_places
from hmc.pose.records import with_angles
from hmc.pose.second_pass import SecondPass
from hmc.pose.starts.fit_body import with_known_stature
from hmc.pose.starts.own_body import choose_frames, own_body
from hmc.pose.steps.polish import PolishSettings, fine_objective, polish
from hmc.pose.steps.proposal import shows_enough
from hmc.pose.steps.refine import refine
from hmc.pose.turned import followed_wrongly, stretches, turn_about
from hmc.pose.views.keypoint_pose import keypoint_pose
from hmc.pose.views.person_view import PersonView
from hmc.tracking.resumable import person_grid
from hmc.voxels.run_options import RunOptions

__all__ = ["backward"]

#: Of those of the backward pass (`hmc.pose.method.other_rng`).
ANEW, TURNED = 1, 2
#: Frames from which it is learnt where a detector's keypoints lie, at most, well spread.
BESIDE_FRAMES = 40


@dataclass(frozen=True)
class _Person:
    """What is known of one person: rows of the first pass's tables, and what the backward pass finds in them.

    Parameters
    ----------
    rows : ndarray of int, shape (n,)
        In order of time; only those that were fitted.
    subject : Subject
        With the person's own body.
    row_of : mapping of int to int
        Frame to its place in `rows`.
    own, back : ndarray, shape (n, 37)
        The first pass's poses, refined, and those of the backward one.
    costs : ndarray, shape (n,)
        Of those of the backward pass, square metres; NaN where nothing showed enough of the person.
    anew : frozenset of int
        Frames in which a pose is looked for anew.
    """

    rows: np.ndarray
    subject: Subject
    row_of: Mapping[int, int]
    own: np.ndarray
    back: np.ndarray
    costs: np.ndarray
    anew: frozenset[int] = frozenset()


def backward(
    recording: Recording, tracks: TrackTable, method: PoseMethod, people: PosedPeople, options: FollowOptions, run: RunOptions
) -> PosedPeople:
    """The poses after a second pass.

    Parameters
    ----------
    recording : Recording
    tracks : TrackTable
    method : PoseMethod
        As it is where `PoseMethod.back` is None.
    people : PosedPeople
        Of the first pass (`hmc.pose.follow.follow`), all of the recording's selection.
    options : FollowOptions
    run : RunOptions
        With the silhouettes that the first pass kept; its journal is another one than the first pass's.

    Returns
    -------
    PosedPeople
        The same rows. With a note and as they were where the silhouettes were not kept.
    """
    settings: BackwardSettings | None = method.back
    fitted = np.array([status == "fitted" for status in people.status], bool)
    if settings is None or not fitted.any():
        return people
    first, end = int(people.frames[fitted].min()), int(people.frames[fitted].max()) + 1
    if run.masks is None or kept_frames(run.masks, run.key, range(first, end)) is None:
        return replace(people, notes=(*people.notes, "silhouettes were not kept on disk: poses are those of one pass, forward in time"))
    run.say("fitting bodies")
    capture = Capture(recording.fps, options.voxel_size_m, recording.room, recording.rig, workers=run.workers)
    grid = person_grid(recording, options.voxel_size_m)
    places = learn_hidden_places(recording.rig, grid, run, people.states) if settings.hidden_places else None
    first_bodies = make_bodies(people.states.bodies, method.limits)
    floor_z = float(recording.room[0, 2])
    records = open_journal(run.journal, with_angles(run.key), run.on_problem)
    pass_ = SecondPass(
        recording, tracks, persons_of(recording, tracks), settings, options, run, capture, people.states, first_bodies, places, {}
    )
    if records:
        turned = {int(person): frames for person, frames in records[0]["turned_frames"].items()}
    else:
        turned = _followed_wrongly(pass_, people, fitted)
    people = _turned_about(people, fitted, turned, first_bodies)
    footing = standing_feet(people.states, first_bodies, recording.fps, floor_z) if settings.standing_feet else {}
    people = replace(people, notes=(*people.notes, *ground_notes(footing, floor_z)))
    pass_ = replace(pass_, states=people.states, footing=footing)
    if records:
        bodies = make_bodies({int(person): body for person, body in records[0]["bodies"].items()}, method.limits)
        known = {int(person): told for person, told in records[0].get("known", {}).items()}  # older journals do not say
    else:
        bodies, known = _bodies(pass_, people, fitted)
        if run.journal is not None:
            dimensions = {person: body.dimensions for person, body in bodies.items()}
            append_journal(run.journal, {"turned_frames": turned, "bodies": dimensions, "known": known})
    people = replace(people, known=known)
    pass_ = _with_beside(pass_, people, fitted, bodies)
    persons = {person: _begun(people, fitted, person, make_subject(body, pass_.capture)) for person, body in bodies.items()}
    if settings.anew is not None:
        lost = doubtful_frames({number: people.costs[person.rows] for number, person in persons.items()}, recording.fps, settings.anew)
        persons = {
            number: replace(person, anew=frozenset(people.frames[person.rows[lost[number]]].tolist())) for number, person in persons.items()
        }
    for record in [record for record in records if "rows" in record]:
        for person, own, back, cost in record["rows"]:
            _put(persons[person], record["frame"], np.array(own), np.array(back), cost)
        end = record["frame"]
    _sweep(pass_, persons, first, end)
    people = _joined(people, persons)
    if settings.colors is not None:
        run.say("asking colors")
        subjects = {number: person.subject for number, person in persons.items()}
        people = limbs_by_color(pass_, subjects, people, settings.colors, *_kept_colors(records, run))
    if settings.smooth_s is None:
        return people
    return people.smoothed("polynomial", window_s=settings.smooth_s, fps=recording.fps, limits=method.limits)


def _with_beside(pass_: SecondPass, people: PosedPeople, fitted: np.ndarray, bodies: Mapping[int, BodyModel]) -> SecondPass:
    """The same with what is learnt of where the detector's keypoints lie, by poses that the hulls alone refine."""
    if pass_.options.keypoints is None:
        return pass_
    persons = {number: _begun(people, fitted, number, make_subject(body, pass_.capture)) for number, body in bodies.items()}

    def told(some: Sequence[int]) -> Iterator[list[tuple[np.ndarray, float]]]:
        for frame, views in pass_.views_of(some):
            of_frame = []
            for number, person in persons.items():
                view = views.get(number)
                if frame in person.row_of and view is not None and view.keypoints is not None and shows_enough(view.target):
                    hulls = fine_objective(pass_.rng(number, frame), person.subject, replace(view, keypoints=None), pass_.settings.polish)
                    state, info = refine(hulls, person.own[person.row_of[frame]], pass_.settings.polish.refine)
                    of_frame.append((beside_body(person.subject.body, state, view.keypoints), info.cost))
            yield of_frame

    frames = spread_frames(np.unique(people.frames[fitted]), BESIDE_FRAMES)
    found = [one for of_frame in pass_.each(told, frames) for one in of_frame]
    return replace(pass_, capture=replace(pass_.capture, beside=learn_beside([beside for beside, _ in found], [cost for _, cost in found])))


def _bodies(pass_: SecondPass, people: PosedPeople, fitted: np.ndarray) -> tuple[dict[int, BodyModel], dict[int, dict[str, float]]]:
    """Every person's body, fitted to frames of the whole run where others bear it out, and how well each dimension is known."""
    settings, bodies, known = pass_.settings, dict(pass_.bodies), dict[int, dict[str, float]]()
    persons = {number: _begun(people, fitted, number, make_subject(body, pass_.capture)) for number, body in bodies.items()}
    if settings.fit_body is None:
        return bodies, known
    chosen = {number: choose_frames(people.costs[person.rows], settings.body_frames) for number, person in persons.items()}
    wanted = {number: {int(people.frames[persons[number].rows[k]]) for part in parts for k in part} for number, parts in chosen.items()}
    poses: dict[int, dict[int, tuple[Objective, np.ndarray]]] = {number: {} for number in persons}
    # By the hulls alone: where a detector's keypoints lie on this body is not known yet.
    hulls_alone = replace(pass_, options=replace(pass_.options, keypoints=None))
    in_wanted = {
        number: replace(person, row_of={frame: k for frame, k in person.row_of.items() if frame in wanted[number]})
        for number, person in persons.items()
    }
    for frame, refined in _each_refined(hulls_alone, in_wanted, sorted(set().union(*wanted.values()))):
        for number, (view, (own, *_)) in refined.items():
            objective = fine_objective(pass_.rng(number, frame), persons[number].subject, view, settings.polish)
            poses[number][persons[number].row_of[frame]] = objective, own
    for number, person in persons.items():
        picks, held_out = ([k for k in part if k in poses[number]] for part in chosen[number])
        subject, deviations = own_body(
            person.subject,
            poses[number],
            (picks, held_out),
            with_known_stature(settings.fit_body, pass_.options.height_m is not None),
            settings.polish.refine,
            SURFACE_POINTS,
            partial(make_subject, capture=pass_.capture),
        )
        bodies[number], known[number] = subject.body, dict(zip(FITTED, deviations, strict=True))
    return bodies, known


def _followed_wrongly(pass_: SecondPass, people: PosedPeople, fitted: np.ndarray) -> dict[int, list[int]]:
    """In which frames people were followed the wrong way round, by frames of the whole run."""
    settings = pass_.settings
    if settings.turned is None:
        return {}
    turned_settings, polish_settings = settings.turned, settings.polish
    persons = {number: _begun(people, fitted, number, make_subject(body, pass_.capture)) for number, body in pass_.bodies.items()}

    def evidence_in(asked: Mapping[int, Sequence[int]]) -> Iterator[dict[int, float]]:
        def told(some: Sequence[int]) -> Iterator[dict[int, float]]:
            for frame, views in pass_.views_of(some):
                evidence = {}
                for number in asked[frame]:
                    person, view = persons[number], views.get(number)
                    if view is not None and shows_enough(view.target):
                        rng = other_rng(pass_.rng(number, frame), TURNED)
                        state = person.own[person.row_of[frame]]
                        evidence[number] = turn_about(rng, person.subject, state, view, polish_settings, turned_settings.start).evidence
                yield evidence

        return pass_.each(told, list(asked))

    followed = {
        number: stretches(people.frames[person.rows], person.own[:, 3], pass_.recording.fps, turned_settings)
        for number, person in persons.items()
    }
    if not pass_.recording.has_images:
        return followed_wrongly(followed, evidence_in, turned_settings)
    return followed_wrongly(followed, evidence_in, turned_settings, partial(turned_by_heads, pass_))


def _turned_about(
    people: PosedPeople, fitted: np.ndarray, turned: Mapping[int, Sequence[int]], bodies: Mapping[int, BodyModel]
) -> PosedPeople:
    """The tables with some people's poses turned about in some frames."""
    states = people.states.states.copy()
    for person, frames in turned.items():
        for row in np.flatnonzero(fitted & (people.persons == person) & np.isin(people.frames, frames)):
            states[row] = swapped_pose(bodies[person], states[row], "all")
    return replace(people, states=replace(people.states, states=states)) if turned else people


def _begun(people: PosedPeople, fitted: np.ndarray, person: int, subject: Subject) -> _Person:
    """A person before the sweep: nothing of the backward pass is known."""
    rows = np.flatnonzero(fitted & (people.persons == person))
    rows = rows[np.argsort(people.frames[rows])]
    own = people.states.states[rows].copy()
    row_of = {int(frame): k for k, frame in enumerate(people.frames[rows])}
    return _Person(rows, subject, row_of, own, own.copy(), np.full(len(rows), np.nan))


def _put(person: _Person, frame: int, own: np.ndarray, back: np.ndarray, cost: float) -> None:
    k = person.row_of[frame]
    person.own[k], person.back[k], person.costs[k] = own, back, cost


def _sweep(pass_: SecondPass, persons: Mapping[int, _Person], first: int, end: int) -> None:
    """Follow everybody back from before frame `end`; what is found goes into the persons' tables and the journal."""
    steps = _each_refined(pass_, persons, range(end - 1, first - 1, -1))
    for frame, refined in pass_.run.progress(steps, end - first) if pass_.run.progress else steps:
        rows = []
        for number, (view, own) in refined.items():
            person, k = persons[number], persons[number].row_of[frame]
            after = person.back[k + 1] if k + 1 < len(person.rows) else person.own[k]
            back, cost = _back(pass_.rng(number, frame), person.subject, own, after, view, pass_.settings.polish)
            _put(person, frame, own[0], back, cost)
            rows.append((number, own[0], back, cost))
        if pass_.run.journal is not None:
            append_journal(pass_.run.journal, {"frame": frame, "rows": rows})


def _each_refined(
    pass_: SecondPass, persons: Mapping[int, _Person], frames: Sequence[int]
) -> Iterator[tuple[int, dict[int, tuple[PersonView, list[np.ndarray]]]]]:
    """What some frames show of those people of whom it is enough, with their first pose, refined, and those that the keypoints show by
    themselves: all that needs no other frame."""

    def refined(some: Sequence[int]) -> Iterator[tuple[int, dict[int, tuple[PersonView | None, list[np.ndarray]]]]]:
        for frame, views in pass_.views_of(some):
            recent = pass_.recent(frame) or {}
            shown = {number: view for number, view in views.items() if number in persons and frame in persons[number].row_of}
            yield (
                frame,
                {
                    # What the asking process has too is not sent.
                    number: (
                        None if number in recent and view.target is recent[number].target else view,
                        _own(pass_.rng(number, frame), persons[number], view, pass_.settings),
                    )
                    for number, view in shown.items()
                    if shows_enough(view.target)
                },
            )

    for frame, found in pass_.each(refined, frames):
        recent = pass_.recent(frame) or {}
        yield frame, {number: (recent[number] if view is None else view, own) for number, (view, own) in found.items()}


def _own(rng: np.random.Generator, person: _Person, view: PersonView, settings: BackwardSettings) -> list[np.ndarray]:
    """A frame's first pose, refined, and where it would be by the keypoints alone, and anew by the hulls alone."""
    objective = fine_objective(rng, person.subject, view, settings.polish)
    own, info = refine(objective, person.own[person.row_of[view.frame]], settings.polish.refine)
    found = [own, *keypoint_pose(person.subject.body, view.keypoints, own)]
    if view.frame in person.anew and settings.anew is not None and view.target is not None:
        found += pose_anew(
            other_rng(rng, ANEW), person.subject, view.target, objective, (own, info.cost_after), settings.polish, settings.anew
        )
    return found


def _back(
    rng: np.random.Generator, subject: Subject, own: Sequence[np.ndarray], after: np.ndarray, view: PersonView, settings: PolishSettings
) -> tuple[np.ndarray, float]:
    """The better of a frame's own poses (`_own`) and the next frame's, with lost limbs looked for; and its cost."""
    objective = fine_objective(rng, subject, view, settings)
    back, cost, _ = polish(rng, objective, [own[0], after, *own[1:]], after, settings)
    return back, cost


def _kept_colors(records: Sequence[Mapping], run: RunOptions) -> tuple[Found, Callable[[int, Sequence[OtherLimb]], None]]:
    """What a stopped run's journal holds of limbs that colors were asked for, and what adds to it."""
    known = {
        record["frame"]: [OtherLimb(one["person"], one["limb"], np.array(one["angles"]), np.array(one["costs"])) for one in record["limbs"]]
        for record in records
        if "limbs" in record
    }

    def keep(frame: int, limbs: Sequence[OtherLimb]) -> None:
        if run.journal is not None:
            append_journal(run.journal, {"frame": frame, "limbs": [asdict(one) for one in limbs]})

    return known, keep


def _joined(people: PosedPeople, persons: Mapping[int, _Person]) -> PosedPeople:
    """The tables with everybody's poses of the backward pass."""
    positions, states, costs = people.positions.copy(), people.states.states.copy(), people.costs.copy()
    apart = np.full(positions.shape[:2], np.nan)
    for person in persons.values():
        body, told = person.subject.body, np.isfinite(person.costs)
        states[person.rows] = person.back
        costs[person.rows[told]] = person.costs[told]
        positions[person.rows] = landmarks(body, person.back)
        apart[person.rows[told]] = np.linalg.norm(landmarks(body, person.own[told]) - landmarks(body, person.back[told]), axis=2)
    bodies = {**people.states.bodies, **{number: person.subject.body.dimensions for number, person in persons.items()}}
    return replace(
        people,
        poses=replace(people.poses, positions=positions),
        states=replace(people.states, states=states, bodies=bodies),
        costs=costs,
        passes_apart=apart,
    )
