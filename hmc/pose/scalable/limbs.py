"""Which limbs the data shows: settings of the lost and found tests (Canton 2009, section 7.4)."""

from __future__ import annotations

from dataclasses import dataclass, field

from hmc.pose.scalable.models import UNITIVE, Unitive

__all__ = ["LimbSettings"]


@dataclass(frozen=True)
class LimbSettings:
    """When a limb counts as lost and when as found again."""

    tree: Unitive = field(default_factory=lambda: UNITIVE)
