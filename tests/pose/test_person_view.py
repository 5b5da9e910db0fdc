"""What a frame shows of each person: shared out once, whoever needs what; what is not needed is None."""

from dataclasses import replace

import numpy as np
import pytest
from drawn import draw_recording
from methods import VOXEL_M, tiny_clip, true_tracks
from numpy.testing import assert_array_equal

from hmc.errors import InputError
from hmc.io.masks import MaskStep
from hmc.io.recording import open_recording
from hmc.io.results import TrackTable
from hmc.pose.views import person_view
from hmc.pose.views.hull_target import distance_at
from hmc.pose.views.person_view import EVIDENCE, check_needs, views_of
from hmc.tracking.resumable import person_grid
from hmc.voxels.carving import shared_tables
from hmc.voxels.hulls import FrontendSettings, carve_step, stream_hulls

OF_HULLS = ("hulls", "skin", "voxels")


@pytest.fixture(scope="module")
def frame():
    """The first frame of the small clip: recording, grid, tracks, hulls."""
    clip = tiny_clip(1)
    grid = person_grid(clip, VOXEL_M)
    return clip, grid, true_tracks(1), next(iter(stream_hulls(clip, grid)))


@pytest.fixture(scope="module")
def pair(tmp_path_factory, ring):
    """One frame of two drawn people."""
    places = [(-0.6, 0.0), (0.7, 0.3)]
    clip = open_recording(draw_recording(tmp_path_factory.mktemp("pair") / "two", ring, [places]))
    grid = person_grid(clip, 0.06)
    tracks = TrackTable(np.zeros(2, int), np.array([3, 5]), np.array([[*place, 0.9] for place in places]))
    return clip, grid, tracks, next(iter(stream_hulls(clip, grid)))


@pytest.mark.parametrize("needs", [(), *((name,) for name in OF_HULLS), OF_HULLS], ids=lambda needs: "+".join(needs) or "nothing")
def test_what_is_not_needed_is_not_made(frame, needs):
    (view,) = views_of(*frame, needs).values()
    assert view.frame == 0 and view.markers is None and not view.velocity.any()
    made = {"hulls": view.target, "skin": view.skin, "voxels": view.voxels}
    assert {name for name, value in made.items() if value is not None} == set(needs)


def test_what_is_needed_beside_does_not_change_what_is_seen(frame):
    (whole,) = views_of(*frame, OF_HULLS).values()
    (hulls,), (skin,), (voxels,) = (views_of(*frame, (name,)).values() for name in OF_HULLS)
    assert_array_equal(hulls.target.surface, whole.target.surface)
    assert_array_equal(hulls.target.rays, whole.target.rays)
    assert_array_equal(skin.skin.points, whole.skin.points)
    assert_array_equal(voxels.voxels.points, whole.voxels.points)
    for one, other in zip(voxels.voxels.votes, whole.voxels.votes, strict=True):
        assert_array_equal(one, other)


def test_a_frame_is_labelled_once_for_all_persons_and_all_evidence(pair, monkeypatch):
    calls = []
    for name in ("observe_step", "person_voxels"):
        real = getattr(person_view, name)
        monkeypatch.setattr(person_view, name, lambda *given, real=real, name=name: calls.append(name) or real(*given))
    views_of(*pair, OF_HULLS)
    assert calls == ["observe_step", "person_voxels"]


def test_voxels_are_shared_out_among_the_people(pair):
    clip, grid, tracks, hull = pair
    views = views_of(clip, grid, tracks, hull, OF_HULLS)
    assert list(views) == [3, 5]
    own = [{tuple(voxel) for voxel in view.voxels.voxels} for view in views.values()]
    assert not own[0] & own[1]
    for view, place in zip(views.values(), tracks.positions, strict=True):
        assert np.abs(view.voxels.points[:, :2].mean(0) - place[:2]).max() < 0.15
        assert np.abs(view.target.surface[:, :2].mean(0) - place[:2]).max() < 0.15
        assert_array_equal(view.voxels.points, grid.centres(view.voxels.voxels))
        assert hull.tolerant[tuple(view.voxels.voxels.T)].all()
    # Rays of one person's silhouette do not ask the other for what is beside them.
    alone = views_of(clip, grid, tracks.where(tracks.persons == 3), hull, ("hulls",))
    assert set(alone) == {3}


