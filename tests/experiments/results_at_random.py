"""Results of every experiment's cells drawn at random, of the shape that the cells have: what no claim may hold on.

Two ways. Shuffled: of about the size that results have, each cell's drawn from the same distribution whatever its parameters are, which is
what a permutation of results among the cells is. Noise: numbers without any structure, of the same scale.
"""

from dataclasses import asdict
from functools import cache

import matplotlib.pyplot as plt
import numpy as np

from hmc.body.joints import dof_index
from hmc.body.kinematics import landmarks
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.experiments import Cell, Plan, find_experiment
from hmc.experiments.engine.style import house_style
from hmc.experiments.fig_4_2 import RANGES
from hmc.experiments.fig_4_9 import SHOWN as SHOWN_STEPS
from hmc.experiments.fig_4_9 import STEPS
from hmc.experiments.fig_6_11 import PANELS, SIDE
from hmc.experiments.hiding import ENDS
from hmc.experiments.hsiao_pso import METHODS as OPTIMISERS
from hmc.experiments.kehl_4 import THRESHOLDS
from hmc.experiments.toy_likelihood import BOUNDS
from hmc.landmarks import LANDMARKS
from hmc.pose.spectral.parts import PART_NAMES
from hmc.tracking.person_tree import LEAF, default_tree

__all__ = ["RESULTS", "claims_at_random"]

FRAMES, FPS = 60, 20.0
#: Frames in which nothing is seen, where that is studied.
GONE = [15, 25]


def amount(rng, noise, usual, shape=None):
    """Positive numbers of one scale: around what is usual, or anything up to twice that."""
    return usual * (rng.uniform(0, 2, shape) if noise else np.exp(0.4 * rng.normal(size=shape)))


@cache
def _truth(seed):
    """A person whose arms move at random."""
    states = np.tile(neutral_state("down"), (FRAMES, 1))
    states[:, 2] = 0.95
    arms = dof_index("l_shoulder_x", "r_shoulder_x", "l_elbow_z", "r_elbow_z")
    states[:, arms] += np.random.default_rng(seed).uniform(-0.8, 0.8, (FRAMES, len(arms)))
    return landmarks(default_body(1.78), states)


def pose(rng, parameters, noise):
    truth = _truth(int(rng.integers(3)))
    if noise:  # every frame off by another size, from centimetres to metres
        truth = truth + rng.normal(size=truth.shape)
        off = 10 ** rng.uniform(-2, 0.5, (FRAMES, 1, 1))
    else:  # a fifth of the landmarks is lost
        off = amount(rng, noise, 0.02) * np.where(rng.random(truth.shape[:2]) < 0.2 * rng.random(), 8, 1)[..., None]
    gone = {"gone": GONE if parameters["gone_s"] else []} if "gone_s" in parameters else {}
    return {
        "frames": np.arange(FRAMES), "fps": FPS, "estimate_m": truth + off * rng.normal(size=truth.shape), "truth_m": truth,
        "filter_s_per_frame": amount(rng, noise, 0.1), "frame_s": amount(rng, noise, 0.1), "problem": "",
    } | gone  # fmt: skip


def descended(rng, parameters, noise):
    drawn = {"seconds": amount(rng, noise, 0.05, FRAMES), "iterations": rng.integers(1, 60, (FRAMES, 2)), "pictures": []}
    return pose(rng, parameters, noise) | drawn


