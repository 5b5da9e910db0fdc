"""What all pages of the site have: head, navigation, search; and the pages themselves as plain values."""

import html
import posixpath
from dataclasses import dataclass, field

from pygments.formatters import HtmlFormatter

__all__ = ["Entry", "Group", "Page", "asset_files", "page_html"]


@dataclass(frozen=True)
class Entry:
    """Something that can be searched for: what it is called, where on its page it is, what kind it is, and what it says."""

    title: str
    anchor: str
    kind: str
    text: str


@dataclass
class Page:
    """A page: where it goes in the site, its title, its HTML without the shell, headings (level, anchor, title), and what is searched."""

    path: str
    title: str
    body: str
    headings: list[tuple[int, str, str]] = field(default_factory=list)
    entries: list[Entry] = field(default_factory=list)
    style: str = ""


@dataclass(frozen=True)
class Group:
    """A part of the navigation: a title, and (path, title) of its pages."""

    title: str
    pages: tuple[tuple[str, str], ...]


def page_html(page: Page, groups: list[Group], top_title: str = "hmc") -> str:
    """A page within the shell; links are relative, so that the site may lie anywhere and be opened from a disk."""
    folder = posixpath.dirname(page.path)

    def to(path: str) -> str:
        return posixpath.relpath(path, folder or ".")

    parts = []
    for group in groups:
        rows = "".join(
            f'<li><a href="{to(path)}"{" aria-current=page" if path == page.path else ""}>{html.escape(title)}</a></li>'
            for path, title in group.pages
        )
        here = any(path == page.path for path, _ in group.pages)
        parts.append(
            f"<details{' open' if here or len(group.pages) < 12 else ''}><summary>{group.title}</summary><ul>{rows}</ul></details>"
        )
    inner = [one for one in page.headings if 1 < one[0] < 4]
    rows = "".join(f'<li class="level{level}"><a href="#{anchor}">{html.escape(name)}</a></li>' for level, anchor, name in inner)
    contents = f'<aside class="contents"><h2>On this page</h2><ul>{rows}</ul></aside>' if len(inner) > 1 else ""
    title = page.title if page.title == top_title else f"{page.title} - {top_title}"
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{html.escape(title)}</title>{page.style}
<link rel="stylesheet" href="{to("site.css")}"></head>
<body data-root="{to(".")}/">
<header class="bar"><label for="menu" class="menu" title="pages">&#9776;</label><a class="home" href="{to("index.html")}">{top_title}</a>
<div class="search"><input type="search" placeholder="Search: press /" aria-label="Search" autocomplete="off"><ol hidden></ol></div>
</header>
<input type="checkbox" id="menu" hidden>
<div class="frame"><nav class="pages">{"".join(parts)}</nav>
<main>{page.body}</main>{contents}</div>
<script src="{to("search-index.js")}" defer></script><script src="{to("site.js")}" defer></script>
</body></html>
"""


def asset_files() -> dict[str, str]:
    """The style and the script of the site, by name."""
    return {"site.css": STYLE + HtmlFormatter(style="friendly").get_style_defs(".highlight"), "site.js": SCRIPT}


STYLE = """
:root { --ink: #1c2430; --soft: #566072; --line: #e3e7ee; --back: #f5f7fa; --link: #1f4f9c; }
* { box-sizing: border-box; } html { scroll-padding-top: 4rem; }
body { font: 16px/1.55 system-ui, "DejaVu Sans", sans-serif; color: var(--ink); margin: 0; }
a { color: var(--link); text-decoration: none; } a:hover { text-decoration: underline; } img { max-width: 100%; height: auto; }
.bar { position: sticky; top: 0; z-index: 5; display: flex; gap: 1rem; align-items: center; height: 3.2rem; padding: 0 1.2rem;
  background: #fff; border-bottom: 1px solid var(--line); }
.home { font-weight: 700; font-size: 1.15rem; color: var(--ink); } .menu { display: none; cursor: pointer; font-size: 1.3rem; }
.search { position: relative; flex: 1; max-width: 34rem; margin-left: auto; }
.search input { width: 100%; font: inherit; font-size: .95rem; padding: .35rem .7rem; border: 1px solid #c9d0db; border-radius: 4px; }
.search ol { position: absolute; left: 0; right: 0; top: 2.4rem; margin: 0; padding: .3rem; list-style: none; max-height: 75vh;
  overflow-y: auto; background: #fff; border: 1px solid #c9d0db; border-radius: 4px; box-shadow: 0 6px 20px #0002; }
.search li a { display: block; padding: .35rem .5rem; border-radius: 3px; color: var(--ink); } .search li a:hover,
.search li.chosen a { background: #e9effa; text-decoration: none; } .search small { color: var(--soft); display: block; }
.search .kind { float: right; color: var(--soft); font-size: .75rem; } .search .none { padding: .4rem; color: var(--soft); }
.frame { display: grid; grid-template-columns: 15rem minmax(0, 1fr) 14rem; gap: 2rem; max-width: 86rem; margin: 0 auto; padding: 0 1.2rem; }
.pages, .contents { position: sticky; top: 3.2rem; align-self: start; max-height: calc(100vh - 3.2rem); overflow-y: auto;
  padding: 1.2rem 0; font-size: .88rem; }
.pages ul, .contents ul { list-style: none; margin: .2rem 0 .8rem; padding: 0; } .pages li a { display: block; padding: .12rem .4rem;
  border-radius: 3px; color: var(--ink); overflow-wrap: anywhere; } .pages a[aria-current] { background: #e9effa; font-weight: 600; }
.pages summary { font-weight: 700; cursor: pointer; padding: .15rem 0; } .contents h2 { font-size: .85rem; color: var(--soft); margin: 0; }
.contents .level3 { padding-left: .8rem; } .contents a { color: var(--soft); }
main { padding: 1rem 0 5rem; min-width: 0; overflow-wrap: break-word; } h1 { font-size: 1.9rem; line-height: 1.2; }
h2 { margin-top: 2.2rem; border-bottom: 1px solid var(--line); padding-bottom: .2rem; } h1 a.here, h2 a.here, h3 a.here, h4 a.here
{ visibility: hidden; margin-left: .4rem; font-weight: 400; } :hover > a.here { visibility: visible; }
pre { background: var(--back); border-radius: 4px; padding: .7rem .9rem; overflow-x: auto; font-size: .84rem; line-height: 1.45; }
pre.output { background: none; border-left: 3px solid #d4dae4; border-radius: 0; } code { font-size: .9em; }
.table { overflow-x: auto; background: linear-gradient(90deg, #fff 40%, #fff0) left / 2.5rem 100% local no-repeat,
  linear-gradient(270deg, #fff 40%, #fff0) right / 2.5rem 100% local no-repeat, linear-gradient(90deg, #0003, #0000) left / .8rem 100%
  no-repeat, linear-gradient(270deg, #0003, #0000) right / .8rem 100% no-repeat; }
table { border-collapse: collapse; font-size: .88rem; } th, td { border: 1px solid var(--line);
  padding: .3rem .55rem; text-align: left; vertical-align: top; } th { background: var(--back); }
.gallery { display: grid; grid-template-columns: repeat(auto-fill, minmax(17rem, 1fr)); gap: 1.5rem; }
.gallery a { color: inherit; } .gallery .picture { height: 180px; overflow: hidden; border: 1px solid var(--line); border-radius: 4px;
  display: flex; align-items: center; justify-content: center; background: #fff; } .gallery img { max-width: 100%; max-height: 100%; }
.gallery h2 { font-size: 1.05rem; margin: .5rem 0 .2rem; border: 0; } .gallery p { margin: 0; font-size: .88rem; color: var(--soft); }
@media (max-width: 75rem) { .frame { grid-template-columns: 15rem minmax(0, 1fr); } .contents { display: none; } }
@media (max-width: 50rem) { .menu { display: block; } .frame { display: block; } .pages { display: none; position: static; max-height: none;
  border-bottom: 1px solid var(--line); } #menu:checked ~ .frame .pages { display: block; } h1 { font-size: 1.5rem; } }
"""

SCRIPT = """
"use strict";
(() => {
  const root = document.body.dataset.root, input = document.querySelector(".search input"), list = document.querySelector(".search ol");
  const entries = (window.HMC_INDEX || []).map(([title, url, kind, text]) => ({title, url, kind, text, low: title.toLowerCase(),
    all: (title + " " + text).toLowerCase()}));
  const words = text => text.toLowerCase().split(/[^\\w.+-]+/).filter(Boolean);
  const score = (entry, asked) => {
    let sum = 0;
    for (const word of asked) {
      if (!entry.all.includes(word)) return 0;
      const at = entry.low.indexOf(word);
      sum += entry.low === word ? 60 : at === 0 ? 25 : at > 0 ? (/\\w/.test(entry.low[at - 1]) ? 8 : 18) : 2;
    }
    return sum + (entry.kind === "guide" ? 3 : entry.kind === "notebook" ? 2 : 0) - entry.title.length / 100;
  };
  const excerpt = (entry, asked) => {
    const near = entry.text.toLowerCase().indexOf(asked[0]) - 40, at = near > 0 ? entry.text.indexOf(" ", near) : 0;
    const end = entry.text.lastIndexOf(" ", at + 130);
    return (at ? "..." : "") + (entry.text.length > at + 130 ? entry.text.slice(at, end) + " ..." : entry.text.slice(at));
  };
  let chosen = -1;
  const mark = () => [...list.children].forEach((row, k) => row.classList.toggle("chosen", k === chosen));
  const show = () => {
    const asked = words(input.value);
    list.replaceChildren();
    list.hidden = !asked.length;
    chosen = -1;
    if (!asked.length) return;
    const found = entries.map(entry => [score(entry, asked), entry]).filter(([points]) => points > 0)
      .sort((a, b) => b[0] - a[0]).slice(0, 14);
    for (const [, entry] of found) {
      const row = document.createElement("li"), link = document.createElement("a"), small = document.createElement("small");
      const kind = document.createElement("span");
      kind.className = "kind"; kind.textContent = entry.kind;
      small.textContent = excerpt(entry, asked);
      link.href = root + entry.url;
      link.append(kind, entry.title, small);
      row.append(link); list.append(row);
    }
    if (!found.length) {
      const row = document.createElement("li");
      row.className = "none"; row.textContent = "nothing has all of these words"; list.append(row);
    }
  };
  input.addEventListener("input", show);
  input.addEventListener("focus", show);
  document.addEventListener("click", event => { if (!event.target.closest(".search")) list.hidden = true; });
  document.addEventListener("keydown", event => {
    if (event.key === "/" && document.activeElement !== input) { event.preventDefault(); input.focus(); }
    if (document.activeElement !== input) return;
    const links = list.querySelectorAll("a");
    if (event.key === "Escape") { list.hidden = true; input.blur(); }
    if (event.key === "ArrowDown" || event.key === "ArrowUp") {
      event.preventDefault();
      chosen = (chosen + (event.key === "ArrowDown" ? 1 : -1) + links.length) % Math.max(links.length, 1); mark();
    }
    if (event.key === "Enter" && links.length) location.href = links[Math.max(chosen, 0)].href;
  });
  const asked = new URLSearchParams(location.search).get("q");
  if (asked) { input.value = asked; show(); }
})();
"""
