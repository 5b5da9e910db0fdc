"""The works behind methods and trackers, as text and as BibTeX: what to cite of what was run.

>>> [work.key for work in works_of("shbm-apf")]
['canton2009', 'deutscher2005']
>>> [work.key for work in works_of("smd", preset="kehl2006")]
['kehl2006']
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hmc import __version__
from hmc.errors import InputError

__all__ = ["SOFTWARE", "WORKS", "Work", "bibtex", "known_names", "works_in", "works_of", "works_of_run"]


@dataclass(frozen=True)
class Work:
    """A work to cite.

    Parameters
    ----------
    key : str
        Of its BibTeX entry.
    kind : str
        Of its BibTeX entry, as "article".
    fields : mapping of str to str
        Of its BibTeX entry, in the order in which they are written.
    text : str
        The reference in plain words.
    names : tuple of str
        How sources in the registries call it.
    """

    key: str
    kind: str
    fields: Mapping[str, str]
    text: str
    names: tuple[str, ...] = ()


SOFTWARE = Work(
    "hmc",
    "software",
    {
        "author": "{The hmc authors}",
        "title": "hmc: markerless human motion capture from calibrated videos",
        "version": __version__,
        "license": "BSD-3-Clause",
    },
    f"The hmc authors: hmc: markerless human motion capture from calibrated videos, version {__version__}.",
)

WORKS: dict[str, Work] = {
    work.key: work
    for work in (
        Work(
            "canton2009",
            "phdthesis",
            {
                "author": "Canton Ferrer, Cristian",
                "title": "Human Motion Capture with Scalable Body Models",
                "school": "Universitat Polit{\\`e}cnica de Catalunya",
                "year": "2009",
            },
            "C. Canton Ferrer: Human Motion Capture with Scalable Body Models. PhD thesis, Universitat Politècnica de Catalunya, 2009.",
            ("Canton (2009)",),
        ),
        Work(
            "deutscher2005",
            "article",
            {
                "author": "Deutscher, Jonathan and Reid, Ian",
                "title": "Articulated Body Motion Capture by Stochastic Search",
                "journal": "International Journal of Computer Vision",
                "volume": "61",
                "number": "2",
                "pages": "185--205",
                "year": "2005",
            },
            "J. Deutscher, I. Reid: Articulated body motion capture by stochastic search. International Journal of Computer Vision 61(2), "
            "185-205, 2005.",
            ("Deutscher and Reid (2005)",),
        ),
        Work(
            "hsiao2008",
            "mastersthesis",
            {
                "author": "Hsiao, Ching-Chun",
                "title": "Model-Based Pose Estimation for Multi-Camera Motion Capture System",
                "school": "National Chiao Tung University",
                "year": "2008",
            },
            "C.-C. Hsiao: Model-Based Pose Estimation for Multi-Camera Motion Capture System. Master's thesis, National Chiao Tung "
            "University, 2008.",
            ("Hsiao (2008)",),
        ),
        Work(
            "kehl2006",
            "article",
            {
                "author": "Kehl, Roland and Van Gool, Luc",
                "title": "Markerless Tracking of Complex Human Motions from Multiple Views",
                "journal": "Computer Vision and Image Understanding",
                "volume": "104",
                "pages": "190--209",
                "year": "2006",
            },
            "R. Kehl, L. Van Gool: Markerless tracking of complex human motions from multiple views. Computer Vision and Image "
            "Understanding 104, 190-209, 2006.",
            ("Kehl and Van Gool (2006)", "Kehl (2006)"),
        ),
    )
}

#: What methods and trackers of the package rest on, where the text of their source does not say all of it.
_ANNEALED = ("canton2009", "deutscher2005")
_BEHIND: dict[str, tuple[str, ...]] = {
    "apf": _ANNEALED,
    "shbm-apf": _ANNEALED,
    "ddm-apf": _ANNEALED,
    "shbm-ddm-apf": _ANNEALED,
    "marker-apf": _ANNEALED,
}


def works_in(source: str) -> list[Work]:
    """The works that the text of a source names, in the order of `WORKS`."""
    return [work for work in WORKS.values() if any(name in source for name in work.names)]


def known_names() -> list[str]:
    """Everything that may be cited by its name: works, methods, presets and trackers."""
    from hmc.pose.registry import METHODS
    from hmc.tracking.trackers import TRACKERS

    return list(dict.fromkeys([*METHODS, *TRACKERS, *WORKS, "hmc"]))


def works_of(name: str, preset: str = "default") -> list[Work]:
    """The works behind a method, a tracker, or a preset that bears a work's name.

    Parameters
    ----------
    name : str
        Of a pose method, of a tracker, or of a preset or work as "kehl2006".
    preset : str
        Of a method.

    Returns
    -------
    list of Work
        Those behind it, in the order of `WORKS`; empty for what is no work's, as the method "keypoints".

    Raises
    ------
    InputError
        When there is no such name, or the method has no such preset.
    """
    from hmc.pose.registry import METHODS, pose_method
    from hmc.tracking.trackers import TRACKERS

    if name in WORKS:
        return [WORKS[name]]
    if name == "hmc":
        return []
    if name in METHODS:
        named = works_in(pose_method(name, preset).source)
        keys = {*_BEHIND.get(name, ()), *(work.key for work in named)}
        return [work for work in WORKS.values() if work.key in keys]
    if name in TRACKERS:
        return works_in(TRACKERS[name].source)
    near = difflib.get_close_matches(name, known_names(), 1, 0.5)
    hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(known_names())}"
    raise InputError(f"{name!r} is no method, tracker or work, nor the folder of a result; {hint}")


def works_of_run(run: Mapping[str, Any], file: str | Path = "run.toml") -> list[Work]:
    """The works behind a result, by its `run.toml`: method, preset, and tracker where one was used.

    Methods of your own are known by the works that their source names, if they are registered.

    Parameters
    ----------
    run : mapping
    file : str or Path
        Where it was read from, for messages.

    Raises
    ------
    InputError
        When it names no method, or one that is not known.
    """
    from hmc.tracking.trackers import DEFAULT

    if "method" not in run:
        raise InputError(f"{file}: names no method; give the folder of a result of `hmc track` or `hmc pose`")
    options, method = run.get("options", {}), str(run["method"])
    if options.get("command") == "track":
        return works_of(method)
    named = works_of(method, str(options.get("preset", "default")))
    if not (options.get("cues") == "keypoints" or options.get("tracks") or method in ("keypoints", "marker-apf")):
        named = [*named, *works_of(str(options.get("tracker", DEFAULT)))]
    return _each_once(named)


def _each_once(works: Iterable[Work]) -> list[Work]:
    keys = {work.key for work in works}
    return [work for work in WORKS.values() if work.key in keys]


def bibtex(work: Work) -> str:
    """The BibTeX entry of a work."""
    body = ",\n".join(f"  {name} = {{{value}}}" for name, value in work.fields.items())
    return f"@{work.kind}{{{work.key},\n{body}\n}}"
