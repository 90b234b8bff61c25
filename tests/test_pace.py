"""How fine a first lattice is chosen, and how large a tile."""
import time

import pytest

from rtcore import Camera, Scene, Sphere
from rtcore.pace import EDGES, LONG, Pace
from rtcore.progressive import Renderer, RenderRequest
from rtcore.schedule import COARSEST, LATTICES, TILE, Pass, passes, tiles, weight
from rtcore.settings import Settings


def pace(**seconds) -> Pace:
    made = Pace()
    made.frame = 0.0
    for name, each in seconds.items():
        made.note(int(name[1:]), 1.0, each)
    return made


def test_nothing_known_means_the_coarsest_lattice_and_tiles_as_ever():
    assert Pace().finest(10 ** 6, 2, 0.1, False) == COARSEST and Pace().edge(1, (1280, 720), 2) == TILE
    assert Pace().finest(10 ** 6, 2, 0.1, True) == 1        # known hits are quick until they turn out not to be


@pytest.mark.parametrize("each, spacing", [(1e-8, 1), (8e-8, 1), (1e-7, 2), (2e-7, 2), (5e-7, 4), (1e-6, 8), (1e-5, 16), (1.0, 16)])
def test_the_lattice_is_as_fine_as_the_deadline_allows(each, spacing):
    found = pace(s1=each)
    assert found.finest(10 ** 6, 1, 0.1, False) == spacing
    assert found.finest(10 ** 6, 4, 0.1, False) <= spacing <= found.finest(10 ** 6, 1, 0.03, False)


def test_a_lattice_that_was_timed_tells_of_its_neighbours():
    found = pace(s8=1e-6)
    assert found.seconds(8) == found.seconds(1) == 1e-6 < found.seconds(16)
    found.note(1, 2.0, 1e-6)
    assert found.seconds(2) == pytest.approx(1.5 * 0.5e-6) and found.seconds(8) == 1e-6
    found.forget()
    assert found.seconds(8) is None


@pytest.mark.parametrize("each", [1e-8, 1e-7, 1e-6, 1e-5])
def test_a_tile_is_soon_over(each):
    edge = pace(s1=each).edge(1, (4000, 4000), 2)
    assert edge ** 2 * each <= LONG and (edge == max(EDGES) or (2 * edge) ** 2 * each > LONG)


@pytest.mark.parametrize("first", LATTICES)
def test_every_pixel_is_in_one_tile_of_one_lattice(first):
    size, seen = (150, 83), []
    for one in passes(True, first):
        found = tiles(one, *size, dict.fromkeys(LATTICES, 32))
        for x0, y0, columns, rows, spacing, skip, *_ in found:
            seen += [(x * spacing, y * spacing) for y in range(y0, y0 + rows) for x in range(x0, x0 + columns)
                     if not (skip and x % 2 == 0 and y % 2 == 0)]
    assert len(seen) == len(set(seen)) == 150 * 83
    assert passes(True, first)[0].spacing == first and sum(weight(one, *size) for one in passes(True, first)) == pytest.approx(1)
    assert passes(False) == [Pass(1, False, range(1))]


@pytest.mark.alone
def test_the_first_picture_comes_in_time_and_shows_all_of_the_view():
    scene, renderer, late, shown = Scene(objects=[Sphere((0, 0, 0), 1)]), Renderer(keep=True), [], []
    for turn in range(12):
        start = time.perf_counter()
        view = Camera(lookfrom=(0.1 * turn, 0, -5))
        for frame in renderer.frames(RenderRequest(scene, view, Settings(size=(640, 360), samples=64)), deadline=0.1):
            late.append(time.perf_counter() - start)
            shown.append((frame.node >= 0).mean())
            break
    renderer.close()
    assert min(late[2:]) < 0.1      # a busy machine may be late now and then
    assert all(abs(share - shown[-1]) < 0.05 for share in shown) and shown[-1] > 0.1
