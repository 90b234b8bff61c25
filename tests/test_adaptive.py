"""Adaptive sampling: samples go where the error is, the estimate stays fair, and the picture is the same for any number of threads."""
import threading

import numpy as np
import pytest

import rtcore
from rtcore import Background, Camera, Checker, Directional, Material, Node, Plane, Scene, Sphere, adaptive
from rtcore import film as films
from rtcore.progressive import Renderer, RenderRequest
from rtcore.schedule import TILE, Pass, tile_order, tiles, weight
from rtcore.settings import Settings

SIZE = 96, 72
BALLS = Scene(objects=[Node(shape=Sphere((x, 0.2 * x, 0), 0.4), material=Material(color=(0.8, 0.2, 0.1))) for x in (-1, 0, 1)],
              lights=[Directional(direction=(1, -2, 1))], background=Background(color=(0.1, 0.2, 0.5), top=(0.6, 0.7, 0.9)),
              camera=Camera(lookfrom=(0, 0, -5), lookat=(0, 0, 0), fov=40))
FLOOR = Scene(objects=[Node(shape=Plane((0, 0, 0), (0, 1, 0)), material=Material(checker=Checker(size=0.5), reflection=0.2))],
              lights=[Directional(direction=(1, -2, 1))], camera=Camera(lookfrom=(0, 1, -5), lookat=(0, 0.5, 0)))
FLAT = Scene(lights=(), background=Background(color=(0.3, 0.4, 0.5)), camera=Camera(lookfrom=(0, 0, -5)))


def render(scene=BALLS, coarse=False, **settings):
    """All frames, and the film."""
    renderer = Renderer()
    chosen = {"size": SIZE, "samples": 32, "adaptive": True, **settings}
    try:
        return list(renderer.frames(RenderRequest(scene, scene.camera, Settings(**chosen)), coarse=coarse)), renderer._render.film
    finally:
        renderer.close()


@pytest.fixture(scope="module")
def truths():
    return {id(scene): rtcore.render(scene, SIZE, 1024, seed=99) for scene in (BALLS, FLOOR)}


def rmse(pixels, truth) -> float:
    """Error of a picture, less what is the reference's own share."""
    return float(np.sqrt(max(np.square(pixels.astype(float) - truth.pixels).mean() - truth.stats["error"]["rmse_estimate"] ** 2, 0)))


def test_samples_go_where_the_error_is(truths):
    frames, film = render()
    count, truth = film.count.reshape(SIZE[::-1]), truths[id(BALLS)]
    assert count.min() == adaptive.FIRST and count.max() >= 128 and (count & (count - 1) == 0).all()
    assert 0.97 * 32 < count.mean() <= 32 and frames[-1].mean == pytest.approx(count.mean()) and frames[-1].done
    uniform = rtcore.render(BALLS, SIZE, 32).pixels
    scatter = np.abs(uniform - truth.pixels).max(2)
    assert np.median(count[scatter > 0.02]) >= 4 * np.median(count[scatter < 1e-4])
    assert rmse(frames[-1].pixels, truth) < 0.5 * rmse(uniform, truth)


@pytest.mark.parametrize("scene", [BALLS, FLOOR], ids=["balls", "floor"])
def test_the_estimate_stays_fair(scene, truths):
    frames, _ = render(scene, samples=40)
    for frame in frames:
        if frame.mean >= 2:
            assert 0.75 < frame.error / rmse(frame.pixels, truths[id(scene)]) < 1.35, frame.mean


def test_same_picture_for_any_threads_and_with_coarse_passes():
    whole, film = render(threads=1)
    for threads, coarse in ((3, False), (2, True)):
        other, same = render(threads=threads, coarse=coarse)
        assert other[-1].pixels.tobytes() == whole[-1].pixels.tobytes() and (same.count == film.count).all()
        assert other[-1].rays == whole[-1].rays


def test_all_samples_are_those_of_their_numbers():
    """Where a pixel has as many samples as in a uniform picture it is the same to the last bit: none was traced twice or left out."""
    frames, film = render()
    for samples in (8, 64):
        uniform, same = rtcore.render(BALLS, SIZE, samples).pixels, film.count.reshape(SIZE[::-1]) == samples
        assert same.sum() > 20 and (frames[-1].pixels[same] == uniform[same]).all()


def test_a_flat_picture_says_so_and_stops():
    frames, film = render(FLAT, samples=1 << 20)
    assert frames[-1].done and frames[-1].converged and frames[-1].error == 0 and (film.count == adaptive.FIRST).all()
    assert not any(frame.converged for frame in frames[:-1])


def test_a_picture_that_has_not_converged_does_not_say_so():
    frames, _ = render()
    assert frames[-1].done and not frames[-1].converged and frames[-1].error > adaptive.CONVERGED


def test_an_error_ends_it_without_much_more_than_was_needed(truths):
    frames, _ = render(FLOOR, samples=1 << 16, error=0.004)
    assert frames[-1].done and 0.0025 < frames[-1].error <= 0.004
    assert rmse(frames[-1].pixels, truths[id(FLOOR)]) == pytest.approx(frames[-1].error, rel=0.3)


