"""The flesh and clothes of an actor as sweeps: what a body measures from station to station.

Tables are in metres for a man of 1.75 m and of average build, and are scaled with stature, sex and build.
"""

from __future__ import annotations

import numpy as np

from hmc.errors import InputError
from hmc.synthetic.skeleton import BONE_NAMES, PosedSkeleton, unit
from hmc.synthetic.surface import Sweep

__all__ = ["BUILDS", "body_sweeps", "girth_of"]

#: Builds by name, as the number that scales girths: 0 is average.
BUILDS: dict[str, float] = {"thin": -1.0, "slim": -0.5, "average": 0.0, "sturdy": 0.5, "heavy": 1.0}

_REFERENCE_M = 1.75

# Trunk: height above the hip centres as a fraction of the way to the neck, half width, half depth, centre forwards.
_TRUNK_MAN = np.array([
    [-0.17, 0.070, 0.060, 0.000], [-0.08, 0.130, 0.100, -0.010], [0.03, 0.166, 0.116, -0.014], [0.16, 0.160, 0.110, -0.006],
    [0.30, 0.148, 0.103, 0.006], [0.42, 0.147, 0.106, 0.010], [0.58, 0.158, 0.116, 0.010], [0.70, 0.165, 0.116, 0.004],
    [0.80, 0.158, 0.104, -0.006], [0.89, 0.122, 0.083, -0.014], [0.96, 0.074, 0.064, -0.014], [1.02, 0.056, 0.056, -0.008],
])  # fmt: skip
_TRUNK_WOMAN = np.array([
    [-0.17, 0.072, 0.062, 0.000], [-0.08, 0.136, 0.104, -0.010], [0.03, 0.174, 0.120, -0.016], [0.16, 0.160, 0.110, -0.008],
    [0.30, 0.130, 0.092, 0.004], [0.42, 0.127, 0.090, 0.008], [0.56, 0.138, 0.116, 0.024], [0.66, 0.144, 0.120, 0.024],
    [0.78, 0.142, 0.096, 0.000], [0.89, 0.108, 0.074, -0.012], [0.96, 0.064, 0.056, -0.012], [1.02, 0.048, 0.050, -0.008],
])  # fmt: skip

