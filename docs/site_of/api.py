"""Pages of the functions, from their docstrings, by pdoc; within the site's own navigation."""

import posixpath
import re
import warnings
from collections.abc import Iterator

import pdoc
import pdoc.doc
import pdoc.render
from pdoc import extract

from site_of.shell import Entry, Page

__all__ = ["api_pages", "path_of"]

MAIN = re.compile(r'<main class="pdoc">(.*?)</main>', re.DOTALL)
STYLE = re.compile(r"<style>(/\*! (?:syntax-highlighting|theme|content)\.css \*/.*?)</style>", re.DOTALL)
#: pdoc's colors are those of a page of its own.
OURS = ".pdoc .view-value-button{box-sizing:content-box}"
OURS += ".pdoc{--link:#1f4f9c;--link-hover:#1f4f9c;--text:#1c2430}.pdoc .modulename{font-size:1.6rem}"


def path_of(module: str) -> str:
    """Where the page of a module is in the site, as pdoc has it."""
    return "api/" + module.replace(".", "/") + ".html"


def api_pages(*packages: str) -> Iterator[Page]:
    """The pages of packages and of all that is in them."""
    pdoc.render.configure(docformat="numpy", show_source=False, search=False)
    with warnings.catch_warnings():
        # the fields of a NamedTuple bear annotations that pdoc cannot look up
        warnings.filterwarnings("ignore", "Error parsing type annotation")
        modules = {name: pdoc.doc.Module.from_name(name) for name in extract.walk_specs(packages)}
        for name, module in modules.items():
            yield _page(name, module, modules)


def _page(name: str, module: pdoc.doc.Module, modules: dict[str, pdoc.doc.Module]) -> Page:
    made = pdoc.render.html_module(module, modules)
    found = MAIN.search(made)
    if found is None:
        raise RuntimeError(f"{name}: pdoc's page has no <main>; is its version another?")
    here = posixpath.dirname(path_of(name))

    def link(other: str) -> str:
        return f'<a href="{posixpath.relpath(path_of(other), here)}"><code>{other}</code></a>'

    below = "".join(f"<li>{link(one.fullname)}</li>" for one in module.submodules if one.fullname in modules)
    above = name.rpartition(".")[0]
    up = f"<p>in {link(above)}</p>" if above in modules else ""
    inner = f'{up}<div class="pdoc">{found[1]}</div>' + (f'<h2 id="in-it">In it</h2><ul>{below}</ul>' if below else "")
    public = [one for one in module.flattened_own_members if one.docstring and not one.name.startswith("_")]
    entries = [
        Entry(name, "", "module", _first(module.docstring)),
        *(Entry(one.qualname, one.qualname, one.kind, f"{name}: {_first(one.docstring)}") for one in public),
    ]
    headings = [(2, one.qualname, one.qualname) for one in public if "." not in one.qualname]
    style = "<style>" + "".join(STYLE.findall(made)) + OURS + "</style>"
    return Page(path_of(name), name, inner, headings, entries, style)


def _first(docstring: str) -> str:
    return " ".join(docstring.strip().partition("\n\n")[0].split())
