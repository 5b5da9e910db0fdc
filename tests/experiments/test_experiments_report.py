"""The report: a row for every table and figure of the papers, pictures and tables in one page."""

import base64
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser

import cv2
import numpy as np
import pytest

from hmc.experiments import EXPERIMENTS, Claim, Plan, Report, find_experiment
from hmc.experiments.__main__ import main
from hmc.experiments.engine.catalogue import CATALOGUE, UNKNOWN
from hmc.experiments.engine.experiment import DIFFERS, HOLDS
from hmc.experiments.engine.markdown import to_markdown
from hmc.experiments.engine.page import to_html, verdict_counts
from hmc.experiments.engine.selection import changed_plan
from hmc.experiments.engine.summary import MISSING, NOT_RUN, REPRODUCED, SHOWN, summarise
from hmc.experiments.engine.writing import write_report
from hmc.io.files import write_toml

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    """An experiment that holds, made by running it, and one that differs, as its files."""
    folder = tmp_path_factory.mktemp("experiments")
    assert main(["run", "fig-B.1", "--quick", "--quiet", "--workers", "1", "--out", str(folder)]) == 0
    write_differing(folder / "fig-4.9-quick")
    return folder


def write_differing(folder):
    claims = [{"claim": "faster over <the> surface", "holds": False, "detail": "0.61 & 0.68"}, {"claim": "it runs", "holds": True}]
    captions = {"second": "Second & last.", "first": "First."}
    parameters = {"quick": True, "recordings": ["tiny@12345678"], "cells": {"a": {"x": 1}}}
    write_toml(folder / "run.toml", {"claims": claims, "figures": ["b", "a"], "captions": captions, "parameters": parameters})
    (folder / "first.csv").write_text("name,ours_mm,paper_mm\n$x$ <y>,1.5,\n")
    (folder / "second.csv").write_text("n\n" + "1\n" * 40)
    (folder / "left_over.csv").write_text("old\n1\n")
    for name, level in {"a": 40, "b": 90}.items():
        cv2.imwrite(str(folder / f"{name}.png"), np.full((60, 80, 3), level, np.uint8))


