"""Why Hsiao's printed system is lost: single changes of it, and of `default` what its swarm and the house add. Ours, not the thesis's.

Is it the parts (section 3.1.4.2), which curve is which (3.2.2.1), the ranges of the joints (Table 3-4), the particles (not printed), where
swarms begin (3.2.2.2), whether the last pose draws them, or which way round the body is (3.2.1.2)? The last has no change of its own:
beside the mean error is that with left and right exchanged in frames where that is nearer. True parts are those of the nearest point of
the rendered actor's skin.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.engine.experiment import Cell, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.selection import REPEAT
from hmc.experiments.engine.style import COLORS
from hmc.experiments.hsiao_runs import facing_interval, followed, scene_of, sequence_name, sequences
from hmc.experiments.pose_intervals import ahead, score_interval
from hmc.experiments.truth import estimates
from hmc.metrics.landmarks import landmark_errors
from hmc.metrics.persons import exchange_sides
from hmc.pose.method import PoseMethod
from hmc.pose.methods.pso import SWARM_PRESETS, pso_method
from hmc.pose.spectral.parts import PART_NAMES
from hmc.pose.spectral.reading import BodyReading, ReadingSettings, read_parts
from hmc.pose.spectral.segmentation import segment_body
from hmc.pose.steps.presets import PRESETS
from hmc.pose.steps.refine import RefineSettings
from hmc.pose.steps.swarm.step import Read, SwarmPreset
from hmc.pose.steps.swarm.temporal import SwarmSettings
from hmc.pose.views.person_view import PersonView
from hmc.search.swarm import PsoSettings
from hmc.synthetic.actor import PARTS
from hmc.synthetic.truth import true_parts

__all__ = ["CHANGES", "EXPERIMENT", "true_reading"]

NAMES, SEEDS = ("s1_wave", "s5_sit", "s8_walk"), 3
ALL = "all"
_PRINTED, _OURS, _HOUSE = SWARM_PRESETS["hsiao2008"], SWARM_PRESETS["default"], PRESETS["default"]
#: Where the actor's parts are in `PART_NAMES`: the reading knows no sides.
_PARTS = {"l_arm": "arm_1", "r_arm": "arm_2", "l_leg": "leg_1", "r_leg": "leg_2"}
_LABELS = np.array([PART_NAMES.index(_PARTS.get(part, part)) for part in PARTS])


def _with(fit: dict | None = None, reading: dict | None = None, swarm: dict | None = None, **changes) -> SwarmPreset:
    """The printed preset with changes of the fit, of what is read, of the swarm and of the rest."""
    found = replace(_PRINTED.swarm, fit=replace(_PRINTED.swarm.fit, **(fit or {})), **(swarm or {}))
    return replace(_PRINTED, reading=replace(_PRINTED.reading, **(reading or {})), swarm=found, **changes)


def _plain(preset: SwarmPreset) -> Callable[[str], PoseMethod]:
    return lambda label: pso_method(preset)


def _true(preset: SwarmPreset) -> Callable[[str], PoseMethod]:
    return lambda label: pso_method(preset, read=true_reading(label, preset.reading))


#: Of `default`, the swarm on curves alone, and the house without refinement and search.
_CURVES = replace(_OURS, swarm=replace(_OURS.swarm, voxels=False))
_UNREFINED = replace(_HOUSE, refine=RefineSettings(iterations=0), search=None)
_FOUR_TIMES = tuple((4 * particles, iterations) for particles, iterations in _PRINTED.swarm.fit.stages)
AS_PRINTED, DEFAULT = "as printed", "default"
#: What is changed, and how, by a recording's label.
CHANGES: dict[str, Callable[[str], PoseMethod]] = {
    AS_PRINTED: _plain(_PRINTED),
    "our segmentation": _plain(_with(reading={"segmentation": ReadingSettings().segmentation})),
    "four times the particles": _plain(_with(fit={"stages": _FOUR_TIMES}, swarm={"particles": 4 * _PRINTED.swarm.particles})),
    "begun at the last pose and drawn to it": _plain(_with({"swarm": PsoSettings()}, swarm={"last_weight": SwarmSettings().last_weight})),
    "anatomical ranges": _plain(_with(thesis=False)),
    "true parts": _true(_PRINTED),
    "true parts, curves named": _true(_with(swarm={"named": True})),
    "true parts, anatomical ranges": _true(_with(thesis=False)),
    DEFAULT: lambda label: pso_method(_OURS, _HOUSE),
    "default without voxels in the swarm": lambda label: pso_method(_CURVES, _HOUSE),
    "default without refinement and search": lambda label: pso_method(_OURS, _UNREFINED),
    "default without either": lambda label: pso_method(_CURVES, _UNREFINED),
}


def true_reading(label: str, settings: ReadingSettings) -> Read:
    """What is read in a frame of a rendered sequence where every voxel has its true part.

    Parameters
    ----------
    label : str
        Of the recording.
    settings : ReadingSettings

    Raises
    ------
    InputError
        When the label is of a recording of the user's.
    """
    scene = scene_of(label)

    def read(view: PersonView, height_m: float) -> BodyReading | None:
        seen = view.voxels
        if seen is None:
            return None
        found = segment_body(seen.voxels, seen.points, seen.voxel_size_m, settings.segmentation, seen.votes)
        labels = _LABELS[true_parts(scene, view.frame, seen.points)[0]]
        known = replace(found, labels=labels, others=(), touching=(), doubts=())
        return read_parts(known, seen.voxels, seen.points, seen.voxel_size_m, height_m, settings)

    return read


def grid(plan: Plan) -> list[dict]:
    """Every change on three sequences; in full with three seeds."""
    return [
        {"recording": source.label, "way": way, REPEAT: seed}
        for source in sequences(plan, NAMES)
        for way in CHANGES
        for seed in range(1 if plan.quick else SEEDS)
    ]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """The person of a recording by one of `CHANGES`."""
    return followed(parameters["recording"], CHANGES[parameters["way"]](parameters["recording"]), inputs, rng)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """A row a sequence and change; which changes make who is lost better followed."""
    by_way = {way: [one for one in cells if one.parameters["way"] == way] for way in CHANGES}
    rows = []
    for name in [*dict.fromkeys(map(sequence_name, cells)), ALL]:
        for way, own in by_way.items():
            shown = [one for one in own if name in (sequence_name(one), ALL)]
            rows.append({
                "sequence": name, "way": way, "mean_mm": str(score_interval(shown, "mean_mm")), "nearer_side_mm": _nearer_side(shown),
                "MMTA_percent": str(score_interval(shown, "MMTA_percent")), "facing_percent": facing_interval(shown).value,
                "without_fit": sum(one.results["without_fit"] for one in shown), "frames": sum(one.results["frames"] for one in shown),
            })  # fmt: skip
    claims = [
        ahead(f"better followed than as printed: {way}", own, by_way[AS_PRINTED], but=("way",))
        for way, own in by_way.items()
        if way != AS_PRINTED and not way.startswith(DEFAULT)
    ]
    claims += [
        ahead(f"worse followed than default: {way}", by_way[DEFAULT], own, but=("way",))
        for way, own in by_way.items()
        if way.startswith(DEFAULT) and way != DEFAULT
    ]
    caption = "Hsiao's system as printed with single changes, and the house's: mean error, that of the nearer side, MMTA at 100 mm."
    return Report((Table("why-hsiao", caption, rows),), {"why-hsiao": _draw(by_way)}, tuple(claims))


def _nearer_side(cells: Sequence[Cell]) -> float:
    """Mean error of the frames with a fit, mm, where left and right of each are exchanged if that is nearer."""
    errors = []
    for one in cells:
        estimate, truth = estimates(one)
        both = np.array([landmark_errors(points, truth).mean(axis=1) for points in (estimate, exchange_sides(estimate))])
        errors.append(1000 * both.min(axis=0))
    known = np.concatenate(errors)
    known = known[np.isfinite(known)]
    return float(known.mean()) if len(known) else np.nan


def _draw(by_way: dict[str, list[Cell]]) -> plt.Figure:
    """Mean error of every change, and that of the nearer side."""
    figure, axes = plt.subplots(figsize=(7, 3.4))
    places = np.arange(len(by_way))
    means = [score_interval(own, "mean_mm").value for own in by_way.values()]
    axes.barh(places - 0.2, means, 0.4, color=COLORS["sparse"], label="mean error")
    axes.barh(
        places + 0.2, [_nearer_side(own) for own in by_way.values()], 0.4, color=COLORS["person"], label="left and right as is nearer"
    )
    axes.set_yticks(places, list(by_way))
    axes.invert_yaxis()
    axes.set_xlabel("mm")
    axes.legend()
    return figure


EXPERIMENT = Experiment("why-hsiao", "why Hsiao's printed system is lost", "ours", grid, cell, report)
