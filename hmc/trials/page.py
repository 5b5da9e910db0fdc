"""A session's report: one page that needs nothing beside it. Pictures lie in it, nothing is fetched, nothing is run."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import cv2
import numpy as np

from hmc.errors import InputError
from hmc.io.result_files import BESIDE, RESULT
from hmc.trials.curves import curves_svg
from hmc.trials.quality import TrialResult, read_trial_result, trust_line
from hmc.trials.session_file import Session, Trial
from hmc.trials.state import DONE, FAILED, TrialState, read_state

__all__ = ["CHECK_PICTURE", "MOMENTS_FOLDER", "VIDEO", "problems_of", "session_page"]

#: In a trial's folder.
CHECK_PICTURE, MOMENTS_FOLDER, VIDEO = "check.png", "moments", "overlay.mp4"
#: Files of a trial to which the page links, where they are there.
LINKED = (*RESULT, *BESIDE, VIDEO, CHECK_PICTURE, "log.txt")
#: Width of the rig's picture, pixels.
RIG_PX, RIG_QUALITY = 1500, 82
_LEGEND = (
    "Cost: what the method minimises, mean over persons and frames; smaller is better, and it compares trials of one method and preset "
    "only. Trusted: share of the landmarks that are not doubtful (trust in joints.csv; where it is not known, two views or more). Time: "
    "that of the run which finished the trial."
)
_MOMENTS_LEGEND = (
    "Left limbs orange, right blue, the trunk in the person's color, the body's flesh as a thin outline; broken lines without white dots: "
    "doubtful."
)
_CURVES_LEGEND = "Curves of knees and elbows are pale where they rest on a landmark that is doubtful (its trust in joints.csv)."
_CHIP = {DONE: "good", FAILED: "bad"}

_STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; color: #1c2430; background: #fff; margin: 0; }
main { max-width: 1080px; margin: 0 auto; padding: 1.25rem 1rem 3rem; }
h1 { font-size: 1.7rem; margin: 0 0 .4rem; } h2 { font-size: 1.25rem; margin: 1.8rem 0 .5rem; }
p, ul { margin: .4rem 0; max-width: 85ch; } ul { padding-left: 1.2rem; } .small { font-size: .86rem; color: #566072; }
table { border-collapse: collapse; width: 100%; font-size: .92rem; margin: .5rem 0; }
th, td { padding: .3rem .6rem; border-bottom: 1px solid #e3e7ee; text-align: left; vertical-align: top; }
th { border-bottom: 2px solid #b9c2d0; font-weight: 600; }
.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.chip { border-radius: 1rem; padding: .05rem .6rem; font-size: .82rem; white-space: nowrap; }
.good { background: #d9f0df; color: #14532d; } .bad { background: #fbdcd8; color: #7a1508; } .open { background: #e9ecf1; color: #475063; }
section { border-top: 1px solid #d4dae4; margin-top: 1.4rem; }
.moments { display: grid; grid-template-columns: repeat(6, 1fr); gap: .4rem; margin: .6rem 0; }
figure { margin: 0; } figcaption { font-size: .8rem; color: #566072; }
img { max-width: 100%; height: auto; display: block; } .curves { width: 100%; max-width: 820px; margin: .4rem 0; }
a { color: #1f4f9c; }
@media screen and (max-width: 640px) {
  .wide { overflow-x: auto; } .wide .rig { max-width: none; width: 1200px; } .wide .curves { max-width: none; width: 640px; }
  .wide::before { content: "wider than this screen: slide it sideways"; position: sticky; left: 0; font-size: .8rem; color: #566072; }
  .moments { grid-template-columns: repeat(3, 1fr); }
  .trials thead { display: none; } .trials, .trials tbody, .trials tr, .trials td { display: block; }
  .trials tr { border: 1px solid #d4dae4; border-radius: .5rem; margin: .6rem 0; padding: .3rem .2rem; }
  .trials td { display: flex; justify-content: space-between; gap: 1rem; border: 0; padding: .12rem .6rem; text-align: right; }
  .trials td::before { content: attr(data-label); color: #566072; text-align: left; }
}
@media print {
  body { font-size: 10pt; } main { max-width: none; padding: 0; } a { color: inherit; text-decoration: none; }
  section { break-before: page; border: 0; margin: 0; } tr, figure, img { break-inside: avoid; }
  .good, .bad, .open { border: 1px solid #889; background: none; } .curves { max-width: 15cm; }
}
"""


