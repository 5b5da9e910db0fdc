"""Train the network that tells people from shadows: ``python -m hmc.voxels.train_shade RECORDING... --out FILE``.

Every recording needs frames of the empty scene and true silhouettes (``truth/silhouettes``), as rendered ones have.
"""

from __future__ import annotations

import argparse
import logging
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hmc.camera.reduction import reduce_mask
from hmc.camera.segmentation import SegmentationSettings, segment, shades_of, train_background
from hmc.camera.shade import FEATURES, FLOOR_UNKNOWN, ShadeNet, floor_pixels, person_chance
from hmc.errors import InputError
from hmc.io.files import atomic_write
from hmc.io.recording import Recording, background_frames, iterate_frames, open_recording, reduced
from hmc.io.true_silhouettes import true_frames, true_silhouettes

__all__ = ["main", "shade_examples", "train_shade", "write_net"]

logger = logging.getLogger("hmc")

#: Of each camera's image, shades that are learnt from, at most; frames of the empty scene; hidden units.
MOST_SHADES, EMPTY_FRAMES, HIDDEN = 1500, 60, 64
#: Images are learnt from as they were recorded, and so many times smaller, as runs read them (`hmc.camera.reduction`).
FACTORS = (1, 2)
#: Each pixel of a person counts as so many: a leg that is lost is lost, a shadow the other cameras may still take away.
PERSON_COUNTS = 3
#: Share of the examples of which the network is not told whether they look at the floor: it must do without where nobody knows.
NO_FLOOR = 0.2


def shade_examples(recording: Recording, rng: np.random.Generator, every: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Shades of a recording's images and whether they are people.

    Parameters
    ----------
    recording : Recording
    rng : numpy.random.Generator
    every : int
        Take every so manieth true silhouette.

    Returns
    -------
    features : ndarray of float32, shape (n, 23)
        `hmc.camera.shade.FEATURES`.
    is_person : ndarray of bool, shape (n,)

    Raises
    ------
    InputError
        When the recording has no true silhouettes.
    """
    frames = true_frames(recording)[::every]
    models = [
        train_background(
            background_frames(recording, c, EMPTY_FRAMES), floor=floor_pixels(camera, recording.room), factor=recording.factors[c]
        )
        for c, camera in enumerate(recording.rig)
    ]
    nobody = (None,) * len(recording.rig)
    features, people = [np.zeros((0, len(FEATURES)), np.float32)], [np.zeros(0, bool)]
    for frame in iterate_frames(recording, 0, frames[-1] + 1):
        if frame.index not in frames:
            continue
        for c, (image, true) in enumerate(zip(frame.images, true_silhouettes(recording, frame.index) or nobody, strict=True)):
            mask, models[c] = segment(models[c], image, SegmentationSettings(least_chance=0))
            if image is None or mask is None or true is None:
                continue
            pixels, found = shades_of(models[c], image)
            chosen = rng.choice(len(pixels), min(MOST_SHADES, len(pixels)), replace=False)
            features.append(found[chosen])
            people.append(reduce_mask(true, recording.factors[c]).ravel()[pixels[chosen]])
    return np.concatenate(features), np.concatenate(people)


def train_shade(features: np.ndarray, is_person: np.ndarray, seed: int = 0) -> ShadeNet:
    """The network of some examples.

    Parameters
    ----------
    features : ndarray, shape (n, 23)
    is_person : ndarray of bool, shape (n,)
    seed : int

    Raises
    ------
    InputError
        When there are too few examples, or of one kind only.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPClassifier

    if min(np.count_nonzero(is_person), np.count_nonzero(~is_person)) < 100:
        raise InputError("too few shades to learn from: a hundred of people and a hundred of shadows at least")
    rng = np.random.default_rng(seed)
    features = features.copy()
    features[rng.random(len(features)) < NO_FLOOR, FEATURES.index("floor")] = FLOOR_UNKNOWN
    again = np.concatenate([np.arange(len(features)), *[np.flatnonzero(is_person)] * (PERSON_COUNTS - 1)])
    features, is_person = features[again], np.asarray(is_person)[again]
    middle, spread = features.mean(axis=0), np.maximum(features.std(axis=0), 1e-6)
    net = MLPClassifier(
        (HIDDEN,), activation="relu", alpha=1e-2, batch_size=1024, max_iter=60, early_stopping=True, tol=1e-5, random_state=seed
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # so many rounds are enough
        net.fit((features - middle) / spread, is_person)
    (inner, outer), (inner_bias, outer_bias) = net.coefs_, net.intercepts_
    return ShadeNet(middle, spread, inner, inner_bias, outer[:, 0], float(outer_bias[0]))


def write_net(path: str | Path, net: ShadeNet, notes: Sequence[str] = ()) -> None:
    """Write a network as CSV (`hmc.camera.shade.read_net`), with notes before it."""
    table = [(name, net.middle[k], net.spread[k], *net.inner[k]) for k, name in enumerate(FEATURES)]
    table += [("inner_bias", 0, 0, *net.inner_bias), ("outer", net.outer_bias, 0, *net.outer)]
    lines = [f"# {note}" for note in notes] + [",".join([row[0], *(f"{value:.6g}" for value in row[1:])]) for row in table]
    with atomic_write(path) as file:
        file.write("\n".join(lines) + "\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; 0, or 2 where the input is wrong."""
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    parser = argparse.ArgumentParser(prog="python -m hmc.voxels.train_shade", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("recordings", nargs="+", type=Path, metavar="RECORDING", help="with truth/silhouettes")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="the network, as CSV")
    parser.add_argument("--most", type=int, default=20000, metavar="N", help="examples of each recording, a size (default: 20000)")
    parser.add_argument("--frames", type=int, default=12, metavar="N", help="true silhouettes of each camera, at most (default: 12)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="(default: 0)")
    args = parser.parse_args(argv)
    try:
        rng = np.random.default_rng(args.seed)
        examples = []
        for path in args.recordings:
            recording = open_recording(path)
            every = max(1, len(true_frames(recording)) // args.frames)
            for factor in FACTORS:
                features, people = shade_examples(reduced(recording, [factor] * len(recording.rig)), rng, every)
                chosen = rng.choice(len(people), min(args.most, len(people)), replace=False)
                examples.append((features[chosen], people[chosen]))
                logger.info("%s: 1 / %d: %d shades, %.1f%% of them people", path.name, factor, len(people), 100 * people.mean())
        features, people = (np.concatenate(column) for column in zip(*examples, strict=True))
        net = train_shade(features, people, args.seed)
        right = (person_chance(net, features) > PERSON_COUNTS / (PERSON_COUNTS + 1)) == people
        notes = (
            f"trained on {', '.join(path.name for path in args.recordings)}",
            f"{np.count_nonzero(people)} pixels of people and {np.count_nonzero(~people)} of shadows",
            f"{100 * right.mean():.1f}% of these are told right",
        )
        write_net(args.out, net, notes)
    except InputError as error:
        logger.error("error: %s", error)
        return 2
    logger.info("%s\n%s\n%s\nin %s", *notes, args.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
