"""Whole commands on files broken at random: they do their work, or say in words what is wrong; nothing else."""

from collections import Counter

import numpy as np
import pytest
from families import FAMILIES
from miniature import COMMANDS, build
from mutations import ROUND, drawn, trials, warm, whole_endings

COUNT = 500


@pytest.mark.slow
def test_broken_files_end_no_command_badly(tmp_path):
    base = build(tmp_path / "miniature")
    warm()
    whole = whole_endings(base, 2)
    assert whole.keys() == {given.words for given in COMMANDS} and not [one for one in whole.values() if one.kind != "ok"]
    endings = list(trials(base, 0, range(COUNT), 2, whole))
    bad = [one for one in endings if one.kind == "bad"]
    assert not bad, "\n".join(f"{one.number}: {one.why}, {one.family}, {one.file}: {one.words}\n{one.text[-400:]}" for one in bad[:5])
    families = Counter(one.family for one in endings)
    assert len(endings) == COUNT and families.keys() == FAMILIES.keys() and max(families.values()) - min(families.values()) <= 1
    assert {one.words for one in endings} == {" ".join(given.words) for given in COMMANDS}
    kinds = Counter(one.kind for one in endings)
    assert kinds["told"] > 150 < kinds["ok"] and kinds["silent"] <= 10, kinds


def test_trials_go_through_all_families_and_all_commands():
    n = len(FAMILIES) * len(ROUND)
    pairs = Counter((family, given.words) for family, given in (drawn(0, number) for number in range(n)))
    words = Counter(given.words for given in COMMANDS for _ in range(given.often))
    assert Counter(family for family, _ in pairs.elements()) == dict.fromkeys(FAMILIES, len(ROUND))
    assert Counter(one for _, one in pairs.elements()) == {one: often * len(FAMILIES) for one, often in words.items()}
    assert len(pairs) > 0.5 * len(FAMILIES) * len(COMMANDS) and drawn(0, 5) == drawn(0, 5)
    assert [drawn(1, number)[0] for number in range(27)] != [drawn(0, number)[0] for number in range(27)]


def test_every_family_leaves_something_else(tmp_path):
    for k, (name, spoil) in enumerate(FAMILIES.items()):
        if name == "huge":
            continue
        folder = tmp_path / str(k) / "in"
        folder.mkdir(parents=True)
        (folder.parent / "other.toml").write_text("b = 2\n")
        path, before = folder / "a.toml", b"a = 1\nb = 22\nc = 333\n" * 3
        changed = False
        for turn in range(8):
            for one in folder.iterdir():
                one.rmdir() if one.is_dir() and not one.is_symlink() else one.unlink()
            path.write_bytes(before)
            spoil(np.random.default_rng((k, turn)), path)
            changed |= not (path.is_file() and not path.is_symlink() and path.read_bytes() == before and len(list(folder.iterdir())) == 1)
        assert changed, name
