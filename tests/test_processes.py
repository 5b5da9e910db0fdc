"""Generators that run ahead in a process, and tasks that are shared out: the same items as without, and ends that leave nothing behind."""

import gc
import multiprocessing
import os
import signal
import subprocess
import sys
import time
import weakref
from contextlib import closing
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from hmc import processes
from hmc.errors import InputError
from hmc.processes import ahead, arrays_ahead, available_processors, each_ahead, may_fork, share_out, stepped_apart

pytestmark = pytest.mark.skipif(not may_fork(), reason="processes are forked on Linux alone")


def drawn(n=20):
    rng = np.random.default_rng(1)
    for k in range(n):
        yield {"k": k, "mask": rng.random((30, 40)) > 0.5, "none": None, "empty": np.zeros((0, 3)), "turned": rng.random((5, 4)).T}


def same(one, other):
    return all(np.array_equal(one[name], other[name]) if isinstance(one[name], np.ndarray) else one[name] == other[name] for name in one)


def test_items_are_the_same():
    found = 0
    for one, other in zip(drawn(), ahead(drawn), strict=True):
        assert same(one, other)
        found += 1
    assert found == 20
    assert not multiprocessing.active_children()


def arrays_of():
    for item in drawn():
        yield [item[name] for name in ("mask", "none", "empty", "turned")], item["k"]


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("item_bytes", [1 << 20, 1500, 1200, 16])
def test_arrays_are_the_same_whether_they_fit_into_shared_memory_or_not(workers, item_bytes):
    found = 0
    for (arrays, k), (others, number) in zip(arrays_of(), arrays_ahead(arrays_of, workers, item_bytes), strict=True):
        assert k == number and len(arrays) == len(others)
        for one, other in zip(arrays, others, strict=True):
            assert (one is None) == (other is None)
            assert one is None or (one.dtype == other.dtype and np.array_equal(one, other))
        found += 1
    assert found == 20
    assert not multiprocessing.active_children()


def test_items_are_made_in_another_process_and_with_one_worker_in_this():
    assert next(iter(ahead(lambda: iter([os.getpid()])))) != os.getpid()
    assert list(ahead(lambda: iter([os.getpid()]), workers=1)) == [os.getpid()]


def test_processes_begin_before_they_are_asked():
    begun = multiprocessing.get_context("fork").Value("q", 0)

    def count():
        with begun.get_lock():
            begun.value += 1
        yield [np.zeros(1)], 0

    with closing(ahead(count)), closing(arrays_ahead(count, 2, 1 << 10)):
        until = time.monotonic() + 10
        while begun.value < 2 and time.monotonic() < until:
            time.sleep(0.01)
        assert begun.value == 2
    assert not multiprocessing.active_children()


def test_what_items_are_made_of_is_not_held_here_too():
    large = np.zeros(8)
    left = weakref.ref(large)
    items = ahead(partial(iter, large), 2)
    del large
    gc.collect()
    assert left() is None
    assert list(items) == [0.0] * 8


def test_no_more_arrays_wait_than_there_is_room_for():
    made = multiprocessing.get_context("fork").Value("q", 0)

    def count():
        for k in range(50):
            made.value = k + 1
            yield [np.full(1000, k)], k

    taken = arrays_ahead(count, 2, 1 << 16)
    for k in range(10):
        arrays, number = next(taken)
        time.sleep(0.01)
        assert (arrays[0] == k).all() and number == k
        assert made.value <= k + 1 + processes.DEPTH
    taken.close()
    assert not multiprocessing.active_children()


def test_what_is_raised_there_is_raised_here():
    def wrong():
        yield 1
        raise InputError("cam_00.mp4: no frame")

    taken = ahead(wrong)
    assert next(taken) == 1
    with pytest.raises(InputError, match=r"cam_00\.mp4: no frame"):
        next(taken)
    with pytest.raises(InputError, match="third"):
        share_out([lambda: 1, lambda: 2, lambda: (_ for _ in ()).throw(InputError("third"))])


def test_an_exception_that_cannot_be_sent_is_told_by_its_words():
    class Odd(Exception):
        pass

    def wrong():
        raise Odd("unheard of")
        yield

    with pytest.raises(RuntimeError, match="Odd: unheard of"):
        list(ahead(wrong))


def test_a_worker_that_is_killed_is_told():
    def gone():
        yield 1
        os.kill(os.getpid(), signal.SIGKILL)
        yield 2

    with pytest.raises(ChildProcessError, match="exit code -9"):
        list(ahead(gone))
    with pytest.raises(ChildProcessError, match="exit code -9"):
        here = os.getpid()
        share_out([lambda: time.sleep(0.05) if os.getpid() == here else os.kill(os.getpid(), signal.SIGKILL)] * 8)


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_results_come_in_the_order_of_the_tasks(workers):
    tasks = [lambda k=k: (k, np.full(40_000, k)) for k in range(9)]
    for k, (number, values) in enumerate(share_out(tasks, workers)):
        assert number == k and (values == k).all()
    assert share_out([], workers) == []


