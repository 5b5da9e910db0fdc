"""P0 of an action, from a part of the data on which nothing is measured (Canton 2009, sections 3.2.2 and 3.2.3).

The thesis sets parameters on an exploratory part of about a tenth of its data. Here that part is, of a rendered action, the same action
by a third person from other random numbers; of any other recording, its first tenth.
"""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from hmc.body.joints import N_DOF
from hmc.body.model import BodyModel
from hmc.body.proportions import canton_body
from hmc.experiments.five_actions import action_of, action_recipe
from hmc.experiments.truth import HEIGHT_M, first_truth, nearest_states, stature_m
from hmc.io.recording import Recording
from hmc.io.results import PoseTable
from hmc.synthetic.recipe import ActorRecipe
from hmc.synthetic.scene import build_scene
from hmc.synthetic.skeleton import landmark_positions

__all__ = ["action_drift", "largest_variation", "measured_truth", "turned"]

#: Who shows the action for the exploratory part, for how long, and from which of the scene's random numbers.
THIRD = ActorRecipe(height_m=1.73, build="average", sex="woman")
SECONDS, SEED = 6.0, 7000
#: Of other recordings, the share that is held apart.
HELD_APART = 0.1
#: The largest variation is that which so many frames do not exceed: inverse kinematics now and then jumps.
USUAL_SHARE = 0.95
#: Of what hardly moves, so much is expected nevertheless, metres and radians.
LEAST_VARIATION = np.r_[np.full(3, 0.02), np.full(N_DOF - 3, np.radians(2))]


def measured_truth(recording: Recording, label: str) -> PoseTable:
    """True joints of a recording's first person in the frames on which results are measured: all but those held apart.

    Parameters
    ----------
    recording : Recording
    label : str
        Of its `hmc.experiments.engine.experiment.Source`.

    Raises
    ------
    InputError
        When the recording has none.
    """
    truth = first_truth(recording)
    return truth if action_of(label) else truth.where(np.arange(len(truth.frames)) >= _held_apart(truth))


def action_drift(recording: Recording, label: str) -> np.ndarray:
    """P0 of a recording's action, shape (37,), metres and radians: as `largest_variation` of its exploratory part. As `measured_truth`."""
    action = action_of(label)
    if action:
        return _third_person(action, recording.fps)
    truth = first_truth(recording)
    return largest_variation(canton_body(stature_m(recording) or HEIGHT_M), truth.positions[: _held_apart(truth)])


def largest_variation(body: BodyModel, positions: np.ndarray) -> np.ndarray:
    """Half of the largest variation of each variable in one frame.

    Parameters
    ----------
    body : BodyModel
    positions : ndarray, shape (n, 15, 3)
        True landmarks in frames that follow one another, metres.

    Returns
    -------
    ndarray, shape (37,)
        Metres and radians.
    """
    if len(positions) < 2:
        return 0.5 * LEAST_VARIATION
    change = turned(np.diff(nearest_states(body, positions), axis=0))
    return 0.5 * np.maximum(np.quantile(np.abs(change), USUAL_SHARE, axis=0), LEAST_VARIATION)


def _held_apart(truth: PoseTable) -> int:
    return max(2, round(HELD_APART * len(truth.frames)))


@functools.cache
def _third_person(action: str, fps: float) -> np.ndarray:
    recipe = action_recipe(action)
    moving = recipe.actors[0]
    who = replace(THIRD, motion=moving.motion, speed_m_s=moving.speed_m_s, turn_radius_m=moving.turn_radius_m, start_m=moving.start_m)
    scene = build_scene(replace(recipe, actors=(who,), seed=recipe.seed + SEED, fps=fps, seconds=SECONDS, background_frames=0))
    motion = scene.motions[0]
    positions = landmark_positions(scene.actors[0].skeleton, motion.root, motion.orientations)
    return largest_variation(canton_body(THIRD.height_m), positions)


def turned(change: np.ndarray) -> np.ndarray:
    """Changes of states, shape (..., 37), with their angles the short way round."""
    return np.concatenate([change[..., :3], (change[..., 3:] + np.pi) % (2 * np.pi) - np.pi], axis=-1)
