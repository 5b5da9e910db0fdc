"""Citations: every method and tracker has those that its source names, and a result those of what made it."""

from pathlib import Path

import pytest

from hmc.citations import SOFTWARE, WORKS, bibtex, works_in, works_of, works_of_run
from hmc.cli import main
from hmc.errors import InputError
from hmc.pose.registry import METHODS, pose_method
from hmc.tracking.trackers import TRACKERS

ROOT = Path(__file__).resolve().parents[2]


def keys(works):
    return [work.key for work in works]


def test_what_sources_name_is_cited():
    for name, entry in METHODS.items():
        for preset in entry.presets:
            named = works_in(pose_method(name, preset).source)
            assert set(keys(named)) <= set(keys(works_of(name, preset)))
            assert preset == "default" or preset in keys(works_of(name, preset))
    assert all(works_of(name) for name in METHODS if name != "keypoints")
    assert all(keys(works_of(name)) == ["canton2009"] for name in TRACKERS)


def test_the_works_are_those_of_the_citation_file():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert SOFTWARE.fields["title"] in text and SOFTWARE.fields["version"] in text
    for work in (WORKS["canton2009"], WORKS["hsiao2008"], WORKS["kehl2006"]):
        family = work.fields["author"].split(",")[0]
        assert family in text and work.fields["title"].lower() in text.lower() and work.fields["year"] in text


def test_bibtex_is_well_formed():
    for work in (SOFTWARE, *WORKS.values()):
        entry = bibtex(work)
        assert entry.count("{") == entry.count("}") and entry.startswith(f"@{work.kind}{{{work.key},\n") and entry.endswith("\n}")


@pytest.mark.parametrize(
    ("run", "found"),
    [
        ({"method": "pso", "options": {"command": "pose", "preset": "hsiao2008"}}, ["canton2009", "hsiao2008"]),
        ({"method": "smd", "options": {"command": "pose", "preset": "default", "tracks": "t.csv"}}, ["kehl2006"]),
        ({"method": "keypoints", "options": {"command": "pose", "cues": "keypoints"}}, []),
        ({"method": "naive", "options": {"command": "track"}}, ["canton2009"]),
    ],
)
def test_a_result_has_those_of_what_made_it(run, found):
    assert keys(works_of_run(run)) == found


def test_command(tmp_path, capsys):
    (tmp_path / "run.toml").write_text('method = "smd"\n[options]\ncommand = "pose"\npreset = "kehl2006"\n', encoding="utf-8")
    assert main(["cite", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert "R. Kehl" in text and "@phdthesis{canton2009," in text and "@software{hmc," in text and "hsiao" not in text
    assert main(["cite", "--bibtex", "pso"]) == 0
    assert capsys.readouterr().out.startswith("@software{hmc,")
    assert main(["cite", "keypoints"]) == 0
    assert "another program's work" in capsys.readouterr().err
    assert main(["cite", "spars"]) == 2
    assert "did you mean 'sparse'" in capsys.readouterr().err
    with pytest.raises(InputError, match="names no method"):
        works_of_run({})
