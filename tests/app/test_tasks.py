"""Threads for tasks: how many there are, who is told, and how they end."""
import threading

import pytest

from app.tasks import Tasks


@pytest.fixture
def tasks(qapp):
    tasks = Tasks()
    yield tasks
    tasks.close()


def test_tasks_in_a_row_share_a_thread(tasks, qtbot):
    threads, told = [], []
    for i in range(5):
        tasks.run(lambda: threads.append(threading.current_thread()), lambda _: told.append(threading.current_thread()), name="one")
        qtbot.waitUntil(lambda i=i: len(told) == i + 1)
        qtbot.waitUntil(lambda: threads[0].name == "task")
    assert len(set(threads)) == 1 and set(told) == {threading.main_thread()}
    tasks.close()
    assert not threads[0].is_alive()


def test_tasks_at_once_have_threads_of_their_own_and_one_stays(tasks, qtbot):
    go, threads, told = threading.Event(), [], []

    def work():
        threads.append(threading.current_thread())
        go.wait(5)
        return threading.current_thread().name
    for name in ("first", "second", "third"):
        tasks.run(work, told.append, name=name)
    qtbot.waitUntil(lambda: len(threads) == 3)
    assert len(set(threads)) == 3 and not told
    go.set()
    qtbot.waitUntil(lambda: len(told) == 3 and sum(thread.is_alive() for thread in threads) == 1)
    assert sorted(told) == ["first", "second", "third"]


def test_a_task_that_fails_does_not_end_the_thread(tasks, qtbot, capsys):
    told, crashed = [], []
    tasks.crashed.connect(crashed.append)
    tasks.run(lambda: 1 / 0, told.append, told.append)
    tasks.run(lambda: [][1], told.append)
    qtbot.waitUntil(lambda: len(told) == len(crashed) == 1)
    assert isinstance(told[0], ZeroDivisionError) and crashed == ["IndexError: list index out of range"]
    assert "IndexError" in capsys.readouterr().err
    tasks.run(lambda: "well", told.append)
    qtbot.waitUntil(lambda: told[1:] == ["well"])


def test_what_a_task_held_goes_when_it_is_done(tasks, qtbot):
    class Held:
        def __del__(self):
            gone.append(True)
    gone, told = [], []
    held = Held()
    tasks.run(lambda held=held: None, told.append)
    del held
    qtbot.waitUntil(lambda: bool(told) and bool(gone))


def test_after_the_end_nobody_is_told(tasks, qtbot):
    go, told = threading.Event(), []
    tasks.run(lambda: go.wait(5), told.append)
    threading.Timer(0.05, go.set).start()
    tasks.close()
    qtbot.wait(50)
    assert told == []
