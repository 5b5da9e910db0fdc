"""Which of a body's dimensions are a person's own, and the body with them changed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.model import BodyModel
from hmc.body.proportions import ASYMMETRIES, DEFAULT_LENGTHS, make_body

__all__ = ["FITTED", "FitBodySettings", "highest_shape", "prior_deviations", "reshaped", "whole_deviations"]

#: Fitted dimensions. Foot and ankle height only follow the common scale: hulls show them badly.
_BONES = ("trunk", "head", "shoulder_half_width", "shoulder_drop", "hip_half_width", "upper_arm", "forearm", "thigh", "shank")
_GIRTHS = ("girth_torso", "girth_depth", "girth_head", "girth_arms", "girth_thighs", "girth_shanks")
#: Where the hips' joints lie in the flesh: legs that swing turn about them.
_PLACES = ("pelvis_flesh_forward",)
FITTED = ("height", *_BONES, "hand", *_GIRTHS, *_PLACES, *ASYMMETRIES)
#: A place changes by so much of the stature where a length changes e-fold, so that one step of the fit suits both.
PLACE_UNIT = 0.1


@dataclass(frozen=True)
class FitBodySettings:
    """How a body is fitted.

    Parameters
    ----------
    iterations : int
        Gauss-Newton steps.
    scale_deviation : float
        Prior deviation of the common scale's logarithm: how far the stature may be off. Of who is first seen crouching, with hidden feet,
        by more.
    length_deviation, girth_deviation : float
        Prior deviations of the logarithms of single lengths and girths, from what they are at the common scale.
    shoulders_deviation : float
        That of the shoulders' width: among people of one stature it differs by 6 %, limbs by 2 or 3 % (ours, and another renderer's).
    hand_deviation : float
        That of how far hands reach beyond the wrists, fists little more than half as far as open ones (`highest_shape`).
    place_deviation : float
        That of joints' places in the flesh, over the stature.
    asymmetry_deviation : float
        That of how much longer left limbs are than right ones, in shares of their length. Legs differ by 5.2 mm on the mean (deviation 4.1;
        Knutson 2005, Chiropractic & Osteopathy 13: 11), which is .8 %. By this one legs get a third of what a free fit has, which is off by
        1.2 % for people with equal legs (docs/accuracy.md, "Hips in the flesh, shoulders and sides").
    prior_weight : float
        Square metres that one prior deviation in one dimension costs a frame. Residuals of neighbouring frames and places go together; by
        this weight dimensions are about as far off as the fit says (`python docs/known_lengths.py`).
    """

    iterations: int = 8
    scale_deviation: float = 0.05
    length_deviation: float = 0.035
    girth_deviation: float = 0.10
    shoulders_deviation: float = 0.07
    hand_deviation: float = 0.15
    place_deviation: float = 0.015
    asymmetry_deviation: float = 0.03
    prior_weight: float = 1e-6


def prior_deviations(settings: FitBodySettings) -> np.ndarray:
    """Prior deviations of a body's shape (`reshaped`), shape (20,)."""
    own = dict.fromkeys(_BONES, settings.length_deviation) | {"height": settings.scale_deviation, "hand": settings.hand_deviation}
    own |= {"shoulder_half_width": settings.shoulders_deviation} | dict.fromkeys(_GIRTHS, settings.girth_deviation)
    own |= dict.fromkeys(_PLACES, settings.place_deviation / PLACE_UNIT) | dict.fromkeys(ASYMMETRIES, settings.asymmetry_deviation)
    return np.array([own[name] for name in FITTED])


def whole_deviations(covariance: np.ndarray) -> np.ndarray:
    """How well each of `FITTED` is known as a whole, where lengths are their own factor times the common scale, shape (20,).

    Of lengths and girths it is the deviation of the logarithm, of places in the flesh that of their share of the stature, and of
    asymmetries that of the share.

    Parameters
    ----------
    covariance : ndarray, shape (20, 20)
        Of a body's shape.
    """
    whole = np.eye(len(FITTED))
    places = [FITTED.index(name) for name in _PLACES]
    whole[places, places] = PLACE_UNIT
    whole[[FITTED.index(name) for name in (*_BONES, "hand")], FITTED.index("height")] = 1
    return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", whole, covariance, whole)))


def highest_shape(body: BodyModel) -> np.ndarray:
    """The largest shape that a body may get, shape (20,): hands reach as far as open ones at most, or as far as they do already.

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
    shape : ndarray, shape (20,)
        Of `FITTED`: the logarithms of the factors on lengths and girths, that of the height on all lengths; and what is added to places
        in the flesh, in `PLACE_UNIT` statures, and to asymmetries.
    """
    change = dict(zip(FITTED, shape.tolist(), strict=True))
    factors = dict(zip(FITTED, np.exp(shape), strict=True))
    dimensions = {}
    for name, value in body.dimensions.items():
        if name.startswith("girth_"):
            dimensions[name] = value * factors[name]
        elif name in ASYMMETRIES:
            dimensions[name] = value + change[name]
        elif name in _PLACES:
            dimensions[name] = (value + PLACE_UNIT * body.height_m * change[name]) * factors["height"]
        elif name == "height":
            dimensions[name] = value * factors["height"]
        else:
            dimensions[name] = value * factors["height"] * factors.get(name, 1.0)
    return make_body(dimensions, body.limits)
