"""Identity by colors: persons who were taken for one another when they met, and persons who come back.

Beyond Canton (2009), which compares colors within a person's samples only. Each person's reference histogram (Eq. 4.11) is compared with
what all look like in this frame by the Bhattacharyya coefficient. Shown by
`test_people_who_were_exchanged_get_their_numbers_back` and `test_people_who_come_back_are_recognised_by_their_colors`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hmc.tracking.appearance import adapt, bhattacharyya
from hmc.tracking.likeness import horizontal_distance
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.state import DepartedTrack, Track
from hmc.tracking.update import FrameUpdate

__all__ = ["exchange_identities", "learn_appearance", "recognise", "reidentify"]

#: Two persons were taken for one another when exchanging them raises the sum of their coefficients by more than this.
CLEAR_GAIN = 0.3
#: They can have been only where they are no further apart than this, metres.
MEETING_M = 2.0
#: A reference histogram learns nothing while another person is nearer than this, metres.
ALONE_M = 0.8
#: A person who left is recognised by at least this coefficient, and by this much more than any other person who left.
RECOGNISED, CLEARLY = 0.7, 0.1
#: A person is compared with those who left after this time, when their colors are known; seconds.
REIDENTIFY_AFTER_S = 1.0


def exchange_identities(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update in which persons who were taken for one another have their numbers back; in order of the numbers, as before."""
    tracks, memories, looks = update.tracks, update.memories, update.estimate.looks
    known = [k for k, look in enumerate(looks) if memories[k].histogram.size and look.size]
    pairs = [(a, b) for i, a in enumerate(known) for b in known[i + 1 :] if _distance(tracks[a], tracks[b]) <= MEETING_M]
    if not pairs:
        return update
    alike = {(a, b): float(bhattacharyya(memories[a].histogram, looks[b])) for pair in pairs for a in pair for b in pair}
    gains = {(a, b): alike[a, b] + alike[b, a] - alike[a, a] - alike[b, b] for a, b in pairs}
    whose = list(range(len(tracks)))
    taken: set[int] = set()
    for (a, b), gain in sorted(gains.items(), key=lambda item: -item[1]):
        if gain > CLEAR_GAIN and not taken & {a, b}:
            whose[a], whose[b] = b, a
            taken |= {a, b}
    # Track k is really the person whose[k].
    whom = [tracks[j] for j in whose]
    renamed = [
        replace(track, person=one.person, first_frame=one.first_frame, asked=one.asked) for track, one in zip(tracks, whom, strict=True)
    ]
    moved = [replace(one, person=memories[j].person, histogram=memories[j].histogram) for one, j in zip(memories, whose, strict=True)]
    order = np.argsort(whose)
    return replace(
        update,
        tracks=tuple(renamed[k] for k in order),
        memories=tuple(moved[k] for k in order),
        estimate=replace(update.estimate, looks=tuple(looks[k] for k in order)),
    )


def learn_appearance(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update whose reference histograms are adapted (Canton, Eq. 4.11), of all who stand alone or of whom nothing is known yet."""
    tracks, looks = update.tracks, update.estimate.looks
    if not looks:
        return update
    alone = [all(other is track or _distance(track, other) > ALONE_M for other in tracks) for track in tracks]
    memories = (
        replace(one, histogram=adapt(one.histogram, look, update.estimate.keep_histogram)) if by_self or one.histogram.size == 0 else one
        for one, look, by_self in zip(update.memories, looks, alone, strict=True)
    )
    return replace(update, memories=tuple(memories))


def reidentify(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update in which ended tracks have departed, and some who began lately are known to have been there before.

    Of everybody it is asked once: in the first frame after `REIDENTIFY_AFTER_S` that tells anything of them.
    """
    histograms = {memory.person: memory.histogram for memory in update.memories}
    departed, reidentified = update.departed, update.reidentified
    born = {track.person for track in update.born}  # nothing is learnt yet of who was born in this frame
    ended = {track.person for track in update.ended}
    due = update.frame - round(REIDENTIFY_AFTER_S * update.state.fps)
    asked = set()
    followed = sorted((*update.tracks, *update.ended), key=lambda track: track.person)
    for track in (track for track in followed if track.person not in born and histograms[track.person].size):
        look = histograms[track.person]
        if track.person in ended:
            departed += (DepartedTrack(dict(reidentified).get(track.person, track.person), look, track.last_frame),)
        elif track.first_frame <= due and not track.asked:
            asked.add(track.person)
            before = recognise(look, track.first_frame, departed)
            if before is not None:
                reidentified += ((track.person, before),)
                departed = tuple(one for one in departed if one.person != before)
    tracks = tuple(replace(track, asked=True) if track.person in asked else track for track in update.tracks)
    return replace(update, tracks=tracks, departed=departed, reidentified=reidentified)


def recognise(histogram: np.ndarray, first_frame: int, departed: tuple[DepartedTrack, ...]) -> int | None:
    """The number of the one who left and looks like this, or None where that is not clear.

    Parameters
    ----------
    histogram : ndarray, shape (n_colors,)
    first_frame : int
        In which the person was seen again; a person seen elsewhere then is another one.
    departed : tuple of DepartedTrack
    """
    absent = [one for one in departed if one.last_frame < first_frame]
    known = sorted(((float(bhattacharyya(histogram, one.histogram)), one.person) for one in absent), reverse=True)
    if not known or known[0][0] < RECOGNISED or (len(known) > 1 and known[0][0] - known[1][0] < CLEARLY):
        return None
    return known[0][1]


def _distance(a: Track, b: Track) -> float:
    return horizontal_distance(a.position, b.position)
