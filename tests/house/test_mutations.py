"""Whole commands on files broken at random: they do their work, or say in words what is wrong; nothing else."""

import numpy as np
import pytest
from families import FAMILIES
from mutations import build, trials, warm

COUNT = 40


@pytest.mark.slow
def test_broken_files_end_no_command_badly(tmp_path):
    base = build(tmp_path / "miniature")
    warm()
    endings = list(trials(base, 0, range(COUNT), 2))
    bad = [one for one in endings if one.kind == "bad"]
    assert not bad, "\n".join(f"{one.number}: {one.why}, {one.family}, {one.file}: {one.words}\n{one.text[-400:]}" for one in bad[:5])
    assert len(endings) == COUNT and {one.family for one in endings} <= FAMILIES.keys()
    assert sum(one.kind == "told" for one in endings) > 3 < sum(one.kind == "ok" for one in endings)


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
