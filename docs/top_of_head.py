"""An objective of one's own in one file: the head's top is as high as the highest voxel; and the default method with it.

hmc pose data/synthetic/tiny --plugin docs/top_of_head.py --method apf-top --out out/top
"""

from dataclasses import dataclass, replace

import numpy as np

import hmc
from hmc.body.joints import N_DOF
from hmc.body.kinematics import landmarks
from hmc.body.model import PARTS, BodyModel
from hmc.landmarks import landmark_index
from hmc.pose.objectives.objective import Sum
from hmc.pose.steps.annealed import annealed
from hmc.pose.steps.polish import fine_objective, polished
from hmc.pose.steps.presets import PRESETS

WEIGHT, STEP = 0.05, 1e-5
HOUSE = PRESETS["default"]


@dataclass(frozen=True)
class HeightAt:
    """The one residual at a state, metres, and how it changes."""

    residuals: np.ndarray
    jacobian: np.ndarray
    near: None = None
    misfit: None = None

    def pulls(self):
        return np.array([0]), self.jacobian


@dataclass(frozen=True)
class TopOfHead:
    """How far the top of the head is from a height."""

    body: BodyModel
    top_z: float

    def residual(self, states):
        return np.sqrt(WEIGHT) * (landmarks(self.body, states)[..., landmark_index("head_top"), 2] - self.top_z)

    def cost(self, states):
        return self.residual(states) ** 2

    def by_part(self, states):
        shares = np.zeros((len(states), len(PARTS)))
        shares[:, PARTS.index("head")] = self.cost(states)
        return shares

    def linearise(self, state, near=None):
        around = self.residual(state + STEP * np.vstack([np.eye(len(state)), -np.eye(len(state))]))
        return HeightAt(self.residual(state[None]), (around[:N_DOF] - around[N_DOF:])[None] / (2 * STEP))

    def coarser(self, rng, n):
        return self


def make_objective(rng, subject, view):
    hulls = fine_objective(rng, subject, view, HOUSE.polish)
    return Sum([hulls, TopOfHead(subject.body, float(view.target.surface[:, 2].max()))])


step = polished(annealed(HOUSE), HOUSE.polish, make_objective)
hmc.register_method(
    replace(hmc.pose_method("apf"), name="apf-top", source="docs", step=step, settings=(HOUSE, WEIGHT)), "with the head's height"
)
