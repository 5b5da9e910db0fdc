"""Which of a body's dimensions are a person's own, and the body with them changed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.model import BodyModel
from hmc.body.proportions import DEFAULT_LENGTHS, make_body

__all__ = ["FITTED", "FitBodySettings", "highest_shape", "prior_deviations", "reshaped", "whole_deviations"]

#: Fitted dimensions. Foot and ankle height only follow the common scale: hulls show them badly.
_BONES = ("trunk", "head", "shoulder_half_width", "shoulder_drop", "hip_half_width", "upper_arm", "forearm", "thigh", "shank")
_GIRTHS = ("girth_torso", "girth_depth", "girth_head", "girth_arms", "girth_thighs", "girth_shanks")
FITTED = ("height", *_BONES, "hand", *_GIRTHS)


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
    hand_deviation : float
        That of how far hands reach beyond the wrists, fists little more than half as far as open ones (`highest_shape`).
    prior_weight : float
        Square metres that one prior deviation in one dimension costs.
    """

    iterations: int = 8
    scale_deviation: float = 0.10
    length_deviation: float = 0.07
    girth_deviation: float = 0.20
    hand_deviation: float = 0.30
    prior_weight: float = 4e-6


def prior_deviations(settings: FitBodySettings) -> np.ndarray:
    """Prior deviations of the logarithms of the factors on `FITTED`, shape (17,)."""
    own = {"height": settings.scale_deviation, "hand": settings.hand_deviation}
    own |= dict.fromkeys(_BONES, settings.length_deviation) | dict.fromkeys(_GIRTHS, settings.girth_deviation)
    return np.array([own[name] for name in FITTED])


def whole_deviations(covariance: np.ndarray) -> np.ndarray:
    """How well each of `FITTED` is known as a whole, where lengths are their own factor times the common scale, shape (17,).

    Parameters
    ----------
    covariance : ndarray, shape (17, 17)
        Of the logarithms of the factors.
    """
    whole = np.eye(len(FITTED))
    whole[[FITTED.index(name) for name in (*_BONES, "hand")], FITTED.index("height")] = 1
    return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", whole, covariance, whole)))


def highest_shape(body: BodyModel) -> np.ndarray:
    """The largest shape that a body may get, shape (17,): hands reach as far as open ones at most, or as far as they do already.

    They close, so that they may be shorter. Longer ones could only be told from a longer arm where it bends, and straight arms of which the
    shoulder is too low would be made longer by their hands.
    """
    highest = np.full(len(FITTED), np.inf)
    hand, most = body.dimensions["hand"], DEFAULT_LENGTHS["hand"] * body.height_m
    if hand > 0:
        highest[FITTED.index("hand")] = np.log(max(hand, most) / hand)
    return highest


def reshaped(body: BodyModel, shape: np.ndarray) -> BodyModel:
    """The body with other values of its fitted dimensions.

    Parameters
    ----------
    body : BodyModel
    shape : ndarray, shape (17,)
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
