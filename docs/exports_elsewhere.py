"""Every format that `hmc export` writes, opened by somebody else's reader, and how far its landmarks are from those of joints.csv.

python docs/exports_elsewhere.py RESULT

Needs the packages of the extra `biomech`, and pybvh, pygltflib and opensim where they are to be tried (pip install
pybvh pygltflib opensim); what is not installed is passed over and said.
"""

import argparse
import csv
import importlib.util
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from hmc.motion.export import export_trajectories
from hmc.motion.trajectory import Trajectory, read_trajectories

# Readers return (n_frames, k, 3) of k names in metres, z up: what each file says of its axes is undone here once more, by hand.


def from_y_up(points: np.ndarray) -> np.ndarray:
    """x forward, y up, z to the right, as OpenSim's."""
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack([x, -z, y], axis=-1)


def from_z_forward(points: np.ndarray) -> np.ndarray:
    """x to the left, y up, z forward, as glTF's."""
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack([z, x, y], axis=-1)


def trc_opensim(path: Path, names: Sequence[str]) -> np.ndarray:
    """By OpenSim's own reader of TRC."""
    import opensim

    opensim.Logger.setLevelString("off")
    table = opensim.TimeSeriesTableVec3(str(path))
    columns = [table.getDependentColumn(name) for name in names]
    points = [[[column[row][axis] for axis in range(3)] for column in columns] for row in range(table.getNumRows())]
    return from_y_up(np.array(points) / 1000)


def trc_pandas(path: Path, names: Sequence[str]) -> np.ndarray:
    """By pandas, as the format's documentation has the columns."""
    import pandas as pd

    table = pd.read_csv(path, sep="\t", skiprows=6, header=None)
    header = path.read_text().splitlines()[3].split("\t")
    columns = [header.index(name) + axis for name in names for axis in range(3)]
    return from_y_up(table.to_numpy(float)[:, columns].reshape(len(table), -1, 3) / 1000)


def c3d_ezc3d(path: Path, names: Sequence[str]) -> np.ndarray:
    """By ezc3d."""
    import ezc3d

    file = ezc3d.c3d(str(path))
    points = file["data"]["points"][:3].transpose(2, 1, 0) / 1000
    points[file["data"]["meta_points"]["residuals"][0].T < 0] = np.nan
    return points[:, [file["parameters"]["POINT"]["LABELS"]["value"].index(name) for name in names]]


def bvh_pybvh(path: Path, names: Sequence[str]) -> np.ndarray:
    """By pybvh, with its forward kinematics."""
    import pybvh

    motion = pybvh.read_bvh_file(str(path))
    points = motion.node_positions(centered="world") / 100
    return from_z_forward(points[:, [motion.node_index[name] for name in names]])


def glb_pygltflib(path: Path, names: Sequence[str]) -> np.ndarray:
    """Content by pygltflib; nodes placed as the glTF specification says, with SciPy's rotations."""
    import pygltflib
    from scipy.spatial.transform import Rotation

    file = pygltflib.GLTF2().load(str(path))
    blob = file.binary_blob()

    def values(number):
        accessor = file.accessors[number]
        view = file.bufferViews[accessor.bufferView]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor.type]
        start = view.byteOffset + (accessor.byteOffset or 0)
        return np.frombuffer(blob, "<f4", accessor.count * width, start).reshape(accessor.count, width)

    animation = file.animations[0]
    moved = {(one.target.node, one.target.path): values(animation.samplers[one.sampler].output) for one in animation.channels}
    n = len(next(iter(moved.values())))
    places: dict[str, np.ndarray] = {}

    def place(number, turn, position):
        node = file.nodes[number]
        shift = moved.get((number, "translation"), np.tile(node.translation or [0.0, 0.0, 0.0], (n, 1)))
        position = position + turn.apply(shift)
        if (number, "rotation") in moved:
            turn = turn * Rotation.from_quat(moved[number, "rotation"])
        places[node.name.split(":")[-1]] = position
        for child in node.children or []:
            place(child, turn, position)

    place(file.scenes[0].nodes[0], Rotation.identity(n), np.zeros((n, 3)))
    return from_z_forward(np.stack([places[name] for name in names], axis=1))


def mot_opensim(path: Path, names: Sequence[str]) -> np.ndarray:
    """The model moved by the motion in OpenSim, and where its markers are."""
    import opensim

    opensim.Logger.setLevelString("off")
    model = opensim.Model(str(path.with_suffix(".osim")))
    state = model.initSystem()
    table = opensim.TimeSeriesTable(str(path))
    coordinates = [model.getCoordinateSet().get(label) for label in table.getColumnLabels()]
    degrees = table.getTableMetaDataAsString("inDegrees") == "yes"
    out = np.empty((table.getNumRows(), len(names), 3))
    for k in range(len(out)):
        row = table.getRowAtIndex(k)
        for column, coordinate in enumerate(coordinates):
            turns = coordinate.getMotionType() == opensim.Coordinate.Rotational
            coordinate.setValue(state, np.radians(row[column]) if degrees and turns else row[column], False)
        model.realizePosition(state)
        markers = model.getMarkerSet()
        out[k] = [[markers.get(name).getLocationInGround(state)[axis] for axis in range(3)] for name in names]
    return from_y_up(out)


def csv_python(path: Path, names: Sequence[str]) -> np.ndarray:
    """By Python's own reader of CSV."""
    with path.open(newline="") as file:
        rows = [[float(row[f"{name}_{axis}_m"] or "nan") for name in names for axis in "xyz"] for row in csv.DictReader(file)]
    return np.array(rows).reshape(len(rows), -1, 3)


def parquet_pandas(path: Path, names: Sequence[str]) -> np.ndarray:
    """By pandas."""
    import pandas as pd

    table = pd.read_parquet(path)
    return table[[f"{name}_{axis}_m" for name in names for axis in "xyz"]].to_numpy(float).reshape(len(table), -1, 3)


#: Of each format, readers by the package that they need.
READERS: tuple[tuple[str, str, Callable[[Path, Sequence[str]], np.ndarray]], ...] = (
    ("trc", "opensim", trc_opensim),
    ("trc", "pandas", trc_pandas),
    ("c3d", "ezc3d", c3d_ezc3d),
    ("bvh", "pybvh", bvh_pybvh),
    ("glb", "pygltflib", glb_pygltflib),
    ("mot", "opensim", mot_opensim),
    ("csv", "csv", csv_python),
    ("parquet", "pyarrow", parquet_pandas),
)


def largest_difference_m(found: np.ndarray, one: Trajectory) -> float:
    """Largest distance of a known point, landmarks and feet, from where the file has it."""
    _, positions = one.points
    known = np.isfinite(positions).all(axis=-1)
    return float(np.linalg.norm(found - positions, axis=-1)[known].max())


def main() -> None:
    """Write, read, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("result", type=Path)
    for one in read_trajectories(parser.parse_args().result):
        print(f"person {one.person}, {len(one.frames)} frames, {len(one.points[0])} points")
        with tempfile.TemporaryDirectory() as folder:
            for kind, package, read in READERS:
                if importlib.util.find_spec(package) is None:
                    print(f"| {kind} | {package} | not installed |")
                    continue
                file = Path(folder) / f"motion.{kind}"
                export_trajectories([one], file)
                print(f"| {kind} | {package} | {1000 * largest_difference_m(read(file, one.points[0]), one):.4f} mm |")


if __name__ == "__main__":
    main()
