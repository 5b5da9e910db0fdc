"""The pose methods by name. A new method is one file and one line here; a stranger's is added with `register_method`.

Nothing heavy is imported until a method is made, so that the command line can list the names.

>>> sorted(METHODS)[:3]
['apf', 'ddm-apf', 'keypoints']
>>> pose_method("smd", preset="kehl2006").source
'Kehl and Van Gool (2006)'
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, cast, get_args

from hmc.errors import InputError
from hmc.io.nested_settings import SettingsTable, changed
from hmc.plugins import load_plugins

if TYPE_CHECKING:
    from hmc.pose.method import PoseMethod

__all__ = ["BUILT_IN", "INITS", "METHODS", "MethodChoice", "MethodEntry", "pose_method", "register_method"]

#: Where a start takes its candidates from.
Init = Literal["hypotheses", "spectral"]
INITS = get_args(Init)
#: Presets whose work has a start of its own.
OWN_START = frozenset({"canton2009", "kehl2006", "hsiao2008"})


@dataclass(frozen=True)
class MethodChoice:
    """What a user says beside a method's name.

    Parameters
    ----------
    preset : str
    models : sequence of str
        Scalable body models (`hmc.pose.methods.scalable.method_preset`).
    init : str or None
        One of `INITS`; None: as the preset has it.
    skin : bool
        Markers are worn on the skin; else they are the joint centres.
    settings : sequence of SettingsTable
        Values in place of the preset's, one table after the other.
    """

    preset: str = "default"
    models: Sequence[str] = ()
    init: Init | None = None
    skin: bool = True
    settings: Sequence[SettingsTable] = ()


@dataclass(frozen=True)
class MethodEntry:
    """A method in the registry.

    Parameters
    ----------
    name : str
    help : str
        A line for the command line.
    presets : tuple of str
    make : callable
        ``make(choice)`` gives the `hmc.pose.method.PoseMethod`.
    takes : frozenset of str
        Which of "models" and "init" it has a use for.
    """

    name: str
    help: str
    presets: tuple[str, ...]
    make: Callable[[MethodChoice], PoseMethod]
    takes: frozenset[str] = frozenset()


def pose_method(
    name: str,
    preset: str = "default",
    models: Sequence[str] = (),
    init: str | None = None,
    skin: bool = True,
    passes: int = 2,
    settings: Sequence[SettingsTable] = (),
) -> PoseMethod:
    """A method by its name.

    Parameters
    ----------
    name : str
        A key of `METHODS`.
    preset, models, init, skin
        As in `MethodChoice`.
    passes : {1, 2}
        1: without the second pass, backward in time, that most methods' `default` has (`hmc.pose.backward`).
    settings
        As in `MethodChoice`; tables are named as the fields of `PoseMethod.settings`, which `run.toml` has as ``parameters.preset``.

    Raises
    ------
    InputError
        When there is no such method or preset, or the method has no use for what is said.

    Examples
    --------
    >>> import hmc
    >>> hmc.pose_method("pso", preset="hsiao2008").source
    'Hsiao (2008)'
    """
    load_plugins()
    if name not in METHODS:
        raise InputError(f"no pose method named {name!r}; there are {', '.join(METHODS)}")
    entry = METHODS[name]
    if preset not in entry.presets:
        raise InputError(f"no preset named {preset!r} of method {name}; there are {', '.join(entry.presets)}")
    if models and "models" not in entry.takes:
        raise InputError(f"--model {models[0]}: method {name} has no use for a scalable model; shbm-apf, ddm-apf and shbm-ddm-apf have")
    if init is not None and init not in INITS:
        raise InputError(f"--init {init}: use one of {', '.join(INITS)}")
    if init is not None and ("init" not in entry.takes or preset in OWN_START):
        raise InputError(f"--init {init}: method {name}{'' if preset == 'default' else f' of preset {preset}'} has a start of its own")
    if passes not in (1, 2):
        raise InputError(f"`passes` must be 1 or 2; got {passes!r}")
    if settings and name not in BUILT_IN:
        raise InputError(f"{settings[0].where}: method {name} is not of the package; its settings are in its own file")
    method = entry.make(MethodChoice(preset, models, cast("Init | None", init), skin, settings))
    return method if passes == 2 else replace(method, back=None)


def register_method(method: PoseMethod, help: str = "") -> None:
    """Add a method under its name: from then on it is used by that name from Python, the command line and the experiments.

    One that was added under the same name before is replaced.

    Parameters
    ----------
    method : PoseMethod
    help : str
        A line for the command line.

    Raises
    ------
    InputError
        When the package has a method of this name.

    Examples
    --------
    >>> import hmc
    >>> from dataclasses import replace
    >>> hmc.register_method(replace(hmc.pose_method("apf"), name="apf-without-recovery", recover=None), "loses poses for good")
    >>> hmc.METHODS.pop("apf-without-recovery").help
    'loses poses for good'
    """
    if method.name in BUILT_IN:
        raise InputError(f"there is a pose method named {method.name!r} already; choose another name")
    METHODS[method.name] = MethodEntry(method.name, help or method.source, ("default",), lambda choice: method)


def _annealed(name: str) -> Callable[[MethodChoice], PoseMethod]:
    def make(choice: MethodChoice) -> PoseMethod:
        from hmc.pose.methods.annealed import annealed_method
        from hmc.pose.methods.scalable import method_preset

        return annealed_method(changed(method_preset(_house(choice), name, choice.models), choice.settings), name)

    return make


def _house(choice: MethodChoice, preset: str | None = None):
    """The preset whose start, refinement and recovery a method has, with the candidates that are asked for."""
    from hmc.pose.steps.presets import PRESETS

    house = PRESETS[preset or choice.preset]
    return house if choice.init is None else replace(house, start=choice.init)


def _smd(choice: MethodChoice) -> PoseMethod:
    parts: dict[str, Any]
    from hmc.pose.methods.smd import SMD_PRESETS, DaVinciStart, smd_method

    if choice.preset == "kehl2006":
        printed = SMD_PRESETS[choice.preset]
        parts = changed({"descent": printed, "without_da_vinci": DaVinciStart(printed).otherwise.preset}, choice.settings)
        return smd_method(parts["descent"], None, parts["without_da_vinci"])
    parts = changed({"descent": SMD_PRESETS[choice.preset], "house": _house(choice, "default")}, choice.settings)
    return smd_method(parts["descent"], parts["house"])


def _pso(choice: MethodChoice) -> PoseMethod:
    from hmc.pose.methods.pso import SWARM_PRESETS, pso_method

    if choice.preset == "hsiao2008":
        return pso_method(changed({"swarm": SWARM_PRESETS[choice.preset]}, choice.settings)["swarm"])
    parts: dict[str, Any] = changed({"swarm": SWARM_PRESETS[choice.preset], "house": _house(choice, "default")}, choice.settings)
    return pso_method(parts["swarm"], parts["house"])


def _markers(choice: MethodChoice) -> PoseMethod:
    from hmc.pose.methods.marker_apf import marker_method
    from hmc.pose.steps.marker_filter import MARKER_PRESETS

    return marker_method(changed(MARKER_PRESETS[choice.preset], choice.settings), choice.skin)


def _keypoints(choice: MethodChoice) -> PoseMethod:
    from hmc.pose.methods.keypoints import KeypointPreset, keypoint_method

    return keypoint_method(changed(KeypointPreset(), choice.settings))


#: By name, in the order in which they are listed.
METHODS: dict[str, MethodEntry] = {
    entry.name: entry
    for entry in (
        MethodEntry("apf", "annealed particle filter (default)", ("default", "canton2009"), _annealed("apf"), frozenset({"init"})),
        MethodEntry(
            "shbm-apf", "by models of rising detail", ("default", "canton2009"), _annealed("shbm-apf"), frozenset({"init", "models"})
        ),
        MethodEntry(
            "ddm-apf",
            "without the limbs that the data does not show",
            ("default", "canton2009"),
            _annealed("ddm-apf"),
            frozenset({"init", "models"}),
        ),
        MethodEntry("shbm-ddm-apf", "both", ("default", "canton2009"), _annealed("shbm-ddm-apf"), frozenset({"init", "models"})),
        MethodEntry("smd", "superellipsoids by stochastic meta descent", ("default", "kehl2006"), _smd, frozenset({"init"})),
        MethodEntry("pso", "spectral skeleton and particle swarm", ("default", "hsiao2008"), _pso, frozenset({"init"})),
        MethodEntry("marker-apf", "annealed particle filter on markers", ("default", "canton2009"), _markers),
        MethodEntry("keypoints", "a 2-D detector's keypoints alone, without silhouettes", ("default",), _keypoints),
    )
}
#: Of these, the ones that come with the package.
BUILT_IN = frozenset(METHODS)
