"""The report as one web page that needs nothing beside it: pictures lie in it, and nothing is fetched."""

from __future__ import annotations

import base64
import itertools
from collections import Counter
from collections.abc import Iterable, Sequence
from html import escape

from hmc.experiments.engine.catalogue import Entry
from hmc.experiments.engine.experiment import DIFFERS, HOLDS, UNDECIDED
from hmc.experiments.engine.summary import MISSING, NOT_RUN, REPRODUCED, SCOPES, SHOWN, Row, StoredRun, StoredTable

__all__ = ["HEADING", "INTRODUCTION", "to_html", "verdict_counts", "without_dataset"]

HEADING = "The papers, computed again"
INTRODUCTION = (
    "Every table and figure of the three papers that hmc implements, and how what comes out here compares. The data of the papers are not "
    "to be had: rendered recordings, or those of the user, stand for them, so that order and shape are compared and not figures. An "
    "experiment is reproduced when everything that its paper shows holds in a run in full. Where it holds in a quick run, or in a "
    "part of the full grid, no more than that is said. Something holds where its confidence interval over clips and seeds says so, and "
    "differs where the interval says the contrary, or what has to be so first is not; where both are in the interval it is undecided. "
    "A figure of a paper's counts as reached where it is in the interval; bounds of our own, which no paper has, are decided on the mean."
)
#: Tables with more rows are folded up.
MAX_OPEN_ROWS = 16
_CLASS = {REPRODUCED: "good", HOLDS: "partly", UNDECIDED: "none", DIFFERS: "bad", SHOWN: "none", NOT_RUN: "none", MISSING: "none"}
_CLAIM_CLASS = {HOLDS: "good", UNDECIDED: "none", DIFFERS: "bad"}

_STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; color: #1c2430; background: #fff; margin: 0; }
main { max-width: 1120px; margin: 0 auto; padding: 1.5rem 1.25rem 4rem; }
h1 { font-size: 1.9rem; margin: 0 0 .5rem; }
h2 { font-size: 1.35rem; margin: 2.5rem 0 .75rem; } h3 { font-size: 1.1rem; margin: 0 0 .25rem; }
p { margin: .4rem 0; max-width: 75ch; } .small { font-size: .86rem; color: #566072; }
table { border-collapse: collapse; font-size: .86rem; margin: .5rem 0; }
caption { caption-side: top; text-align: left; color: #566072; padding: 0 0 .3rem; }
th, td { padding: .28rem .6rem; border-bottom: 1px solid #e3e7ee; text-align: left; vertical-align: top; }
th { border-bottom: 2px solid #b9c2d0; font-weight: 600; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
th.paper, td.paper { background: #f1f4fa; }
.scroll { overflow-x: auto; } .overview { width: 100%; table-layout: fixed; } .overview p { margin: .15rem 0; }
.overview td:first-child { white-space: nowrap; }
.overview th:nth-child(1) { width: 7.5rem; } .overview th:nth-child(2) { width: 18%; } .overview th:nth-child(3) { width: 34%; }
.verdict { display: inline-block; border-radius: 1rem; padding: .02rem .6rem; font-size: .8rem; white-space: nowrap; }
.good { background: #d9f0df; color: #14532d; } .partly { background: #e3edf9; color: #1d3f6e; }
.bad { background: #fde8cf; color: #7a3c04; } .none { background: #e9ecf1; color: #475063; }
section.experiment { border-top: 1px solid #d4dae4; padding: 1.25rem 0 .75rem; }
ul.claims { list-style: none; padding: 0; margin: .5rem 0; } ul.claims li { margin: .3rem 0; max-width: 100ch; }
img { max-width: 100%; height: auto; display: block; margin: .75rem 0; }
a { color: #1f4f9c; text-decoration: none; } a:hover { text-decoration: underline; }
@media print { main { max-width: none; padding: 0; } section.experiment { break-inside: avoid-page; } }
"""


def to_html(rows: Sequence[Row]) -> str:
    """The page.

    Parameters
    ----------
    rows : sequence of Row
        As `hmc.experiments.engine.summary.summarise` gives them.

    Returns
    -------
    str
    """
    body = [f"<h1>{escape(HEADING)}</h1>", f"<p>{escape(INTRODUCTION)}</p>", f"<p>{escape(verdict_counts(rows))}</p>"]
    for work, own in itertools.groupby(rows, lambda row: row.entry.work):
        body += [f"<h2>{escape(work)}</h2>", _overview(list(own))]
    body.append("<h2>In detail</h2>")
    body += [_section(row) for row in rows if row.results]
    versions = next((row.results[0].versions for row in rows if row.results), {})
    body.append(f'<p class="small">{escape(", ".join(f"{name} {version}" for name, version in versions.items()))}</p>')
    head = f'<meta charset="utf-8">\n<meta name="viewport" content="width=device-width, initial-scale=1">\n<title>{escape(HEADING)}</title>'
    lines = ["<!DOCTYPE html>", '<html lang="en">', f"<head>\n{head}\n<style>{_STYLE}</style>\n</head>", "<body>", "<main>", *body]
    return "\n".join([*lines, "</main>", "</body>", "</html>"]) + "\n"


def verdict_counts(rows: Sequence[Row]) -> str:
    """How many rows have which verdict, in full, in part and quick told apart, as a sentence."""
    counts = Counter(row.label for row in rows)
    told = {REPRODUCED: REPRODUCED}
    words = {HOLDS: "hold", UNDECIDED: "undecided", DIFFERS: "differ"}
    told |= {f"{scope}, {verdict}": f"{word} {scope}" for verdict, word in words.items() for scope in SCOPES}
    told |= {verdict: verdict for verdict in (SHOWN, NOT_RUN, MISSING)}
    return f"{len(rows)} experiments: {', '.join(f'{counts[label]} {words}' for label, words in told.items() if counts[label])}."


def without_dataset(entry: Entry) -> str:
    """What cannot be compared for want of the paper's data; empty where there was none."""
    return f"measured on {entry.dataset}: to compare figures is not possible without it" if entry.dataset else ""


def _overview(rows: Sequence[Row]) -> str:
    lines = ['<table class="overview"><thead><tr><th>experiment</th><th>what</th><th>the paper</th><th>here</th></tr></thead><tbody>']
    for row in rows:
        entry = row.entry
        name = f'<a href="#{_anchor(entry.id)}">{escape(entry.id)}</a>' if row.results else escape(entry.id)
        here = [_chip(row)]
        here += [f"<p>{escape(_how(claim.text, claim.detail))}</p>" for claim in row.differing]
        if row.why:
            here.append(f'<p class="small">{escape(row.why)}</p>')
        paper = escape(entry.shows)
        if entry.dataset:
            paper += f'<br><span class="small">{escape(without_dataset(entry))}</span>'
        lines.append(f"<tr><td>{name}</td><td>{escape(entry.title)}</td><td>{paper}</td><td>{''.join(here)}</td></tr>")
    return "\n".join([*lines, "</tbody></table>"])


def _section(row: Row) -> str:
    entry = row.entry
    lines = [f'<section class="experiment" id="{_anchor(entry.id)}">', f"<h3>{escape(entry.id)}: {escape(entry.title)}</h3>"]
    lines.append(f"<p>{_chip(row)} {escape(entry.work)}: {escape(entry.shows)}</p>")
    if row.why:
        lines.append(f"<p>{escape(row.why)}</p>")
    for result in row.results:
        lines += _run(entry.id, result)
    return "\n".join([*lines, "</section>"])


def _run(name: str, result: StoredRun) -> Iterable[str]:
    yield f'<p class="small">{escape(result.what)}</p>'
    if result.claims:
        yield '<ul class="claims">'
        for claim in result.claims:
            mark = f'<span class="verdict {_CLAIM_CLASS[claim.verdict]}">{claim.verdict}</span>'
            yield f"<li>{mark} {escape(_how(claim.text, claim.detail))}</li>"
        yield "</ul>"
    for picture in result.pictures:
        data = base64.b64encode(picture.read_bytes()).decode("ascii")
        yield f'<img alt="{escape(f"{name}: {picture.stem}", quote=True)}" src="data:image/png;base64,{data}">'
    for table in result.tables:
        yield _table(table)


def _table(table: StoredTable) -> str:
    kinds = [_kind(name, [row[k] for row in table.rows if k < len(row)]) for k, name in enumerate(table.columns)]
    lines = ['<div class="scroll"><table>', f"<caption>{escape(table.caption or table.name)}</caption>"]
    cells = (f"<th{kind}>{escape(name)}</th>" for name, kind in zip(table.columns, kinds, strict=True))
    lines.append(f"<thead><tr>{''.join(cells)}</tr></thead><tbody>")
    for row in table.rows:
        lines.append(f"<tr>{''.join(f'<td{kind}>{escape(text)}</td>' for text, kind in zip(row, kinds, strict=False))}</tr>")
    lines.append("</tbody></table></div>")
    text = "\n".join(lines)
    if len(table.rows) <= MAX_OPEN_ROWS:
        return text
    return f"<details><summary>{escape(table.name)}: {len(table.rows)} rows</summary>\n{text}\n</details>"


def _kind(name: str, values: Sequence[str]) -> str:
    """The class of a column: numbers to the right, the paper's own figures shaded."""
    classes = ["n"] if all(_is_number(value) for value in values) else []
    classes += ["paper"] if "paper" in name.lower() else []
    return f' class="{" ".join(classes)}"' if classes else ""


def _is_number(text: str) -> bool:
    try:
        float(text or "0")
    except ValueError:
        return False
    return True


def _how(claim: str, detail: str) -> str:
    return f"{claim}: {detail}" if detail else claim


def _chip(row: Row) -> str:
    return f'<span class="verdict {_CLASS[row.verdict]}">{escape(row.label)}</span>'


def _anchor(name: str) -> str:
    return name.replace(".", "-")
