"""The house from its imports: who imports whom, and the way of a frame from the disk to `joints.csv`.

    python docs/draw_house.py            # writes docs/images/house.png

Boxes are the rooms of `hmc/`, as tests/house/test_architecture.py names them, with their code lines. Grey arrows go from a room to those
that import from it, without arrows that a longer way says already; of the command line, which imports most rooms, only the registry's.
Of a blue arrow, what is handed over must be imported there under that name: a way that the code does not have cannot be drawn.
"""

from __future__ import annotations

import argparse
import ast
from collections import defaultdict
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from house_figures import code_lines

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "hmc"
#: The way of a frame: from, to, what is handed over (a name that the second imports from the first), and which way the arrow bends.
FLOW = (
    ("io", "voxels", "Frame", 0.0),
    ("voxels", "tracking", "HullStep", 0.0),
    ("voxels", "pose.views", "HullStep", 0.0),
    ("tracking", "pose.views", "person_voxels", 0.0),
    ("pose.views", "pose.person", "PersonView", 0.0),
    ("pose.person", "pose.follow", "DecidedFrames", 0.0),
    ("pose.follow", "pose.chain", "follow", -0.35),
    ("pose.chain", "cli", "finished_poses", 0.0),
)
#: Where boxes stand: columns from left to right as a frame goes, rows from above.
PLACES = {
    "camera": (0, 2), "io": (0, 1), "processes": (0, 3),
    "search": (1, 3), "body": (1, 2), "voxels": (1, 1),
    "pose.spectral": (2, 3), "pose.objectives": (2, 2), "pose.views": (2, 1), "tracking": (2, 0),
    "pose.steps": (3, 3), "pose.method": (3, 2), "pose.person": (3, 1), "pose.finished": (3, 0),
    "pose.starts": (4, 3), "pose.legs": (4, 2), "pose.follow": (4, 1), "pose.records": (4, 0),
    "pose.recovery": (5, 3), "pose.methods": (5, 2), "pose.clear_views": (5, 1),
    "pose.part_colors": (3, 4), "pose.turned": (4, 4), "pose.anew": (5, 4), "pose.back_settings": (6, 4),
    "pose.registry": (6, 2), "pose.second_pass": (6, 3), "pose.trust": (6, 1),
    "pose.occluders": (5, 0), "pose.contacts": (6, 0), "pose.head_colors": (7, 3), "pose.limb_colors": (7, 2), "pose.backward": (7, 1),
    "pose.keypoint_tracks": (2, -1), "pose.keypoint_sides": (3, -1), "pose.keypoint_cues": (4, -1), "pose.keypoint_views": (5, -1),
    "pose.turned_by_silhouettes": (6, -1), "pose.turned_by_keypoints": (7, -1), "pose.turned_back": (7, 0),
    "pose.chain": (8, 1), "cli": (9, 1),
}  # fmt: skip
#: Rooms around the way of a frame, which may use all that they need of it: no arrows.
AROUND = ("check", "synthetic", "metrics", "view", "motion", "api", "session", "trials", "experiments")
#: Of everybody's use, or too small for a box.
LEFT_OUT = {"errors", "landmarks", "plugins", "callable_package", "citations", "__init__", "__main__", "pose.__init__", "pose.trust_model"}
WIDTH, HEIGHT, COLUMN, ROW = 2.2, 0.72, 3.05, 1.0
AROUND_ROW = 5.15
INK, GREY, BLUE, FILL = "#1c2430", "#b9c2cf", "#1f5fbf", "#f2f5f9"


def part_of(names: tuple[str, ...]) -> str:
    """The room of a module."""
    return ".".join(names[:2]) if names[0] == "pose" else names[0]


def read_house() -> tuple[dict[str, int], dict[tuple[str, str], set[str]]]:
    """Code lines of each room, and the names that one imports from another."""
    sizes: dict[str, int] = defaultdict(int)
    imports: dict[tuple[str, str], set[str]] = defaultdict(set)
    for path in PACKAGE.rglob("*.py"):
        text, here = path.read_text(encoding="utf-8"), part_of(path.relative_to(PACKAGE).with_suffix("").parts)
        sizes[here] += code_lines(text)
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("hmc."):
                there = part_of(tuple(node.module.split(".")[1:]))
                if there != here:
                    imports[there, here] |= {alias.name for alias in node.names}
    return dict(sizes), dict(imports)


