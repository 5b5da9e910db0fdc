"""The scalable methods by name: what they add to a preset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from hmc.body.scalable_models import Inclusive, Unitive
from hmc.errors import InputError
from hmc.pose.methods.model_file import read_hierarchy
from hmc.pose.steps.presets import PosePreset

__all__ = ["SCALABLE_METHODS", "method_preset"]

SCALABLE_METHODS = ("shbm-apf", "ddm-apf", "shbm-ddm-apf")


def method_preset(preset: PosePreset, method: str, models: Sequence[str] = ()) -> PosePreset:
    """A preset with a method's scalable models.

    Parameters
    ----------
    preset : PosePreset
    method : {"apf", "shbm-apf", "ddm-apf", "shbm-ddm-apf"}
    models : sequence of str
        "1" (the default) and "2" of the preset's `hierarchies`, "auto" (in every frame the one that suits the last pose), or files of
        hierarchies (`read_hierarchy`): at most one inclusive one, for structural annealing, and one unitive one, for missing limbs.

    Raises
    ------
    InputError
        When the method has no use for a model, or two stand for the same.
    """
    shipped = {"1": preset.hierarchies[:1], "2": preset.hierarchies[1:], "auto": preset.hierarchies}
    structural: tuple[Inclusive, ...] | None = None
    tree: Unitive | None = None
    for text in models:
        found = shipped[text] if text in shipped else read_hierarchy(text)
        unitive = isinstance(found, Unitive)
        if method not in SCALABLE_METHODS or (unitive and "ddm" not in method) or (not unitive and "shbm" not in method):
            what = "unitive" if unitive else "inclusive"
            uses = [name for name in SCALABLE_METHODS if ("ddm" if unitive else "shbm") in name]
            raise InputError(f"--model {text}: method {method} has no use for an {what} model; {' and '.join(uses)} have")
        if (unitive and tree is not None) or (not unitive and structural is not None):
            raise InputError(f"--model {text}: there is another model of its kind already; give one")
        if isinstance(found, Unitive):
            tree = found
        else:
            structural = (found,) if isinstance(found, Inclusive) else found
    if method in SCALABLE_METHODS:
        preset = replace(preset, sparing=None)  # of one body: its refinement knows neither a hierarchy nor which limbs are missing
    if "shbm" in method:
        preset = replace(preset, models=structural or shipped["1"])
    if "ddm" in method:
        limbs = preset.hidden_limbs
        preset = replace(preset, limbs=limbs if tree is None else replace(limbs, tree=tree))
    return preset
