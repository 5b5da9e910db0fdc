"""How far a landmark can be trusted: the fit of `hmc.pose.trust_model`, and its calibration on recordings that had no part in it. Ours.

The model is fitted to half of the rendered recipes (`FIT`); all else is held out: the other recipes, and with ``--recordings`` any with a
truth, those of another renderer say. What is told of them is told by the coefficients that the package holds.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from sklearn.metrics import roc_auc_score

from hmc.experiments.chain_runs import FEW, name_of
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.inputs import rendered
from hmc.experiments.engine.style import COLORS
from hmc.experiments.trust_fit import Sample, fit_model, predict, sample_of, smallest_threshold
from hmc.experiments.trust_runs import BOTH, FAMILY, FIRST, SHUFFLED, VERSION, cell
from hmc.landmarks import TRUSTED
from hmc.pose.trust import FEATURES
from hmc.pose.trust_model import KINDS, ONE_PASS, TWO_PASSES, TrustModel

__all__ = ["EXPERIMENT", "FIT", "HELD_OUT"]

#: Recipes that the model is fitted to, and others; of each the first frame, how many, and with how many cameras (0: all).
FIT = {"jog": (0, 60, (0, FEW)), "pale": (0, 60, (0,)), "pick_up": (30, 75, (0, FEW)), "sit": (0, 75, (FEW,))}
HELD_OUT = {"gesture": (0, 60, (FEW,)), "crossing": (0, 60, (0,)), "throw_catch": (0, 60, (FEW,))}
#: Recipes that neither the model nor the choice of its features was made with or compared on; run where they are given.
UNSEEN = {"workbench": (0, 60, (0,)), "kick_turn": (0, 60, (0,)), "dance": (0, 60, (0,)), "close_seven": (0, 60, (0,))}
QUICK, QUICK_FRAMES = ("jog", "gesture"), 45
#: Of recordings that another program rendered, where they are given, and of all others, the same.
OTHER_RENDERER = {"r1": (0, 75, (FEW,)), "r2": (0, 75, (0,)), "r3": (0, 60, (0,)), "r4": (0, 100, (0, FEW))}
OTHER = (0, 75, (0, FEW))
#: Of landmarks that are trusted, as many are to be near the truth.
SHARE = 0.99
#: Edges of the bins of the reliability curve.
EDGES = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.98, 0.99, 1.0])
#: A bin of fewer landmarks is not drawn.
FEW_LANDMARKS = 50
#: How far trust and share may be apart, a mean over the landmarks, and the fit's coefficients from those that are held, by share.
MOST_APART, ROUNDING = 0.03, 0.01
FITTED, OURS, NEW, OTHERS = "fitted to", "held out, recipes", "held out, new recipes", "held out, others"
MODELS: Mapping[str, TrustModel] = {BOTH: TWO_PASSES, FIRST: ONE_PASS, SHUFFLED: TWO_PASSES}


def grid(plan: Plan) -> list[dict[str, Any]]:
    """Every recording with all or with four of its cameras, or both."""
    clips = FIT | HELD_OUT | UNSEEN | OTHER_RENDERER
    sources = plan.recordings or tuple(map(rendered, QUICK if plan.quick else FIT | HELD_OUT))
    cells = []
    for source in sources:
        start, frames, numbers = clips.get(source.name, OTHER)
        own = {"recording": source.label, "start": start, "frames": QUICK_FRAMES if plan.quick else frames, "repeat": 0}
        cells += [own | {"cameras": cameras} for cameras in numbers]
    return cells


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """The fit, a row a recording, and the reliability curve."""
    rows = [_row(one, way) for way in (BOTH, FIRST, SHUFFLED) for one in cells]
    groups = _groups(cells)
    curve = [{"poses": way, "recordings": group} | row for (way, group), own in groups.items() for row in _reliability(*_all_of(own, way))]
    tables = [
        Table(
            "trust",
            "Landmarks within 60 mm of the truth, all and those that are trusted: by recording, after both passes, after the first "
            f"alone, and of poses at wrong times. Trusted: {TRUSTED:g} or more.",
            rows,
        ),
        Table("trust-reliability", "Trust against the share of landmarks that is within 60 mm.", curve),
    ]
    fits = {way: _fit(cells, way) for way in (BOTH, FIRST)}
    fitted = {way: fit for way, fit in fits.items() if fit is not None}
    if fitted:
        coefficients = [row for way, (model, threshold) in fitted.items() for row in _coefficients(way, model, threshold)]
        tables.append(Table("trust-model", "The fit, and what hmc.pose.trust_model holds.", coefficients))
    return Report(tuple(tables), {"trust": _draw(groups)}, tuple(_claims(groups, fitted)))


def _sample(one: Cell, way: str, n_features: int | None = None) -> Sample:
    found = one.results[way]
    features, errors = (np.array(found[name], float) for name in ("features", "errors_m"))
    n = len(MODELS[way].weights) if n_features is None else n_features
    return sample_of(name_of(one), features.reshape(-1, 15, len(FEATURES)), errors.reshape(-1, 15), n)


def _group_of(one: Cell) -> str:
    name = name_of(one)
    return FITTED if name in FIT else OURS if name in HELD_OUT else NEW if name in UNSEEN else OTHERS


def _groups(cells: Sequence[Cell]) -> dict[tuple[str, str], list[Cell]]:
    """Cells by kind of poses and of recordings; poses at wrong times are of held-out recordings."""
    groups: dict[tuple[str, str], list[Cell]] = {}
    for way in (BOTH, FIRST, SHUFFLED):
        for group in (FITTED, OURS, NEW, OTHERS):
            own = [one for one in cells if _group_of(one) == group and len(_sample(one, way).near)]
            if own:
                groups[way, group] = own
    return groups


def _all_of(cells: Sequence[Cell], way: str) -> tuple[np.ndarray, np.ndarray]:
    """Trust in all landmarks of some cells, and which are near the truth."""
    samples = [_sample(one, way) for one in cells]
    trust = np.concatenate([np.zeros(0), *(predict(MODELS[way], one) for one in samples)])
    return trust, np.concatenate([np.zeros(0, bool), *(one.near for one in samples)])


def _row(one: Cell, way: str) -> dict[str, Any]:
    return {
        "recording": name_of(one),
        "cameras": one.results["cameras"],
        "role": _group_of(one),
        "poses": way,
        **_scores(*_all_of([one], way)),
    }


def _scores(trust: np.ndarray, near: np.ndarray) -> dict[str, Any]:
    good = trust >= TRUSTED
    both = bool(near.any() and not near.all())
    return {
        "landmarks": len(near),
        "within_60_percent": _percent(near),
        "trusted_percent": _percent(good),
        "trusted_within_60_percent": _percent(near[good]),
        "doubtful_within_60_percent": _percent(near[~good]),
        "AUC": float(roc_auc_score(near, trust)) if both else None,
        "mean_trust_percent": _percent(trust),
    }


def _percent(values: np.ndarray) -> float | None:
    return float(100 * values.mean()) if len(values) else None


def _bins(trust: np.ndarray) -> np.ndarray:
    return np.clip(np.searchsorted(EDGES, trust, side="right") - 1, 0, len(EDGES) - 2)


def _reliability(trust: np.ndarray, near: np.ndarray) -> list[dict[str, Any]]:
    """A row a bin: mean trust, share that is near, and how many landmarks there are."""
    bins = _bins(trust)
    rows = []
    for k in np.unique(bins).tolist():
        own = bins == k
        rows.append(
            {
                "from": float(EDGES[k]),
                "to": float(EDGES[k + 1]),
                "landmarks": int(own.sum()),
                "trust_percent": _percent(trust[own]),
                "within_60_percent": _percent(near[own]),
            }
        )
    return rows


def _apart(trust: np.ndarray, near: np.ndarray) -> float:
    """How far trust is from the share that is near, a mean over the landmarks, bin by bin."""
    rows = _reliability(trust, near)
    return sum(row["landmarks"] * abs(row["trust_percent"] - row["within_60_percent"]) for row in rows) / (100 * len(trust))


def _fit(cells: Sequence[Cell], way: str) -> tuple[TrustModel, float] | None:
    """The model of the recordings of `FIT`, and the smallest threshold from which on `SHARE` of their landmarks are near; None without them
    all."""
    own = [one for one in cells if _group_of(one) == FITTED]
    if {name_of(one) for one in own} < set(FIT):
        return None
    n_features = len(MODELS[way].weights)
    samples, garbage = ([one for one in (_sample(one, kind, n_features) for one in own) if len(one.near)] for kind in (way, SHUFFLED))
    if not samples:
        return None
    model = fit_model(samples, garbage)
    trust, near = (np.concatenate(values) for values in zip(*((predict(model, one), one.near) for one in samples), strict=True))
    return model, smallest_threshold(trust, near, SHARE)


def _coefficients(way: str, model: TrustModel, threshold: float) -> list[dict[str, Any]]:
    held = MODELS[way]
    names = [*(f"intercept, {kind}" for kind in KINDS), *FEATURES[: len(model.weights)]]
    found, kept = (model.intercepts + model.weights, held.intercepts + held.weights)
    rows = [{"poses": way, "coefficient": name, "fit": new, "held": old} for name, new, old in zip(names, found, kept, strict=True)]
    return [*rows, {"poses": way, "coefficient": "threshold", "fit": threshold, "held": TRUSTED}]


def _claims(groups: Mapping, fitted: Mapping[str, tuple[TrustModel, float]]) -> Iterator[Claim]:
    for way, (model, _) in fitted.items():
        new, old = (np.array(one.intercepts + one.weights) for one in (model, MODELS[way]))
        worst = float(np.max(np.abs(new - old) / np.maximum(np.abs(old), 1)))
        yield Claim(f"{way}: the coefficients held are those of the fit", worst < ROUNDING, f"apart by {worst:.2g} of their size at most")
    for group in (OURS, NEW, OTHERS):
        for way in (BOTH, FIRST):
            if (way, group) not in groups:
                continue
            trust, near = _all_of(groups[way, group], way)
            scores, apart = _scores(trust, near), _apart(trust, near)
            within = scores["trusted_within_60_percent"]
            detail = (
                f"{within or 0:.2f} % of the {scores['trusted_percent']:.1f} % that are trusted, {scores['within_60_percent']:.1f} % of all"
            )
            yield Claim(f"{group}, {way}: {SHARE:.0%} of what is trusted is within 60 mm", bool((within or 0) >= 100 * SHARE), detail)
            yield Claim(f"{group}, {way}: trust and share are {MOST_APART:g} apart at most", apart <= MOST_APART, f"{apart:.4f}")
        if (SHUFFLED, group) in groups:
            trust, near = _all_of(groups[SHUFFLED, group], SHUFFLED)
            sound = _scores(*_all_of(groups[BOTH, group], BOTH))["trusted_percent"]
            few, close = (_scores(trust, near)[name] for name in ("trusted_percent", "within_60_percent"))
            detail = f"{few:.1f} %, of those as they are {sound:.1f} %; {close:.1f} % are near the truth all the same"
            yield Claim(f"{group}: of poses at wrong times half as many are trusted at most", 2 * few <= sound, detail)


def _draw(groups: Mapping[tuple[str, str], Sequence[Cell]]) -> plt.Figure:
    """The reliability curve, with how many landmarks there are in each bin below."""
    shades = {FITTED: COLORS["naive"], OURS: COLORS["particle"], NEW: COLORS["person"], OTHERS: COLORS["sparse"]}
    figure, axes = plt.subplots(2, 2, figsize=(7.5, 4.2), sharex="col", height_ratios=(3, 1))
    for column, way in enumerate((BOTH, FIRST)):
        above, below = axes[:, column]
        above.plot([0, 100], [0, 100], ":", color=COLORS["paper"], linewidth=0.8)
        for k, group in enumerate((FITTED, OURS, NEW, OTHERS)):
            if (way, group) not in groups:
                continue
            rows = _reliability(*_all_of(groups[way, group], way))
            drawn = [row for row in rows if row["landmarks"] >= FEW_LANDMARKS]
            trust, near = ([row[name] for row in drawn] for name in ("trust_percent", "within_60_percent"))
            above.plot(trust, near, "o-", color=shades[group], label=group)
            places = [50 * (row["from"] + row["to"]) + 1.2 * (k - 1.5) for row in rows]
            below.bar(places, [row["landmarks"] for row in rows], 1.2, color=shades[group])
        above.axvline(100 * TRUSTED, color=COLORS["paper"], linewidth=0.8)
        above.set(title=way, ylabel="within 60 mm (%)" if not column else "", ylim=(0, 102), xlim=(0, 101))
        below.set(yscale="log", xlabel="trust (%)", ylabel="landmarks" if not column else "")
        above.legend(loc="upper left")
    return figure


EXPERIMENT = Experiment(
    "trust",
    "how far a landmark can be trusted",
    "ours; docs/accuracy.md",
    grid,
    cell,
    report,
    FAMILY,
    VERSION,
)
