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
from hmc.experiments import EXPERIMENTS, Cell, Plan, find_experiment
from hmc.experiments.engine.selection import REPEAT, grid_of
from hmc.experiments.engine.style import house_style
from hmc.experiments.fig_4_2 import RANGES
from hmc.experiments.fig_4_9 import SHOWN as SHOWN_STEPS
from hmc.experiments.fig_4_9 import STEPS
from hmc.experiments.fig_6_11 import PANELS, SIDE
from hmc.experiments.fig_7_8 import MODELS as HIERARCHIES
from hmc.experiments.fig_b_1 import SHOWN as SHOWN_SQUARES
from hmc.experiments.filter_study import CHAINS, MARKERS
from hmc.experiments.hiding import ENDS
from hmc.experiments.hsiao_3_15 import MODIFIED, OURS, SCORES, SUNDARESAN
from hmc.experiments.hsiao_pso import METHODS as OPTIMISERS
from hmc.experiments.kehl_4 import THRESHOLDS
from hmc.experiments.kehl_9 import METHODS as SAMPLINGS
from hmc.experiments.toy_likelihood import BOUNDS, drawn_peaks
from hmc.experiments.tracking_runs import REFERENCES
from hmc.experiments.why_slow import PLACES
from hmc.landmarks import LANDMARKS
from hmc.pose.spectral.parts import PART_NAMES
from hmc.tracking.person_tree import LEAF, default_tree

__all__ = ["REPEATED", "RESULTS", "claims_at_random", "claims_on", "held_always"]

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
    return {"frames": np.arange(FRAMES), "fps": FPS, "estimate_m": truth + off * rng.normal(size=truth.shape), "truth_m": truth}


def marked(rng, parameters, noise):
    return pose(rng, parameters, noise) | {"problem": ""}


def filtered(rng, parameters, noise):
    if parameters["method"] in MARKERS:
        return marked(rng, parameters, noise)
    times = {} if parameters["method"] in CHAINS else {"filter_s_per_frame": float(amount(rng, noise, 0.1))}
    return pose(rng, parameters, noise) | times


def too_fast(rng, parameters, noise):
    if parameters["seen"] != PLACES:
        return marked(rng, parameters, noise)
    return pose(rng, parameters, noise) | {"motion_p0": amount(rng, noise, 3.0, FRAMES)}


def in_hulls(rng, parameters, noise):
    results = filtered(rng, parameters, noise)
    return results | {"nearest_m": results["truth_m"]}


def timed(rng, parameters, noise):
    return pose(rng, parameters, noise) | {"frame_s": float(amount(rng, noise, 0.1))}


def unseen(rng, parameters, noise):
    return pose(rng, parameters, noise) | {"gone": GONE if parameters["gone_s"] else []}


def descended(rng, parameters, noise):
    drawn = {"seconds": amount(rng, noise, 0.05, FRAMES), "iterations": rng.integers(1, 60, (FRAMES, 2)), "pictures": []}
    return pose(rng, parameters, noise) | drawn


