"""Trust in landmarks: monotone in all that speaks against one, as scikit-learn has the same regression, low for poses that are beside the
silhouettes, and the columns and lines that tell of it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sklearn.linear_model import LogisticRegression

from hmc.body.flesh import flesh_points, place_points
from hmc.body.joints import DOF_NAMES
from hmc.body.kinematics import landmarks, segment_transforms
from hmc.body.limbs import LIMBS
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.camera.model import Rig, look_at, project
from hmc.io.masks import MaskStep
from hmc.io.results import PoseStates, PoseTable
from hmc.landmarks import LANDMARKS, TRUSTED, landmark_index
from hmc.pose.clear_views import BARE_M, BorneOut, clear_views
from hmc.pose.trust import FEATURES, KIND_OF_LANDMARK, doubt_notes, trust_features, trust_of
from hmc.pose.trust_model import KINDS, ONE_PASS, TWO_PASSES
from hmc.trials.quality import trust_line, trust_summary

BODY = default_body(1.75)
SIZE = (240, 240)
RIG = Rig(tuple(look_at(f"cam_{k}", SIZE, [5 * np.cos(a), 5 * np.sin(a), 1.2], [0, 0, 0.9], 35) for k, a in enumerate((0, 1.5, 3.0, 4.5))))
FPS = 30.0


def posed(turn=0.0, at=(0.0, 0.0)):
    state = neutral_state("sideways", BODY.limits)
    state[:3] = (*at, 0.95)
    state[LIMBS["l_arm"].dofs[0]] += turn
    return state


def masks_of(state):
    """Silhouettes of a pose, drawn point by point."""
    table = flesh_points(BODY, 0.012)
    points = place_points(*segment_transforms(BODY, state), table.points, table.segment)
    masks = []
    for camera in RIG:
        mask = np.zeros(SIZE[::-1], bool)
        column, row = np.rint(project(camera, points)[0]).astype(int).T
        for by in (-1, 0, 1):
            mask[np.clip(row, 1, SIZE[1] - 2) + by, np.clip(column, 1, SIZE[0] - 2)] = True
        masks.append(mask)
    return tuple(masks)


def trusted(shown, estimate, apart=0.0):
    states = np.array([estimate] * 9)
    frames = np.arange(len(states))
    masks = masks_of(shown)
    steps = [MaskStep(int(frame), (None,) * len(RIG), masks, (None,) * len(RIG)) for frame in frames]
    rows = PoseStates(frames, frames * 0, states, DOF_NAMES, {0: BODY.dimensions})
    poses = PoseTable(frames, frames * 0, landmarks(BODY, states))
    passes = None if apart is None else np.full((len(states), 15), apart)
    return trust_of(trust_features(poses, clear_views(RIG, steps, rows), passes, FPS))[4]


def test_a_pose_on_its_silhouettes_is_trusted_and_an_arm_that_is_elsewhere_is_not():
    right, wrong = trusted(posed(), posed()), trusted(posed(), posed(-1.0))
    # Two cameras at least have the arms sideways.
    assert right[[landmark_index(name) for name in ("pelvis", "neck", "l_knee", "r_ankle")]].min() > TRUSTED
    wrist = landmark_index("l_wrist")
    assert right[wrist] > TRUSTED and wrong[wrist] < 0.6
    assert trusted(posed(), posed(), 0.4)[wrist] < TRUSTED  # both passes disagree
    beside = trusted(posed(), posed(at=(1.0, 1.0)))
    assert beside.max() < 0.5


def test_silhouette_that_nothing_covers_is_an_area_on_the_person():
    """A square of 10 cm at a landmark's distance, beside a body that is not there, is as large as it is."""
    camera, state = RIG[0], posed()
    mask, wrist = np.zeros(SIZE[::-1], bool), landmarks(BODY, state)[landmark_index("l_wrist")]
    depth = camera.rotation[2] @ wrist + camera.translation[2]
    pixels = 0.1 * camera.matrix[0, 0] / depth
    column, row = project(camera, wrist + np.array([0, 0, 0.14]))[0]
    half = round(pixels / 2)
    mask[round(row) - half : round(row) + half, round(column) - half : round(column) + half] = True
    rows = PoseStates(np.zeros(1, int), np.zeros(1, int), state[None], DOF_NAMES, {0: BODY.dimensions})
    found = clear_views(Rig((camera,)), [MaskStep(0, (None,), (mask,), (None,))], rows).bare_m[0]
    assert 0.03 < found[landmark_index("l_wrist")] < 0.13
    far = np.linalg.norm(landmarks(BODY, state) - wrist, axis=1) > BARE_M + 0.3
    assert not found[far].any() and far.sum() > 8


def borne_out(shown, denied, bare_m):
    return BorneOut(np.zeros(shown.shape, int), shown, denied, bare_m, np.zeros(1))


def table_of(n, persons=None):
    return PoseTable(np.arange(n), np.zeros(n, int) if persons is None else persons, np.zeros((n, 15, 3)))