# The rest: distance along the bone, two half-widths, two offsets of the centre. Arms lie along Y, legs point down, feet forwards.
_LIMBS: dict[str, list[list[float]]] = {
    "clavicle": [[-0.02, 0.050, 0.040, 0, -0.004], [0.10, 0.052, 0.042, 0, 0.002], [0.17, 0.050, 0.044, 0, -0.002]],
    "upper_arm": [
        [-0.03, 0.044, 0.044, 0, 0], [0.01, 0.056, 0.054, 0, 0], [0.06, 0.055, 0.051, 0, 0], [0.14, 0.049, 0.044, 0.003, 0],
        [0.22, 0.042, 0.041, 0, 0], [0.285, 0.040, 0.040, 0, 0], [0.30, 0.034, 0.034, 0, 0],
    ],
    "forearm": [
        [-0.02, 0.036, 0.036, 0, 0], [0.01, 0.041, 0.039, 0, 0], [0.06, 0.044, 0.038, 0, 0], [0.14, 0.037, 0.033, 0, 0],
        [0.22, 0.029, 0.025, 0, 0], [0.262, 0.027, 0.022, 0, 0],
    ],
    "hand": [
        [-0.015, 0.026, 0.021, 0, 0], [0.03, 0.036, 0.019, 0, 0], [0.08, 0.042, 0.018, 0, -0.003], [0.12, 0.039, 0.016, 0, -0.009],
        [0.155, 0.033, 0.014, 0, -0.021], [0.178, 0.020, 0.012, 0, -0.032],
    ],
    "fist": [
        [-0.015, 0.026, 0.021, 0, 0], [0.025, 0.036, 0.023, 0, -0.002], [0.06, 0.042, 0.030, 0, -0.006], [0.085, 0.040, 0.030, 0, -0.008],
        [0.100, 0.028, 0.021, 0, -0.008],
    ],
    "thumb": [[0.0, 0.016, 0.016, 0, 0], [0.04, 0.014, 0.013, 0, 0], [0.065, 0.011, 0.011, 0, 0]],
    "thigh": [
        [-0.06, 0.070, 0.078, 0, -0.012], [0.0, 0.084, 0.092, 0, -0.010], [0.08, 0.084, 0.090, 0, -0.004], [0.20, 0.075, 0.080, 0, 0.004],
        [0.32, 0.060, 0.064, 0, 0.004], [0.42, 0.054, 0.058, 0, 0.002], [0.45, 0.046, 0.048, 0, 0],
    ],
    "shank": [
        [-0.03, 0.048, 0.050, 0, 0], [0.0, 0.052, 0.056, 0, 0.002], [0.06, 0.050, 0.055, 0, -0.006], [0.12, 0.053, 0.059, 0, -0.012],
        [0.20, 0.048, 0.053, 0, -0.012], [0.30, 0.039, 0.043, 0, -0.006], [0.40, 0.034, 0.040, 0, -0.002], [0.43, 0.034, 0.040, 0, 0],
    ],
    "foot": [
        [-0.064, 0.022, 0.024, 0, -0.057], [-0.048, 0.033, 0.038, 0, -0.044], [0.0, 0.037, 0.046, 0, -0.036],
        [0.05, 0.039, 0.038, 0, -0.044], [0.10, 0.045, 0.029, 0, -0.053], [0.135, 0.047, 0.025, 0, -0.057],
    ],
    "toes": [
        [-0.02, 0.046, 0.0255, 0, 0], [0.03, 0.045, 0.022, 0, -0.004], [0.06, 0.037, 0.019, 0, -0.007], [0.076, 0.022, 0.015, 0, -0.011],
    ],
    "neck": [[-0.05, 0.062, 0.062, 0, 0.0], [0.04, 0.057, 0.059, 0, 0.012], [0.12, 0.054, 0.058, 0, 0.016], [0.15, 0.045, 0.050, 0, 0.018]],
    "head": [
        [-0.074, 0.024, 0.022, 0, 0.066], [-0.056, 0.044, 0.042, 0, 0.049], [-0.02, 0.058, 0.072, 0, 0.024], [0.02, 0.068, 0.087, 0, 0.012],
        [0.06, 0.075, 0.095, 0, 0.006], [0.10, 0.072, 0.090, 0, 0.000], [0.13, 0.054, 0.070, 0, -0.003], [0.147, 0.028, 0.038, 0, -0.004],
    ],
    "nose": [[-0.022, 0.016, 0.012, 0, 0.104], [-0.012, 0.016, 0.018, 0, 0.106], [0.03, 0.010, 0.010, 0, 0.098]],
    "hair": [
        [0.035, 0.068, 0.062, 0, -0.040], [0.07, 0.081, 0.092, 0, -0.012], [0.11, 0.076, 0.090, 0, -0.004], [0.14, 0.050, 0.062, 0, -0.004],
        [0.152, 0.024, 0.030, 0, -0.004],
    ],
    "long_hair": [
        [-0.15, 0.045, 0.016, 0, -0.070], [-0.08, 0.066, 0.030, 0, -0.062], [0.0, 0.078, 0.052, 0, -0.044], [0.08, 0.078, 0.080, 0, -0.020],
    ],
}  # fmt: skip


def girth_of(build: str | float) -> float:
    """The number of a build given by name or as a number from -1 (thin) to 1 (heavy).

    Raises
    ------
    InputError
        For an unknown name or a number out of range.
    """
    if isinstance(build, str):
        if build not in BUILDS:
            raise InputError(f"build {build!r} is unknown; use one of {', '.join(BUILDS)} or a number from -1 to 1")
        return BUILDS[build]
    if not -1.2 <= build <= 1.2:
        raise InputError(f"build must lie between -1 (thin) and 1 (heavy); got {build}")
    return float(build)