@pytest.mark.parametrize("workers", [1, 2, 3, 9])
def test_items_come_in_the_order_of_their_keys(workers):
    keys = range(30, 23, -1)
    found = list(each_ahead(lambda own: ((key, np.full(100, key)) for key in own), keys, workers))
    assert [key for key, _ in found] == list(keys)
    assert all((values == key).all() for key, values in found)
    assert list(each_ahead(lambda own: iter(own), [], workers)) == []


def test_items_that_are_kept_stay_as_they_were():
    kept = list(ahead(lambda: (np.full(2000, k) for k in range(12))))
    assert [int(values[0]) for values in kept] == list(range(12))


def test_large_results_do_not_keep_a_helper_from_its_next_task():
    def task():
        time.sleep(0.02)
        return os.getpid(), np.zeros(1 << 17)

    counts = np.unique([worker for worker, _ in share_out([task] * 12, 2)], return_counts=True)[1]
    assert len(counts) == 2 and counts.min() >= 3


def test_workers_do_not_fork_again():
    assert share_out([lambda: may_fork()] * 2, 2)[0] in (True, False)
    assert list(ahead(lambda: iter([may_fork()]))) == [False]
    # What would be shared out there is done there.
    assert list(ahead(lambda: iter(share_out([os.getpid, os.getpid], 2)))) != [os.getpid(), os.getpid()]


def test_opencv_and_linear_algebra_go_on_on_both_sides_of_a_fork():
    image = np.random.default_rng(0).integers(0, 255, (1200, 1600, 3)).astype(np.uint8)
    square = np.random.default_rng(0).random((400, 400))
    before, threads = cv2.GaussianBlur(image, (9, 9), 0), cv2.getNumThreads()
    product = square @ square

    def blurred():
        yield cv2.GaussianBlur(image, (9, 9), 0), square @ square

    for there, there_product in ahead(blurred):
        assert np.array_equal(there, before) and np.allclose(there_product, product)
    assert np.array_equal(cv2.GaussianBlur(image, (9, 9), 0), before)
    assert cv2.getNumThreads() == threads


def test_workers_end_when_the_process_that_asked_is_killed(tmp_path: Path):
    script = tmp_path / "asks.py"
    script.write_text(
        "import os, sys, time\n"
        "from hmc.processes import ahead\n"
        "def endless():\n"
        "    while True:\n"
        "        yield os.getpid()\n"
        "print(next(ahead(endless)), flush=True)\n"
        "time.sleep(60)\n"
    )
    # The generator is kept by a name, or it would be closed.
    script.write_text(script.read_text().replace("print(next(ahead(endless))", "taken = ahead(endless)\nprint(next(taken)"))
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True) as asking:
        worker = int(asking.stdout.readline())
        asking.kill()
    for _ in range(100):
        if not Path(f"/proc/{worker}").exists() or "Z" in Path(f"/proc/{worker}/stat").read_text().split()[2]:
            return
        time.sleep(0.05)
    os.kill(worker, signal.SIGKILL)
    raise AssertionError("the worker was left behind")


def test_as_many_processors_as_this_process_may_use():
    assert 1 <= available_processors() <= (os.cpu_count() or 1)


def summed(state, item):
    """Sums of what came, told at every third; who told them."""
    total, n = state[0] + item[0], state[1] + 1
    return (total, n), [(total, os.getpid())] if n % 3 == 0 else []


@pytest.mark.parametrize("size", [1, 1 << 16])
def test_a_state_goes_on_in_a_process_of_its_own(size):
    found, state, expected = [], (np.zeros(size), 0), []
    with closing(stepped_apart(summed, (np.zeros(size), 0))) as stepping:
        for k in range(8):
            found += stepping.send((np.full(size, k),))
            state, told = summed(state, (np.full(size, k),))
            expected += told
        found += stepping.send(None)
    assert len(found) == len(expected) == 2
    for (total, there), (other, here) in zip(found, expected, strict=True):
        assert there != here and np.array_equal(total, other)
    assert not multiprocessing.active_children()


def test_what_a_step_raises_is_raised_where_items_are_sent():
    def wrong(state, item):
        raise InputError(f"no {item}")

    with closing(stepped_apart(wrong, 0)) as stepping, pytest.raises(InputError, match="no item"):
        for _ in range(1000):
            stepping.send("item")
    with closing(stepped_apart(lambda state, item: os.kill(os.getpid(), signal.SIGKILL), 0)) as stepping:
        with pytest.raises(ChildProcessError, match="exit code -9"):
            for _ in range(1000):
                stepping.send("item")
    assert not multiprocessing.active_children()


def test_what_waits_to_be_taken_does_not_keep_a_process_from_its_next_item(monkeypatch):
    monkeypatch.setattr(processes, "WAITING_BYTES", 20 << 20)
    made = multiprocessing.get_context("fork").Value("q", 0)

    def large():
        for k in range(50):
            made.value = k + 1
            yield np.full(1 << 17, k)  # a megabyte, of which a pipe takes a sixteenth

    with closing(ahead(large)) as taken:
        until = time.monotonic() + 20
        while made.value < 18 and time.monotonic() < until:
            time.sleep(0.01)
        time.sleep(0.1)
        assert 18 <= made.value <= 24
        assert [int(values[0]) for values in taken] == list(range(50))