@dataclass(frozen=True)
class _Row:
    """A trial with what there is of it."""

    trial: Trial
    folder: Path
    state: TrialState
    result: TrialResult | None

    @property
    def anchor(self) -> str:
        return f"trial-{self.trial.name}".replace(" ", "-")

    @property
    def names(self) -> dict[int, str]:
        """Who is who, by number: known where one person is in the trial, and one was found."""
        found = [] if self.result is None else np.unique(self.result.poses.persons).tolist()
        return {found[0]: self.trial.persons[0].name} if len(found) == len(self.trial.persons) == 1 else {}

    @property
    def problems(self) -> list[str]:
        return problems_of(self.state, self.result)


def session_page(session: Session, out: Path) -> str:
    """The page of all trials, as far as they are.

    Parameters
    ----------
    session : Session
    out : Path
        Folder of the results, in which the page will lie: links lead from there.

    Returns
    -------
    str
        HTML.
    """
    rows = [_row(trial, out) for trial in session.trials]
    done = sum(row.state.status == DONE for row in rows)
    failed = sum(row.state.status == FAILED for row in rows)
    rest = len(rows) - done - failed
    counts = f"{len(rows)} trials: {done} done" + f", {failed} failed" * bool(failed) + f", {rest} not finished" * bool(rest) + "."
    body = [f"<h1>{escape(session.name)}</h1>", f"<p>{counts}</p>", _table(rows)]
    body.append(f'<p class="small">{_LEGEND}</p>')
    body += _rig(rows)
    for row in rows:
        body += ["<section>", *_trial(row), "</section>"]
    versions: Mapping[str, str] = next((row.result.run.get("versions", {}) for row in rows if row.result is not None), {})
    body.append(f'<p class="small">{escape(", ".join(f"{name} {version}" for name, version in versions.items()))}</p>')
    viewport = '<meta name="viewport" content="width=device-width, initial-scale=1">'
    head = f'<meta charset="utf-8">\n{viewport}\n<title>{escape(session.name)}</title>'
    lines = ["<!DOCTYPE html>", '<html lang="en">', f"<head>\n{head}\n<style>{_STYLE}</style>\n</head>", "<body>", "<main>", *body]
    return "\n".join([*lines, "</main>", "</body>", "</html>"]) + "\n"


def problems_of(state: TrialState, result: TrialResult | None) -> list[str]:
    """Why a trial failed, what the check warns of, and what the run survived, a line each."""
    told = [line for line in state.findings if not line.startswith("note: ") and line.partition(": ")[2] not in state.fault]
    ran = [] if result is None else result.problems
    return [state.fault] * bool(state.fault) + told + [line for line in ran if not any(one.endswith(line) for one in told)]


def _row(trial: Trial, out: Path) -> _Row:
    folder = out / trial.name
    try:
        state = read_state(folder)
        return _Row(trial, folder, state, read_trial_result(folder))
    except InputError as error:  # a damaged file is told in its place, not in place of the page
        return _Row(trial, folder, TrialState(FAILED, str(error)), None)


def _table(rows: Sequence[_Row]) -> str:
    names = ("trial", "status", "frames", "persons", "problems", "mean cost", "trusted", "time")
    lines = [
        f'<table class="trials"><thead><tr>{"".join(_cell(name, name, k > 1, "th") for k, name in enumerate(names))}</tr></thead><tbody>'
    ]
    for row in rows:
        result = row.result
        link = f'<a href="#{escape(row.anchor, quote=True)}">{escape(row.trial.name)}</a>'
        values = [link, _chip(row.state.status), "", "", str(len(row.problems)), "", "", _seconds(row.state)]
        if result is not None:
            values[2], values[3] = str(result.n_frames), str(result.n_persons)
            values[5] = _number(result.mean_cost, "{:.2e}")
            values[6] = _number(100 * result.sound_share, "{:.0f} %")
        cells = (_cell(value, name, k > 1) for k, (name, value) in enumerate(zip(names, values, strict=True)))
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return "\n".join([*lines, "</tbody></table>"])