def body_sweeps(
    posed: PosedSkeleton, sex: str, girth: float, loose_m: float, long_hair: bool, rng: np.random.Generator, fists: bool = False
) -> list[tuple[str, Sweep]]:
    """The body's sweeps in a given pose, each with the name of its table.

    Parameters
    ----------
    posed : PosedSkeleton
    sex : {"man", "woman"}
    girth : float
        From `girth_of`.
    loose_m : float
        How far clothes stand off the body, metres.
    long_hair : bool
    rng : Generator
        Individual variation of girths.
    fists : bool
        Whether the hands are closed, the thumbs over the fingers.

    Returns
    -------
    list of (str, Sweep)
    """
    skeleton, joints = posed.skeleton, posed.joints
    scale = skeleton.height_m / _REFERENCE_M
    woman = sex == "woman"
    factor = {name: scale * float(1 + 0.03 * np.clip(rng.standard_normal(), -2, 2)) for name in ("trunk", "arm", "leg", "end")}
    limb = 1 + 0.14 * girth - 0.06 * woman
    sweeps: list[tuple[str, Sweep]] = []

    def add(name: str, bone: str, axes: list[list[float]], table: np.ndarray, power: float, blend: float, origin=(0.0, 0.0, 0.0)) -> None:
        k = BONE_NAMES.index(bone)
        frame = posed.frames[k]
        sweeps.append((name, Sweep(k, joints[k] + frame @ np.array(origin), unit(np.array(axes)) @ frame.T, table, power, blend)))

    forward, left, up = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]
    trunk = np.array(_TRUNK_WOMAN if woman else _TRUNK_MAN)
    trunk = np.column_stack([trunk, np.zeros(len(trunk))])[:, [0, 1, 2, 4, 3]]
    body = np.exp(-((np.clip(trunk[:, 0], 0, 1) - 0.28) ** 2) / (2 * 0.22**2))  # where weight is put on first
    upper = np.clip((1.05 - trunk[:, 0]) / 0.35, 0.4, 1)
    trunk[:, 1] *= (1 + girth * upper * (0.10 + 0.07 * body)) * factor["trunk"]
    trunk[:, 2] *= (1 + girth * upper * (0.12 + 0.14 * body)) * factor["trunk"]
    trunk[:, 4] = (trunk[:, 4] + max(girth, 0) * 0.028 * body) * scale
    height = joints[BONE_NAMES.index("neck"), 2] - joints[0, 2]
    trunk[:, 0] *= height
    trunk[1:-3, 1:3] += loose_m
    add("trunk", "pelvis", [left, forward, up], trunk, 2.3, 0.03)

    def table(name: str, girths: float, lengths: float = scale, cloth: float = 0.0) -> np.ndarray:
        rows = np.array(_LIMBS[name])
        rows[:, 0] *= lengths
        rows[:, 1:3] = rows[:, 1:3] * girths + cloth
        rows[:, 3:] *= scale
        return rows

    for side, sign in (("l", 1.0), ("r", -1.0)):
        out = [0.0, sign, 0.0]
        down = [0.0, 0.0, -1.0]
        trousers = table("shank", factor["leg"] * limb, skeleton.length(f"{side}_foot") / 0.434, loose_m)
        trousers[-3:, 1:3] = np.maximum(trousers[-3:, 1:3], (0.036 + 1.2 * loose_m) * scale)
        arm, end = factor["arm"] * limb, factor["end"] * (1 + 0.04 * girth - 0.08 * woman)
        collar = table("clavicle", arm, skeleton.length(f"{side}_upper_arm") / 0.17)
        add("clavicle", f"{side}_clavicle", [forward, up, out], collar, 2, 0.06)
        add(
            "upper_arm",
            f"{side}_upper_arm",
            [forward, up, out],
            table("upper_arm", arm, skeleton.length(f"{side}_forearm") / 0.285, 0.6 * loose_m),
            2,
            0.035,
        )
        add(
            "forearm",
            f"{side}_forearm",
            [forward, up, out],
            table("forearm", arm, skeleton.length(f"{side}_hand") / 0.26, 0.4 * loose_m),
            2,
            0.02,
        )
        add("hand", f"{side}_hand", [forward, up, out], table("fist" if fists else "hand", end), 2.2, 0.012)
        if not fists:
            add(
                "thumb",
                f"{side}_hand",
                [up, [0.8, -0.6 * sign, 0], [0.6, 0.8 * sign, -0.25]],
                table("thumb", end),
                2,
                0.012,
                (0.022 * scale, sign * 0.025 * scale, 0),
            )
        thigh = table("thigh", factor["leg"] * (limb + 0.10 * woman), skeleton.length(f"{side}_shank") / 0.42, loose_m)
        add("thigh", f"{side}_thigh", [left, forward, down], thigh, 2, 0.035)
        add("shank", f"{side}_shank", [left, forward, down], trousers, 2, 0.025)
        foot = scale * (0.94 if woman else 1.0)
        shoe, toes = table("foot", 1.0), table("toes", 1.0)
        sole = skeleton.ankle_height
        # Widths follow the person; heights are set so that the sole is flat and lies on the floor.
        for rows, drop in ((shoe, sole), (toes, sole + skeleton.offsets[BONE_NAMES.index("l_toes"), 2])):
            rows[:, 1] *= foot
            rows[:, 2] *= scale
            rows[:, 4] = np.where(rows[:, 0] < -0.055 * scale, rows[:, 4], rows[:, 2] - drop + 0.003)
        add("foot", f"{side}_foot", [left, up, forward], shoe, 3, 0.02)
        add("toes", f"{side}_toes", [left, up, forward], toes, 3, 0.015)
    head = skeleton.head_top[2] / 0.154
    neck = 1 + 0.10 * max(girth, 0) - 0.14 * woman
    add("neck", "neck", [left, forward, up], table("neck", scale * neck, scale), 2, 0.03)
    add("head", "head", [left, forward, up], table("head", head, head), 2, 0.02)
    add("nose", "head", [left, forward, up], table("nose", head, head), 2, 0.01)
    add("hair", "head", [left, forward, up], table("hair", head, head), 2, 0.01)
    if long_hair:
        add("long_hair", "head", [left, forward, up], table("long_hair", head, head), 2, 0.012)
    return sweeps
