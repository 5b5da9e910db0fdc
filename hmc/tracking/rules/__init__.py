"""The rules by which a frame becomes tracks, in their order; what shows each of them is on ``docs/tracking.md``."""

from __future__ import annotations

from hmc.tracking.rules.birth import confirm_candidates, locate_births, propose_candidates
from hmc.tracking.rules.death import delete_tracks
from hmc.tracking.rules.detection import detect_people
from hmc.tracking.rules.false_tracks import reject_false_tracks, remember_false_tracks
from hmc.tracking.rules.filtering import filter_tracks
from hmc.tracking.rules.gating import associate_voxels
from hmc.tracking.rules.ghosts import reject_ghosts
from hmc.tracking.rules.handover import hand_over_tracks
from hmc.tracking.rules.identity import exchange_identities, learn_appearance, reidentify
from hmc.tracking.rules.measurement import measure_tracks
from hmc.tracking.rules.printed import (
    adapt_histograms,
    begin_tracks,
    claim_regions,
    end_tracks,
    filter_in_place,
    move_tracks,
)
from hmc.tracking.rules.pushed_objects import release_pushed_objects
from hmc.tracking.rules.state_update import update_tracks
from hmc.tracking.rules.static_objects import hide_static_objects, learn_static_objects, reject_static_objects
from hmc.tracking.rules.unseen_by_one import reject_unsolid
from hmc.tracking.rules.upright import match_columns, share_columns
from hmc.tracking.update import Rule

__all__ = ["PRINTED", "RULES", "RULE_SETS"]

RULES: tuple[Rule, ...] = (
    hide_static_objects,
    filter_tracks,
    match_columns,
    associate_voxels,
    share_columns,
    release_pushed_objects,
    measure_tracks,
    update_tracks,
    exchange_identities,
    learn_appearance,
    detect_people,
    reject_static_objects,
    reject_ghosts,
    reject_unsolid,
    locate_births,
    reject_false_tracks,
    propose_candidates,
    confirm_candidates,
    hand_over_tracks,
    delete_tracks,
    remember_false_tracks,
    learn_static_objects,
    reidentify,
)
#: Those of Canton (2009), and no others.
PRINTED: tuple[Rule, ...] = (
    filter_in_place,
    claim_regions,
    move_tracks,
    adapt_histograms,
    begin_tracks,
    end_tracks,
)
#: By the name in `FollowingSettings.rules`.
RULE_SETS = {"default": RULES, "canton2009": PRINTED}
