"""What all trackers are told of people: when a set of voxels is a person, and which voxels a track owns."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hmc.errors import InputError
from hmc.tracking.person_tree import PersonTree, default_tree, read_tree

__all__ = ["ALIKE", "CANTON_2009", "FollowingSettings", "LifecycleSettings"]


@dataclass(frozen=True)
class LifecycleSettings:
    """When a set of voxels is a person, and how long it takes to come and go.

    Attributes
    ----------
    person : str
        What decides whether a set of voxels looks like a person: "rules", the limits from `least_top_m` to `least_side_m` alone; "tree",
        the decision tree that comes with the package, within these limits; or the path of a tree of the user's own
        (`hmc.tracking.train_person_tree`), within them too.
    least_top_m, most_top_m : float
        Height of the highest point of a person who appears: bent down or on the knees, and with a hand up.
    least_height_m : float
        Least extent from lowest to highest point: no table top, no shadow.
    most_bottom_m : float
        Furniture may hide the legs, but no person floats higher than this.
    least_volume_m3, most_volume_m3 : float
        A hull is fatter than its person; the most leaves room for two who come in arm in arm.
    most_side_m, least_side_m : float
        Longest horizontal side (arms stretched out) and least value of the longer side (a ghost is a thin column).
    keep_volume_m3 : float
        What is enough of the strict hull for a person who is tracked already.
    keep_share : float
        And what share of the person's usual volume.
    confirm_s, confirm_frames : float, int
        A candidate becomes a person after this time and at least this many frames.
    beside_m, confirm_beside_s : float
        Nearer to a track than this, seen from above, it takes this time: between people there are ghosts that last for some frames.
    patience_s : float
        A track is deleted after this time without support.
    edge_m : float
        Width of the room's edge, at which people come and go.
    unlike_s : float
        A track is deleted when its voxels have not looked like a person for so long, however many they are: furniture that was left
        behind (Canton, section 4.2.3, third criterion of deletion). A frame in which they do makes up for two in which they do not.
    established_s : float
        A track whose voxels have looked like a person for so long altogether is one, whatever they look like now: people sit on the floor,
        lie and crouch. Verdicts do not end it (beyond the thesis).
    known_s, same_body : float, (float, float)
        A track whose voxels have looked like a person for so long keeps looking like one where it owns between these shares of the strict
        hull that it had then: who goes down on the floor keeps the volume (beyond the thesis).
    still_s, still_m : float
        But it ends when what it holds has looked like an object and has not moved by more than this for so long (beyond the thesis).
    least_lying_m : float
        Objects that people leave behind are not as long as what is seen of a person who lies.
    lying_m, lying_m3, lying_height_m, most_lying_top_m : (float, float), (float, float), (float, float), float
        Longest side, volume, extent upwards and height of the highest point of a person who lies when first seen, on the floor or on a
        table, below which cameras look from above do not see (beyond the thesis).
    least_efficiency, efficiency_s : float
        A track is deleted when the survival rate of its filter's particles (Canton, Eq. 3.11) has been below this share for so long
        (section 4.2.3, second criterion). Of Sparse Sampling, the share of the samples that found a voxel of their own.
    least_distance_m : float
        No candidate nearer to a track than this, horizontally (section 4.2.3, criterion of creation).
    same_place_m, same_place_s : float
        Two tracks nearer than this for so long follow one person; the younger is deleted (section 4.2.3, first criterion of deletion).
    fragment_gap_m : float
        Unowned pieces that stand nearer than this, seen from above, are judged together.
    tree : PersonTree or None
        What `person` names; None for "rules". Not to be given.
    """

    person: str = "tree"
    least_top_m: float = 0.9
    most_top_m: float = 2.6
    least_height_m: float = 0.6
    most_bottom_m: float = 0.9
    least_volume_m3: float = 0.025
    most_volume_m3: float = 0.7
    most_side_m: float = 2.2
    least_side_m: float = 0.25
    keep_volume_m3: float = 0.012
    keep_share: float = 0.2
    confirm_s: float = 0.3
    confirm_frames: int = 4
    beside_m: float = 1.2
    confirm_beside_s: float = 1.0
    patience_s: float = 1.0
    edge_m: float = 0.3
    unlike_s: float = 2.0
    established_s: float = 3.0
    known_s: float = 0.5
    same_body: tuple[float, float] = (0.6, 1.6)
    still_s: float = 8.0
    still_m: float = 0.06
    least_lying_m: float = 0.95
    lying_m: tuple[float, float] = (1.3, 2.2)
    lying_m3: tuple[float, float] = (0.06, 0.4)
    lying_height_m: tuple[float, float] = (0.2, 0.85)
    most_lying_top_m: float = 1.5
    least_efficiency: float = 0.05
    efficiency_s: float = 1.0
    least_distance_m: float = 0.45
    same_place_m: float = 0.2
    same_place_s: float = 0.5
    fragment_gap_m: float = 0.2
    tree: PersonTree | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        if self.person != "rules":
            object.__setattr__(self, "tree", default_tree() if self.person == "tree" else read_tree(self.person))


@dataclass(frozen=True)
class FollowingSettings:
    """What every tracker needs to know of people and of the voxels that they own.

    Attributes
    ----------
    enlarge_xy, enlarge_z : float
        Canton's alpha and beta (section 4.3.1).
    rules : {"default", "canton2009"}
        By which a frame becomes tracks (`hmc.tracking.rules.RULE_SETS`): ours, or those of the thesis and no others.
    reach : float
        Voxels of a person's component count up to this distance, in radii of the region.
    velocity_time_s : float
        Time constant of the velocity's smoothing.
    shared_gain : float
        Share of the measured correction that is believed while persons share one component, where no filter tells them apart.
    filter_gain : float
        The same of what a filter says.
    least_certain_m3 : float
        A person with so much of the strict hull is located by it; else by the tolerant one. Infinite: there is one hull, the tolerant.
    least_colored : int
        Fewer colored voxels tell nothing of what a person looks like.
    shared_looks : bool
        Whether a voxel in several persons' ellipsoids counts for what each of them looks like (Eq. 4.11 as printed).
    lifecycle : LifecycleSettings
    """

    enlarge_xy: float = 1.5
    enlarge_z: float = 1.2
    rules: str = "default"
    reach: float = 2.0
    velocity_time_s: float = 0.3
    shared_gain: float = 0.5
    filter_gain: float = 1.0
    least_certain_m3: float = 0.03
    least_colored: int = 30
    shared_looks: bool = False
    lifecycle: LifecycleSettings = field(default_factory=LifecycleSettings)

    def __post_init__(self) -> None:
        if self.rules not in ("default", "canton2009"):
            raise InputError(f"`rules` must be 'default' or 'canton2009'; got {self.rules!r}")


#: As Canton (2009) prints it: sections 4.2.3 and 4.3.1. How close is too close is not printed: of .45 to 1.0 m (to begin) and .2 to .4 m
#: (to end) those with which the trackers, without color, have the best mean MOTA on the recipe `meeting_tuning`. Nothing is tested on it.
CANTON_2009 = FollowingSettings(
    rules="canton2009",
    least_certain_m3=np.inf,
    least_colored=1,
    shared_looks=True,
    lifecycle=LifecycleSettings(least_distance_m=0.8, same_place_m=0.3),
)
#: For people who are dressed alike: where they share a component, filters tell them apart less surely.
ALIKE = FollowingSettings(filter_gain=0.5)
