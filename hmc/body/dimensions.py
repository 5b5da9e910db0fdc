"""Which of a body's dimensions are a person's own, and the body with them changed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.model import BodyModel
from hmc.body.proportions import make_body

__all__ = ["FITTED", "GIRTHS", "LENGTHS", "FitBodySettings", "reshaped"]

#: Fitted dimensions. Hand, foot and ankle height only follow the common scale: hulls show them badly.
LENGTHS = ("trunk", "head", "shoulder_half_width", "shoulder_drop", "hip_half_width", "upper_arm", "forearm", "thigh", "shank")
GIRTHS = ("girth_torso", "girth_depth", "girth_head", "girth_arms", "girth_thighs", "girth_shanks")
FITTED = ("height", *LENGTHS, *GIRTHS)


@dataclass(frozen=True)
class FitBodySettings:
    """How a body is fitted.

    Parameters
    ----------
    iterations : int
        Gauss-Newton steps.
    scale_deviation : float
        Prior deviation of the common scale's logarithm: how far the stature may be off. Of who is first seen crouching, with hidden feet, a
        tenth.
    length_deviation, girth_deviation : float
        Prior deviations of the logarithms of single lengths and girths, from what they are at the common scale.
    prior_weight : float
        Square metres that one prior deviation in one dimension costs.
    """

    iterations: int = 8
    scale_deviation: float = 0.10
    length_deviation: float = 0.07
    girth_deviation: float = 0.20
    prior_weight: float = 4e-6


def reshaped(body: BodyModel, shape: np.ndarray) -> BodyModel:
    """The body with other values of its fitted dimensions.

    Parameters
    ----------
    body : BodyModel
    shape : ndarray, shape (16,)
        Logarithms of the factors on `FITTED`; that of the height is on all lengths.
    """
    factors = dict(zip(FITTED, np.exp(shape), strict=True))
    dimensions = {}
    for name, value in body.dimensions.items():
        if name.startswith("girth_"):
            dimensions[name] = value * factors[name]
        elif name == "height":
            dimensions[name] = value * factors["height"]
        else:
            dimensions[name] = value * factors["height"] * factors.get(name, 1.0)
    return make_body(dimensions, body.limits)
