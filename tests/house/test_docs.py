"""What the documentation says can be done: its commands are understood, its links lead somewhere, its Python runs."""

import importlib
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from hmc import __version__
from hmc.cli import COMMANDS, make_parser

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "benchmarks").glob("*.md")])
README = ROOT / "README.md"

BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"(?<!`)`([^`]+)`(?!`)")
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ +(.*)$", re.MULTILINE)
NAME = re.compile(r"`(hmc(?:\.\w+)+)")
PREFIXES = (("hmc",), ("python", "-m", "hmc"), (".venv/bin/hmc",), (".venv/bin/python", "-m", "hmc"))


def name_of(path):
    return str(path.relative_to(ROOT))


def shell_lines(page):
    """Every line of a page's shell blocks, and every command in running text."""
    text = page.read_text(encoding="utf-8")
    for language, block in BLOCK.findall(text):
        if language in ("sh", "bash", "console"):
            yield from (line.removeprefix("$ ") for line in block.replace("\\\n", " ").splitlines())
    yield from (" ".join(code.split()) for code in INLINE.findall(BLOCK.sub("", text)))


def hmc_commands(page):
    """Arguments of every call of hmc in a page."""
    for line in shell_lines(page):
        try:
            words = shlex.split(line, comments=True)
        except ValueError:
            continue  # prose with an apostrophe
        for prefix in PREFIXES:
            if tuple(words[: len(prefix)]) == prefix and len(words) > len(prefix):
                yield words[len(prefix) :]


def resolves(name):
    """Whether a dotted name leads to a module, or to something in one, be it a method."""
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:k]))
        except ModuleNotFoundError:
            continue
        for part in parts[k:]:
            fields = getattr(found, "__dataclass_fields__", {})
            if not (hasattr(found, part) or part in fields):
                return False
            found = getattr(found, part, None)
        return True
    return False


def test_names_in_docstrings_and_pages_are_there():
    pages = [*PAGES, *(ROOT / "hmc").rglob("*.py"), *(ROOT / "notebooks").glob("*.ipynb")]
    named = {(name_of(page), name) for page in pages for name in NAME.findall(page.read_text(encoding="utf-8"))}
    assert len(named) > 100
    assert not sorted((page, name) for page, name in named if not resolves(name))


def test_tests_that_pages_name_are_there():
    text = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("*.py"))
    there = {path.stem for path in (ROOT / "tests").rglob("*.py")} | set(re.findall(r"^ *def (test_\w+)", text, re.MULTILINE))
    named = {(name_of(page), code) for page in PAGES for code in INLINE.findall(BLOCK.sub("", page.read_text(encoding="utf-8")))}
    tests = {(page, code) for page, code in named if code.startswith("test_")}
    assert len(tests) > 10
    assert not sorted((page, code) for page, code in tests if code not in there)


def test_the_picture_of_the_house_has_all_rooms(tmp_path):
    command = [sys.executable, "docs/draw_house.py", "--out", str(tmp_path / "house.png")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "house.png").stat().st_size > 10_000


def test_tables_are_those_of_the_stored_results():
    done = subprocess.run([sys.executable, "docs/make_tables.py", "--check"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "<!-- table: all-methods -->\n| `--method` |" in README.read_text(encoding="utf-8")


def anchor_of(heading):
    """As the sites that show Markdown make them."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_commands_are_understood(page, capsys):
    for words in hmc_commands(page):
        if words[0] == "COMMAND" or (len(words) == 1 and words[0] in COMMANDS):
            continue  # the form of a command, or its name
        try:
            make_parser().parse_args(words)
        except SystemExit as leaving:
            assert leaving.code == 0, f"hmc {shlex.join(words)}: {capsys.readouterr().err}"


def test_readme_shows_every_command():
    shown = {words[0] for words in hmc_commands(README)}
    assert set(COMMANDS) <= shown


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page):
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        if target.startswith(("http://", "https://", "mailto:")):
            continue
        file, _, anchor = target.partition("#")
        place = (page.parent / file) if file else page
        assert place.exists(), f"{name_of(page)} links to {target}, which is not there"
        if anchor:
            anchors = [anchor_of(heading) for heading in HEADING.findall(place.read_text(encoding="utf-8"))]
            assert anchor in anchors, f"{name_of(page)} links to {target}; {file or 'the page'} has no such heading"


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_make_targets_and_scripts_exist(page):
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    for line in shell_lines(page):
        words = line.split("#")[0].split()
        if len(words) > 1 and words[0] == "make":
            wanted = {word for word in words[1:] if "=" not in word}
            assert wanted <= targets, f"{name_of(page)}: {line}"
        if len(words) > 1 and words[0].endswith("python") and words[1].endswith(".py"):
            assert (ROOT / words[1]).exists(), f"{name_of(page)}: {line}"


def test_version_is_the_same_everywhere():
    assert f"\nversion: {__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\n## {__version__} " in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_readme_names_every_part_of_the_tree():
    tree = README.read_text(encoding="utf-8").split("## Where things are")[1].split("## ")[0]
    parts = [path for path in (ROOT / "hmc").iterdir() if path.is_dir() and path.name != "__pycache__"]
    unnamed = [path.name for path in parts if f"{path.name}/" not in tree]
    assert not unnamed


@pytest.mark.slow
def test_python_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    code = next(block for language, block in BLOCK.findall(README.read_text(encoding="utf-8")) if language == "python")
    (tmp_path / "data").symlink_to(ROOT / "data", target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    exec(compile(code, str(README), "exec"), {})
    assert 5 < float(capsys.readouterr().out) < 30  # millimetres
    assert (tmp_path / "people.png").is_file()
    rows = (tmp_path / "result" / "joints.csv").read_text().splitlines()
    assert rows[0] == "frame,person,joint,x,y,z,views,trust" and len(rows) == 1 + 30 * 15
