"""How one camera's frames run beside the others': a shift, and frames it dropped, or a clock that runs faster or slower."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hmc.check.sync.evidence import Evidence

__all__ = ["Course", "against", "best_course", "disagreement", "weights"]

#: No frame of a camera belongs to a moment.
NONE = -(10**9)
#: Courses may leave their shift by so many frames, either way, and drop so many frames at once.
ROOM, MOST_DROPPED = 20, 5
#: A dropped frame is believed when it is seen in as many moments after it as would be as much worse by a whole frame.
LEAST_SEEN = 8.0
#: It may as well have been dropped at another moment that makes no more difference than so many moments seen a whole frame off.
AS_WELL = 2.0
#: Where so many frames are dropped at once, a camera must be no worse than usual by so many frames' shift between any two steps.
MANY, FITTING = 3, 2.0
#: A moment counts for no worse than so many frames' shift.
CAP = 4.0
#: What is gained is more than so many deviations of what chance gains over all moments; moments of one part.
NOISE, PART = 1.0, 12
#: A clock is believed to be off when by the end it is so by this many frames, and not by more frames a frame than any clock is.
LEAST_DRIFT, MOST_SLOPE = 0.75, 0.005
#: Pairs of cameras are never taken for less unlike than this at their best: silhouettes are of pixels.
LEAST_UNLIKE = 0.015
#: People stand still where a frame more or less makes less than this share of the usual difference.
STILL = 0.5
#: A clock is off, and nothing was dropped, where shifts over time are this much nearer to a line than to steps.
LINE = 0.6


@dataclass(frozen=True)
class Course:
    """Which frame of a camera belongs to each moment: frame = moment + shift + start + slope * moment + what steps before it add.

    Parameters
    ----------
    shift : int
        Frames.
    steps : tuple of (int, int)
        A moment from which on, and by how many frames the shift is another: -2 where the camera dropped two, whose moments are the two
        before; +1 where it has a frame more than there was time for.
    start, slope : float
        Of a clock that drifts: frames, and frames a frame.
    spans : tuple of (int, int)
        For each step the first and the last moment that fit it as well, nearly: while nobody moves, any does.
    """

    shift: int = 0
    steps: tuple[tuple[int, int], ...] = ()
    start: float = 0.0
    slope: float = 0.0
    spans: tuple[tuple[int, int], ...] = field(default=(), compare=False)

    @property
    def is_plain(self) -> bool:
        """Whether a shift is all."""
        return not self.steps and not self.slope

    def frames(self, n: int) -> np.ndarray:
        """The frame at each of n moments, int; `NONE` where it was dropped."""
        moments = np.arange(n)
        found = np.rint(moments + self.shift + self.start + self.slope * moments).astype(int)
        for moment, change in self.steps:
            found[moment:] += change
            if change < 0:
                found[max(0, moment + change) : moment] = NONE
        return found

    def moments(self, frames: np.ndarray) -> np.ndarray:
        """The moments at which frames were taken, by the same rule turned round; float."""
        frames = np.asarray(frames, float)
        if self.slope:
            return (frames - self.shift - self.start) / (1 + self.slope)
        found, shift = frames - self.shift, self.shift
        for moment, change in self.steps:
            shift += change
            if change > 0:
                before = moment + shift - change  # the first frame too many
                extra = (frames >= before) & (frames < before + change)
                found[extra] = moment - 1 + (frames[extra] - before + 1) / (change + 1)
            after = frames >= moment + shift
            found[after] = frames[after] - shift
        return found


def weights(evidence: Evidence, frames: Sequence[np.ndarray]) -> dict[tuple[int, int], float]:
    """What each pair of cameras counts for: one over how unlike both usually are at their best.

    A pair of which one camera sees legs that furniture hides from the other stays unlike at any time, and what it tells of time is lost
    in that.

    Parameters
    ----------
    evidence : Evidence
    frames : sequence of ndarray of int, shape (n_moments,)
        Each camera's frame at each moment.

    Returns
    -------
    dict from (int, int) to float
    """
    found = {}
    for i, j in evidence.bands:
        own = _pair_costs(evidence, frames, i, j, frames[j][:, None])
        known = own[np.isfinite(own)]
        found[i, j] = 1 / max(LEAST_UNLIKE, float(np.median(known)) if len(known) else 1.0)
    return found


def _pair_costs(evidence: Evidence, frames: Sequence[np.ndarray], j: int, c: int, own: np.ndarray) -> np.ndarray:
    """How unlike camera c, at the frames `own` (n_moments, k), is to camera j at each moment; NaN where that cannot be told."""
    n, reach = evidence.n_moments, evidence.reach
    other = np.broadcast_to(frames[j][:, None], own.shape)
    first, second = (own, other) if c < j else (other, own)
    there = (first >= 0) & (first < n) & (second >= 0) & (second < n) & (np.abs(second - first) <= reach)
    values = np.full(own.shape, np.nan)
    values[there] = evidence.bands[min(c, j), max(c, j)][first[there], (second - first + reach)[there]]
    return values


def against(
    evidence: Evidence,
    frames: Sequence[np.ndarray],
    members: Sequence[int],
    c: int,
    weighed: Mapping[tuple[int, int], float] | None = None,
) -> np.ndarray:
    """How unlike a camera is to the others at each moment, when it is taken some frames from where it is.

    Parameters
    ----------
    evidence : Evidence
    frames : sequence of ndarray of int, shape (n_moments,)
        Each camera's frame at each moment.
    members : sequence of int
        The cameras to compare with.
    c : int
    weighed : mapping from (int, int) to float, optional
        What each pair counts for, as from `weights`; without it all count alike.

    Returns
    -------
    ndarray, shape (n_moments, 2 * ROOM + 1)
        The mean over the others; NaN where nothing can be told. Of a moment whose frame the camera has not, of the frame it would be.
    """
    n = evidence.n_moments
    total, weight, number = (np.zeros((n, 2 * ROOM + 1)) for _ in range(3))
    own = (frames[c][:, None] + np.arange(-ROOM, ROOM + 1)).clip(-1, n)
    for j in members:
        pair = (min(c, j), max(c, j))
        if j == c or pair not in evidence.bands:
            continue
        values = _pair_costs(evidence, frames, j, c, own)
        known, counts = np.isfinite(values), 1.0 if weighed is None else weighed[pair]
        total[known] += counts * values[known]
        weight[known] += counts
        number[known] += 1
    # Where one camera alone saw somebody, what it says is no mean of what the others say.
    most = number.max(axis=1, keepdims=True)
    return np.where((number > 0) & (number == most), total / np.where(number > 0, weight, 1), np.nan)


def best_course(costs: np.ndarray) -> tuple[Course, float]:
    """The course that fits best, beside that of no change.

    A moment counts for no worse than some frames' shift would make it, since silhouettes are bad now and then.

    Parameters
    ----------
    costs : ndarray, shape (n_moments, 2 * ROOM + 1)
        As from `against`, about a plain course.

    Returns
    -------
    course : Course
        As a change of that about which the costs are.
    gain : float
        By how much it lowers the costs, less what its complication is charged, as a share of that charge; 0 where nothing is gained.
    """
    made = _filled(costs)
    if made is None:
        return Course(), 0.0
    filled, usual, frame, scatter = made
    charge = max(LEAST_SEEN * frame, NOISE * scatter)
    now = float(filled[:, ROOM].sum())
    best = int(filled.sum(axis=0).argmin())
    found = [
        (Course(shift=best - ROOM), now - float(filled[:, best].sum())),
        _drifting(filled, now, charge),
        _stepping(filled, usual, frame, charge),
    ]
    course, gain = max(found, key=lambda one: one[1])
    if course.steps and all(change == course.steps[0][1] for _, change in course.steps):
        course = _evenly(course, filled) or course
    return course, gain / charge


def disagreement(evidence: Evidence, frames: Sequence[np.ndarray], members: Sequence[int], c: int, course: Course) -> float:
    """At how many moments a camera's frame might be another without one of the cameras that it is compared with.

    Where people hardly move, what silhouettes are off by decides at which moment a frame was dropped, and that is another for each pair.
    Moments at which a frame more or less makes no difference do not count: people are still there, and any frame is as good.

    Parameters
    ----------
    evidence, frames, members, c
        As of `against`; of the other cameras the courses that were found.
    course : Course
        The camera's own, with steps.

    Returns
    -------
    float
        The largest share of the moments over all cameras that are left out, from 0 to 1; 1 where fewer than two are left to compare with.
    """
    partners = [j for j in members if j != c and (min(c, j), max(c, j)) in evidence.bands]
    if len(partners) < 2:
        return 1.0
    n, weighed = evidence.n_moments, weights(evidence, frames)
    about = [*frames[:c], Course(course.shift).frames(n), *frames[c + 1 :]]
    together = _filled(against(evidence, about, partners, c, weighed))
    if together is None:
        return 1.0
    filled, _, frame, _ = together
    told = _telling(filled, frame, course)
    own, worst = course.frames(n), 0.0
    if not told.any():
        return 1.0
    for left_out in partners:
        costs = against(evidence, about, [j for j in partners if j != left_out], c, weighed)
        other = replace(found := best_course(costs)[0], shift=found.shift + course.shift).frames(n)
        there = told & (own != NONE) & (other != NONE)
        differing = float((own != other)[there].mean()) if there.any() else 1.0
        rest = _filled(costs)
        spans = ((0, n),) if rest is None else _spans(rest[0], course.steps, ROOM, AS_WELL * rest[2])
        # Too little may be left for the step to be found at all, and yet it fits nowhere else.
        worst = max(worst, min(differing, max(float(told[low:high].sum()) for low, high in spans) / float(told.sum())))
    return worst


def _telling(costs: np.ndarray, frame: float, course: Course) -> np.ndarray:
    """The moments at which a frame more or less makes half the difference that it usually makes where people move, bool; `costs` are about
    the course's shift, with nothing unknown."""
    columns = np.full(len(costs), ROOM)
    for moment, change in course.steps:
        columns[moment:] += change
    near = np.stack([costs[np.arange(len(costs)), (columns + k).clip(0, 2 * ROOM)] for k in (-1, 0, 1)])
    return np.ptp(near, axis=0) >= STILL * frame


