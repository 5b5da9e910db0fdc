"""Dimensions of a body from the person's height, and the body made from them.

Joint-centre lengths and flesh lengths differ: the forearm ends at the wrist's centre while its flesh reaches to the
finger tips, the shank ends at the ankle while its flesh has a foot. Canton's Table 6.1 has one length a part, and arms longer
than people's; it is the preset `canton_body`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from numbers import Real

import numpy as np

from hmc.body.joints import SEGMENTS, JointLimits, canton_limits, default_limits, stiff_limits
from hmc.body.model import PART_OF_SEGMENT, BodyModel, Cones
from hmc.errors import InputError
from hmc.landmarks import LANDMARKS

__all__ = [
    "ASYMMETRIES", "CANTON_LENGTHS", "DEFAULT_LENGTHS", "GIRTHS", "SOLE", "SOLE_PITCH", "canton_body", "default_body", "flesh_ahead",
    "landmark_segments", "make_bodies", "make_body", "side_factor", "sole_ends", "stature", "stiff_body",
]  # fmt: skip

#: Joint-centre lengths over stature. Trunk: hip centres' middle to the base of the neck. Sources: Winter (2009), figure 4.1
#: (limbs; shoulders: half its width of .259, less some 4 cm from the tip of the shoulder to the joint's centre; ankle: .039 and a
#: sole of 1 cm), and the ranges that rendered and captured people show (trunk, head). Hips: wider than .36 of the distance
#: between the pelvis's front spines (Bell, Brand and Pedersen 1989, Human Movement Science 8: 3), which is some .048 of the stature, as
#: programs that render people have them at .053 to .067. The spine is behind: a standing person's
#: last neck vertebra is behind the hip centres (Mac-Thiong et al. 2010, Spine 35: E1193), while the chest and the skull are over or
#: before them. From the line of hips and neck the chest's middle is `chest_forward` to the front, the crown `head_forward`. The crown is
#: the skull's; silhouettes have its hair as well. Joints are not in the middle of the flesh around them: with the arms stretched sideways
#: that of the arms is lower and more to the front; that of waist and hips is to the front, of hips inward, of ankles and feet outward, of
#: the head to the back, by the lengths that are named so. The spine bends `lumbar` above the hips' middle, about at the lowest rib;
#: each shoulder turns with its collar bone about a point `collar` inward (`python -m hmc.experiments run body-bias`). How far the flesh
#: of hips and trunk lies before their joints is each person's besides (`pelvis_flesh_forward`): all of it at the hips, nothing at the neck.
DEFAULT_LENGTHS: dict[str, float] = {
    "trunk": 0.318, "head": 0.147, "shoulder_half_width": 0.104, "shoulder_drop": 0.060, "hip_half_width": 0.060,
    "upper_arm": 0.157, "forearm": 0.150, "hand": 0.085, "thigh": 0.245, "shank": 0.250, "ankle_height": 0.046, "foot": 0.105,
    "chest_forward": 0.010, "head_forward": 0.027, "hair": 0.010,
    "shoulder_flesh_low": 0.0046, "elbow_flesh_low": 0.0034, "wrist_flesh_low": 0.0069, "arm_flesh_forward": 0.0023,
    "waist_flesh_forward": 0.0046, "hip_flesh_forward": 0.0034, "hip_flesh_inward": 0.0020,
    "ankle_flesh_outward": 0.0046, "head_flesh_back": 0.007, "lumbar": 0.143, "collar": 0.083, "pelvis_flesh_forward": 0.0,
}  # fmt: skip
#: By how much of their length left limbs are longer than right ones, 0 in an average person.
ASYMMETRIES: tuple[str, ...] = ("arms_longer_left", "legs_longer_left")
#: Between what dimensions lie that may be negative, shares and metres.
_BOUNDS = dict.fromkeys(ASYMMETRIES, (-0.5, 0.5)) | {"pelvis_flesh_forward": (-0.5, 0.5)}
#: What is 0 in a body that was stored before it was known, and in Canton's: joints in the middle of the flesh, which ends at the crown, a
#: trunk of one piece, and limbs as long on both sides.
_ONCE_UNKNOWN = ("hair", "lumbar", "collar", *ASYMMETRIES, *(name for name in DEFAULT_LENGTHS if "_flesh_" in name))

#: Table 6.1 of Canton (2009), which gives no widths (hips: ours; shoulders: so that the arms span about the height), no hand or foot.
CANTON_LENGTHS: dict[str, float] = DEFAULT_LENGTHS | {
    "shoulder_half_width": 0.098,
    "trunk": 0.33, "head": 0.16, "upper_arm": 0.20, "forearm": 0.20, "hand": 0.0, "thigh": 0.26, "shank": 0.25,
    "ankle_height": 0.0, "foot": 0.0, "chest_forward": 0.0, "head_forward": 0.0,
    **{name: 0.0 for name in _ONCE_UNKNOWN if name in DEFAULT_LENGTHS},
}  # fmt: skip

#: The foot's axis at the heel, over the floor and over stature. Soles are round and cameras stand higher: the lowest 2 cm of feet are
#: hardly in any hull, and a flesh that reached to the floor would lift the whole body out of it (`python -m hmc.experiments run
#: body-bias`).
SOLE = 0.036

#: The sole's ends, from below the ankle forward: the heel's over stature, and the sole's length over that of `DEFAULT_LENGTHS`, which is
#: the foot's from the ankle on.
HEEL, SOLE_LENGTH = -0.032, 1.35

#: The angle of an ankle at which the sole is at a right angle to the shank, radians, toes down: for the same reason the flesh that fits
#: hulls best points down from a flat sole (people of our own renderer who stand and walk; flesh that is turned by as much lifts bodies).
SOLE_PITCH = 0.14

#: What hulls do not show of a hand, over stature.
FINGER_TIPS = 0.006

#: Factors on the radii of the flesh, one a group of parts.
GIRTHS: tuple[str, ...] = ("torso", "depth", "head", "arms", "thighs", "shanks")

_LANDMARK_SEGMENT = {
    "pelvis": "pelvis", "neck": "head", "head_top": "head",
    "l_shoulder": "l_upper_arm", "l_elbow": "l_forearm", "l_wrist": "l_forearm",
    "r_shoulder": "r_upper_arm", "r_elbow": "r_forearm", "r_wrist": "r_forearm",
    "l_hip": "l_thigh", "l_knee": "l_shank", "l_ankle": "l_shank",
    "r_hip": "r_thigh", "r_knee": "r_shank", "r_ankle": "r_shank",
}  # fmt: skip
_SEGMENT_INDEX = {segment.name: index for index, segment in enumerate(SEGMENTS)}


def landmark_segments() -> np.ndarray:
    """Segment that carries each of the fifteen landmarks, shape (15,)."""
    return np.array([_SEGMENT_INDEX[_LANDMARK_SEGMENT[name]] for name in LANDMARKS])


def make_body(dimensions: dict[str, float], limits: JointLimits | None = None, sole: float = SOLE) -> BodyModel:
    """The body of given dimensions.

    Parameters
    ----------
    dimensions : dict
        ``height`` (metres), the lengths of `DEFAULT_LENGTHS` (metres), ``girth_<group>`` for each of `GIRTHS` (factors) and `ASYMMETRIES`
        (shares). Without hair the flesh ends at the crown, without lengths named ``_flesh_`` joints are in its middle, without `lumbar` and
        `collar` the trunk is of one piece, and without asymmetries left and right are alike, as in results that were made before these were
        known.
    limits : JointLimits, optional
        `default_limits` unless given.
    sole : float
        As `SOLE`: what another height of the feet's flesh does is for studies of the model, and no body is stored with it.

    Returns
    -------
    BodyModel

    Raises
    ------
    InputError
        When a dimension is missing or not finite, when a size is negative, and when a difference is no person's.
    """
    wanted = ["height", *DEFAULT_LENGTHS, *(f"girth_{group}" for group in GIRTHS), *ASYMMETRIES]
    dimensions = dict.fromkeys(_ONCE_UNKNOWN, 0.0) | dimensions
    for name in wanted:
        value = dimensions.get(name, np.nan)
        least, most = _BOUNDS.get(name, (0, np.inf))
        if not (np.isfinite(value) and least <= value <= most):
            between = f" of at least {least}" if most == np.inf else f" between {least} and {most}"
            raise InputError(f"body dimension '{name}' must be a number{between}; got {dimensions.get(name)}")
    d = dimensions
    offsets = np.zeros((len(SEGMENTS), 3))
    tips = np.zeros((len(LANDMARKS), 3))

    def put(name: str, offset) -> None:
        offsets[_SEGMENT_INDEX[name]] = offset

    lumbar = d["lumbar"]
    put("chest", (0, 0, lumbar))
    put("head", (0, 0, d["trunk"] - lumbar))
    for side, sign in (("l", 1.0), ("r", -1.0)):
        put(f"{side}_clavicle", (0, sign * (d["shoulder_half_width"] - d["collar"]), d["trunk"] - d["shoulder_drop"] - lumbar))
        put(f"{side}_upper_arm", (0, sign * d["collar"], 0))
        arm, leg = side_factor(d, "arms", side), side_factor(d, "legs", side)
        put(f"{side}_forearm", (0, sign * arm * d["upper_arm"], 0))
        put(f"{side}_thigh", (0, sign * d["hip_half_width"], 0))
        put(f"{side}_shank", (0, 0, -leg * d["thigh"]))
        put(f"{side}_foot", (0, 0, -leg * d["shank"]))
        tips[LANDMARKS.index(f"{side}_wrist")] = (0, sign * arm * d["forearm"], 0)
        tips[LANDMARKS.index(f"{side}_ankle")] = (0, 0, -leg * d["shank"])
    tips[LANDMARKS.index("head_top")] = (d["head_forward"], 0, d["head"])
    kept = {name: float(d[name]) for name in wanted}
    return BodyModel(float(d["height"]), offsets, tips, _flesh(d, sole), limits or default_limits(), kept)


def side_factor(dimensions: Mapping[str, float], limbs: str, side: str) -> float:
    """The factor on the lengths of the limbs of one side, whose dimensions are the mean of both sides.

    Parameters
    ----------
    dimensions : mapping
        As `make_body` takes them.
    limbs : {"arms", "legs"}
    side : {"l", "r"}
    """
    share = 0.5 * dimensions.get(f"{limbs}_longer_left", 0.0)
    return 1 + share if side == "l" else 1 - share


def flesh_ahead(dimensions: Mapping[str, float], at: float) -> float:
    """How far the trunk's flesh lies before the line from the hips to the neck, metres, beside what it does in an average person.

    Parameters
    ----------
    dimensions : mapping
        As `make_body` takes them.
    at : float
        Share of the line: all of it at the hips, 0, and nothing at the neck, 1.
    """
    return (1 - at) * dimensions["pelvis_flesh_forward"]


def make_bodies(dimensions: Mapping[int, Mapping[str, float | np.ndarray]], limits: JointLimits | None = None) -> dict[int, BodyModel]:
    """The bodies of several people by number, as a result keeps their dimensions; parameters and errors as of `make_body`."""
    for person, own in dimensions.items():
        for name, value in own.items():
            if np.ndim(value):
                raise InputError(f"body dimension '{name}' of person {person} must be one number; got {np.size(value)}")
    return {person: make_body({name: float(value) for name, value in own.items()}, limits) for person, own in dimensions.items()}


def default_body(height_m: float) -> BodyModel:
    """A person of average proportions and joint-centre lengths.

    Parameters
    ----------
    height_m : float
        Stature, metres.
    """
    return make_body(_scaled(height_m, DEFAULT_LENGTHS), default_limits())


def stiff_body(height_m: float) -> BodyModel:
    """The body of `default_body` with a trunk that does not bend.

    Parameters
    ----------
    height_m : float
        Stature, metres.
    """
    return make_body(_scaled(height_m, DEFAULT_LENGTHS), stiff_limits())


def canton_body(height_m: float) -> BodyModel:
    """The body of Canton (2009), Table 6.1: one length a part, the table's angular ranges.

    Parameters
    ----------
    height_m : float
        Stature, metres.
    """
    return make_body(_scaled(height_m, CANTON_LENGTHS), canton_limits())


def stature(dimensions: Mapping[str, float]) -> float:
    """The stature that a body's lengths from head to ankle speak for, metres.

    The entry ``height`` is only the scale of a fitted body's flesh; its lengths have moved away from it.

    Parameters
    ----------
    dimensions : mapping
        As `make_body` takes them.
    """
    upright = ("trunk", "head", "thigh", "shank")
    # Canton's lengths, which have no ankle, are of that table; he let them sum to the height.
    table = DEFAULT_LENGTHS if dimensions["ankle_height"] > 0 else CANTON_LENGTHS
    return float(sum(dimensions[name] for name in upright) / sum(table[name] for name in upright))


def sole_ends(dimensions: Mapping[str, float]) -> tuple[float, float]:
    """How far the sole reaches from below the ankle, to the heel's end (negative) and to the toes', metres; parameters as of `stature`."""
    heel = HEEL * dimensions["height"]
    return heel, heel + SOLE_LENGTH * dimensions["foot"]


def _scaled(height_m: float, lengths: dict[str, float]) -> dict[str, float]:
    if not isinstance(height_m, Real):
        raise InputError(f"a height must be a number of metres; got {height_m!r}")
    if not 0.3 < height_m < 3.0:
        raise InputError(f"a height of {height_m:g} m is no person's; give the stature in metres")
    own = {"height": height_m} | {name: value * height_m for name, value in lengths.items()} | {f"girth_{g}": 1.0 for g in GIRTHS}
    return own | dict.fromkeys(ASYMMETRIES, 0.0)


def _flesh(d: dict[str, float], sole: float) -> Cones:
    """Truncated cones around the segments. Radii are fractions of the stature for an average adult, times the girth factors.

    A trunk that does not bend is of one piece.
    """
    h = d["height"]
    rows: list[tuple] = []

    def cone(segment: str, ends, radii, across, girth: tuple[float, float]) -> None:
        start, end = np.array(ends, float)
        length = np.linalg.norm(end - start)
        if length >= 1e-3:
            index, axis = _SEGMENT_INDEX[segment], (end - start) / length
            first = across - (across @ axis) * axis
            first /= np.linalg.norm(first)
            rows.append((index, PART_OF_SEGMENT[index], start, end, h * np.array(radii) * np.array(girth), first))

    wide, deep, trunk = d["girth_torso"], d["girth_torso"] * d["girth_depth"], d["trunk"]
    x, y = np.eye(3)[:2]
    chest, face = d["chest_forward"], d["head_forward"] - d["head_flesh_back"]
    nape = 0.4 * chest
    waist = nape + d["waist_flesh_forward"]
    ahead = partial(flesh_ahead, d)
    hips, belly = (ahead(0), 0, -0.035 * h), (waist + ahead(0.15), 0, 0.15 * trunk)
    middle, high = chest + ahead(0.48), chest + ahead(0.82)
    # Radii over stature: [lateral, front to back] at both ends.
    cone("pelvis", (hips, belly), ((0.090, 0.062), (0.086, 0.060)), y, (wide, deep))
    cone("torso", ((waist + ahead(0.12), 0, 0.12 * trunk), (middle, 0, 0.48 * trunk)), ((0.084, 0.059), (0.082, 0.057)), y, (wide, deep))
    low = d["lumbar"]
    upper = "chest" if low > 0 else "torso"
    cone(upper, ((middle, 0, 0.48 * trunk - low), (high, 0, 0.82 * trunk - low)), ((0.084, 0.058), (0.096, 0.058)), y, (wide, deep))
    cone(upper, ((high, 0, 0.82 * trunk - low), (nape, 0, trunk - low)), ((0.096, 0.056), (0.042, 0.036)), y, (wide, deep))
    head, g = d["head"], (d["girth_head"], d["girth_head"])
    skull = 0.01 * h + 0.6 * face
    cone("head", ((nape, 0, -0.02 * h), (0.004 * h + 0.4 * face, 0, 0.28 * head)), ((0.034, 0.034), (0.034, 0.040)), y, g)
    cone("head", ((0.006 * h + 0.4 * face, 0, 0.22 * head), (skull, 0, 0.65 * head)), ((0.036, 0.046), (0.045, 0.057)), y, g)
    cone("head", ((skull, 0, 0.65 * head), (skull - 0.002 * h, 0, head + d["hair"])), ((0.045, 0.057), (0.026, 0.032)), y, g)
    arms = (d["girth_arms"],) * 2
    thighs, shanks = (d["girth_thighs"],) * 2, (d["girth_shanks"],) * 2
    front = d["arm_flesh_forward"]
    for side, sign in (("r", -1.0), ("l", 1.0)):
        arm_longer, leg_longer = side_factor(d, "arms", side), side_factor(d, "legs", side)
        arm, fore = sign * arm_longer * d["upper_arm"], sign * arm_longer * d["forearm"]
        armpit, elbow, wrist = (-d[f"{joint}_flesh_low"] for joint in ("shoulder", "elbow", "wrist"))
        if d["collar"] > 0:
            collar = ((0, 0, -0.01 * h), (0, sign * d["collar"], -0.005 * h))
            cone(f"{side}_clavicle", collar, ((0.030, 0.030), (0.034, 0.034)), x, (wide, wide))
        cone(f"{side}_upper_arm", ((front, -sign * 0.01 * h, armpit), (front, arm, elbow)), ((0.034, 0.034), (0.025, 0.025)), x, arms)
        cone(f"{side}_forearm", ((front, 0, elbow), (front, fore, wrist)), ((0.026, 0.026), (0.016, 0.016)), x, arms)
        shown = fore + sign * max(d["hand"] - FINGER_TIPS * h, 0.0)
        cone(f"{side}_forearm", ((front, fore, wrist), (front, shown, wrist)), ((0.021, 0.015), (0.016, 0.010)), x, arms)
        hip = (d["hip_flesh_forward"] + ahead(0), -sign * d["hip_flesh_inward"], 0)
        cone(f"{side}_thigh", (hip, (0, 0, -leg_longer * d["thigh"])), ((0.050, 0.050), (0.033, 0.033)), x, thighs)
        shank, ankle, foot = leg_longer * d["shank"], d["ankle_height"], d["foot"]
        calf, ankle_y = (-0.004 * h, 0, -0.4 * shank), sign * d["ankle_flesh_outward"]
        cone(f"{side}_shank", ((0, 0, 0), calf), ((0.030, 0.032), (0.031, 0.033)), y, shanks)
        cone(f"{side}_shank", (calf, (0, ankle_y, -shank - 0.3 * ankle)), ((0.031, 0.033), (0.020, 0.021)), y, shanks)
        if foot > 0:
            low = -ankle + sole * h
            heel, toe = sole_ends(d)
            ends = (heel, ankle_y, low), (toe, ankle_y, low - 0.012 * h)
            cone(f"{side}_foot", ends, ((0.020, 0.024), (0.028, 0.012)), y, (1.0, 1.0))
    return Cones(*(np.array(column) for column in zip(*rows, strict=True)))
