"""Which limbs the data shows: what is remembered of each, and the tests by which it is lost and found (Canton 2009, section 7.4.2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from hmc.body.scalable_models import UNITIVE, Unitive
from hmc.errors import InputError

__all__ = ["LimbMemory", "LimbSettings", "limb_spread_deg", "look_again"]


@dataclass(frozen=True)
class LimbSettings:
    """When a limb counts as lost and when as found again; the defaults are the printed ones; the scouts' numbers are not printed.

    Parameters
    ----------
    tree : Unitive
        The limbs that may be missing.
    lost_spread_deg : float
        A tracked limb is in doubt when each of its angles varies by more than this among the particles, degrees; 0 where particles are
        annealed so strongly that they say nothing of it.
    lost_occupancy : float
        ... and when less than this share of its flesh is in occupied voxels that no other part fills.
    lost_strict : float
        ... or when less than this share of its free flesh is in the strict hull, and it has found room where everything is occupied, by one
        of the next two; 0: this does not matter.
    lost_closeness : float
        It lies folded against other parts, and its skin is less close than this to the hull's surface, 0 to 1.
    lost_inside : float
        More than this share of it is in other parts; of an upper arm or thigh, `hmc.pose.steps.hidden.shown.JOINED` more.
    found_spread_deg : float
        A missing limb is shown when its angles vary by less than this (in the median) among its scouts, degrees.
    found_occupancy : float
        ... and when more than this share of it is in such voxels,
    found_strict : float
        ... or more than this share in the strict hull; 1: that is not enough.
    lost_frames, found_frames : int
        For how many frames on end a limb must be in doubt, and shown, before it is lost, and found.
    scouts : int
        Particles that look for a missing limb in the first layer; a third in the others.
    scout_layers : int
    scout_survival : float
        Their survival rate.
    scout_spread_deg : float
        Spread of the first layer, degrees; halved from layer to layer.
    """

    tree: Unitive = field(default_factory=lambda: UNITIVE)
    lost_spread_deg: float = 15.0
    lost_occupancy: float = 0.05
    lost_strict: float = 0.0
    lost_closeness: float = 0.0
    lost_inside: float = 1.0
    found_spread_deg: float = 5.0
    found_occupancy: float = 0.7
    found_strict: float = 1.0
    lost_frames: int = 1
    found_frames: int = 1
    scouts: int = 120
    scout_layers: int = 4
    scout_survival: float = 0.2
    scout_spread_deg: float = 25.0

    def __post_init__(self) -> None:
        if not 0 <= self.lost_occupancy <= self.found_occupancy <= 1:
            raise InputError(
                "`lost_occupancy` must be at most `found_occupancy`, both from 0 to 1, or limbs come and go; got "
                f"{self.lost_occupancy} and {self.found_occupancy}"
            )
        for name in ("lost_strict", "lost_closeness", "lost_inside", "found_strict"):
            if not 0 <= getattr(self, name) <= 1:
                raise InputError(f"`{name}` must lie in 0 to 1; got {getattr(self, name)}")
        for name, least in (("lost_spread_deg", 0), ("found_spread_deg", 0), ("lost_frames", 1), ("found_frames", 1)):
            if not getattr(self, name) >= least:
                raise InputError(f"`{name}` must be at least {least}; got {getattr(self, name)}")
        if self.scouts < 3 or self.scout_layers < 1:
            raise InputError(f"there must be 3 `scouts` or more in 1 layer or more; got {self.scouts} in {self.scout_layers}")


@dataclass(frozen=True)
class LimbMemory:
    """What is remembered of a person's limbs.

    Parameters
    ----------
    active : ndarray of bool, shape (n_limbs,)
        The state vector s of the thesis.
    streak : ndarray of int, shape (n_limbs,)
        For how many frames on end the data has spoken against it.
    """

    active: np.ndarray
    streak: np.ndarray

    @staticmethod
    def first(settings: LimbSettings) -> LimbMemory:
        """All limbs there, none in doubt."""
        n = len(settings.tree.limbs)
        return LimbMemory(np.ones(n, bool), np.zeros(n, int))

    @staticmethod
    def of(memory: Mapping[str, np.ndarray], settings: LimbSettings) -> LimbMemory:
        """From what a filter's state keeps; `first` where that has none."""
        return LimbMemory(memory["active"], memory["streak"]) if "active" in memory else LimbMemory.first(settings)

    def kept(self) -> dict[str, np.ndarray]:
        """As arrays by name."""
        return {"active": self.active, "streak": self.streak}


def limb_spread_deg(particles: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """How far angles vary among weighted particles: standard deviations (Eq. 7.27), degrees.

    Parameters
    ----------
    particles : ndarray, shape (n, k)
        Radians.
    weights : ndarray, shape (n,)
        Summing to 1.

    Returns
    -------
    ndarray, shape (k,)
    """
    off = particles - weights @ particles
    return np.degrees(np.sqrt(weights @ off**2))


def look_again(memory: LimbMemory, evidence: np.ndarray, settings: LimbSettings) -> LimbMemory:
    """Limbs that are lost and found after one more frame.

    Parameters
    ----------
    memory : LimbMemory
    evidence : ndarray of bool, shape (n_limbs,)
        Of an active limb: that it is in doubt; of a missing one: that it is shown.
    settings : LimbSettings

    Returns
    -------
    LimbMemory
        A limb changes after its evidence has held long enough on end. A body that loses a limb loses what needs it.
    """
    streak = np.where(evidence, memory.streak + 1, 0)
    enough = np.where(memory.active, settings.lost_frames, settings.found_frames)
    changed = streak >= enough
    active = settings.tree.possible(memory.active ^ changed)
    return LimbMemory(active, np.where(changed | (active != memory.active), 0, streak))
