"""Cameras out of time are told by their sound: known shifts and clocks, and nothing where there is nothing to hear."""

import shutil
import subprocess
import tomllib

import numpy as np
import pytest
from drawn import draw_recording
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal
from scipy.io import wavfile

from hmc.check.sync.hearing import Heard, heard_later, onsets
from hmc.check.sync.sound import settled
from hmc.cli import main
from hmc.io.ffmpeg import ffmpeg_path
from hmc.io.sound import SAMPLE_RATE, read_sound, video_begins

RATE = SAMPLE_RATE
needs_ffmpeg = pytest.mark.skipif(ffmpeg_path() is None, reason="no ffmpeg here")


def steps(rng, seconds):
    """Steps and knocks at uneven times, (n,)."""
    n = round(seconds * RATE)
    sound = np.zeros(n)
    for place in (np.cumsum(rng.exponential(0.5, 3 * round(seconds))) * RATE).astype(int):
        if place < n - 800:
            sound[place : place + 800] += rng.normal(size=800) * np.exp(-np.arange(800) / 80) * rng.uniform(0.3, 1)
    return sound


def microphone(rng, sound, gain=1.0):
    """As it is heard in a room of its own, with noise 10 dB below."""
    echoes = rng.normal(size=1600) * np.exp(-np.arange(1600) / 400)
    echoes[0] = 8
    heard = signal.fftconvolve(sound, echoes)[: len(sound)]
    heard /= heard.std()
    return (0.1 * gain * (heard + 0.3 * rng.normal(size=len(heard)))).astype(np.float32)


def in_pieces(sound, size=RATE):
    return onsets([sound[k : k + size] for k in range(0, len(sound), size)], RATE)


@pytest.mark.parametrize("shift_s", [0.0, 0.734, -1.9])
def test_a_shift_is_heard(shift_s):
    rng = np.random.default_rng(3)
    sound = steps(rng, 14)
    first = in_pieces(microphone(rng, sound[2 * RATE : 12 * RATE]))
    begin = round((2 - shift_s) * RATE)
    second = in_pieces(microphone(rng, sound[begin : begin + 9 * RATE], gain=0.05))
    heard = heard_later(first, second, 5.0)
    assert heard.begin_s == pytest.approx(shift_s, abs=0.005) and heard.ratio > 1.5 and heard.slope == 0
    back = heard_later(second, first, 5.0)
    assert back.begin_s == pytest.approx(-shift_s, abs=0.005)


def test_pieces_make_no_difference():
    sound = microphone(np.random.default_rng(0), steps(np.random.default_rng(0), 4))
    np.testing.assert_allclose(in_pieces(sound, 4567), onsets([sound], RATE), atol=1e-3)


