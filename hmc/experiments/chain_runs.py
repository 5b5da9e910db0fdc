"""The whole chain as `hmc pose` runs it, from videos to the poses of everybody, or without one of its parts: one cell, one recording.

Nothing differs from ``hmc pose RECORDING --height auto --cues silhouettes --seed REPEAT --frames FRAMES``: the same seed gives the same
joints. What cells share is made once and kept beside them: silhouettes of a recording, tracks of each seed, and the first pass of all that
leave out something of the second one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from hmc.body.dimensions import FitBodySettings
from hmc.errors import InputError
from hmc.experiments.engine.experiment import Cell, Parameters, Results, Source
from hmc.experiments.engine.inputs import Inputs, once, recipe_of
from hmc.experiments.markerless_runs import TRACK_VOXEL_M, VOXEL_M, opened
from hmc.experiments.truth import all_truth, truth_path
from hmc.io.masks import keep_masks
from hmc.io.provenance import code_digest
from hmc.io.recording import Recording, for_voxels, open_recording
from hmc.io.results import PoseTable, TrackTable, read_centroids
from hmc.metrics.scores import evaluate_pose, evaluate_tracks
from hmc.pose.backward import backward
from hmc.pose.follow import FollowOptions, PosedPeople, follow
from hmc.pose.method import PoseMethod
from hmc.pose.methods.annealed import annealed_method
from hmc.pose.steps.presets import PRESETS
from hmc.pose.turned_back import turned_back
from hmc.synthetic.rigs import RIGS
from hmc.tracking.resumable import track_recording
from hmc.voxels.hulls import FrontendSettings, stream_masks
from hmc.voxels.run_options import RunOptions

__all__ = [
    "FAMILY", "FEW", "MANY", "PARTS", "VERSION", "WHOLE", "FollowedPeople", "Part", "as_read", "cell", "chain_options", "followed",
    "method_without", "name_of", "one_before_many", "scored_poses", "truth_in",
]  # fmt: skip

FAMILY, VERSION = "chain", 1
WHOLE = ""
#: Cameras that are left of many, and how many are many.
FEW, MANY = 4, 7
#: Under which silhouettes, tracks and first passes are kept; what they depend on is in the names of their files.
_KEY = "chain"
#: To six decimals, as in ``joints.csv``, metres.
_DECIMALS = 6
#: A deviation by which nothing moves.
_HELD = 1e-6


@dataclass(frozen=True)
class Part:
    """What is left out of the chain, as changes of its settings.

    Parameters
    ----------
    frontend, preset, method : mapping of str to object
        Fields of `FrontendSettings`, of the preset ``default`` and of the method that is made of it.
    back : mapping of str to object, or None
        Fields of the second pass's `hmc.pose.back_settings.BackwardSettings`; None: there is no second pass.
    """

    frontend: Mapping[str, Any] = field(default_factory=dict)
    preset: Mapping[str, Any] = field(default_factory=dict)
    method: Mapping[str, Any] = field(default_factory=dict)
    back: Mapping[str, Any] | None = field(default_factory=dict)

    @property
    def changes_first(self) -> bool:
        """Whether the first pass is another."""
        return bool(self.frontend or self.preset or self.method)


PARTS: dict[str, Part] = {
    WHOLE: Part(),
    "second pass": Part(back=None),
    "own body of the whole run": Part(back={"fit_body": None}),
    "hips where each has them": Part(preset={"fit_body": FitBodySettings(place_deviation=_HELD)}),
    "shoulders as people's differ": Part(preset={"fit_body": FitBodySettings(shoulders_deviation=FitBodySettings().length_deviation)}),
    "limbs of unequal length": Part(back={"fit_body": FitBodySettings(asymmetry_deviation=_HELD)}),
    "what furniture hides": Part(back={"hidden_places": False}),
    "others' rays": Part(back={"own_rays": False}),
    "a trunk that bends": Part(preset={"body": "stiff"}),
    "recovery": Part(method={"recover": None}),
    "legs told apart": Part(method={"legs": None, "alternatives": None}),
    "particles where they are needed only": Part(preset={"sparing": None}),
    "limb search": Part(preset={"search": None}),
    "fresh starts for who is lost": Part(back={"anew": None}),
    "turning about who faces backwards": Part(back={"turned": None}),
    "colors of a person's parts": Part(back={"colors": None}),
    "feet that stand": Part(back={"standing_feet": False}),
    "smoothing": Part(back={"smooth_s": None}),
    "the floor as others see it": Part(frontend={"ask_floor": False}),
    "completion by other cameras": Part(frontend={"complete": False}),
    "cutting of shadows": Part(frontend={"cut_shadows": False}),
}


def method_without(part: Part) -> PoseMethod:
    """The method ``apf`` with a part left out."""
    method = replace(annealed_method(replace(PRESETS["default"], **part.preset)), **part.method)
    return replace(method, back=None if part.back is None else replace(method.back, **part.back))


def name_of(one: Cell) -> str:
    """The recording of a cell, without the digest."""
    return str(one.parameters["recording"]).rpartition("@")[0]


def one_before_many(source: Source) -> bool:
    """Whether a recording shows one person to `MANY` cameras or more, of which `FEW` can be taken; False where that cannot be told."""
    if source.folder is None:
        recipe = recipe_of(source.name)
        return len(recipe.actors) == 1 and sum(RIGS[recipe.rig.kind]) >= MANY
    try:
        recording = open_recording(source.folder)
        return len(recording.rig) >= MANY and len(np.unique(all_truth(recording).persons)) == 1
    except InputError:  # the cells with all cameras tell what is wrong
        return False


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Landmarks of every true person in every frame with a truth, and what was estimated for it, metres; NaN where nothing was.

    Parameters
    ----------
    parameters : mapping
        ``recording``, ``cameras`` (0: all), ``without`` (a key of `PARTS`), ``frames`` (0: all), ``repeat``, which is the seed.
    inputs : Inputs
    rng : numpy.random.Generator
        Not used: the chain draws by its seed.

    Returns
    -------
    dict
        ``frames`` and ``persons``, shape (n,); ``estimate_m`` and ``truth_m``, shape (n, 15, 3); ``fps``; ``cameras``, how many;
        ``reference``, whether the truth is another system's; ``tracks``, what CLEAR MOT counts, empty without true centroids.

    Raises
    ------
    InputError
        When the recording has no truth, or none in these frames.
    """
    some = opened(inputs, parameters["recording"], parameters["cameras"])
    recording = as_read(open_recording(some.path, some.rig.names, frames=parameters["frames"] or None))
    truth = truth_in(recording)
    people, counts = _run(parameters, inputs, recording)
    return scored_poses(recording, people.poses, truth) | {"tracks": counts}


