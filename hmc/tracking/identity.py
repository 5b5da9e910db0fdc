"""Who is who, by colours: people who were taken for one another when they met, and people who come back.

Beyond Canton (2009), which compares colours within a person's samples only. Each person's reference histogram (Eq. 4.11) is compared with
what everybody looks like in this frame by the Bhattacharyya coefficient.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hmc.tracking.appearance import adapt, bhattacharyya
from hmc.tracking.cloud import Cloud, Departed
from hmc.tracking.lifecycle import Track

__all__ = ["exchange_mistaken", "learn_looks", "recognise"]

#: Two persons were taken for one another when exchanging them raises the sum of their coefficients by more than this.
CLEAR_GAIN = 0.3
#: They can have been only where they are no further apart than this, metres.
MEETING_M = 2.0
#: A reference histogram learns nothing while another person is nearer than this, metres.
ALONE_M = 0.8
#: Someone who left is recognised by at least this coefficient, and by this much more than anybody else who left.
RECOGNISED, CLEARLY = 0.7, 0.1


def exchange_mistaken(
    tracks: tuple[Track, ...], clouds: tuple[Cloud, ...], looks: tuple[np.ndarray, ...]
) -> tuple[tuple[Track, ...], tuple[Cloud, ...], tuple[np.ndarray, ...]]:
    """Give persons who were taken for one another their numbers back.

    Parameters
    ----------
    tracks : tuple of Track
    clouds : tuple of Cloud, one a track
    looks : tuple of ndarray, one a track
        Histogram of what each looks like in this frame; empty where nothing is seen.

    Returns
    -------
    tracks, clouds, looks
        By person.
    """
    known = [k for k, (cloud, look) in enumerate(zip(clouds, looks, strict=True)) if cloud.histogram.size and look.size]
    pairs = [(a, b) for i, a in enumerate(known) for b in known[i + 1 :] if _gap(tracks[a], tracks[b]) <= MEETING_M]
    if not pairs:
        return tracks, clouds, looks
    alike = {(a, b): float(bhattacharyya(clouds[a].histogram, looks[b])) for pair in pairs for a in pair for b in pair}
    gains = {(a, b): alike[a, b] + alike[b, a] - alike[a, a] - alike[b, b] for a, b in pairs}
    whose = list(range(len(tracks)))
    taken: set[int] = set()
    for (a, b), gain in sorted(gains.items(), key=lambda item: -item[1]):
        if gain > CLEAR_GAIN and not taken & {a, b}:
            whose[a], whose[b] = b, a
            taken |= {a, b}
    # Track k is really the person whose[k].
    renamed = [replace(track, person=tracks[j].person, first_frame=tracks[j].first_frame) for track, j in zip(tracks, whose, strict=True)]
    moved = [replace(cloud, person=clouds[j].person, histogram=clouds[j].histogram) for cloud, j in zip(clouds, whose, strict=True)]
    order = np.argsort(whose)
    return tuple(renamed[k] for k in order), tuple(moved[k] for k in order), tuple(looks[k] for k in order)


def learn_looks(tracks: tuple[Track, ...], clouds: tuple[Cloud, ...], looks: tuple[np.ndarray, ...], keep: float) -> tuple[Cloud, ...]:
    """Adapt the reference histograms (Canton, Eq. 4.11) of everybody who stands alone, or of whom nothing is known yet.

    Parameters
    ----------
    tracks, clouds, looks
        As for `exchange_mistaken`.
    keep : float
        Share of the old histogram.

    Returns
    -------
    tuple of Cloud
    """
    alone = [all(other is track or _gap(track, other) > ALONE_M for other in tracks) for track in tracks]
    return tuple(
        replace(cloud, histogram=adapt(cloud.histogram, look, keep)) if by_self or cloud.histogram.size == 0 else cloud
        for cloud, look, by_self in zip(clouds, looks, alone, strict=True)
    )


def recognise(histogram: np.ndarray, first_frame: int, departed: tuple[Departed, ...]) -> int | None:
    """The number of the one who left and looks like this, or None where that is not clear.

    Parameters
    ----------
    histogram : ndarray, shape (n_colors,)
    first_frame : int
        In which the person was seen again; who was seen elsewhere then is somebody else.
    departed : tuple of Departed
    """
    absent = [one for one in departed if one.last_frame < first_frame]
    known = sorted(((float(bhattacharyya(histogram, one.histogram)), one.person) for one in absent), reverse=True)
    if not known or known[0][0] < RECOGNISED or (len(known) > 1 and known[0][0] - known[1][0] < CLEARLY):
        return None
    return known[0][1]


def _gap(a: Track, b: Track) -> float:
    """Horizontal distance, metres."""
    return float(np.hypot(*(a.position - b.position)[:2]))