def test_a_clock_that_runs_differently_is_heard():
    rng = np.random.default_rng(5)
    sound = steps(rng, 42)
    slow = np.interp(np.arange(round(len(sound) * 1.002)) / 1.002, np.arange(len(sound)), sound)
    heard = heard_later(in_pieces(microphone(rng, sound)), in_pieces(microphone(rng, slow[RATE // 2 :])), 5.0)
    assert heard.slope == pytest.approx(0.002, abs=0.0002) and heard.begin_s == pytest.approx(-0.5, abs=0.01)


def test_what_has_nothing_in_common_tells_nothing():
    for seed in range(6):
        rng = np.random.default_rng(seed)
        other = np.random.default_rng(seed + 50)
        pairs = [
            (steps(rng, 12), steps(other, 12)),
            (rng.normal(size=10 * RATE), other.normal(size=10 * RATE)),
            (np.zeros(10 * RATE), np.zeros(10 * RATE)),
            (steps(rng, 12), np.zeros(12 * RATE)),
        ]
        for first, second in pairs:
            tracks = [in_pieces(one.astype(np.float32) if not one.any() else microphone(rng, one)) for one in (first, second)]
            assert heard_later(*tracks, 5.0) is None


def test_an_even_beat_and_a_single_bang_tell_nothing():
    rng = np.random.default_rng(0)
    bang = rng.normal(size=800) * np.exp(-np.arange(800) / 80)
    beat, once = np.zeros(12 * RATE), np.zeros(12 * RATE)
    for place in range(0, 12 * RATE - 800, RATE // 2):
        beat[place : place + 800] = bang
    once[5 * RATE : 5 * RATE + 800] = bang
    for sound in (beat, once):
        assert heard_later(in_pieces(microphone(rng, sound[RATE:])), in_pieces(microphone(rng, sound)), 5.0) is None


@given(st.lists(st.floats(-3, 3), min_size=3, max_size=6), st.data())
def test_pairs_that_contradict_the_others_are_left_out(begins, data):
    n = len(begins)
    pairs = {(i, j): Heard(begins[j] - begins[i], 0.0, 2.0) for i in range(n) for j in range(i + 1, n)}
    if n > 3:
        wrong = data.draw(st.sampled_from(sorted(pairs)))
        pairs[wrong] = pairs[wrong]._replace(begin_s=pairs[wrong].begin_s + 1.5)
    found, slopes = settled(n, pairs, np.full((n, n), 0.01))
    np.testing.assert_allclose(found - found[0], np.array(begins) - begins[0], atol=1e-9)
    assert not slopes.any()


def test_cameras_that_nothing_ties_are_left_out():
    found, _ = settled(5, {(0, 1): Heard(1.0, 0.0, 2.0), (1, 3): Heard(0.5, 0.0, 2.0)}, np.zeros((5, 5)))
    np.testing.assert_array_equal(np.isfinite(found), [True, True, False, True, False])
    assert not np.isfinite(settled(3, {}, np.zeros((3, 3)))[0]).any()


def with_ffmpeg(*words):
    subprocess.run([ffmpeg_path(), "-v", "error", "-y", *map(str, words)], check=True)


@needs_ffmpeg
def test_sound_is_read_as_another_reader_reads_it(tmp_path):
    sound = microphone(np.random.default_rng(0), steps(np.random.default_rng(0), 9))
    wavfile.write(tmp_path / "a.wav", RATE, sound)
    pieces = list(read_sound(tmp_path / "a.wav", 7.5))
    assert max(map(len, pieces)) <= 4 * RATE
    np.testing.assert_allclose(np.concatenate(pieces), wavfile.read(tmp_path / "a.wav")[1][: round(7.5 * RATE)], atol=1e-6)
    assert not list(read_sound(tmp_path / "none.wav", 1.0))


@needs_ffmpeg
@pytest.mark.parametrize("container", ["mkv", "ts", "mp4"])
def test_pictures_that_begin_later_than_sound_are_later(tmp_path, container):
    late = 0.5 if container != "mp4" else 0.0
    wavfile.write(tmp_path / "a.wav", RATE, np.full(2 * RATE, 0.5, np.float32))
    file = tmp_path / f"b.{container}"
    picture = ("-itsoffset", late, "-f", "lavfi", "-i", "color=c=red:s=64x48:r=20:d=2")
    with_ffmpeg(
        *picture,
        "-i",
        tmp_path / "a.wav",
        "-ar",
        48000,
        "-c:v",
        "mpeg2video" if container == "ts" else "mpeg4",
        "-bf",
        "0",
        "-c:a",
        "aac",
        file,
    )
    # A stream of AAC in these containers may begin with up to two frames of 1024 samples that are none.
    assert video_begins(file) == pytest.approx(late, abs=2 * 1024 / 48000 + 0.05)


def filmed(ring, folder, sounds):
    """Somebody who stands still, filmed for as long as there is sound: images tell nothing of time."""
    n = round(20 * min(len(sound) for sound in sounds) / RATE)
    draw_recording(folder, ring, [[(0.2, 0.1)]] * n)
    (folder / "videos").mkdir()
    for camera, sound in zip(ring, sounds, strict=True):
        wavfile.write(folder / "sound.wav", RATE, sound)
        images = ("-framerate", 20, "-i", folder / "images" / camera.name / "%06d.png")
        with_ffmpeg(
            *images, "-i", folder / "sound.wav", "-q:v", 3, "-c:v", "mpeg4", "-c:a", "aac", folder / "videos" / f"{camera.name}.mp4"
        )
    shutil.rmtree(folder / "images")
    return folder


@needs_ffmpeg
@pytest.mark.slow
def test_the_command_listens_where_images_do_not_tell(ring, tmp_path, capsys, monkeypatch):
    rng = np.random.default_rng(1)
    scene = steps(rng, 9)
    ahead = [0, 14, 0, -10, 0]  # frames of 20 a second
    begins = [RATE - frames * RATE // 20 for frames in ahead]
    sounds = [microphone(rng, scene[begin : begin + 6 * RATE]) for begin in begins]
    folder = filmed(ring, tmp_path / "late", sounds)
    words = ["sync", str(folder), "--out", str(tmp_path / "a.png")]
    monkeypatch.setattr("hmc.check.sync.sound.ffmpeg_path", lambda: None)
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "there is no ffmpeg" in said and "too little to go by" in said
    monkeypatch.undo()
    assert main(words) == 0
    assert "by its sound alone" in capsys.readouterr().out
    first = tomllib.loads((folder / "recording.toml").read_text())["first_frame"]
    assert [first[camera.name] - 10 for camera in ring] == ahead
