"""By how much later one microphone heard what another heard, by onsets of sound in several bands.

Onsets (where a band grows louder) say when, whatever a microphone's color and distance do to what is heard. Their cross-correlation has one
peak where both heard the same, and many low ones where they did not: how far the highest stands above all others is how sure it is.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy import fft, signal

__all__ = ["ONSETS_HZ", "Heard", "heard_later", "onsets"]

#: Bands of sound, Hz: below is wind and hum.
BANDS_HZ = ((200, 450), (450, 900), (900, 1800), (1800, 3600))
#: Onsets a second, and over how much of it loudness is taken, in onsets.
ONSETS_HZ, SMOOTH = 400, 9
#: Loudness below this share of the loudest is silence: 60 dB, and as much of full scale.
SILENCE = 1e-3
#: Peaks as near as this to the highest belong to it (echoes), seconds.
NEAR_S = 0.08
#: A peak is believed when it is so many times as high as any other, so many deviations above the rest, ...
LEAST_RATIO, LEAST_DEVIATIONS = 1.5, 8.0
#: ... made of so many events at least (a single bang may be another one), each this long, seconds, ...
LEAST_EVENTS, EVENT_S = 3.0, 0.05
#: ... and when both were heard at the same time for so long, seconds.
LEAST_COMMON_S = 1.5
#: Windows along a recording by which a clock that runs differently is found, and by how much any clock does.
WINDOW_S, STEP_S, MOST_SLOPE = 10.0, 5.0, 0.005
#: Windows lie this near to a line, seconds, and so many of those that tell anything do.
ON_LINE_S, LEAST_ON_LINE, LEAST_WINDOWS = 0.015, 0.7, 3


class Heard(NamedTuple):
    """How much later a sound is in the second track than in the first.

    Parameters
    ----------
    begin_s : float
        At the beginning of the first track, seconds.
    slope : float
        Seconds a second that this grows by; 0 where windows do not tell.
    ratio : float
        How many times as high as any other peak of the correlation.
    """

    begin_s: float
    slope: float
    ratio: float


def onsets(pieces: Iterable[np.ndarray], rate: int) -> np.ndarray:
    """Where each band grows louder.

    Parameters
    ----------
    pieces : iterable of ndarray, shape (n,)
        Sound that follows one another.
    rate : int
        Samples a second; a multiple of `ONSETS_HZ`.

    Returns
    -------
    ndarray of float32, shape (n, 4)
        `ONSETS_HZ` a second, of no unit; empty where there is no sound or silence alone.
    """
    filters = [signal.butter(2, band, "bandpass", fs=rate, output="sos") for band in BANDS_HZ]
    states = [np.zeros((len(sos), 2)) for sos in filters]
    hop = rate // ONSETS_HZ
    left = np.zeros(0, np.float32)
    loud: list[np.ndarray] = []
    for piece in pieces:
        piece = np.concatenate([left, piece])
        whole = len(piece) // hop * hop
        piece, left = piece[:whole], piece[whole:]
        powers = []
        for k, sos in enumerate(filters):
            heard, states[k] = signal.sosfilt(sos, piece, zi=states[k])
            powers.append((heard.reshape(-1, hop) ** 2).mean(axis=1))
        loud.append(np.stack(powers, axis=1))
    power = np.concatenate(loud) if loud else np.zeros((0, len(BANDS_HZ)))
    if not len(power) or power.max() <= SILENCE**2 * 1e-2:
        return np.zeros((0, len(BANDS_HZ)), np.float32)
    window = np.hanning(SMOOTH + 2)[1:-1, None]
    power = signal.fftconvolve(power, window / window.sum(), "same", axes=0).clip(0)
    level = np.log(np.maximum(power, SILENCE**2 * power.max(axis=0)) + 1e-20)
    rise = np.zeros_like(level)
    step = SMOOTH // 2
    rise[step:] = np.maximum(level[step:] - level[:-step], 0)
    return rise.astype(np.float32)


def heard_later(first: np.ndarray, second: np.ndarray, search_s: float) -> Heard | None:
    """How much later the second track has what the first has.

    Parameters
    ----------
    first, second : ndarray, shape (n, bands) and (m, bands)
        As from `onsets`.
    search_s : float
        At most so much either way, seconds.

    Returns
    -------
    Heard or None
        None where nothing stands out: other sounds, silence, what repeats itself evenly, or a single bang.
    """
    whole = _lag(first, second, search_s)
    size, step = round(WINDOW_S * ONSETS_HZ), round(STEP_S * ONSETS_HZ)
    told = []
    for begin in range(0, max(1, len(first) - size + 1), step):
        one = _lag(first[begin : begin + size], second, search_s + begin / ONSETS_HZ, begin)
        if one is not None and abs(one[0]) <= search_s:
            told.append((begin / ONSETS_HZ + WINDOW_S / 2, *one))
    line = _line(np.array(told)) if len(told) >= LEAST_WINDOWS else None
    if line is not None:
        return line
    if whole is None or (len(told) >= LEAST_WINDOWS and np.median(np.abs(np.array(told)[:, 1] - whole[0])) > NEAR_S):
        return None
    return Heard(whole[0], 0.0, whole[1])


def _line(told: np.ndarray) -> Heard | None:
    """The line on which windows lie, rows (middle, lag, ratio); None where they do not, or it is too steep."""
    i, j = np.triu_indices(len(told), 1)
    slope = float(np.median((told[j, 1] - told[i, 1]) / (told[j, 0] - told[i, 0])))
    begin = float(np.median(told[:, 1] - slope * told[:, 0]))
    near = np.abs(told[:, 1] - begin - slope * told[:, 0]) <= ON_LINE_S
    if abs(slope) > MOST_SLOPE or near.sum() < LEAST_WINDOWS or near.mean() < LEAST_ON_LINE:
        return None
    slope, begin = (float(value) for value in np.polyfit(told[near, 0], told[near, 1], 1))
    return Heard(begin, slope, float(np.median(told[near, 2])))


def _lag(first: np.ndarray, second: np.ndarray, search_s: float, begin: int = 0) -> tuple[float, float] | None:
    """By how much later the second has what the first has, which begins so late, and how many times as high as any other the peak is."""
    n, m = len(first), len(second)
    least = round(LEAST_COMMON_S * ONSETS_HZ)
    if min(n, m) < least:
        return None
    first, second = (_even(one) for one in (first, second))
    size = fft.next_fast_len(n + m, real=True)
    product = np.conj(fft.rfft(first, size, axis=0)) * fft.rfft(second, size, axis=0)
    both = fft.irfft(product.sum(axis=1), size)
    lags = np.arange(-(n - 1), m)
    common = np.minimum(m, lags + n) - np.maximum(0, lags)
    kept = (np.abs(lags - begin) <= round(search_s * ONSETS_HZ)) & (common >= least)
    if kept.sum() < 3:
        return None
    # Fewer products scatter less: all lags are weighed as if they had as many.
    lags, values = lags[kept], both[lags[kept] % size] / np.sqrt(common[kept])
    k = int(values.argmax())
    rest = values[np.abs(lags - lags[k]) > round(NEAR_S * ONSETS_HZ)]
    if not len(rest) or values[k] <= 0:
        return None
    spread = 1.4826 * float(np.median(np.abs(rest - np.median(rest))))
    ratio = float(values[k] / max(rest.max(), 1e-12))
    if ratio < LEAST_RATIO or values[k] - np.median(rest) < LEAST_DEVIATIONS * spread or spread <= 0:
        return None
    if _events(first, second, int(lags[k])) < LEAST_EVENTS:
        return None
    part = 0.0
    if 0 < k < len(values) - 1 and (bend := values[k - 1] - 2 * values[k] + values[k + 1]) < 0:
        part = float(np.clip((values[k - 1] - values[k + 1]) / (2 * bend), -0.5, 0.5))
    return (float(lags[k]) + part - begin) / ONSETS_HZ, ratio


def _even(rises: np.ndarray) -> np.ndarray:
    """Bands that count alike, about a mean of 0."""
    rises = rises - rises.mean(axis=0)
    return rises / np.maximum(np.sqrt((rises**2).mean(axis=0)), 1e-6)


def _events(first: np.ndarray, second: np.ndarray, lag: int) -> float:
    """Of how many events, as if of one strength, a peak is made (inverse participation ratio of their products)."""
    low, high = max(0, -lag), min(len(first), len(second) - lag)
    products = (first[low:high] * second[low + lag : high + lag]).sum(axis=1)
    size = round(EVENT_S * ONSETS_HZ)
    sums = np.add.reduceat(products, np.arange(0, len(products), size)).clip(0)
    return float(sums.sum() ** 2 / max((sums**2).sum(), 1e-12))
