"""What of the pages is made of stored results: tables in them, and the page of the papers' experiments, docs/results.md.

    python docs/make_tables.py            # write them anew
    python docs/make_tables.py --check    # only say which pages are old

``results/ID/`` holds what `python -m hmc.experiments run ID` wrote: the tables, and in run.toml what they were made with. A page marks a
place with ``<!-- table: NAME -->`` and ``<!-- end of table -->``; what stands between is replaced.
"""

from __future__ import annotations

import csv
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from hmc.experiments.engine.markdown import to_markdown
from hmc.experiments.engine.summary import summarise

ROOT = Path(__file__).resolve().parent.parent
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
RESULTS = ROOT / "docs" / "results.md"
PLACE = re.compile(r"(<!-- table: ([\w-]+) -->\n).*?(<!-- end of table -->)", re.DOTALL)

#: Pages of the methods, beside the names in the README's table.
METHOD_PAGES = {"shbm-apf": "scalable", "ddm-apf": "scalable", "shbm-ddm-apf": "scalable", "smd": "multi-cue", "pso": "spectral"}


def all_methods() -> str:
    """All pose methods over five actions."""
    lines = [
        "| `--method` | mean error | within 100 mm | within 50 mm | frames a second | a frame |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for row in _rows("all-methods"):
        name, _, preset = row["method"].partition(" ")
        shown = f"`{name} --preset {preset}`" if preset else f"`{name}`"
        if not preset and name in METHOD_PAGES:
            shown = f"[{shown}](docs/{METHOD_PAGES[name]}.md)"
        spread = f" +- {float(row['mean_spread_mm']):.1f}" if row["mean_spread_mm"] else ""
        shares = (f"{float(row[column]) / 100:.3f}".lstrip("0") for column in ("MMTA_percent", "MMTA_50_percent"))
        cells = (
            shown + (" (the default)" if name == "apf" and not preset else ""),
            f"{float(row['mean_mm']):.1f}{spread} mm",
            *shares,
            f"{float(row['frames_per_s']):.1f}",
            row["a frame"],
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


#: By the name in the page.
TABLES: Mapping[str, Callable[[], str]] = {"all-methods": all_methods}


def with_tables(text: str) -> str:
    """A page's text with its tables made anew."""
    return PLACE.sub(lambda found: found[1] + TABLES[found[2]]() + found[3], text)


def _rows(experiment: str) -> list[dict[str, str]]:
    """Rows of an experiment's first table, of the fullest run of it that is stored."""
    stored = [ROOT / "results" / f"{experiment}{part}" / f"{experiment}.csv" for part in ("", "-other", "-quick")]
    with open(next(path for path in stored if path.is_file()), encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def made_pages() -> dict[Path, str]:
    """Every page's text as results/ has it."""
    pages = {page: with_tables(page.read_text(encoding="utf-8")) for page in PAGES}
    return pages | {RESULTS: to_markdown(summarise(ROOT / "results"), "../results")}


def main() -> int:
    """Write the pages, or say which are old."""
    pages = made_pages()
    old = [page for page, text in pages.items() if not page.is_file() or page.read_text(encoding="utf-8") != text]
    for page in old:
        if "--check" in sys.argv[1:]:
            print(f"{page.relative_to(ROOT)}: is not what results/ has; run python docs/make_tables.py")
        else:
            page.write_text(pages[page], encoding="utf-8")
            print(f"wrote {page.relative_to(ROOT)}")
    return 1 if old and "--check" in sys.argv[1:] else 0


if __name__ == "__main__":
    sys.exit(main())