def _filled(costs: np.ndarray) -> tuple[np.ndarray, float, float, float] | None:
    """Costs with nothing unknown and no moment that counts for much, their usual value, and what a frame makes worse and by how much that
    scatters; None where they tell too little."""
    known = np.isfinite(costs)
    told = known[:, ROOM - 1 : ROOM + 2].all(axis=1)
    if told.sum() < 2 * LEAST_SEEN:
        return None
    # What cannot be told speaks neither for a course nor against it.
    filled = np.where(known, costs, costs[:, ROOM : ROOM + 1])
    rises = np.array([_rise(filled[part]) for part in np.array_split(np.flatnonzero(told), max(1, int(told.sum()) // PART))])
    frame = float(np.median(rises[:, 0]))
    if frame <= 0:
        return None
    usual = float(np.median(filled[told].min(axis=1)))
    filled = np.where(np.isfinite(filled), np.minimum(filled, usual + CAP * frame), usual)
    return filled, usual, frame, float(np.median(rises[:, 1])) * float(np.sqrt(told.sum()))


def _rise(costs: np.ndarray) -> tuple[float, float]:
    """How much worse the frame before or after the best is, over some moments, and by how much that scatters."""
    k = int(costs[:, 1:-1].mean(axis=0).argmin()) + 1
    steps = np.minimum(costs[:, k - 1], costs[:, k + 1]) - costs[:, k]
    means = costs[:, k - 1 : k + 2].mean(axis=0)
    return float(min(means[0], means[2]) - means[1]), float(np.std(steps))


def _drifting(costs: np.ndarray, now: float, charge: float) -> tuple[Course, float]:
    """The clock that fits best, and its gain."""
    moments = np.arange(len(costs))

    def cost(first: float, last: float) -> float:
        where = first + (last - first) * moments / (len(costs) - 1) + ROOM
        low = np.minimum(where.astype(int), 2 * ROOM - 1)
        part = where - low
        return float(((1 - part) * costs[moments, low] + part * costs[moments, low + 1]).sum())

    most = min(2 * ROOM, MOST_SLOPE * len(costs))
    wide = np.arange(-ROOM, ROOM + 1.0)
    tried = {(a, b): cost(a, b) for a in wide for b in wide if abs(b - a) <= most + 1}
    a, b = min(tried, key=tried.__getitem__)
    fine = np.arange(-1, 1.01, 0.125)
    tried = {(x, y): cost(x, y) for x in (a + fine).clip(-ROOM, ROOM) for y in (b + fine).clip(-ROOM, ROOM)}
    tried = {ends: value for ends, value in tried.items() if LEAST_DRIFT <= abs(ends[1] - ends[0]) <= most}
    if not tried:
        return Course(), -charge
    a, b = min(tried, key=tried.__getitem__)
    shift = round(a)
    return Course(shift, (), float(a - shift), float((b - a) / (len(costs) - 1))), now - tried[a, b] - charge


def _evenly(course: Course, costs: np.ndarray) -> Course | None:
    """The drift that steps stand for, where shifts of parts of the recording, to fractions of a frame, lie on a line rather than on steps.

    Costs rise evenly from the truth to either side, so that both sides tell where between two frames it is.
    """
    n = len(costs)
    told, shifts, steps = [], [], []
    places = course.frames(n) - np.arange(n)
    for part in np.array_split(np.arange(n), max(4, n // PART)):
        means = costs[part].mean(axis=0)
        k = int(means[1:-1].argmin()) + 1
        before, now, after = means[k - 1 : k + 2]
        there = places[part][places[part] > NONE // 2]
        if max(before, after) > now and len(there):
            told.append(float(part.mean()))
            shifts.append(k - ROOM + (before - after) / (2 * (max(before, after) - now)))
            steps.append(float(there.mean()))
    if len(told) < 4:
        return None
    slope, start = np.polyfit(told, shifts, 1)
    on_line = np.median(np.abs(np.array(shifts) - start - slope * np.array(told)))
    on_steps = np.median(np.abs(np.array(shifts) - steps))
    if abs(slope) > MOST_SLOPE or abs(slope) * n < LEAST_DRIFT or on_line > LINE * on_steps:
        return None
    shift = round(start)
    return Course(shift, (), float(start - shift), float(slope))


def _stepping(costs: np.ndarray, usual: float, frame: float, charge: float) -> tuple[Course, float]:
    """The dropped (and doubled) frames that fit best, and their gain.

    Dynamic programming over moments and shifts; between two steps there are `LEAST_SEEN` moments. A frame more than there was time for is
    charged double, since cameras hardly ever make one.
    """
    n, size = costs.shape
    least = int(LEAST_SEEN)
    sums = np.vstack([np.zeros(size), np.cumsum(costs, axis=0)])
    totals = np.full((n, size), np.inf)  # best until moment t, the last stretch being long enough
    began = np.zeros((n, size), int)  # the moment at which that stretch began
    change = np.zeros((n, size), int)  # and the step there
    for t in range(least - 1, n):
        start = t - least + 1
        if start == 0:
            totals[t], began[t], change[t] = sums[t + 1], 0, 0
            continue
        stretch = sums[t + 1] - sums[start]
        best, steps = np.full(size, np.inf), np.zeros(size, int)
        for m in range(1, MOST_DROPPED + 1):
            if start - 1 - m >= 0:
                dropped = totals[start - 1 - m][m:] + charge + m * (usual + frame)
                better = dropped < best[: size - m]
                best[: size - m][better], steps[: size - m][better] = dropped[better], -m
            doubled = totals[start - 1][: size - m] + 2 * charge
            better = doubled < best[m:]
            best[m:][better], steps[m:][better] = doubled[better], m
        longer = totals[t - 1] + costs[t]
        fresh = best + stretch < longer
        totals[t] = np.where(fresh, best + stretch, longer)
        began[t] = np.where(fresh, start, began[t - 1])
        change[t] = np.where(fresh, steps, change[t - 1])
    t, k = n - 1, int(totals[-1].argmin())
    gain = float(sums[-1, ROOM] - totals[t, k])
    found: list[tuple[int, int]] = []
    fits: list[float] = []
    while began[t, k] > 0:
        moment, step = int(began[t, k]), int(change[t, k])
        found.append((moment, step))
        fits.append(float(np.median(costs[moment : t + 1, k])))
        t, k = moment - 1 - max(0, -step), k - step
    fits.append(float(np.median(costs[: t + 1, k])))
    if max((abs(step) for _, step in found), default=0) >= MANY and max(fits) > usual + FITTING * frame:
        return Course(), -charge  # not in time anywhere: it is something else that is wrong there
    steps_found = tuple(reversed(found))
    return Course(shift=k - ROOM, steps=steps_found, spans=_spans(costs, steps_found, k, AS_WELL * frame)), gain


def _spans(costs: np.ndarray, steps: Sequence[tuple[int, int]], first: int, allowed: float) -> tuple[tuple[int, int], ...]:
    """The moments at which each step might be as well, between those beside it; `first` is the shift before them all, as a column."""
    spans = []
    ends = [0, *(moment for moment, _ in steps), len(costs)]
    k = first
    for number, (moment, change) in enumerate(steps, 1):
        worse = costs[:, k] - costs[:, k + change]  # of a moment that is taken for one before the step
        later = np.cumsum(worse[moment : ends[number + 1] - 1]) < allowed
        earlier = np.cumsum(-worse[ends[number - 1] + 1 : moment][::-1]) < allowed
        late, early = (len(row) if row.all() else int(np.argmin(row)) for row in (later, earlier))
        spans.append((moment - early, moment + late))
        k += change
    return tuple(spans)
