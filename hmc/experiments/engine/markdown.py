"""The report as a page of Markdown: verdicts, claims with their figures, and the smaller tables; pictures stay beside it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

from hmc.experiments.engine.page import HEADING, INTRODUCTION, verdict_counts, without_dataset
from hmc.experiments.engine.summary import Row, StoredTable

__all__ = ["to_markdown"]

#: Tables with more rows are named only.
MAX_ROWS = 40


def to_markdown(rows: Sequence[Row], link: str = "") -> str:
    """The page.

    Parameters
    ----------
    rows : sequence of Row
        As `hmc.experiments.engine.summary.summarise` gives them.
    link : str
        Folder of the reports as seen from the page, where tables and pictures are to be linked.
    """
    lines = [f"# {HEADING}", "", INTRODUCTION, "", verdict_counts(rows), ""]
    for work, own in itertools.groupby(rows, lambda row: row.entry.work):
        lines += [f"## {work}", "", "| | what | the paper | here |", "| --- | --- | --- | --- |"]
        for row in own:
            entry, run = row.entry, f" ({row.results[0].what})" if row.results else ""
            name = f"[{entry.id}](#{entry.id.lower().replace('.', '')})" if row.results else entry.id
            lines.append(f"| {name} | {_cell(entry.title)} | {_cell(entry.shows)} | {row.label}{_cell(run)} |")
        lines.append("")
    for row in rows:
        if row.results:
            lines += _section(row, link)
    return "\n".join(lines).rstrip() + "\n"


def _section(row: Row, link: str) -> Iterator[str]:
    entry, run = row.entry, row.results[0]
    yield from (f"## {entry.id}", "", f"{_sentence(entry.title)}. {entry.work}: {entry.shows}.")
    without = without_dataset(entry)
    if without:
        yield f"{_sentence(without)}."
    yield from ("", f"**{_sentence(row.label)}**; {run.what}.")
    for claim in run.claims:
        yield f"- {claim.verdict}: {claim.text}{f' ({claim.detail})' if claim.detail else ''}"
    if row.why:
        yield from ("", row.why)
    yield ""
    if link:
        files = [*(f"{table.name}.csv" for table in run.tables), *(picture.name for picture in run.pictures)]
        yield from (", ".join(f"[{name}]({link}/{run.folder.name}/{name})" for name in files), "")
    for table in run.tables:
        if len(table.rows) <= MAX_ROWS:
            yield from _table(table)


def _table(table: StoredTable) -> Iterator[str]:
    yield from (table.caption or table.name, "")
    yield f"| {' | '.join(name.replace('_', ' ') for name in table.columns)} |"
    yield f"| {' | '.join('---' for _ in table.columns)} |"
    for row in table.rows:
        yield f"| {' | '.join(_cell(text) for text in row)} |"
    yield ""


def _sentence(text: str) -> str:
    """With a capital in front; names keep theirs."""
    return text[:1].upper() + text[1:]


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
