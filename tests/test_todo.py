"""What threads take from, one after the other."""
import threading

import numpy as np

from rtcore.indirect import caller
from rtcore.todo import FINISHED, NO_PIXELS, TAKEN, count_one, new_todo


@caller
def take_all(todo, owner, me):
    """Take tiles until none is left, and note who has which."""
    while True:
        i = count_one(todo.counters, TAKEN)
        if i >= todo.tiles.shape[0]:
            return
        owner[i] += me
        count_one(todo.counters, FINISHED)


def test_each_tile_is_taken_once():
    """By threads that really run at once: kernels release Python's lock."""
    todo, owner, n = new_todo(np.zeros((200_000, 8), np.int64)), np.zeros(200_000, np.int64), 4
    take_all(new_todo(todo.tiles[:0]), owner, 0)      # compiled
    start = threading.Barrier(n)

    def work(me):
        start.wait()
        take_all(todo, owner, me)
    threads = [threading.Thread(target=work, args=(10 ** k,)) for k in range(n)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert set(owner.tolist()) <= {10 ** k for k in range(n)}
    assert todo.counters.tolist() == [len(owner) + n, len(owner)]


def test_no_list_is_an_empty_one():
    assert new_todo(np.zeros((1, 8), np.int64)).pixels is NO_PIXELS and len(NO_PIXELS) == 0