def test_seconds_end_it_within_a_pass():
    frames, film = render(FLOOR, samples=1 << 16, seconds=0.3, size=(320, 240))
    assert frames[-1].done and frames[-1].elapsed < 3 and film.count.min() >= 1 and np.isfinite(frames[-1].pixels).all()


def test_stats_tell_the_least_the_mean_and_the_most():
    stats = rtcore.render(BALLS, SIZE, 32, adaptive=True).stats
    assert stats["samples"]["least"] == 8 < stats["samples_per_pixel"] == stats["samples"]["mean"] < 32.01 < stats["samples"]["most"]
    stats = rtcore.render(BALLS, SIZE, 4).stats
    assert stats["samples_per_pixel"] == 4 and stats["samples"] == {"least": 4, "mean": 4, "most": 4}


def test_views_show_samples_and_error():
    for view in ("samples", "error"):
        frames, _ = render(view=view)
        beauty, film = render()
        shown, count = frames[-1].pixels.sum(2), film.count.reshape(SIZE[::-1])
        assert np.isfinite(shown).all() and frames[-1].rays == beauty[-1].rays
        if view == "samples":
            assert shown[count == count.max()].min() > shown[count == 8].max()
        else:
            errors = np.sqrt(adaptive.squared_errors(film, *SIZE)).reshape(count.shape)
            assert shown[errors > 0.5 * errors.max()].min() > shown[errors < 0.05 * errors.max()].max()
        assert np.isfinite(rtcore.render(BALLS, SIZE, 1, view=view).pixels).all()


def test_material_view_has_a_colour_per_material():
    shared, own = Material(), Material(color=(1, 0, 0))
    balls = Scene(objects=[Node(shape=Sphere((x, 0, 0), 0.4), material=m) for x, m in ((-1, shared), (0, own), (1, shared))],
                  camera=BALLS.camera)
    shown = render(balls, samples=1, view="material")[0][-1].pixels[36]
    left, middle, right = shown[24], shown[48], shown[72]
    assert (left == right).all() and (left != middle).any() and middle.any() and not shown[0].any()


# --- the parts ---

