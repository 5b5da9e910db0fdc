"""How far each landmark of a finished pose can be trusted: how likely it is within 60 mm of the truth.

Four things that are known without a truth tell good landmarks from bad ones:

1. how much of the landmark's flesh cameras show clear of all else, and how much of it would stand clear and is in no silhouette
   (`hmc.pose.clear_views`);
2. how much silhouette near the landmark, and near the whole body, no body covers, and how much of the whole body is in no silhouette;
3. how far apart the pass forward in time and the one backward have it, where there were two;
4. which landmark it is: wrists are lost more often than hips.

All are means over a fifth of a second before and after. A logistic regression makes one number of them; its coefficients, none of which
lets a landmark gain by what speaks against it, come from rendered recordings with known truth (`hmc.pose.trust_model`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import expit

from hmc.io.evidence import EVIDENCE
from hmc.io.recording import Recording
from hmc.io.results import PoseTable
from hmc.landmarks import LANDMARKS
from hmc.pose.clear_views import BorneOut, kept_borne_out, uncovered_notes
from hmc.pose.trust_model import KINDS, NEAR_M, ONE_PASS, TWO_PASSES
from hmc.voxels.run_options import RunOptions

if TYPE_CHECKING:
    from hmc.pose.follow import PosedPeople

__all__ = ["FEATURES", "KIND_OF_LANDMARK", "doubt_notes", "trust_features", "trust_of", "with_trust"]

#: What the columns of the features are; the last is known after two passes only.
FEATURES = ("not_shown", "denied", "bare_m", "bare_body_m", "denied_body", "passes_apart")
#: Features are means over so long before and after, seconds.
WINDOW_S = 0.2
#: Cameras that show a landmark clear count up to this many, those that deny it up to this many, and bare silhouette up to this, metres.
ENOUGH_SHOWN, MOST_DENIED, MOST_BARE_M = 4.0, 2.0, 0.15
#: Of a body of which cameras show and deny something, the share that is denied counts beyond this: furniture denies as much of sound poses.
DENIED_SHARE = 0.2
#: Distances between the passes count in proportion below this, by their logarithm beyond, metres.
APART_M = 0.02
#: A person is told of if more than this share of the landmarks are, by their trust, off: sound runs have .01 to .05 (results/trust). Where
#: trust is not known, if more than that share is seen by too few cameras.
MUCH_OFF, MANY_DOUBTS = 0.1, 0.05

#: Place of each landmark's kind in `KINDS`, shape (15,): pelvis, neck and head are the trunk's.
KIND_OF_LANDMARK = np.array([next((k for k, kind in enumerate(KINDS) if name.endswith(kind)), 0) for name in LANDMARKS])


def trust_features(poses: PoseTable, borne_out: BorneOut, passes_apart: np.ndarray | None, fps: float) -> np.ndarray:
    """What speaks against each landmark.

    Parameters
    ----------
    poses : PoseTable
    borne_out : BorneOut
        Of the same rows.
    passes_apart : ndarray, shape (n, 15), or None
        `hmc.pose.follow.PosedPeople.passes_apart`.
    fps : float

    Returns
    -------
    ndarray, shape (n, 15, 6)
        In the order of `FEATURES`, none below 0; NaN for a distance between passes that is not known.
    """
    bare = np.minimum(borne_out.bare_m, MOST_BARE_M)
    apart = np.full(bare.shape, np.nan) if passes_apart is None else passes_apart
    features = np.stack(
        [
            np.clip(ENOUGH_SHOWN - borne_out.shown, 0, ENOUGH_SHOWN),
            np.minimum(borne_out.denied, MOST_DENIED),
            bare,
            np.repeat(bare.mean(axis=1, keepdims=True), bare.shape[1], axis=1),
            np.log1p(apart / APART_M),
        ],
        axis=-1,
    )
    out = np.empty_like(features)
    for person in np.unique(poses.persons):
        rows = np.flatnonzero(poses.persons == person)
        rows = rows[np.argsort(poses.frames[rows])]
        out[rows] = _smoothed(features[rows], poses.frames[rows], round(WINDOW_S * fps))
    out[np.isnan(features)] = np.nan
    shown, denied = (one.sum(axis=1, keepdims=True) for one in (ENOUGH_SHOWN - out[..., 0], out[..., 1]))
    body = np.maximum(denied / np.maximum(shown + denied, 1e-9) - DENIED_SHARE, 0)
    return np.stack([*np.moveaxis(out[..., :4], -1, 0), np.repeat(body, bare.shape[1], axis=1), out[..., 4]], axis=-1)


def _smoothed(values: np.ndarray, frames: np.ndarray, reach: int) -> np.ndarray:
    """Means of rows (n, ...) over those of frames, ascending, that are no more than `reach` away; what is NaN counts nothing."""
    known = np.isfinite(values)
    zero = np.zeros((1, *values.shape[1:]))
    sums, counts = (np.concatenate([zero, np.cumsum(one, axis=0)]) for one in (np.where(known, values, 0.0), known))
    first, end = np.searchsorted(frames, frames - reach), np.searchsorted(frames, frames + reach, side="right")
    return np.maximum(sums[end] - sums[first], 0) / np.maximum(counts[end] - counts[first], 1)


def trust_of(features: np.ndarray) -> np.ndarray:
    """How likely each landmark is within 60 mm of the truth.

    Parameters
    ----------
    features : ndarray, shape (n, 15, 6)
        From `trust_features`.

    Returns
    -------
    ndarray, shape (n, 15)
        0 to 1, to three decimals, as in ``joints.csv``.
    """
    twice = np.isfinite(features[..., -1])
    logits = [
        np.array(model.intercepts)[KIND_OF_LANDMARK] - features[..., : len(model.weights)] @ np.array(model.weights)
        for model in (TWO_PASSES, ONE_PASS)
    ]
    return np.round(expit(np.where(twice, *logits)), 3)


def with_trust(people: PosedPeople, recording: Recording, run: RunOptions) -> PosedPeople:
    """Poses with views and trust beside their landmarks, what trust rests on, and lines on who is in doubt and on what no body covers.

    Parameters
    ----------
    people : PosedPeople
    recording : Recording
    run : RunOptions
        With the silhouettes that were kept; where they were not, the poses stay as they are.
    """
    found = kept_borne_out(people, recording, run)
    if found is None:
        return people
    trust = trust_of(trust_features(people.poses, found, people.passes_apart, recording.fps))
    trust[~np.isfinite(people.positions).all(axis=2)] = np.nan
    poses = replace(people.poses, views=found.views, trust=trust)
    notes = (*people.notes, *doubt_notes(poses), *uncovered_notes(recording.rig, found.uncovered))
    return replace(people, poses=poses, notes=notes, evidence=_evidence(people, found))


def _evidence(people: PosedPeople, found: BorneOut) -> dict[str, np.ndarray]:
    """What trust rests on, of each row by itself, by the names of `hmc.io.evidence.EVIDENCE`."""
    apart = np.full(found.shown.shape, np.nan) if people.passes_apart is None else people.passes_apart
    costs = np.repeat(people.costs[:, None], found.shown.shape[1], axis=1)
    return dict(zip(EVIDENCE, (found.shown, found.denied, found.bare_m, apart, costs), strict=True))


def doubt_notes(poses: PoseTable) -> list[str]:
    """A line on every person of whose landmarks many are off or not known: how many, and which are doubtful most often."""
    notes = []
    for person in np.unique(poses.persons).tolist():
        own = poses.of(person)
        there = np.isfinite(own.positions).all(axis=2)
        doubtful = there if own.doubtful is None else own.doubtful
        told = there & np.isfinite(own.trust) if own.trust is not None else np.zeros_like(there)
        if own.trust is not None and told.any():
            share = float(1 - own.trust[told].mean())
            what = f"by their trust about {share:.0%} of the landmarks are more than {1000 * NEAR_M:.0f} mm off (`trust` in joints.csv)"
            much = share > MUCH_OFF
        else:
            share = doubtful.sum() / max(there.sum(), 1)
            what = f"{share:.0%} of the landmarks are doubtful, as fewer than two cameras show them (`views` in joints.csv)"
            much = share > MANY_DOUBTS
        if much:
            counts = doubtful.sum(axis=0)
            most = ", ".join(f"{LANDMARKS[k]} {counts[k]}" for k in np.argsort(-counts, kind="stable")[:4] if counts[k])
            notes.append(f"person {person}: {what}; doubtful in how many of {len(there)} frames, most of all: {most}")
    return notes