def _cell(text: str, name: str, number: bool, tag: str = "td") -> str:
    kind = ' class="n"' if number else ""
    label = f' data-label="{name}"' if tag == "td" else ""
    return f"<{tag}{kind}{label}>{text}</{tag}>"


def _rig(rows: Sequence[_Row]) -> Iterator[str]:
    """The check's picture of the first trial that has one."""
    for row in rows:
        image = cv2.imread(str(row.folder / CHECK_PICTURE)) if (row.folder / CHECK_PICTURE).is_file() else None
        if image is not None:
            factor = min(1.0, RIG_PX / image.shape[1])
            image = cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
            data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, RIG_QUALITY])[1].tobytes()
            yield f"<h2>The rig</h2>\n{_wide(_image(data, 'jpeg', 'the room from above, and what each camera sees', 'rig'))}"
            yield f'<p class="small">As <code>hmc check</code> has it for {escape(row.trial.name)}.</p>'
            return


def _trial(row: _Row) -> Iterator[str]:
    trial, result = row.trial, row.result
    yield f'<h2 id="{escape(row.anchor, quote=True)}">{escape(trial.name)} {_chip(row.state.status)}</h2>'
    if trial.persons:
        yield f"<p>With {escape(', '.join(map(str, trial.persons)))}.</p>"
    if result is not None:
        known = np.isfinite(result.poses.positions).all(axis=(1, 2))
        fitted = [f"a pose in {100 * known.mean():.0f} % of their frames"] if len(known) else []
        lines = "; ".join([*result.lines(row.names), *fitted, *trust_line(result.poses, row.names)])
        yield f"<p>{result.n_frames} frames, {result.fps:g} a second: {escape(lines)}.</p>"
    if row.problems:
        yield "<ul>"
        yield from (f"<li>{escape(line)}</li>" for line in row.problems)
        yield "</ul>"
    if result is not None:
        yield from _pictures(row, result)
    linked = [name for name in LINKED if (row.folder / name).is_file()]
    folder = _path(trial.name)
    if linked:
        yield "<p>" + " &middot; ".join(f'<a href="{folder}/{name}">{name}</a>' for name in linked) + "</p>"


def _pictures(row: _Row, result: TrialResult) -> Iterator[str]:
    pictures = sorted((row.folder / MOMENTS_FOLDER).glob("*.jpg"))
    if pictures:
        yield '<div class="moments">'
        for picture in pictures:
            when = f"{int(picture.stem) / result.fps:.2f} s"
            yield f"<figure>{_image(picture.read_bytes(), 'jpeg', when)}<figcaption>{when}, frame {int(picture.stem)}</figcaption></figure>"
        yield f'</div><p class="small">{_MOMENTS_LEGEND}</p>'
    if result.n_persons:
        words = "speed of the centroid, how far knees and elbows are bent, and cost over time"
        yield _wide(_image(curves_svg(result).encode(), "svg+xml", words, "curves"))
        yield f'<p class="small">{_CURVES_LEGEND}</p>'


def _image(data: bytes, kind: str, words: str, style: str = "") -> str:
    text = base64.b64encode(data).decode("ascii")
    return f'<img{f" class={style!r}" if style else ""} alt="{escape(words, quote=True)}" src="data:image/{kind};base64,{text}">'


def _wide(image: str) -> str:
    """A picture whose letters would be too small to read at the width of a phone: there it is slid sideways, by a finger or by keys."""
    return f'<div class="wide" tabindex="0">{image}</div>'


def _chip(status: str) -> str:
    return f'<span class="chip {_CHIP.get(status, "open")}">{escape(status)}</span>'


def _number(value: float, form: str) -> str:
    return form.format(value) if np.isfinite(value) else ""


def _seconds(state: TrialState) -> str:
    total = sum(state.seconds.values())
    return f"<time>{total:.0f} s</time>" if total else ""


def _path(name: str) -> str:
    from urllib.parse import quote

    return quote(name)