def swarmed(rng, parameters, noise):
    counts = {name: int(rng.integers(FRAMES // 2)) for name in ("restarts", "turned", "without_fit")}
    return pose(rng, parameters, noise) | {"frames": FRAMES, "error_mm": amount(rng, noise, 40.0, FRAMES)} | counts


def behind_furniture(rng, parameters, noise):
    """Limbs come and go: in the data, and in the estimate."""
    results = pose(rng, parameters, noise)
    occupancy = rng.random((FRAMES, len(ENDS))) if noise else np.repeat(rng.random((FRAMES // 20, len(ENDS))), 20, axis=0)
    left_out = rng.random(occupancy.shape) < 0.3 if noise else np.repeat(rng.random((FRAMES // 10, len(ENDS))), 10, axis=0) < 0.3
    for k, end in enumerate(ENDS.values()):
        results["estimate_m"][left_out[:, k], LANDMARKS.index(end)] = np.nan
    return results | {"occupancy": occupancy, "cameras": rng.integers(0, 8, occupancy.shape).astype(float)}


def lost_arm(rng, parameters, noise):
    errors = amount(rng, noise, 0.1, FRAMES) if noise else np.repeat(amount(rng, noise, 0.1, FRAMES // 10), 10)
    return {"frames": np.arange(FRAMES), "errors_m": errors, "gone": GONE}


def peaks(rng, parameters, noise):
    layers = [{"x": rng.uniform(*BOUNDS, 100), "weight": np.full(100, 0.01)} for _ in range(3)]
    estimate = rng.uniform(*BOUNDS) if noise else rng.choice([5.5, -0.5, -4.5]) + 0.1 * rng.normal()
    return {"estimate": float(estimate), "layers": layers if parameters["repeat"] == 0 else []}


def components(rng, parameters, noise):
    low, high = np.array(RANGES).T
    # People, and other things; as noise, numbers of no distribution that two cells share.
    middle, width = (rng.random(6), rng.random(6)) if noise else (np.full(6, 0.4), np.full(6, 0.15))
    share = middle + width * rng.normal(size=(400, 6))
    return {"features": np.clip(low + share * (high - low), low, high), "is_person": (rng.random(400) < 0.5).astype(int)}


def classified(rng, parameters, noise):
    scores = {name: float(rng.random() if noise else rng.choice([0.98, 0.92, 0.8])) for name in ("precision", "recall", "f_measure")}
    return scores | {f"{part}_{label}": int(rng.integers(1, 999)) for part in ("train", "test") for label in ("people", "others")}


def tree(rng, parameters, noise):
    """The tree's nodes, each asking for any feature."""
    found = asdict(default_tree())
    return found | {"feature": [one if one == LEAF else int(rng.integers(6)) for one in found["feature"]]}


def ellipsoid(rng, parameters, noise):
    return {"n_voxels": int(rng.integers(1, 9999)), "mean_mm": float(amount(rng, noise, 10.0)), "sd_mm": float(amount(rng, noise, 3.0))}


def samples(rng, parameters, noise):
    spread = amount(rng, noise, 0.6, STEPS + 1) if noise else amount(rng, noise, 0.6) * np.ones(STEPS + 1)
    shown = {str(step): rng.uniform(-1, 1, (400, 3)) for step in SHOWN_STEPS}
    return {"spread": spread, "error_mm": amount(rng, noise, 50.0, STEPS + 1), "n_samples": [400] * (STEPS + 1), "shown_m": shown}


def tracks(rng, parameters, noise):
    counts = {name: int(amount(rng, noise, usual)) for name, usual in (("misses", 30), ("false_positives", 30), ("mismatches", 3))}
    matches = int(amount(rng, noise, 700)) + 1
    times = {"filter_s": float(amount(rng, noise, 2.0)), "color_s": float(amount(rng, noise, 1.0))}
    return counts | times | {"objects": 800, "matches": matches, "distance_m": float(matches * amount(rng, noise, 0.1)),
                             "frames": 300, "fps": 15.0, "rows": 800}  # fmt: skip


def crossing(rng, parameters, noise):
    plain = {"frames": np.arange(10), "persons": np.zeros(10, int), "positions": rng.uniform(-1, 1, (10, 3))}
    counts = {"mismatches": int(rng.integers(0, 9 if noise else 3)), "wrong": int(rng.integers(90)), "persons": int(rng.integers(1, 5))}
    return counts | {"objects": 100, "tracks": plain, "truth": plain}


def maps(rng, parameters, noise):
    degrees = np.array([np.linspace(-60, 60, SIDE), np.linspace(-30, 90, SIDE)])
    values = rng.normal(size=(len(PANELS), SIDE, SIDE))
    if not noise:  # a few hills each
        place = rng.uniform(-1, 1, (len(PANELS), 4, 2, 1, 1))
        x, y = np.meshgrid(*2 * (np.linspace(-1, 1, SIDE),), indexing="ij")
        values = np.exp(-((x - place[:, :, 0]) ** 2 + (y - place[:, :, 1]) ** 2) / 0.1).max(axis=1)
    return {"degrees": degrees, "log_likelihood": amount(rng, noise, 20.0) * values, "true_degrees": rng.uniform(-30, 60, 2)}


def schedule(rng, parameters, noise):
    particles = rng.permutation([300, 300, 500]) if not noise else rng.integers(100, 900, 3)
    return {"particles": particles, "effective": rng.permutation(2 * particles), "spread": rng.random((6, 3)), "layers": 2}


def square(rng, parameters, noise):
    angles = np.arange(0, 91, 3.0)
    left = rng.random(len(angles)) if noise else np.full(len(angles), rng.uniform(0.8, 1.0))
    return {"angle_deg": angles, "area_left": left, "holes": np.maximum(amount(rng, noise, 0.1, len(angles)) - 0.1, 0),
            "picture": rng.integers(-25, 25, (300, 2))}  # fmt: skip


def ghosts(rng, parameters, noise):
    rows = np.column_stack([np.arange(8), rng.integers(0 if noise else 2, 4, 8), rng.integers(0, 2, 8), *amount(rng, noise, 60.0, (4, 8))])
    return {"rows": rows, "shown": rng.random((50, 3)), "texts": []}


def parts(rng, parameters, noise):
    shares = rng.random((6, 6)) if noise else np.clip(amount(rng, noise, 0.75, (6, 6)), 0, 1)
    rows = np.column_stack([np.arange(6), rng.integers(0, 2, 6), shares[:, :3], rng.integers(0, 2, 6), shares[:, 3:5]])
    n, truth = 200, _truth(0)[0]
    names = [name for name in PART_NAMES if rng.random() < 0.5]
    near = 1.0 if noise else 0.1
    curves = {name: truth[rng.choice(15, 5)] + near * rng.normal(size=(5, 3)) for name in names}
    shown = {name: rng.normal(size=(n, 3)) for name in ("points", "places", "plain_places")}
    shown |= {name: rng.integers(0, 6, n) for name in ("ours", "baseline")}
    shown |= {"joints": truth, "curves": curves, "plain_curves": curves}
    return {"rows": rows, "shown": shown}


def optimised(rng, parameters, noise):
    rows = [[frame, k, *amount(rng, noise, 60.0, 2), 9000] for frame in range(5) for k in range(len(OPTIMISERS))]
    return {"rows": np.array(rows)}


def carved(rng, parameters, noise):
    times = {name: float(amount(rng, noise, 5.0)) for name in ("incremental", "scratch", "blocks", "texturing")}
    return {"ms": times, "identical": bool(rng.random() < 0.5), "surface_voxels": int(rng.integers(100, 9999))}


def edges(rng, parameters, noise):
    def curve():
        return rng.random(14) if noise else np.sort(rng.random(14))[::-1]

    recall = {name: np.maximum(curve(), 0.01) for name in THRESHOLDS}
    image = rng.integers(0, 255, (40, 40, 3))
    return {"recall": recall, "clutter_px": {name: 100 * curve() for name in THRESHOLDS}, "images": 9,
            "example": {"image": image, "box": [5, 35, 5, 35]}}  # fmt: skip


def displaced(rng, parameters, noise):
    names = ("SMD", "deterministic")
    return {"distance_m": {name: amount(rng, noise, 0.05, 50) for name in names}, "degrees": rng.uniform(15, 45, 50)}


#: By the folder of the cells: ``draw(rng, parameters, noise) -> results``.
RESULTS = {
    "fig-3.3": peaks, "fig-3.5": lambda rng, parameters, noise: {"score": float(rng.random()), "mean_error": float(rng.random())},
    "fig-4.2": components, "table-4.2": classified, "fig-4.4": tree, "fig-4.7": ellipsoid, "fig-4.9": samples, "tracking": tracks,
    "fig-4.12": crossing, "pose": pose, "fig-6.11": maps, "markers": pose, "filters": pose, "markerless": pose,
    "fig-7.8": schedule, "fig-7.15": behind_furniture, "lost-arm": lost_arm, "over-time": pose,
    "all-methods": pose, "fig-B.1": square, "hsiao-3.8": ghosts, "hsiao-parts": parts, "hsiao-4": swarmed, "hsiao-pso": optimised,
    "kehl-1": carved, "kehl-4": edges, "kehl-9": displaced, "kehl": descended,
}  # fmt: skip


def claims_at_random(name, seed, noise):
    """The claims of an experiment's quick report on results that are drawn at random."""
    rng, plan = np.random.default_rng(seed), Plan(quick=True)
    experiment = find_experiment(name)
    draw = RESULTS[experiment.store_name]
    cells = [Cell(parameters, draw(rng, parameters, noise)) for parameters in experiment.grid(plan)]
    with house_style(), np.errstate(all="ignore"):
        report = experiment.report(cells, plan)
        plt.close("all")
    return report.claims