def test_a_piece_that_is_nobodys_may_be_anybodys(frame, monkeypatch):
    """A hand beyond a sleeve that all cameras lost: a body may be there, and silhouettes ask for it."""
    clip, grid, tracks, hull = frame
    (whole,) = views_of(clip, grid, tracks, hull).values()
    above = grid.centres(np.argwhere(hull.strict))[:, 2].max() - 0.2
    real = person_view.person_voxels

    def without_head(*given):
        return [voxels[grid.centres(voxels)[:, 2] < above] for voxels in real(*given)]

    monkeypatch.setattr(person_view, "person_voxels", without_head)
    (view,) = views_of(clip, grid, tracks, hull).values()
    heads = grid.centres(np.argwhere(hull.strict))
    heads = heads[heads[:, 2] > above]
    at = tuple(np.rint((heads - view.target.origin) / view.target.voxel_size_m).astype(int).T)
    assert len(heads) > 20 and view.target.loose[at].all() and not view.target.tolerant[at].any()
    assert (view.target.rays[:, 2] > above).sum() > 0.5 * (whole.target.rays[:, 2] > above).sum()


def test_a_body_may_be_where_a_camera_only_doubts_what_the_others_show(pair):
    """Between people one camera's loss is in the tolerant hull at a price. Where it only doubts, the price is that of a hidden place."""
    clip, grid, tracks, hull = pair
    rows = np.flatnonzero(hull.masks[1].any(axis=1))
    lost = hull.masks[1].copy()
    lost[: rows[len(rows) // 2]] = False  # trunks and heads
    gone = hull.masks[1] & ~lost
    masks = (hull.masks[0], lost, *hull.masks[2:])
    steps = [MaskStep(0, hull.images, masks, (None, doubt, *(None,) * (len(masks) - 2))) for doubt in (None, gone)]
    denied, doubted = (carve_step(shared_tables(grid, clip.rig), step, FrontendSettings()) for step in steps)
    assert denied.doubted is None
    assert_array_equal(doubted.doubted, hull.strict)
    inside = grid.centres(np.argwhere(hull.strict & ~denied.strict))
    off = [
        np.minimum(*(distance_at(view.target, inside) for view in views_of(clip, grid, tracks, one).values())) for one in (denied, doubted)
    ]
    assert off[0].max() > 0.015 and off[1].max() < 0.011


def test_people_who_are_not_in_the_frame_and_those_whom_nothing_shows(frame):
    clip, grid, tracks, hull = frame
    elsewhere = TrackTable(np.array([0, 0, 1]), np.array([0, 7, 9]), np.vstack([tracks.positions, [2.2, 2.0, 0.9], tracks.positions]))
    views = views_of(clip, grid, elsewhere, hull, OF_HULLS)
    assert set(views) == {0, 7}
    assert views[7].target is None and views[7].skin is None and views[7].voxels is None
    (alone,) = views_of(clip, grid, tracks, hull, OF_HULLS).values()
    assert_array_equal(views[0].target.surface, alone.target.surface)
    # A frame whose silhouettes were of no use shows nothing of anybody.
    unusable = replace(hull, masks=[None] * len(hull.masks), strict=hull.strict & False, tolerant=hull.tolerant & False)
    (nothing,) = views_of(clip, grid, tracks, unusable, OF_HULLS).values()
    assert nothing.target is None and nothing.skin is None and nothing.voxels is None and nothing.frame == 0


@pytest.mark.parametrize(("every", "taken"), [(3, "strict"), (40, "tolerant")])
def test_a_strict_hull_that_is_whole_is_taken_however_fat_the_tolerant_one(frame, every, taken):
    """Of few cameras it is less than half of the tolerant one; only where nearly nothing is left of it a camera lost the person."""
    clip, grid, tracks, hull = frame
    strict = np.zeros_like(hull.tolerant)
    few = np.argwhere(hull.tolerant)[::every]
    strict[tuple(few.T)] = True
    (view,) = views_of(clip, grid, tracks, replace(hull, strict=strict), ("voxels",)).values()
    voxels = view.voxels.voxels
    assert 0 < len(voxels) <= (len(few) if taken == "strict" else hull.tolerant.sum())
    assert strict[tuple(voxels.T)].all() == (taken == "strict")


def test_needs_that_nobody_knows_are_refused():
    assert check_needs(EVIDENCE) == frozenset(EVIDENCE)
    with pytest.raises(InputError, match="may need hulls, skin, voxels, detections, keypoints; got 'sound'"):
        check_needs(["hulls", "sound"])