def swarmed(rng, parameters, noise):
    counts = {name: int(rng.integers(FRAMES // 2)) for name in ("restarts", "without_fit")}
    rates = {"evaluations_per_frame": float(amount(rng, noise, 9000.0)), "seconds_per_frame": float(amount(rng, noise, 0.5))}
    found = pose(rng, parameters, noise)
    estimate, truth = found["estimate_m"], found["truth_m"]
    if noise:  # bodies that face anywhere
        turns = np.exp(1j * rng.uniform(0, 2 * np.pi, (FRAMES, 1)))
        turned = turns * (estimate[..., 0] + 1j * estimate[..., 1])
        estimate = np.stack([turned.real, turned.imag, estimate[..., 2]], axis=-1)
    return {"estimate_m": estimate, "truth_m": truth, "frames": FRAMES} | counts | rates


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
    layers = [{"x": rng.uniform(*BOUNDS, 100), "weight": np.full(100, 0.01)} for _ in range(parameters["layers"])]
    # As it is of any function: on one of its peaks.
    places = [place for _, place, _ in drawn_peaks(int(rng.integers(12)))]
    estimate = rng.uniform(*BOUNDS) if noise else rng.choice(places) + 0.1 * rng.normal()
    return {"estimate": float(estimate), "layers": layers if parameters["repeat"] == parameters["function"] == 0 else []}


def colored(rng, parameters, noise):
    angles = {way: float(amount(rng, noise, 10.0)) for way in ("plain", "visible")}
    picture = {name: rng.random((50, 3)) for name in ("points", "paint", *angles)}
    return {"voxels": 50, "angle_deg": angles, "shown": picture if parameters["at"] < 0.25 else None}


def over_annealed(rng, parameters, noise):
    return {"score": float(rng.random()), "mean_error": float(amount(rng, noise, 0.5))}


def components(rng, parameters, noise):
    low, high = np.array(RANGES).T
    # People, and other things; as noise, numbers of no distribution that two cells share.
    middle, width = (rng.random(6), rng.random(6)) if noise else (np.full(6, 0.4), np.full(6, 0.15))
    share = middle + width * rng.normal(size=(400, 6))
    return {"features": np.clip(low + share * (high - low), low, high), "is_person": (rng.random(400) < 0.5).astype(int)}


def classified(rng, parameters, noise):
    scores = {name: float(rng.random() if noise else rng.choice([0.98, 0.92, 0.8])) for name in ("precision", "recall", "f_measure")}
    # Of every recording: either as good as the run is, or anything.
    n = len(parameters["test"])
    both, shares = rng.integers(50, 400, n), rng.random(n) if noise else np.full(n, scores["f_measure"])
    counts = {f"{part}_{label}": int(rng.integers(1, 999)) for part in ("train", "test") for label in ("people", "others")}
    return scores | counts | {"by_recording": [[round(share * total), total] for share, total in zip(shares, both.tolist(), strict=True)]}


def tree(rng, parameters, noise):
    """The tree's nodes, each asking for any feature."""
    found = asdict(default_tree())
    return found | {"feature": [one if one == LEAF else int(rng.integers(6)) for one in found["feature"]]}


def ellipsoid(rng, parameters, noise):
    return {"n_voxels": int(rng.integers(1, 9999)), "mean_mm": float(amount(rng, noise, 10.0)), "sd_mm": float(amount(rng, noise, 3.0))}


def samples(rng, parameters, noise):
    spread = amount(rng, noise, 0.6, STEPS + 1) if noise else amount(rng, noise, 0.6) * np.ones(STEPS + 1)
    shown = {str(step): rng.uniform(-1, 1, (400, 3)) for step in SHOWN_STEPS}
    return {"spread": spread, "error_mm": amount(rng, noise, 50.0, STEPS + 1), "n_samples": [400] * (STEPS + 1),
            "shown_m": shown if parameters["repeat"] == 0 else {}}  # fmt: skip


def errors_of_tracks(rng, noise):
    """What CLEAR MOT counts; few are lost, or anything up to everybody."""
    usual = {"misses": 400 if noise else 30, "false_positives": 400 if noise else 30, "mismatches": 3}
    counts = {name: int(amount(rng, noise, size)) for name, size in usual.items()}
    matches = max(800 - counts["misses"], 1)
    return counts | {"objects": 800, "matches": matches, "distance_m": float(matches * amount(rng, noise, 0.1))}


def tracks(rng, parameters, noise):
    times = {"filter_s": float(amount(rng, noise, 2.0)), "color_s": float(amount(rng, noise, 1.0))}
    return {name: errors_of_tracks(rng, noise) for name in REFERENCES} | times | {"frames": 300, "fps": 15.0, "rows": 800}


def crossing(rng, parameters, noise):
    plain = {"frames": np.arange(10), "persons": np.zeros(10, int), "positions": rng.uniform(-1, 1, (10, 3))}
    kept = {"tracks": plain, "truth": plain} if parameters["repeat"] == 0 else {}
    counts = {"rows": 200, "filter_s": float(amount(rng, noise, 2.0)), "persons": int(rng.integers(1, 5))}
    return {name: errors_of_tracks(rng, noise) for name in REFERENCES} | counts | kept


def behind(rng, parameters, noise):
    """Who walks may be far behind, or hardly; or anywhere around."""
    standing, walking = rng.integers(50, 500, 2).tolist()
    walking_m = float(walking * amount(rng, noise, 0.1))
    share = rng.uniform(-1, 1) if noise else rng.choice([0.8, 0.1])
    return {"standing": standing, "standing_m": float(standing * amount(rng, noise, 0.05)), "walking": walking, "walking_m": walking_m,
            "behind_m": float(share * walking_m)}  # fmt: skip


def maps(rng, parameters, noise):
    degrees = np.array([np.linspace(-60, 60, SIDE), np.linspace(-30, 90, SIDE)])
    values = rng.normal(size=(len(PANELS), SIDE, SIDE))
    if not noise:  # a few hills each
        place = rng.uniform(-1, 1, (len(PANELS), 4, 2, 1, 1))
        x, y = np.meshgrid(*2 * (np.linspace(-1, 1, SIDE),), indexing="ij")
        values = np.exp(-((x - place[:, :, 0]) ** 2 + (y - place[:, :, 1]) ** 2) / 0.1).max(axis=1)
    return {"degrees": degrees, "log_likelihood": amount(rng, noise, 20.0) * values, "true_degrees": rng.uniform(-30, 60, 2)}


def schedule(rng, parameters, noise):
    """Layers and models of the filter in any order."""
    group = HIERARCHIES[parameters["model"]].group
    models, layers = int(group.max()) + 1, 2
    falls = [0.5**step for step in range(layers * models)]
    moved = np.column_stack([np.r_[np.zeros(layers * k), falls[: layers * (models - k)]] for k in range(models)])
    drift_of_model, evaluations = rng.permutation(moved.ravel()).reshape(moved.shape), rng.permutation(np.repeat([300, 500, 300], layers))
    if noise:
        drift_of_model, evaluations = amount(rng, noise, 0.3, moved.shape) + 1e-9, rng.integers(100, 900, layers * models)
    return {"evaluations": evaluations, "drift": drift_of_model[:, group], "drift_of_model": drift_of_model, "group": group}


def square(rng, parameters, noise):
    angles = np.arange(0, 90 + 1e-9, parameters["step_deg"])
    left = rng.random(len(angles)) if noise else np.full(len(angles), rng.uniform(0.8, 1.0))
    picture = rng.integers(-25, 25, (300 if parameters["alpha"] in SHOWN_SQUARES else 0, 2))
    return {"angle_deg": angles, "area_left": left, "holes": np.maximum(amount(rng, noise, 0.1, len(angles)) - 0.1, 0), "picture": picture}


def ghosts(rng, parameters, noise):
    rows = np.column_stack([np.arange(8), rng.integers(0 if noise else 2, 4, 8), rng.integers(0, 2, 8), *amount(rng, noise, 60.0, (4, 8))])
    return {"rows": rows, "shown": rng.random((50, 3)), "texts": []}


def parts(rng, parameters, noise):
    n, ways, truth = 6, (MODIFIED, OURS, SUNDARESAN), _truth(0)[0]
    shape = (n, len(ways), 4)
    shares = rng.random(shape) if noise else np.clip(amount(rng, noise, 0.75, shape), 0, 1)
    scores = np.concatenate([shares, amount(rng, noise, 0.06, (n, len(ways), len(SCORES) - 4))], axis=2)
    near = 1.0 if noise else 0.1

    def picture():
        names = [name for name in PART_NAMES if rng.random() < 0.5]
        curves = {name: truth[rng.choice(15, 5)] + near * rng.normal(size=(5, 3)) for name in names}
        return {"labels": rng.integers(-1, len(PART_NAMES) + 1, 200), "places": rng.normal(size=(200, 3)), "curves": curves}

    shown = {"points": rng.normal(size=(200, 3)), "joints": truth, "ways": {way: picture() for way in ways}}
    return {"frames": list(range(n)), "apart": rng.integers(0, 2, n).tolist(), "scores": scores, "shown": shown}


def optimised(rng, parameters, noise):
    rows = [[frame, k, *amount(rng, noise, 60.0, 2), 9000] for frame in range(5) for k in range(len(OPTIMISERS))]
    return {"rows": np.array(rows)}


def carved(rng, parameters, noise):
    names = ("incremental", "scratch", "blocks", "texturing")
    usual = {name: 5.0 if noise else float(amount(rng, noise, 5.0)) for name in names}
    times = {name: amount(rng, noise, size, parameters["frames"]).tolist() for name, size in usual.items()}
    return {"ms": times, "identical": bool(rng.random() < 0.5), "surface_voxels": int(rng.integers(100, 9999))}


def edges(rng, parameters, noise):
    def curve(name):
        n = len(THRESHOLDS[name])
        return rng.random(n) if noise else np.sort(rng.random(n))[::-1]

    hits = {name: np.round(1000 * curve(name)) for name in THRESHOLDS}
    image = rng.integers(0, 255, (40, 40, 3))
    return {"hits": hits, "outline_px": 1000, "clutter_px": {name: 100 * curve(name) for name in THRESHOLDS},
            "images": parameters["images"], "example": {"image": image, "box": [5, 35, 5, 35]}}  # fmt: skip


def displaced(rng, parameters, noise):
    n = parameters["displacements"]
    return {"distance_m": {name: amount(rng, noise, 0.05, n) for name in SAMPLINGS}, "degrees": rng.uniform(15, 45, n)}


def chained(rng, parameters, noise):
    """Four people before four cameras where the recording is of several."""
    several = parameters["recording"].startswith(("close", "crossing"))
    counts = {"objects": FRAMES, "misses": 1, "false_positives": 0, "mismatches": int(rng.integers(3))}
    more = {"cameras": 4 if several else parameters["cameras"] or 7, "reference": False, "tracks": counts}
    return pose(rng, parameters, noise) | {"persons": np.repeat(np.arange(4 if several else 1), FRAMES // 4 if several else FRAMES)} | more


def cued(rng, parameters, noise):
    """The chain's without tracks; a fault lasts a third of it."""
    several = parameters["recording"].startswith(("crossing", "sit"))
    more = {"cameras": parameters["cameras"] or (5 if several else 7), "faulty": [20, 40] if parameters["fault"] else []}
    return chained(rng, parameters, noise) | more


def overlaps(rng, parameters, noise):
    usual = rng.uniform(0.1, 0.9) if noise else rng.uniform(0.78, 0.82)
    return {"silhouettes": np.clip(usual + 0.01 * rng.normal(size=(4, 5)), 0, 1), "hulls": np.clip(usual + 0.01 * rng.normal(size=4), 0, 1)}


def pulled_off(rng, parameters, noise):
    """Bodies that are lifted or lowered as a whole, and landmarks off besides."""
    start, end = (amount(rng, noise, 0.012) * rng.normal(size=(8, len(LANDMARKS), 3)) for _ in range(2))
    up = rng.uniform(-0.05, 0.05) if noise else 0.015 * rng.normal()
    return {"start_off_m": start, "off_m": end + np.array([0, 0, up])}


def doubted(rng, parameters, noise):
    """Landmarks of which one in eight is far off, whatever speaks against them, little or much."""
    results = {"cameras": parameters["cameras"] or 7}
    for way in ("both passes", "one pass", "at wrong times"):
        much = rng.choice([0.01, 1.0]) if noise else 0.01
        results[way] = {"features": much * rng.uniform(0, 1, (40, 15, 6)), "errors_m": rng.exponential(0.03, (40, 15))}
    return results


#: By the folder of the cells: ``draw(rng, parameters, noise) -> results``.
RESULTS = {
    "fig-2.4": colored, "fig-3.3": peaks, "fig-3.5": over_annealed, "fig-4.2": components, "table-4.2": classified, "fig-4.4": tree,
    "fig-4.7": ellipsoid, "fig-4.9": samples, "tracking": tracks, "fig-4.12": crossing, "why-behind": behind, "pose": pose,
    "fig-6.11": maps, "markers": marked, "filters": filtered, "markerless": pose, "fig-7.8": schedule, "fig-7.15": behind_furniture,
    "lost-arm": lost_arm, "over-time": unseen, "all-methods": timed, "fig-B.1": square, "hsiao-3.8": ghosts, "hsiao-parts": parts,
    "hsiao-4": swarmed, "why-hsiao": swarmed, "why-slow": too_fast, "why-hulls": in_hulls, "hsiao-pso": optimised, "repairs": overlaps,
    "body-bias": pulled_off, "chain": chained, "cues": cued, "trust": doubted,
    "kehl-1": carved, "kehl-4": edges, "kehl-9": displaced, "kehl": descended,
}  # fmt: skip


def claims_on(name, draw, seed=0, quick=True, repeats=None):
    """The claims of an experiment on results that ``draw(rng, parameters)`` makes of every cell; ``repeats``: so many seeds of each."""
    rng, plan, experiment = np.random.default_rng(seed), Plan(quick=quick, seeds=repeats), find_experiment(name)
    cells = [Cell(parameters, draw(rng, parameters)) for parameters in grid_of(experiment, plan)]
    with house_style(), np.errstate(all="ignore"):
        report = experiment.report(cells, plan)
        plt.close("all")
    assert report.claims
    return report.claims


def held_always(name, draw, quick=True, seeds=(1, 2, 3)):
    """The claims that hold in every draw: of intervals of 95 % one in forty is above zero by chance."""
    return set.intersection(*({claim.text for claim in claims_on(name, draw, seed, quick) if claim.holds} for seed in seeds))


def claims_at_random(name, seed, noise, quick=True, repeats=None):
    """The claims of an experiment's report, quick or in full, on results that are drawn at random."""
    draw = RESULTS[find_experiment(name).store_name]
    return claims_on(name, lambda rng, parameters: draw(rng, parameters, noise), seed, quick, repeats)


#: The experiments whose cells draw at random from seed to seed.
REPEATED = tuple(name for name in EXPERIMENTS if any(REPEAT in cell for cell in find_experiment(name).grid(Plan())))