@settings(max_examples=30, deadline=None)
@given(arrays(float, (4, 3, 15), elements=st.floats(0, 3)), st.integers(0, 3), st.floats(0.01, 1))
def test_what_speaks_against_a_landmark_never_helps_it(values, which, more):
    shown, denied, bare, apart = values

    def trust(shown, denied, bare, apart):
        return trust_of(trust_features(table_of(3), borne_out(shown, denied, bare), apart, FPS))

    worse = [shown, denied, bare, apart]
    worse[which] = np.maximum(worse[which] - more, 0) if which == 0 else worse[which] + more
    assert (trust(*worse) <= trust(shown, denied, bare, apart) + 1e-3).all()  # it is rounded


def test_a_window_is_a_mean_over_the_frames_around_of_the_same_person():
    rng = np.random.default_rng(0)
    frames, persons = np.array([0, 1, 2, 3, 9, 0, 4, 30]), np.array([0, 0, 0, 0, 0, 1, 1, 1])
    shuffle = rng.permutation(8)
    frames, persons = frames[shuffle], persons[shuffle]
    bare, apart = rng.uniform(0, 0.1, (2, 8, 15))
    apart[2] = np.nan
    found = trust_features(PoseTable(frames, persons, np.zeros((8, 15, 3))), borne_out(bare * 9, bare, bare), apart, FPS)
    assert found.shape == (8, 15, len(FEATURES))
    for row in range(8):
        near = (persons == persons[row]) & (np.abs(frames - frames[row]) <= 6)
        assert found[row, :, 2] == pytest.approx(bare[near].mean(axis=0))
        logs = np.log1p(apart / 0.02)
        assert found[row, :, -1] == pytest.approx(np.full(15, np.nan) if row == 2 else np.nanmean(logs[near], axis=0), nan_ok=True)


@pytest.mark.parametrize("model", [TWO_PASSES, ONE_PASS], ids=["two", "one"])
def test_the_number_is_that_of_a_logistic_regression(model):
    """scikit-learn's, with our coefficients in it."""
    rng = np.random.default_rng(1)
    features = rng.uniform(0, 0.5, (6, 15, len(FEATURES)))
    if model is ONE_PASS:
        features[..., -1] = np.nan
    columns = np.broadcast_to(np.eye(len(KINDS))[KIND_OF_LANDMARK], (6, 15, len(KINDS)))
    rows = np.concatenate([columns, features[..., : len(model.weights)]], axis=-1).reshape(90, -1)
    other = LogisticRegression(fit_intercept=False).fit(rows, np.arange(90) % 2)
    other.coef_ = np.array([[*model.intercepts, *(-np.array(model.weights))]])
    assert trust_of(features).ravel() == pytest.approx(other.predict_proba(rows)[:, 1], abs=6e-4)
    assert min(model.weights) >= 0 and len(model.intercepts) == len(KINDS)


def test_who_is_in_doubt_is_told():
    trust = np.full((10, 15), 0.97)
    trust[:4, landmark_index("r_wrist")] = 0.3
    trust[:8, landmark_index("l_elbow")] = 0.8
    poses = replace(table_of(10), trust=trust, views=np.zeros((10, 15)))  # what is trusted is no matter of views
    assert poses.doubtful.sum() == 12
    assert trust_summary(poses) == {"landmarks": 150, "doubtful": 12, "persons": {"0": {"l_elbow": 8, "r_wrist": 4}}}
    assert trust_line(poses) == [
        "of 150 landmarks 12 are doubtful (8.0%): l_elbow of person 0 in 8 frames, r_wrist of person 0 in 4 frames"
    ]
    assert not doubt_notes(poses)  # 5.7 % are off, by their trust
    trust[:, landmark_index("r_wrist")] = 0.02
    note = doubt_notes(replace(poses, trust=trust))[0]
    assert note.startswith("person 0: by their trust about 10% of the landmarks are more than 60 mm off")
    assert note.endswith("doubtful in how many of 10 frames, most of all: r_wrist 10, l_elbow 8")
    assert not doubt_notes(replace(poses, trust=np.full((10, 15), TRUSTED)))
    seen = np.full((10, 15), 2.0)
    assert not doubt_notes(replace(poses, trust=None, views=seen))
    seen[:, 0] = 1
    assert "7% of the landmarks are doubtful, as fewer than two cameras show them" in doubt_notes(replace(poses, trust=None, views=seen))[0]
    assert trust_line(replace(poses, trust=None, views=None)) == []


def test_where_trust_is_not_known_views_decide_and_what_is_missing_is_not_doubtful():
    poses = table_of(1)
    views, trust = np.full((1, 15), 3.0), np.full((1, 15), np.nan)
    views[0, :2], trust[0, 1], trust[0, 2] = 1, 0.99, 0.1
    positions = poses.positions.copy()
    positions[0, 3] = np.nan
    trust[0, 3] = 0.1
    found = replace(poses, positions=positions, views=views, trust=trust).doubtful
    assert [name for name, doubt in zip(LANDMARKS, found[0], strict=True) if doubt] == [LANDMARKS[0], LANDMARKS[2]]
    assert poses.doubtful is None
