"""Truncated draws against SciPy's, systematic resampling against a loop. Row 6 of README.md.

python benchmarks/bench_montecarlo.py
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from _timing import interleaved, report
from scipy import stats

from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.pose.steps.presets import drift
from hmc.search import find_beta, systematic, truncated_normal


def loop(rng, weights, n):
    """Algorithm 2 as printed, from an array to an array; over a list in between, which Python walks quicker."""
    weights = weights.tolist()
    start, j, cumulative, out = rng.random() / n, 0, weights[0], []
    for i in range(n):
        while start + i / n > cumulative:
            j += 1
            cumulative += weights[j]
        out.append(j)
    return np.array(out)


def main() -> int:
    rng, body, good = np.random.default_rng(0), default_body(1.75), True
    low, high = body.limits.low, body.limits.high
    mean = truncated_normal(rng, np.tile(neutral_state("down", body.limits), (600, 1)), drift(30), low, high)
    sd = np.broadcast_to(drift(30), mean.shape)
    a, b = (low - mean) / sd, (high - mean) / sd
    times = interleaved(
        {
            "ours": lambda: truncated_normal(rng, mean, sd, low, high),
            "scipy": lambda: stats.truncnorm.rvs(a, b, loc=mean, scale=sd, random_state=rng),
        }
    )
    note = f"{times['ours'] * 1e3:.2f} ms"
    good &= report("6", "truncated draw / scipy.stats.truncnorm.rvs, 600 x 27", times["ours"] / times["scipy"], 0.25, note=note)
    for n in (600, 5000):
        weights = rng.gamma(0.3, 1, n)
        weights /= weights.sum() * (1 - 1e-12)  # the loop must not run past the end by rounding
        times = interleaved(
            {"ours": lambda w=weights, n=n: systematic(rng, w, n), "loop": lambda w=weights, n=n: loop(rng, w, n)}, rounds=101
        )
        note = f"{times['ours'] * 1e6:.0f} us"
        good &= report("6", f"systematic resampling / Python loop, {n} particles", times["ours"] / times["loop"], 0.2, note=note)
    log_likelihood = -rng.gamma(3, 5, 600)
    seconds = interleaved({"beta": lambda: find_beta(log_likelihood, 0.5)}, rounds=101)["beta"]
    print(f"     annealing rate of 600 particles: {seconds * 1e6:.0f} us in {find_beta(log_likelihood, 0.5)[1].evaluations} evaluations")
    return 0 if good else 1


if __name__ == "__main__":
    raise SystemExit(main())