class Reader(HTMLParser):
    """What a page links to and holds."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.links, self.sources, self.words, self.open = [], [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.ids += [values["id"]] if "id" in values else []
        self.links += [values[name] for name in ("href",) if name in values]
        self.sources += [values["src"]] if "src" in values else []
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def test_every_table_and_figure_has_its_row(out):
    rows = {row.entry.id: row for row in summarise(out)}
    assert list(rows) == [entry.id for entry in CATALOGUE] + [name for name in EXPERIMENTS if name not in {e.id for e in CATALOGUE}]
    assert rows["fig-B.1"].verdict == HOLDS and rows["fig-4.9"].verdict == DIFFERS and rows["fig-4.7"].verdict == NOT_RUN
    assert rows["fig-4.9"].why == f"Why it differs, as far as known: {UNKNOWN}" and rows["fig-4.7"].why == ""
    assert rows["fig-B.1"].why == rows["fig-B.1"].entry.why, "what has to be known of what holds"
    assert rows["table-4.3"].entry.why and rows["table-4.3"].entry.why in replace(rows["fig-4.9"], entry=rows["table-4.3"].entry).why
    assert [claim.text for claim in rows["fig-4.9"].differing] == ["faster over <the> surface"]
    without = {name for name, row in rows.items() if row.verdict == MISSING}
    assert without == {entry.id for entry in CATALOGUE} - set(EXPERIMENTS)


def test_a_figure_without_an_experiment_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr("hmc.experiments.engine.summary.EXPERIMENTS", {name: EXPERIMENTS[name] for name in ("fig-3.3", "what-each-adds")})
    rows = {row.entry.id: row.verdict for row in summarise(tmp_path)}
    assert rows["fig-3.3"] == rows["what-each-adds"] == NOT_RUN and rows["table-4.3"] == rows["kehl-4"] == MISSING
    assert "no experiment yet" in to_html(summarise(tmp_path))


def test_a_full_run_counts_before_a_quick_one_and_own_recordings_come_beside(out, tmp_path):
    for name in ("fig-4.9-quick", "fig-4.9-quick-own"):
        shutil.copytree(out / "fig-4.9-quick", tmp_path / name)
    write_toml(tmp_path / "fig-4.9" / "run.toml", {"claims": [{"claim": "yes", "holds": True}], "parameters": {"quick": False}})
    row = next(row for row in summarise(tmp_path) if row.entry.id == "fig-4.9")
    assert row.verdict == REPRODUCED
    assert [result.folder.name for result in row.results] == ["fig-4.9", "fig-4.9-quick-own"]


def run_of(folder, holds=(True, True), cells=("a", "b"), **parameters):
    claims = [{"claim": f"claim {k}", "holds": one} for k, one in enumerate(holds)]
    content = {"claims": claims, "parameters": {"quick": False, "cells": {key: {"x": 1} for key in cells}} | parameters}
    write_toml(folder / "run.toml", content)


def row_of(folder, name="fig-4.9"):
    return next(row for row in summarise(folder) if row.entry.id == name)


def test_reproduced_is_what_holds_in_full_alone(tmp_path):
    """Less and less of the grid: a run counts by how much it is, and none but the whole one is called reproduced."""
    told = []
    run_of(tmp_path / "fig-4.9-quick-other", quick=True, changed={"asked": {"seeds": 1}, "own_cells": 4, "of_own": 2})
    told.append(row_of(tmp_path).label)
    run_of(tmp_path / "fig-4.9-quick", quick=True)
    told.append(row_of(tmp_path).label)
    run_of(tmp_path / "fig-4.9-other", changed={"asked": {"frames": 60}, "own_cells": 40, "of_own": 0})
    told.append(row_of(tmp_path).label)
    run_of(tmp_path / "fig-4.9-other", changed={"asked": {"seeds": 1}, "own_cells": 40, "of_own": 2})
    told.append(row_of(tmp_path).label)
    assert row_of(tmp_path).results[0].what == "in part, 2 cells, 2 of the 40 of the full grid, with seeds = 1"
    run_of(tmp_path / "fig-4.9", holds=())
    told.append(row_of(tmp_path).label)
    run_of(tmp_path / "fig-4.9", holds=(True, False))
    told.append(row_of(tmp_path).label)
    run_of(tmp_path / "fig-4.9")
    told.append(row_of(tmp_path).label)
    assert told == ["changed, holds", "quick, holds", "quick, holds", "in part, holds", SHOWN, "in full, differs", REPRODUCED]
    assert row_of(tmp_path).results[0].what == "in full, 2 cells"


def test_a_row_is_undecided_where_nothing_differs_and_something_is(tmp_path):
    """It says over how many recordings, and that nothing of it differs; written and read it stays so."""
    experiment, plan = find_experiment("fig-4.9"), Plan(quick=True)
    claims = [Claim("yes", True), Claim("who knows", False, "by 1 [-1, 3]", True), Claim("no", False)]
    for claims_of, label in ((claims[:2], "quick, undecided"), (claims, "quick, differs")):
        write_report(tmp_path, experiment, plan, Report(claims=tuple(claims_of)))
        row = row_of(tmp_path)
        assert row.label == label and row.results[0].claims == tuple(claims_of)
    assert "Undecided: the interval over its runs" in row.why and UNKNOWN in row.why
    page, text = to_html([row]), to_markdown([row])
    assert ">undecided</span>" in page and "- undecided: who knows (by 1 [-1, 3])" in text and "- differs: no" in text
    run_of(tmp_path / "lost-arm", holds=(True,), recordings=["a@1", "b@2"])
    stored = row_of(tmp_path, "lost-arm").results[0]
    assert stored.recordings == ("a", "b")
    told = replace(row_of(tmp_path, "lost-arm"), verdict="undecided", results=(replace(stored, claims=(claims[1],)),)).why
    assert told == "Undecided: the interval over 2 recordings has both in it, that it is so and that it is not."


def test_a_changed_run_that_does_not_say_by_what_is_none_in_full(tmp_path):
    run_of(tmp_path / "fig-4.9-other")
    assert row_of(tmp_path).label == "changed, holds"


def test_what_is_no_papers_is_not_reproduced(tmp_path):
    run_of(tmp_path / "lost-arm")
    assert row_of(tmp_path, "lost-arm").label == "in full, holds"


@pytest.mark.parametrize(
    ("changes", "label", "told"),
    [
        ({"seeds": 1}, "in part, holds", "in part, 2 cells, 2 of the 6 of the full grid, with seeds = 1"),
        ({"seeds": 4}, "changed, holds", "changed, 8 cells, 6 of the 6 of the full grid, with seeds = 4"),
        ({"settings": (("layers", 1),)}, "in part, holds", "in part, 3 cells, 3 of the 6 of the full grid, with layers = 1"),
        ({"settings": (("layers", 9),)}, "changed, holds", "changed, 3 cells, 0 of the 6 of the full grid, with layers = 9"),
        ({}, "reproduced", "in full, 6 cells"),
    ],
)
def test_how_much_of_the_grid_a_run_is_stands_in_its_file(tmp_path, changes, label, told):
    full = [{"layers": layers, "repeat": k} for layers in (1, 2) for k in range(3)]
    experiment = replace(find_experiment("fig-4.9"), grid=lambda plan: full)
    write_report(tmp_path, experiment, changed_plan(Plan(), **changes), Report(claims=(Claim("so it is", True),)))
    row = row_of(tmp_path)
    assert (row.label, row.results[0].what) == (label, told)


def test_counts_tell_the_scopes_apart(tmp_path):
    for name, holds, quick in (("fig-3.3", True, False), ("fig-3.5", True, True), ("fig-4.9", False, True), ("fig-4.7", False, False)):
        run_of(tmp_path / f"{name}{'-quick' * quick}", holds=(holds,), quick=quick)
    rows = summarise(tmp_path)
    counts = f"{len(rows)} experiments: 1 reproduced, 1 hold quick, 1 differ in full, 1 differ quick, {len(rows) - 4} not computed yet."
    assert verdict_counts(rows) == counts
    words = " ".join(Reader(to_html(rows)).words)
    for told in (counts, "quick, holds", "quick, differs", "in full, differs"):
        assert told in words


def test_a_run_of_earlier_cells_is_no_longer_told(out, tmp_path):
    shutil.copytree(out / "fig-B.1-quick", tmp_path / "fig-B.1-quick")
    path = tmp_path / "fig-B.1-quick" / "run.toml"
    version = find_experiment("fig-B.1").version
    for told, verdict in ((version, HOLDS), (version + 1, NOT_RUN)):
        text = re.sub(r"(?m)^cells_version = .*\n", "", path.read_text(encoding="utf-8"))
        path.write_text(text.replace("[parameters]\n", f"[parameters]\ncells_version = {told}\n"), encoding="utf-8")
        assert next(row for row in summarise(tmp_path) if row.entry.id == "fig-B.1").verdict == verdict


def test_page_is_whole_and_needs_nothing_beside_it(out):
    rows = summarise(out)
    page = Reader(to_html(rows))
    assert not page.open and len(page.ids) == len(set(page.ids))
    assert {link.removeprefix("#") for link in page.links} == set(page.ids)
    pictures = [base64.b64decode(source.removeprefix("data:image/png;base64,")) for source in page.sources]
    own = [path for name in ("fig-4.9-quick", "fig-B.1-quick") for path in sorted((out / name).glob("*.png"))]
    assert sorted(pictures) == sorted(path.read_bytes() for path in own)
    levels = [cv2.imdecode(np.frombuffer(picture, np.uint8), 0)[0, 0] for picture in pictures]
    assert levels.index(90) < levels.index(40)  # in the order of the report that drew them
    text = " ".join(page.words)
    for words in ("faster over <the> surface: 0.61 & 0.68", "$x$ <y>", "Second & last.", "HumanEva-I", "hsiao-3.15"):
        assert words in text
    assert "left_over" not in text and "1 reproduced" not in text and "1 hold quick, 1 differ quick" in text


def test_report_is_written(out, capsys):
    assert main(["report", "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert "1 hold quick, 1 differ quick" in told and "report.html" in told
    assert (out / "report.html").read_text(encoding="utf-8") == to_html(summarise(out))


def test_the_markdown_page_has_every_row_and_its_files(out):
    text = to_markdown(summarise(out), ".")
    for entry in CATALOGUE:
        assert f"| {entry.id} |" in text or f"| [{entry.id}](" in text
    links = re.findall(r"\]\(\./([^)]+)\)", text)
    assert links and all((out / link).is_file() for link in links)
    assert "- differs: faster over <the> surface (0.61 & 0.68)" in text
    anchors = {line[3:].replace(".", "").lower() for line in text.splitlines() if line.startswith("## ")}
    assert {link.lower() for link in re.findall(r"\]\(#([^)]+)\)", text)} <= anchors
    table = next(line for line in text.splitlines() if line.startswith("| ---"))
    assert table.count("|") == 5


def test_names_keep_their_capitals_on_the_markdown_page(out):
    rows = {row.entry.id: row for row in summarise(out)}
    lines = to_markdown([replace(rows["fig-4.9"], entry=rows["table-4.3"].entry)]).splitlines()
    assert "Measured on CLEAR 2007: to compare figures is not possible without it." in lines
    assert any(line.startswith("MOTP and MOTA of all trackers") for line in lines) and any(
        line.startswith("**Quick, differs**") for line in lines
    )


def test_report_of_nothing(tmp_path, capsys):
    assert main(["report", "--out", str(tmp_path / "none")]) == 0
    assert "reproduced" not in capsys.readouterr().out
    assert (tmp_path / "none" / "report.html").is_file()


def test_damaged_run_is_told_in_a_line(tmp_path, capsys):
    (tmp_path / "fig-B.1").mkdir()
    (tmp_path / "fig-B.1" / "run.toml").write_text("claims = [")
    assert main(["report", "--out", str(tmp_path)]) == 2
    told = capsys.readouterr().err
    assert "run.toml" in told and told.count("\n") == 1


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")
def test_page_in_a_browser(out, tmp_path):
    page = tmp_path / "report.html"
    page.write_text(to_html(summarise(out)), encoding="utf-8")
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
               "--disable-component-update", "--disable-sync", "--window-size=1200,1600",
               f"--user-data-dir={tmp_path / 'profile'}"]  # fmt: skip
    shot = tmp_path / "shot.png"
    subprocess.run([CHROMIUM, *options, f"--screenshot={shot}", page.as_uri()], capture_output=True, timeout=120, check=True)
    image = cv2.imread(str(shot))
    assert image.shape == (1600, 1200, 3)
    assert (image[:400] < 100).any() and (image.reshape(-1, 3).mean(axis=1) > 250).mean() > 0.5  # dark letters on a light page
