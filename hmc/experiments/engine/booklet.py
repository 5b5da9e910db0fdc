"""The report as one PDF, drawn with matplotlib: A4 pages that are filled from the top down."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Sequence
from pathlib import Path

from matplotlib import rc_context
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.image import imread

from hmc.experiments.engine.page import HEADING, INTRODUCTION, verdict_counts, without_dataset
from hmc.experiments.engine.summary import OURS, Row, StoredRun, StoredTable
from hmc.io.files import sibling

__all__ = ["write_booklet"]

#: Page, margin and line height relative to the size of the letters; inches.
PAGE, MARGIN, LEADING = (8.27, 11.69), 0.7, 1.35
POINT = 1 / 72
#: Mean width of a letter relative to its size, in running text and in columns.
LETTER, LETTER_MONO = 0.53, 0.605
TEXT_SIZE, TABLE_SIZES = 9.0, (7.0, 3.5)


class _Pages:
    """Pages that are filled; the one place that is no function, because a page is a place to write on."""

    def __init__(self, pdf: PdfPages) -> None:
        self.pdf, self.figure, self.top = pdf, Figure(figsize=PAGE), PAGE[1] - MARGIN

    def turn(self) -> None:
        """Put this page away and begin a new one."""
        self.close()
        self.figure, self.top = Figure(figsize=PAGE), PAGE[1] - MARGIN

    def close(self) -> None:
        """Put this page away."""
        self.pdf.savefig(self.figure)

    def room(self, height: float) -> None:
        """Turn the page where less than so many inches are left."""
        if self.top - height < MARGIN and self.top < PAGE[1] - MARGIN:
            self.turn()

    def text(self, text: str, size: float = TEXT_SIZE, weight: str = "normal", indent: float = 0.0, after: float = 0.06, **style) -> None:
        """A paragraph, broken into lines."""
        width = max(int((PAGE[0] - 2 * MARGIN - indent) / (LETTER * size * POINT)), 10)
        for line in textwrap.wrap(text, width) or [""]:
            self.line(line, size, indent, weight=weight, **style)
        self.top -= after

    def line(self, line: str, size: float, indent: float = 0.0, **style) -> None:
        """One line."""
        height = LEADING * size * POINT
        self.room(height)
        self.top -= height
        # parse_math: a dollar sign is a dollar sign
        self.figure.text((MARGIN + indent) / PAGE[0], self.top / PAGE[1], line, fontsize=size, va="bottom", parse_math=False, **style)

    def picture(self, path: Path) -> None:
        """A PNG as wide as the text allows and no larger than it was drawn."""
        image = imread(path)
        height, width = image.shape[:2]
        scale = min(1 / 150, (PAGE[0] - 2 * MARGIN) / width, (PAGE[1] - 2 * MARGIN) / height)
        width, height = width * scale, height * scale
        self.room(height)
        self.top -= height
        axes = self.figure.add_axes((MARGIN / PAGE[0], self.top / PAGE[1], width / PAGE[0], height / PAGE[1]))
        axes.imshow(image, aspect="auto", interpolation="none")
        axes.set_axis_off()
        self.top -= 0.12


def write_booklet(path: Path, rows: Sequence[Row]) -> None:
    """Write the report as a PDF.

    Parameters
    ----------
    path : Path
    rows : sequence of Row
        As `hmc.experiments.engine.summary.summarise` gives them.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    metadata = {"Title": HEADING, "CreationDate": None, "Producer": None, "Creator": None}
    with (
        sibling(path) as temporary,
        rc_context({"pdf.fonttype": 42, "figure.constrained_layout.use": False}),
        PdfPages(temporary, metadata=metadata) as pdf,
    ):
        pages = _Pages(pdf)
        pages.text(HEADING, 18, "bold", after=0.15)
        pages.text(INTRODUCTION, after=0.1)
        pages.text(verdict_counts(rows), after=0.15)
        for work, own in itertools.groupby(rows, lambda row: row.entry.work):
            pages.room(0.9)
            pages.text(work, 13, "bold", after=0.08)
            for row in own:
                _summary(pages, row)
        for row in rows:
            if row.results:
                pages.turn()
                _detail(pages, row)
        pages.close()


def _summary(pages: _Pages, row: Row) -> None:
    entry = row.entry
    pages.room(0.6)
    pages.text(f"{entry.id}: {entry.title}. {row.label.capitalize()}.", weight="bold", after=0.0)
    paper = "" if entry.work == OURS else "The paper: "
    pages.text(f"{paper}{entry.shows}. {without_dataset(entry).capitalize()}", 8, indent=0.2, after=0.0, color="0.3")
    for claim in row.differing:
        pages.text(f"Differs: {claim.text}{': ' if claim.detail else ''}{claim.detail}", 8, indent=0.2, after=0.0)
    if row.why:
        pages.text(row.why, 8, indent=0.2, after=0.0, style="italic")
    pages.top -= 0.07


def _detail(pages: _Pages, row: Row) -> None:
    entry = row.entry
    pages.text(f"{entry.id}: {entry.title}", 13, "bold")
    pages.text(f"{row.label.capitalize()}. {entry.work}: {entry.shows}.")
    if row.why:
        pages.text(f"Why it differs, as far as known: {row.why}")
    for result in row.results:
        _run(pages, result)


def _run(pages: _Pages, result: StoredRun) -> None:
    pages.text(result.what, 8, color="0.3", after=0.1)
    for claim in result.claims:
        word = "holds" if claim.holds else "DIFFERS"
        pages.text(f"{word}: {claim.text}{': ' if claim.detail else ''}{claim.detail}", 8, indent=0.1, after=0.03)
    pages.top -= 0.1
    for picture in result.pictures:
        pages.picture(picture)
    for table in result.tables:
        _table(pages, table)


def _table(pages: _Pages, table: StoredTable) -> None:
    widths = [max(map(len, column), default=0) for column in itertools.zip_longest(table.columns, *table.rows, fillvalue="")]
    letters = sum(widths) + 2 * len(widths)
    size = min(TABLE_SIZES[0], max(TABLE_SIZES[1], (PAGE[0] - 2 * MARGIN) / (letters * LETTER_MONO * POINT)))
    pages.room(0.6)
    pages.text(table.caption or table.name, 8, color="0.3", after=0.03)
    for k, row in enumerate((table.columns, *table.rows)):
        line = "  ".join(text.rjust(width) for text, width in zip(row, widths, strict=False))
        pages.line(line, size, family="monospace", weight="bold" if k == 0 else "normal")
    pages.top -= 0.15