def as_read(recording: Recording) -> Recording:
    """The recording with images no larger than the command reads them."""
    return for_voxels(recording, min(VOXEL_M, TRACK_VOXEL_M))


def truth_in(recording: Recording) -> PoseTable:
    """True joints of everybody in the recording's selection; `hmc.experiments.truth.truth_path` says what is refused."""
    truth = all_truth(recording)
    return truth.where((truth.frames >= recording.start) & (truth.frames < recording.start + recording.n_frames))


def scored_poses(recording: Recording, poses: PoseTable, truth: PoseTable) -> Results:
    """The results of a cell, but for its tracks: what `cell` returns.

    Raises
    ------
    InputError
        When the truth is empty.
    """
    persons = evaluate_pose(poses, truth).persons
    return {
        "frames": np.concatenate([one.frames for one in persons]),
        "persons": np.concatenate([np.full(len(one.frames), one.person) for one in persons]),
        "estimate_m": np.concatenate([one.estimate for one in persons]).round(_DECIMALS),
        "truth_m": np.concatenate([one.truth for one in persons]).round(_DECIMALS),
        "fps": recording.fps,
        "cameras": len(recording.rig),
        "reference": truth_path(recording).parent.name != "truth",
    }


@dataclass(frozen=True)
class FollowedPeople:
    """The tracks of a recording's people, and what cells that pose them share.

    Parameters
    ----------
    tracks : TrackTable
    run : RunOptions
        With the silhouettes.
    folder : Path
        For what else is made once.
    """

    tracks: TrackTable
    run: RunOptions
    folder: Path


def followed(parameters: Parameters, inputs: Inputs, recording: Recording, without: str = WHOLE) -> FollowedPeople:
    """Segment a recording and track its people, once for all cells of the same recording, cameras, frames and seed.

    Parameters
    ----------
    parameters : mapping
        ``recording``, ``cameras``, ``frames``, ``repeat``.
    inputs : Inputs
    recording : Recording
        Opened with these cameras and frames.
    without : str
        A key of `PARTS`.
    """
    part, seed = PARTS[without], parameters["repeat"]
    frontend = FrontendSettings(threads=1, **part.frontend)
    # Of other code nothing is taken over: what was kept and what is computed now belong together.
    chosen = f"{parameters['cameras']}-cameras-{parameters['frames']}-frames-{code_digest()[:8]}"
    folder = inputs.folder / parameters["recording"] / f"chain-{chosen}"

    def segment(file: Path) -> None:
        steps = stream_masks(recording, frontend, on_problem=_ignore)
        for _ in keep_masks(file, _KEY, recording.start, steps, _ignore):
            pass

    masks = once(folder / f"masks{_slug(without if part.frontend else WHOLE)}", segment)
    run = RunOptions(frontend, masks=masks, key=_KEY, on_problem=_ignore)

    def track(file: Path) -> TrackTable:
        return track_recording(recording, TRACK_VOXEL_M, seed=seed, run=replace(run, journal=file))

    return FollowedPeople(track(once(masks.with_name(f"{masks.name}-tracks-{seed}"), track)), run, folder)


def chain_options(parameters: Parameters) -> FollowOptions:
    """What the poses of a cell are computed with."""
    return FollowOptions(VOXEL_M, parameters["repeat"])


def _run(parameters: Parameters, inputs: Inputs, recording: Recording) -> tuple[PosedPeople, dict[str, int]]:
    """The poses of all people, and the errors of their tracks."""
    without, seed = parameters["without"], parameters["repeat"]
    method, options = method_without(PARTS[without]), chain_options(parameters)
    seen = followed(parameters, inputs, recording, without)
    tracks, run = seen.tracks, seen.run
    recording = turned_back(recording, tracks, run).recording

    def pose(own: Path) -> PosedPeople:
        own.mkdir(exist_ok=True)
        return follow(recording, tracks, method, options, replace(run, journal=own / "journal"))

    # The journal of a finished run holds all of it, to the last digit.
    people = pose(once(seen.folder / f"first-pass{_slug(without if PARTS[without].changes_first else WHOLE)}-{seed}", pose))
    people = backward(recording, tracks, method, people, options, run)
    path = recording.path / "truth" / "centroids.csv"
    if not path.is_file():
        return people, {}
    true = read_centroids(path)
    true = true.where((true.frames >= recording.start) & (true.frames < recording.start + recording.n_frames))
    mot = evaluate_tracks(tracks, true)
    return people, {name: int(getattr(mot, name)) for name in ("objects", "misses", "false_positives", "mismatches")}


def _slug(part: str) -> str:
    return "-without-" + part.replace(" ", "-").replace("'", "") if part else ""


def _ignore(line: str) -> None:
    """What was survived is told by `hmc pose`; here errors tell it."""
