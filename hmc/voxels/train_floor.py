"""Fit what the floor says of shades: ``python -m hmc.voxels.train_floor RECORDING...``.

The two numbers of the likelihood ratio (`hmc.voxels.floor_light`) by which the other cameras' sight of the floor outweighs a camera's own
guess. Every recording needs frames of the empty scene and true silhouettes (``truth/silhouettes``), as rendered ones have; the network that
guesses should not have learnt of it, as a guess is surer of what it has learnt.
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.optimize import minimize

from hmc.errors import InputError
from hmc.io.recording import Recording, open_recording
from hmc.io.true_silhouettes import true_frames, true_silhouettes
from hmc.voxels.completion import make_completion_tables
from hmc.voxels.floor_light import SPREAD, UNLIKE, FloorEvidence, floor_evidence, person_by_floor
from hmc.voxels.floor_shadows import lit_views
from hmc.voxels.frontend_settings import FrontendSettings
from hmc.voxels.looks import look_at

__all__ = ["FloorExamples", "fit_floor", "floor_examples", "floor_loss", "main"]

logger = logging.getLogger("hmc")

#: Pixels about a true outline, to either side, of which nothing is learnt: they are half of them something else.
OUTLINE_PX = 2
#: Shades of a recording that are learnt from, at most.
MOST_SHADES = 20000
#: The numbers as they are.
NOW = (SPREAD, UNLIKE)


@dataclass(frozen=True)
class FloorExamples:
    """Shades of one recording.

    Parameters
    ----------
    evidence : FloorEvidence
        Of all cameras and frames, one after the other.
    is_person : ndarray of bool, shape (n,)
    """

    evidence: FloorEvidence
    is_person: np.ndarray


def floor_examples(recording: Recording, rng: np.random.Generator, every: int = 1) -> FloorExamples:
    """Shades of a recording behind which some other camera sees the floor, and whether they are people.

    Parameters
    ----------
    recording : Recording
    rng : numpy.random.Generator
    every : int
        Take every so manieth true silhouette.

    Raises
    ------
    InputError
        When the recording has no true silhouettes, or no camera tells anything of the floor.
    """
    frames = true_frames(recording)[::every]
    tables = make_completion_tables(recording.room, recording.rig)
    rows: list[tuple[np.ndarray, ...]] = []
    with ThreadPoolExecutor() as pool:
        for look in look_at(recording, {}, range(len(recording.rig)), FrontendSettings(), 0, frames[-1] + 1, 1, pool):
            truth = true_silhouettes(recording, look.index) if look.index in frames else None
            if truth is None:
                continue
            views = lit_views(look.images, look.scenes, look.gains)
            for c, found in floor_evidence(tables, views, look.chances, look.masks).items():
                person, sure = _labels(truth[c], found.pixels)
                rows.append((found.pixels[sure], found.guess[sure], found.light[sure], found.others[sure], person[sure]))
    if not rows or not sum(len(row[0]) for row in rows):
        raise InputError(f"{recording.path}: no camera sees the floor behind another one's shades; nothing to learn from")
    columns = [np.concatenate(column) for column in zip(*rows, strict=True)]
    chosen = rng.choice(len(columns[0]), min(MOST_SHADES, len(columns[0])), replace=False)
    pixels, guess, light, others, person = (column[chosen] for column in columns)
    return FloorExamples(FloorEvidence(pixels, guess, light, others), person)


def _labels(true: np.ndarray, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether flat pixels are people, and whether that is sure, as they are not near an outline."""
    square = np.ones((2 * OUTLINE_PX + 1,) * 2, np.uint8)
    inside, around = cv2.erode(true.view(np.uint8), square), cv2.dilate(true.view(np.uint8), square)
    person = inside.ravel()[pixels] > 0
    return person, person | (around.ravel()[pixels] == 0)


def floor_loss(examples: Sequence[FloorExamples], numbers: Sequence[float] = NOW) -> float:
    """Mean logarithmic loss, nats a shade; each recording counts the same.

    Parameters
    ----------
    examples : sequence of FloorExamples
    numbers : sequence of float
        `hmc.voxels.floor_light.SPREAD` and `UNLIKE`.
    """
    losses = []
    for one in examples:
        chance = np.clip(person_by_floor(one.evidence, *numbers), 1e-9, 1 - 1e-7)
        losses.append(-np.mean(np.log(np.where(one.is_person, chance, 1 - chance))))
    return float(np.mean(losses))


def fit_floor(examples: Sequence[FloorExamples]) -> tuple[float, ...]:
    """The two numbers of the least loss."""
    options = {"xatol": 1e-2, "fatol": 1e-6}
    found = minimize(lambda logs: floor_loss(examples, np.exp(logs)), np.log(NOW), method="Nelder-Mead", options=options)
    return tuple(np.exp(found.x).tolist())


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; 0, or 2 where the input is wrong."""
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    parser = argparse.ArgumentParser(prog="python -m hmc.voxels.train_floor", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("recordings", nargs="+", type=Path, metavar="RECORDING", help="with truth/silhouettes")
    parser.add_argument("--frames", type=int, default=12, metavar="N", help="true silhouettes of each camera, at most (default: 12)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="(default: 0)")
    args = parser.parse_args(argv)
    try:
        rng, examples = np.random.default_rng(args.seed), []
        for path in args.recordings:
            recording = open_recording(path)
            examples.append(floor_examples(recording, rng, max(1, len(true_frames(recording)) // args.frames)))
            person = examples[-1].is_person
            logger.info("%s: %d shades, %.1f%% of them people", path.name, len(person), 100 * person.mean())
    except InputError as error:
        logger.error("error: %s", error)
        return 2
    logger.info("as it is: %s: loss %.4f", _named(NOW), floor_loss(examples))
    logger.info("fitted to all: %s: loss %.4f", _named(best := fit_floor(examples)), floor_loss(examples, best))
    for name, own, others in (("first", examples[::2], examples[1::2]), ("second", examples[1::2], examples[::2])):
        if own and others:
            best = fit_floor(own)
            told = floor_loss(others, best), floor_loss(others)
            logger.info("fitted to the %s half: %s: loss of the other half %.4f (as it is: %.4f)", name, _named(best), *told)
    return 0


def _named(numbers: Sequence[float]) -> str:
    return ", ".join(f"{name} {number:.3f}" for name, number in zip(("spread", "unlike"), numbers, strict=True))


if __name__ == "__main__":
    sys.exit(main())
