"""How far fitted bodies' lengths are off the true bones, and how well each fit says that it knows them.

    hmc pose r1 --out out-r1 --height auto --cues silhouettes --frames 90
    python docs/known_lengths.py out-r1=r1 out-box=box

One person a recording. Deviations of an account that is right are as large as what lengths are off, and the last column is near 1. What
every body has wrong the same way, as joints that another renderer places elsewhere, is in it.
"""

from __future__ import annotations

import argparse
import tomllib
from pathlib import Path

import numpy as np

from hmc.body.proportions import ASYMMETRIES
from hmc.experiments.body_bias import true_lengths
from hmc.io.results import read_joints


def main() -> None:
    """Print a row for each dimension."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("results", nargs="+", metavar="RESULT=RECORDING")
    args = parser.parse_args()
    off: dict[str, list[tuple[float, float]]] = {}
    for pair in args.results:
        result, recording = (Path(part) for part in pair.split("="))
        person, known = next(iter(tomllib.loads((result / "run.toml").read_text())["bodies"]["known_to_percent"].items()))
        with np.load(result / "pose.npz") as stored:
            own = {name: float(stored[f"body/{person}/{name}"]) for name in known}
        for name, value in true_lengths(read_joints(recording / "truth" / "joints.csv").positions).items():
            error = own[name] - value if name in ASYMMETRIES else np.log(own[name] / value)
            off.setdefault(name, []).append((100 * error, known[name]))
    print("| dimension | off, %, root mean square | mean | known to, % | off over known |\n| --- | --- | --- | --- | --- |")
    for name, rows in off.items():
        error, deviation = np.array(rows).T
        said = np.sqrt(np.mean(error**2)), error.mean(), deviation.mean(), np.sqrt(np.mean((error / deviation) ** 2))
        print(f"| {name} | {said[0]:.1f} | {said[1]:+.1f} | {said[2]:.1f} | {said[3]:.2f} |")


if __name__ == "__main__":
    main()