def reduced(edges: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """The arrows that no longer way says already; of an acyclic graph."""
    after = defaultdict(set)
    for one, other in edges:
        after[one].add(other)

    def reaches(one: str, other: str) -> bool:
        return other in after[one] or any(reaches(middle, other) for middle in after[one])

    return {(one, other) for one, other in edges if not any(reaches(middle, other) for middle in after[one] if middle not in (one, other))}


def middle_of(name: str) -> tuple[float, float]:
    """Of a box."""
    column, row = (AROUND.index(name), AROUND_ROW) if name in AROUND else PLACES[name]
    return column * COLUMN, -row * ROW * 1.35


def draw(out: Path) -> None:
    """Draw the house."""
    sizes, imports = read_house()
    placed = {*PLACES, *AROUND}
    if wrong := placed ^ (set(sizes) - LEFT_OUT):
        raise SystemExit(f"PLACES and AROUND do not fit the house: {sorted(wrong)}")
    for one, other, name, _ in FLOW:
        if name not in imports.get((one, other), ()):
            raise SystemExit(f"hmc.{other} does not import {name} from hmc.{one}")
    figure, axes = plt.subplots(figsize=(20, 8.4))
    known = {edge for edge in imports if set(edge) <= set(PLACES) and edge[1] != "cli"} | {("pose.registry", "cli")}
    for one, other in sorted(reduced(known) - {flow[:2] for flow in FLOW}):
        arrow(axes, one, other, GREY, 1.0, 0.12)
    for one, other, name, bend in FLOW:
        arrow(axes, one, other, BLUE, 2.4, bend, name)
    for name in placed:
        x, y = middle_of(name)
        box = plt.Rectangle((x - WIDTH / 2, y - HEIGHT / 2), WIDTH, HEIGHT, facecolor=FILL, edgecolor=INK, linewidth=1.1, zorder=3)
        axes.add_patch(box)
        axes.text(x, y + 0.11, name, ha="center", va="center", fontsize=min(10, 125 / len(name)), color=INK, zorder=4, weight="bold")
        axes.text(x, y - 0.18, f"{sizes[name]:,} lines", ha="center", va="center", fontsize=8.5, color="#566072", zorder=4)
    x, y = middle_of("io")
    axes.annotate(
        "videos", (x - WIDTH / 2, y), (x - WIDTH / 2 - 0.85, y), ha="center", va="center", arrowprops=_line(BLUE, 2.4), color=BLUE
    )
    axes.set(
        xlim=(-2.3, max(len(AROUND) - 1, *(column for column, _ in PLACES.values())) * COLUMN + 1.4),
        ylim=(-AROUND_ROW * ROW * 1.35 - 0.5, ROW * 1.35 + 0.5),
    )
    axes.text(*_below("cli"), "joints.csv, tracks.csv, pose.npz", ha="center", va="top", fontsize=9, color=BLUE, zorder=5)
    axes.axhline(-(AROUND_ROW - 0.55) * ROW * 1.35, color=GREY, linewidth=0.8, linestyle=":")
    axes.text(-2.2, -(AROUND_ROW - 0.55) * ROW * 1.35 - 0.06, "around it", va="top", fontsize=9, color="#566072")
    axes.axis("off")
    figure.savefig(out, dpi=110, bbox_inches="tight", metadata={"Software": None})


def _below(name: str) -> tuple[float, float]:
    x, y = middle_of(name)
    return x, y - HEIGHT / 2 - 0.04


def _line(color: str, width: float) -> dict:
    return {"arrowstyle": "-|>", "color": color, "linewidth": width, "shrinkA": 1, "shrinkB": 2}


def arrow(axes: plt.Axes, one: str, other: str, color: str, width: float, bend: float, label: str = "") -> None:
    """From the edge of a box to that of another."""
    (x0, y0), (x1, y1) = middle_of(one), middle_of(other)
    if abs(x1 - x0) < 0.1:
        side = 1 if y1 < y0 else -1
        start, end = (x0, y0 - side * HEIGHT / 2), (x1, y1 + side * HEIGHT / 2)
    else:
        side = 1 if x1 > x0 else -1
        start, end = (x0 + side * WIDTH / 2, y0), (x1 - side * WIDTH / 2, y1)
    style = _line(color, width) | {"connectionstyle": f"arc3,rad={bend}"}
    axes.annotate("", end, start, arrowprops=style, zorder=2 if label else 1)
    if label:
        x, y = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
        upright = abs(x1 - x0) < 0.1
        level = abs(y1 - y0) < 0.1  # between two boxes there is less room than a name takes: above them
        shift = (0.08, 0.0) if upright else (0.0, HEIGHT / 2 + 0.03 if level else 0.1)
        axes.text(x + shift[0], y + shift[1], label, ha="left" if upright else "center", va="bottom", fontsize=8.5, color=BLUE, zorder=5)


def main() -> None:
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images" / "house.png")
    draw(parser.parse_args().out)


if __name__ == "__main__":
    main()
