"""Recordings from which the person tree that comes with the package was trained: ``python -m hmc.experiments.person_data FOLDER``.

Every recipe ``train_*`` is rendered as it is, and some once more with other cameras, other statures and all of their furniture brought in
after the empty room was filmed. Where furniture was brought in, tables and chairs are foreground, and no people. Afterwards:
``python -m hmc.tracking.train_person_tree FOLDER/* --out hmc/tracking/person_tree.csv``.
"""

from __future__ import annotations

import argparse
import logging
import os
import shutil
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from hmc.errors import InputError
from hmc.synthetic.recipe import Recipe, load_recipe, shipped_recipes
from hmc.synthetic.render import render_recording

__all__ = ["main", "other_scene", "render_brought_in", "training_recipes"]

logger = logging.getLogger("hmc")

#: Recipes whose furniture is brought in as it is.
BROUGHT_IN = ("train_brought_in", "train_moved_tables", "train_floor_work")
#: Recipes that are rendered once more.
TWICE = ("train_arms", "train_brought_in", "train_close", "train_crowd", "train_low", "train_pushed")
#: The rig of the second scene, by that of the first.
OTHER_RIG = {"corners4_overhead": "ring7", "ring7": "corners4_overhead", "corners4": "ring7_overhead", "ring7_overhead": "corners4"}
#: Statures of the second scene, as a share of the first's.
OTHER_STATURE = (1.08, 0.92, 0.97)


def training_recipes() -> list[tuple[Recipe, bool]]:
    """What to render, and whether the furniture was brought in after the empty room was filmed."""
    recipes = [load_recipe(name) for name in shipped_recipes() if name.startswith("train_")]
    return [(recipe, recipe.name in BROUGHT_IN) for recipe in recipes] + [
        (other_scene(recipe), True) for recipe in recipes if recipe.name in TWICE
    ]


def other_scene(recipe: Recipe) -> Recipe:
    """The same motions with other cameras, people of other statures, and other irregularities of room and camera; shorter."""
    actors = tuple(
        replace(actor, height_m=min(actor.height_m * factor, 2.0), pattern="stripes" if actor.pattern == "plain" else "plain")
        for actor, factor in zip(recipe.actors, OTHER_STATURE, strict=False)
    )
    rig = replace(recipe.rig, kind=OTHER_RIG[recipe.rig.kind], distorted=not recipe.rig.distorted)
    return replace(recipe, name=f"{recipe.name}_other", seed=recipe.seed + 1000, seconds=5.0, actors=actors, rig=rig)


def render_brought_in(recipe: Recipe, out: Path, workers: int = 1) -> Path:
    """Render a recipe whose empty room was filmed without the furniture.

    Parameters
    ----------
    recipe : Recipe
    out : Path
        Folder of the recording, as for `hmc.synthetic.render.render_recording`.
    workers : int

    Returns
    -------
    Path
        `out`.

    Raises
    ------
    InputError
        As `render_recording`.
    """
    empty = out.with_name(f".{out.name}.empty")
    try:
        render_recording(replace(recipe, furniture=(), seconds=0.0), empty, workers=workers)
        render_recording(replace(recipe, background_frames=1), out, workers=workers)
        shutil.rmtree(out / "background")
        shutil.move(empty / "background", out / "background")
    finally:
        shutil.rmtree(empty, ignore_errors=True)
    return out


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; 0, or 2 where the input is wrong."""
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    parser = argparse.ArgumentParser(prog="python -m hmc.experiments.person_data", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="where the recordings go; those that are there are kept")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, metavar="N", help="processes (default: one a core)")
    args = parser.parse_args(argv)
    try:
        if args.folder.is_file():
            raise InputError(f"{args.folder}: is a file; give a folder")
        if args.workers < 1:
            raise InputError(f"--workers {args.workers}: must be 1 or more")
        for recipe, brought_in in training_recipes():
            out = args.folder / recipe.name
            if (out / "recording.toml").is_file():
                continue
            logger.info("rendering %s", recipe.name)
            if brought_in:
                render_brought_in(recipe, out, args.workers)
            else:
                render_recording(recipe, out, workers=args.workers)
    except InputError as error:
        logger.error("error: %s", error)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
