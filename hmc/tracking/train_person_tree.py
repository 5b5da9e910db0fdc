"""Train the person tree: ``python -m hmc.tracking.train_person_tree RECORDING... --out FILE``.

Every recording needs truth (``truth/centroids.csv``). The tree is used by its path: ``LifecycleSettings(person="FILE")``.
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hmc.errors import InputError
from hmc.io.recording import Recording, open_recording
from hmc.tracking.classifiers import detection_scores, fit_tree, frame_groups
from hmc.tracking.feature_table import FeatureTable, feature_table, join_tables
from hmc.tracking.person_tree import PersonTree, predict_person, write_tree
from hmc.voxels.hulls import FrontendSettings

__all__ = ["main", "person_examples", "train_person_tree"]

logger = logging.getLogger("hmc")


def person_examples(
    recordings: Sequence[Recording], voxel_size_m: float = 0.05, frontend: FrontendSettings | None = None, every: int = 1
) -> FeatureTable:
    """Components of the tolerant and of the strict hulls of recordings with truth.

    Both, because a tracker judges both: whole components, and the parts into which the strict hull takes a crowd apart.

    Parameters
    ----------
    recordings : sequence of Recording
    voxel_size_m : float
    frontend : FrontendSettings, optional
    every : int
        Take every so manieth frame.

    Returns
    -------
    FeatureTable
        With the number of the recording in `recordings`.

    Raises
    ------
    InputError
        When there is no recording, or one has no truth.
    """
    tables = []
    for recording in recordings:
        logger.info("%s", recording.name)
        tables.append(feature_table(recording, voxel_size_m, frontend, hulls=("tolerant", "strict"), every=every))
    return join_tables(tables)


def train_person_tree(table: FeatureTable, rng: np.random.Generator) -> PersonTree:
    """The pruned tree (`hmc.tracking.classifiers.fit_tree`) of a table of examples.

    Raises
    ------
    InputError
        When there are too few examples.
    """
    return fit_tree(table.features, table.is_person, frame_groups(table.frames, table.recordings), rng)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; 0, or 2 where the input is wrong."""
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    parser = argparse.ArgumentParser(prog="python -m hmc.tracking.train_person_tree", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("recordings", nargs="+", type=Path, metavar="RECORDING", help="with truth/centroids.csv")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="the tree, as CSV")
    parser.add_argument("--voxel", type=float, default=0.05, metavar="M", help="side of a voxel, metres (default: 0.05)")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="take every Nth frame (default: all)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="for ties between questions (default: 0)")
    args = parser.parse_args(argv)
    try:
        if args.seed < 0:
            raise InputError(f"--seed {args.seed}: must be 0 or more")
        recordings = [open_recording(path) for path in args.recordings]
        table = person_examples(recordings, args.voxel, every=args.every)
        tree = train_person_tree(table, np.random.default_rng(args.seed))
        scores = detection_scores(table.is_person, predict_person(tree, table.features))
        notes = (
            f"trained on {', '.join(recording.name for recording in recordings)}",
            f"{np.count_nonzero(table.is_person)} components with people and {np.count_nonzero(~table.is_person)} without; "
            f"voxels of {args.voxel:g} m",
            f"on these, precision {scores.precision:.3f}, recall {scores.recall:.3f}, F {scores.f_measure:.3f}",
        )
        write_tree(args.out, tree, notes)
    except InputError as error:
        logger.error("error: %s", error)
        return 2
    logger.info("%s\n%s\n%s\n%d nodes in %s", *notes, len(tree), args.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