@pytest.mark.parametrize("size", [(1, 1), (64, 64), (97, 130), (200, 3)])
def test_the_order_has_every_pixel_once_block_by_block(size):
    order = tile_order(*size)
    assert sorted(order) == list(range(size[0] * size[1]))
    x, y = order % size[0], order // size[0]
    first = slice(0, min(64, size[0] * size[1]))
    if min(size) >= 8:
        assert np.ptp(x[first]) < 8 and np.ptp(y[first]) < 8
    places = np.stack([x // TILE, y // TILE])
    changes = (np.diff(places) != 0).any(axis=0).sum()
    assert changes == len(np.unique(places, axis=1).T) - 1      # a tile is not come back to


def test_a_list_is_cut_into_parts_of_about_a_tile():
    pixels = np.array([[p, 8, 8 + (4096 if p == 5 else 24)] for p in range(1000)], np.int32)
    one = Pass(1, False, range(0), pixels)
    found = tiles(one, 40, 25)
    parts = [pixels[first:last] for first, last, *_ in found]
    assert np.concatenate(parts).tolist() == pixels.tolist()
    assert all((part[:, 2] - part[:, 1]).sum() == rays * one < TILE ** 2 + 4096 for part, (_, _, rays, one, *_) in zip(parts, found))
    assert weight(one, 40, 25) == (999 * 24 + 4096) / 1000


def refined(film: films.Film, width: int, height: int, budget: float, **more) -> Pass | None:
    return adaptive.refinement(film, adaptive.squared_errors(film, width, height), tile_order(width, height), budget, **more)


def film_of(scatter: np.ndarray, n: int) -> films.Film:
    """A film of n samples a pixel that scatter by so much (h, w), their halves as far apart as independent ones are."""
    height, width = scatter.shape
    film = films.new_film(width, height)
    film.count[:] = n
    film.total[:] = n * 0.5
    film.square[:] = n * 0.25 + scatter.ravel() * (n - 1)
    film.split[:] = np.sqrt(scatter.ravel() * n)[:, None]
    return film


def test_errors_are_those_of_the_replicates_where_all_pixels_are_alike():
    film = film_of(np.full((20, 30), 0.02), 16)
    assert np.allclose(adaptive.squared_errors(film, 30, 20), 0.02 / 16, rtol=0.02)
    assert films.rmse_estimate(film) == pytest.approx((0.02 / 16) ** 0.5)
    assert adaptive.rmse_estimate(adaptive.squared_errors(film, 30, 20)) == pytest.approx((0.02 / 16) ** 0.5, rel=0.01)


def test_any_number_of_samples_has_an_estimate():
    for n in (2, 3, 1 << 16, (1 << 20) - 1, 1 << 20):
        errors = adaptive.squared_errors(film_of(np.full((4, 5), 0.02), n), 5, 4)
        assert np.isfinite(errors).all() and 0.01 / n ** 1.5 < errors.min() <= errors.max() < 0.03 / n
    film = film_of(np.full((4, 5), 0.2), 1 << 16)
    assert refined(film, 5, 4, 1 << 20, enough=1e-9) is None      # as far as it goes


def test_enough_is_as_little_as_is_asked_for():
    film = film_of(np.full((4, 5), 1e-9), 8)
    assert len(refined(film, 5, 4, 64.0).pixels) == 0
    assert len(refined(film, 5, 4, 64.0, enough=1e-6).pixels) > 0
    frames, _ = render(BALLS, samples=4096, error=5e-5, size=(24, 18))
    assert frames[-1].done and frames[-1].error <= 5e-5


def test_a_pixel_without_scatter_beside_an_edge_is_not_forgotten():
    scatter = np.zeros((20, 30))
    scatter[:, 15] = 0.2
    errors = adaptive.squared_errors(film_of(scatter, 8), 30, 20).reshape(20, 30)
    assert (errors[:, 14] > 0.02 * errors[:, 15]).all() and (errors[:, :13] == 0).all()
    assert (errors[:, 14] < 0.3 * errors[:, 15]).all()


@pytest.mark.parametrize("budget", [8.0, 8.001, 9.3, 12.0, 40.0])
def test_a_pass_costs_what_it_may(budget):
    random = np.random.default_rng(4)
    film = film_of(random.random((40, 50)) ** 4, 8)
    one = refined(film, 50, 40, budget)
    spent = 0 if one is None else weight(one, 50, 40)
    most = min(budget - 8, adaptive.GROWTH * 8)
    assert spent <= most and (spent > 0.97 * most or most < 0.01)
    if one is not None:
        assert (one.pixels[:, 1] == 8).all() and set(one.pixels[:, 2]) <= {16, 32}


def test_equal_pixels_share_what_there_is_evenly():
    one = refined(film_of(np.full((40, 50), 0.1), 8), 50, 40, 12.0)
    assert weight(one, 50, 40) == 4 and (one.pixels[:, 2] == 16).all()
    columns = np.bincount(one.pixels[:, 0] % 50, minlength=50)
    assert columns.min() >= 15 and columns.max() <= 25


# --- going on ---

@pytest.mark.parametrize("adaptive", [True, False])
def test_another_view_traces_nothing_and_goes_on(adaptive):
    renderer, chosen = Renderer(), {"size": SIZE, "samples": 16, "adaptive": adaptive, "threads": 2}

    def request(view):
        return RenderRequest(BALLS, BALLS.camera, Settings(view=view, **chosen))
    halfway = threading.Event()
    seen = [frame for frame in renderer.frames(request("beauty"), halfway.is_set) if frame.samples < 4 or halfway.set() is None]
    first, *rest = renderer.frames(request("normal"), lambda: True)
    assert not seen[-1].done and not rest and first.rays == seen[-1].rays and (first.pixels != seen[-1].pixels).any()
    *_, last = renderer.frames(request("beauty"))
    whole = rtcore.render(BALLS, SIZE, 16, adaptive=adaptive)
    assert last.done and last.pixels.tobytes() == whole.pixels.tobytes() and last.rays == whole.stats["rays"]
    (depth,) = renderer.frames(request("depth"))
    assert depth.done and depth.rays == last.rays and depth.number == last.number
    (beauty,) = renderer.frames(request("beauty"))
    assert beauty.pixels.tobytes() == last.pixels.tobytes()
    again = list(renderer.frames(request("beauty")))       # asked for the same once it is done, it is done again
    assert len(again) > 1 and again[-1].rays == last.rays
    renderer.close()


def test_a_view_without_light_has_none_to_go_on_with():
    renderer, chosen = Renderer(), {"size": SIZE, "samples": 2}
    list(renderer.frames(RenderRequest(BALLS, BALLS.camera, Settings(view="normal", **chosen))))
    *_, last = renderer.frames(RenderRequest(BALLS, BALLS.camera, Settings(**chosen)))
    renderer.close()
    assert last.pixels.tobytes() == rtcore.render(BALLS, SIZE, 2).pixels.tobytes()


def test_a_stopped_render_goes_on_wherever_it_was_stopped(monkeypatch):
    monkeypatch.setattr("rtcore.picture.LOOK", 0.0002)      # seconds between two questions while a pass is traced
    renderer, settings = Renderer(), Settings(size=(480, 320), samples=12, adaptive=True, threads=2)
    request, last, stops = RenderRequest(BALLS, BALLS.camera, settings), None, 0

    def patience(calls):
        """Whether it was asked so many times before; once so, for ever."""
        left = [calls]

        def tired():
            left[0] -= 1
            return left[0] < 0
        return tired
    while last is None or not last.done:
        for frame in renderer.frames(request, patience(3 + stops // 2)):
            last = frame
        stops += 1
    renderer.close()
    whole = rtcore.render(BALLS, (480, 320), 12, adaptive=True)
    assert stops > 10 and last.pixels.tobytes() == whole.pixels.tobytes() and last.rays == whole.stats["rays"]
