"""Whole commands on recordings, results and surroundings that are whole and strange: they do their work, or say in words what is wrong."""

import pytest
from miniature import build
from mutations import warm
from strangers import run, tasks

#: Each so many-th of them.
STEP = 5


@pytest.mark.slow
def test_strange_things_end_no_command_badly(tmp_path):
    base = build(tmp_path / "miniature")
    warm()
    endings = [run(base, task, k) for k, task in enumerate(tasks(pairs=0, seed=0)) if k % STEP == 0]
    bad = [one for one in endings if one.kind not in ("ok", "told")]
    assert not bad, "\n".join(f"{one.family}: {one.why}: {one.words}\n{one.text[-400:]}" for one in bad[:5])
    assert len(endings) > 90 and sum(one.kind == "told" for one in endings) > 30
