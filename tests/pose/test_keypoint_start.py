"""Which way a first pose faces where a detector's keypoints are seen: by these, whichever way the hull alone would have it."""

from dataclasses import replace

import numpy as np
import pytest
from acted import act, ring
from posed import COST, capture_of, subject_of, true_state, views_of_act

from hmc.body.exchange import swapped_pose
from hmc.body.keypoint_places import BODY_KEYPOINTS, keypoint_places, place_keypoints
from hmc.body.kinematics import segment_transforms
from hmc.camera.model import project
from hmc.pose.starts.candidates import StartSettings, candidates
from hmc.pose.starts.window import WindowStart
from hmc.pose.steps.limb_search import SearchSettings
from hmc.pose.steps.presets import PRESETS
from hmc.pose.views.keypoints import see_keypoints
from hmc.search.filters import AnnealedSettings

LEAN = replace(
    PRESETS["default"],
    symmetric=COST,
    annealed=AnnealedSettings(layers=2, particles=50, survival_rate=0.1, spread=0.5),
    search=SearchSettings(draws=80),
)


def someone(turned: bool):
    """Who stands still: hulls, and keypoints of a body in these that faces as the person does, or the other way."""
    acted = act("stand")
    body = subject_of(acted, LEAN).body
    views = []
    for frame, view in enumerate(views_of_act(acted)):
        state = true_state(body, acted, frame)
        state = swapped_pose(body, state, "all") if turned else state
        places = place_keypoints(*segment_transforms(body, state), keypoint_places(body))
        images = [np.column_stack([project(camera, places)[0], np.ones(len(places))])[None] for camera in ring()]
        views.append(replace(view, velocity=np.zeros(3), keypoints=see_keypoints(ring(), images, {0: state[:3]})[0]))
    return acted, views, state[3]


def turn(one: float, other: float) -> float:
    """Angle between two headings, degrees."""
    return float(np.degrees(np.abs(np.angle(np.exp(1j * (one - other))))))


def with_face_alone(view):
    """Nose and ears, of which no pose can be told."""
    seen = view.keypoints
    face = np.array([name.endswith(("nose", "ear")) for name in BODY_KEYPOINTS])
    return replace(view, keypoints=replace(seen.of(face[seen.keypoint]), points=np.where(face[:, None], seen.points, np.nan)))


@pytest.mark.parametrize("turned", [False, True])
def test_keypoints_say_which_way_candidates_face(turned):
    acted, views, heading = someone(turned)
    states, costs = candidates(np.random.default_rng(0), subject_of(acted, LEAN), views[3], LEAN)
    facing = np.array([turn(state[3], heading) for state in states])
    # Clearly: those that face the other way cost far more, though the hull alone is for one of the two.
    assert facing[0] < 25 and costs[facing > 90].min(initial=np.inf) > 3 * costs[0]


@pytest.mark.parametrize("turned", [False, True])
def test_a_face_says_which_way_candidates_face(turned):
    acted, views, heading = someone(turned)
    states, _ = candidates(np.random.default_rng(0), subject_of(acted, LEAN), with_face_alone(views[3]), LEAN)
    assert turn(states[0, 3], heading) < 25


@pytest.mark.parametrize("turned", [False, True])
def test_keypoints_say_which_way_a_start_faces(turned):
    acted, views, heading = someone(turned)
    start = WindowStart(LEAN, StartSettings(anchors=2, candidates=4))
    found = start(lambda frame: np.random.default_rng(frame), views, capture_of(acted), acted.height_m)
    assert turn(found.state[3], heading) < 25
