"""What speaks against each landmark of finished poses, and how far it is from the truth: one cell, one recording, some of its cameras.

Poses are those of the whole chain (`hmc.experiments.chain_runs`), after both passes and after the first alone; and, as garbage, those of
both passes at wrong times: every pose half of the recording later and, of several people, at the next person's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hmc.experiments.chain_runs import PARTS, WHOLE, FollowedPeople, as_read, chain_options, followed, method_without, truth_in
from hmc.experiments.engine.experiment import Parameters, Results
from hmc.experiments.engine.inputs import Inputs
from hmc.io.recording import Recording, open_recording
from hmc.io.results import PoseTable
from hmc.metrics.landmarks import landmark_errors
from hmc.metrics.persons import match_persons
from hmc.pose.backward import backward
from hmc.pose.clear_views import kept_borne_out
from hmc.pose.follow import PosedPeople, follow
from hmc.pose.trust import trust_features
from hmc.pose.turned_back import turned_back

__all__ = ["BOTH", "FAMILY", "FIRST", "SHUFFLED", "VERSION", "cell", "results_of", "some_cameras"]

FAMILY, VERSION = "trust", 1
BOTH, FIRST, SHUFFLED = "both passes", "one pass", "at wrong times"
#: To so many decimals features and errors are kept.
_DECIMALS = 6


def some_cameras(names: Sequence[str], n: int) -> list[str]:
    """So many of the names, evenly spread over their order; all where `n` is 0 or there are no more."""
    return [names[round(k * len(names) / n)] for k in range(n)] if 0 < n < len(names) else list(names)


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Features of trust and errors of all estimated landmarks.

    Parameters
    ----------
    parameters : mapping
        ``recording``, ``cameras`` (0: all), ``start``, ``frames`` (0: all that follow), ``repeat``, which is the seed.
    inputs : Inputs
    rng : numpy.random.Generator
        Not used: the chain draws by its seed.

    Returns
    -------
    dict
        As of `results_of`.

    Raises
    ------
    InputError
        When the recording has no truth.
    """
    folder = inputs.recording_folder(parameters["recording"])
    names = some_cameras(open_recording(folder).rig.names, parameters["cameras"])
    recording = as_read(open_recording(folder, names, start=parameters["start"], frames=parameters["frames"] or None))
    truth = truth_in(recording)
    # Others keep what they share under the number of their cameras, which are not these.
    which = f"{len(names)}-even-from-{parameters['start']}"
    seen = followed({**parameters, "cameras": which}, inputs, recording)
    recording = turned_back(recording, seen.tracks, seen.run).recording
    method, options = method_without(PARTS[WHOLE]), chain_options(parameters)
    first = follow(recording, seen.tracks, method, options, seen.run)
    return results_of(recording, truth, first, backward(recording, seen.tracks, method, first, options, seen.run), seen)


def results_of(recording: Recording, truth: PoseTable, first: PosedPeople, both: PosedPeople, seen: FollowedPeople) -> Results:
    """Features and errors of the poses of one pass, of both, and of both at wrong times.

    Parameters
    ----------
    recording : Recording
    truth : PoseTable
    first, both : PosedPeople
    seen : FollowedPeople
        With the silhouettes.

    Returns
    -------
    dict
        ``cameras``, how many; and by `BOTH`, `FIRST` and `SHUFFLED` a mapping: ``features``, shape (n, 15, 6), ``errors_m``, shape
        (n, 15), NaN where there is no estimate or no truth.
    """
    names = match_persons(truth.frames, truth.persons, truth.positions, both.frames, both.persons, both.positions)
    ways = {BOTH: both, FIRST: first, SHUFFLED: at_wrong_times(both)}
    results: dict[str, object] = {"cameras": len(recording.rig)}
    for way, people in ways.items():
        borne_out = kept_borne_out(people, recording, seen.run)
        if borne_out is None:
            raise ValueError("the silhouettes of this recording were not kept")
        features = trust_features(people.poses, borne_out, people.passes_apart, recording.fps)
        errors = np.full(people.positions.shape[:2], np.nan)
        for found, true in names.items():
            rows, own = np.flatnonzero(people.persons == found), truth.of(true)
            _, a, b = np.intersect1d(people.frames[rows], own.frames, return_indices=True)
            errors[rows[a]] = landmark_errors(people.positions[rows[a]], own.positions[b])
        errors[~np.isfinite(people.positions).all(axis=2)] = np.nan
        results[way] = {"features": features.round(_DECIMALS), "errors_m": errors.round(_DECIMALS)}
    return results


def at_wrong_times(people: PosedPeople) -> PosedPeople:
    """The same rows with poses of other ones: half of the recording later and, of several people, where the next one is."""
    persons, frames = np.unique(people.persons), np.unique(people.frames)
    row_of = {pair: row for row, pair in enumerate(zip(people.frames.tolist(), people.persons.tolist(), strict=True))}
    source = np.arange(len(people.frames))
    for (frame, person), row in row_of.items():
        later = int(frames[(np.searchsorted(frames, frame) + len(frames) // 2) % len(frames)])
        source[row] = row_of.get((later, person), row)
    states, positions = people.states.states[source].copy(), people.positions[source].copy()
    if len(persons) > 1:
        # Where the next person is: their pelvis; the pose itself stays this body's.
        for (frame, person), row in row_of.items():
            other = row_of.get((frame, int(persons[(np.searchsorted(persons, person) + 1) % len(persons)])))
            if other is not None and np.isfinite(states[row, :3]).all() and np.isfinite(people.states.states[other, :3]).all():
                shift = people.states.states[other, :3] - states[row, :3]
                states[row, :3] += shift
                positions[row] += shift
    apart = None if people.passes_apart is None else people.passes_apart[source]
    return replace(
        people,
        poses=replace(people.poses, positions=positions),
        states=replace(people.states, states=states),
        passes_apart=apart,
    )
