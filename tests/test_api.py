"""The contract of the Python API: shapes and types of arrays, node indices, limits, and one clear error for each bad input."""
import gc
import io
import math
import pickle
import warnings

import numpy as np
import pytest
from PIL import Image

import rtcore
from rtcore import Camera, FieldError, Fog, Material, Mesh, Node, Plane, Scale, Scene, Sphere, Translate, api
from rtcore.flatten import flatten

BALL = Scene(objects=[Sphere((0, 0, 0), 1)], camera=Camera(lookfrom=(0, 0, -5)))
Z = (0, 0, 1)


def stacked() -> Scene:
    """Five leaves along z, 4 apart: a group with a hidden child, a definition used twice, a plane at the end."""
    pair = Node(children=[Sphere((0, 0, 0), 1), Node(shape=Sphere((0, 0, 2), 0.5), visible=False)])
    uses = [Node(use="pair", transform=[Translate((0, 0, z))]) for z in (0, 4)]
    return Scene(objects=[*uses, Plane((0, 0, 9), (0, 0, -1))], definitions={"pair": pair}, camera=Camera(lookfrom=(0, 0, -5)))


# --- intersect ---

@pytest.mark.parametrize("precision,dtype", [("f64", np.float64), ("f32", np.float32)])
def test_shapes_and_types(precision, dtype):
    for n in (0, 1, 7, 8, 9, 1000):
        o, d = np.tile((0.1, 0.2, -5), (n, 1)), np.tile(Z, (n, 1))
        hits = rtcore.intersect(BALL, o, d, precision=precision)
        assert all(a is b for a, b in zip(hits, (hits.t, hits.node, hits.normal, hits.uv), strict=True))
        assert [a.shape for a in hits] == [(n,), (n,), (n, 3), (n, 2)]
        assert [a.dtype for a in hits] == [dtype, np.int32, dtype, dtype]
        assert (hits.node == 0).all() and (np.unique(hits.t).size <= 1)
        dark = rtcore.occluded(BALL, o, d, precision=precision)
        assert dark.shape == (n,) and dark.dtype == bool and dark.all()


def test_any_kind_of_input():
    expected = rtcore.intersect(BALL, np.array([(0.0, 0, -5)]), np.array([(0.0, 0, 2)]))
    for o, d in ([[[0, 0, -5]], [[0, 0, 2]]], [np.array([[0, 0, -5]]), np.array([[0, 0, 2]], np.int8)],
                 [np.asfortranarray(np.array([[0, 0, -5]], np.float32)), ((0, 0, 2),)]):
        hits = rtcore.intersect(BALL, o, d)
        assert all((a == b).all() for a, b in zip(hits, expected))
    strided = np.zeros((10, 6))[::2, ::2]
    strided[:, 2] = -5
    before = strided.copy()
    assert (rtcore.intersect(BALL, strided, np.tile(Z, (5, 1))).t == 4).all()
    assert (strided == before).all()


def test_the_arrays_given_may_change_before_the_normals_are_asked_for():
    rng = np.random.default_rng(1)
    o, d = rng.normal(size=(api.CHUNK + 5, 3)), rng.normal(size=(api.CHUNK + 5, 3))
    expected = rtcore.intersect(stacked(), o, d)
    assert 100 < np.count_nonzero(np.linalg.norm(expected.normal, axis=1)) == np.count_nonzero(expected.node >= 0) < len(o)
    hits = rtcore.intersect(stacked(), o, d)
    o[:], d[:] = 0, 1
    assert (hits.normal == expected.normal).all() and (hits.uv == expected.uv).all()


def test_hits_are_copied_and_shown():
    hits = rtcore.intersect(BALL, [(0, 0, -5), (0, 3, -5)], [Z] * 2)
    assert repr(hits) == "<Hits: 1 of 2 rays>"
    for asked in (False, True):
        again = pickle.loads(pickle.dumps(hits))
        assert all((a == b).all() for a, b in zip(again, hits)) and again.normal.tolist() == [[0, 0, -1], [0, 0, 0]], asked


def test_a_scene_is_flattened_once_and_forgotten_with_it(monkeypatch):
    made = []
    monkeypatch.setattr(api, "flatten", lambda *words: made.append(words[1]) or flatten(*words))

    def ask(scene, precision="f64"):
        return rtcore.intersect(scene, [(0, 0, -5)], [Z], precision=precision).t[0]
    scene, other = Scene(objects=[Sphere((0, 0, 0), 1)]), Scene(objects=[Sphere((0, 0, 0), 2)])
    assert [ask(scene), ask(other), ask(scene, "f32"), ask(scene), ask(other)] == [4, 3, 4, 4, 3]
    assert rtcore.occluded(scene, [(0, 0, -5)], [Z]).all() and made == ["f64", "f64", "f32"]
    one = id(scene)
    assert (one, "f64") in api._geometries
    del scene
    gc.collect()
    assert (one, "f64") not in api._geometries and (one, "f32") not in api._geometries
    for radius in range(1, 9):      # a new scene may have the place in memory of one that is gone
        assert ask(Scene(objects=[Sphere((0, 0, 0), radius / 8)])) == 5 - radius / 8
    kept = [Scene(objects=[Sphere((0, 0, 0), radius / 8)]) for radius in range(1, 9)]
    assert [ask(s) for s in kept] == [5 - radius / 8 for radius in range(1, 9)] and len(api._geometries) == api.KEPT


def test_t_counts_in_lengths_of_the_direction():
    lengths = np.array([1e-305, 1e-20, 0.3, 1, 7, 1e20, 1e308])
    hits = rtcore.intersect(BALL, np.tile((0, 0, -5), (7, 1)), lengths[:, None] * Z)
    np.testing.assert_allclose(hits.t * lengths, 4, rtol=1e-15)
    assert (hits.normal == (0, 0, -1)).all()


def test_t_too_large_for_its_type_is_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        hits = rtcore.intersect(BALL, [(0, 0, -5)], [(0, 0, 1e-39)], precision="f32")
    assert hits.node[0] == 0 and hits.t[0] == np.inf


def test_nothing_hit():
    hits = rtcore.intersect(BALL, [(0, 0, -5), (0, 0, 5)], [(0, 1, 0), Z])
    assert (hits.t == np.inf).all() and (hits.node == -1).all() and not hits.normal.any() and not hits.uv.any()


def test_node_counts_leaves_hidden_and_repeated_ones_too():
    scene = stacked()
    leaves = list(scene.leaves())
    assert [leaf.visible for leaf in leaves] == [True, False, True, False, True]
    hits = rtcore.intersect(scene, [(0, 0, -5), (0, 0, 1.5), (0, 0, 5.5), (0, 0, 4)], [Z] * 4)
    assert hits.node.tolist() == [0, 2, 4, 2] and hits.t.tolist() == [4, 1.5, 3.5, 1]
    assert (rtcore.intersect(scene, [(0, 0, 2)], [(1, 0, 0)]).t == np.inf).all()     # the hidden one


@pytest.mark.parametrize("n", [0, 1, 7, 8, 9, 16, 21])
@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_any_number_of_rays_each_with_its_own_limits(n, precision):
    rng = np.random.default_rng(n)
    o, d = rng.normal(size=(n, 3)) * 3, rng.normal(size=(n, 3)) * 10.0 ** rng.integers(-6, 6, (n, 1))
    t_min, t_max = rng.uniform(0, 2, n), rng.uniform(2, 5, n)
    scale = 1 / np.linalg.norm(d, axis=1)
    all_ = rtcore.intersect(BALL, o, d, t_min * scale, t_max * scale, precision)
    alone = [rtcore.intersect(BALL, o[i:i + 1], d[i:i + 1], t_min[i] * scale[i], t_max[i] * scale[i], precision) for i in range(n)]
    assert all_.t.tolist() == [one.t[0] for one in alone]
    assert all_.node.tolist() == [one.node[0] for one in alone]
    for k in range(n):
        for bad, where in ((np.nan, d), (np.inf, o), (0, d)):
            spoilt = where.copy()
            spoilt[k] = bad
            with pytest.raises(FieldError, match=rf"\[{k}\]"):
                rtcore.intersect(BALL, spoilt if where is o else o, spoilt if where is d else d)


def test_t_min_and_t_max():
    o, d = [(0, 0, -5)] * 4, [Z] * 4
    assert rtcore.intersect(BALL, o, d, t_min=[0, 4, 5, 6]).t.tolist() == [4, 6, 6, np.inf]      # t_min < t
    assert rtcore.intersect(BALL, o, d, t_max=[3, 4, 4.5, 7]).t.tolist() == [np.inf, np.inf, 4, 4]      # t < t_max
    assert rtcore.intersect(BALL, o, d, t_min=4.5, t_max=5.5).t.tolist() == [np.inf] * 4
    assert rtcore.occluded(BALL, o, d, t_max=[3, 4, 4.5, math.inf]).tolist() == [False, False, True, True]
    assert rtcore.intersect(BALL, o, np.multiply(d, 0.25), t_min=17, t_max=25).t.tolist() == [24] * 4
    assert rtcore.intersect(BALL, o, d, t_max=0).t.tolist() == [np.inf] * 4


def test_t_min_below_zero_is_refused():
    """A tree is entered at t = 0: what lies behind the origin would be found for some shapes and missed for others."""
    for t_min in (-1, -math.inf, [0, -1e-9]):
        with pytest.raises(FieldError, match="t_min: expected a number of at least 0"):
            rtcore.intersect(BALL, [(0, 0, -5)] * 2, [Z] * 2, t_min=t_min)


def test_threads_and_chunks_change_nothing():
    rng = np.random.default_rng(0)
    o, d = rng.normal(size=(40_001, 3)) * 2, rng.normal(size=(40_001, 3))
    one, three, all_ = (rtcore.intersect(stacked(), o, d, threads=n) for n in (1, 3, None))
    assert all((a == b).all() and (a == c).all() for a, b, c in zip(one, three, all_))
    assert (rtcore.occluded(stacked(), o, d, threads=3) == (one.node >= 0)).all()
    part = rtcore.intersect(stacked(), o[123:456], d[123:456])
    assert all((a == b[123:456]).all() for a, b in zip(part, one))


def test_empty_scene():
    for scene in (Scene(), Scene(objects=[Node(children=[])]), Scene(objects=[Node(shape=Sphere((0, 0, 0), 1), visible=False)])):
        hits = rtcore.intersect(scene, [(0, 0, -5)], [Z])
        assert hits.t.tolist() == [np.inf] and hits.node.tolist() == [-1]
        assert not rtcore.occluded(scene, [(0, 0, -5)], [Z]).any()
        assert rtcore.render(scene, (8, 6)).pixels.shape == (6, 8, 3)
    flat = Mesh([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)])     # all its triangles are dropped
    assert rtcore.intersect(Scene(objects=[flat]), [(0, 0, -5)], [Z]).node.tolist() == [-1]
    assert rtcore.render(Scene(objects=[flat]), (8, 6)).stats["rays"]["primary_hits"] == 0


def test_transparent_things_occlude():
    glass = Scene(objects=[Node(shape=Sphere((0, 0, 0), 1), material=Material(transmission=1))])
    assert rtcore.occluded(glass, [(0, 0, -5)], [Z]).all()


BAD = {
    "origins: expected an array (N, 3)": ([(0, 0)], [Z]),
    "directions: expected an array (N, 3)": ([(0, 0, 0)], Z),
    "origins: expected an array (N, 3), got 'abc'": ("abc", [Z]),
    "directions: expected as many directions as origins, 2": ([(0, 0, 0)] * 2, [Z]),
    "origins[1]: expected three finite numbers": ([(0, 0, 0), (0, math.nan, 0)], [Z] * 2),
    "directions[0]: expected three finite numbers": ([(0, 0, 0)], [(math.inf, 0, 0)]),
    "directions[1]: expected a vector that is not zero": ([(0, 0, 0)] * 2, [Z, (0, -0.0, 0)]),
}


@pytest.mark.parametrize("threads", [1, 2])
def test_a_bad_number_in_any_chunk_is_told_with_its_row(threads):
    n = 3 * api.CHUNK
    for name, value, row, expected in (("origins", math.nan, n - 1, "three finite numbers, got [0.0, nan, 0.0]"),
                                       ("directions", -math.inf, n // 2, "three finite numbers, got [0.0, -inf, 1.0]"),
                                       ("directions", 0, 5, "a vector that is not zero, got [0.0, 0.0, 0.0]")):
        given = {"origins": np.zeros((n, 3)), "directions": np.tile(np.float64(Z), (n, 1))}
        given[name][row, 1:2 if value else 3] = value
        given["directions"][row + 1:row + 2, 0] = math.nan if name == "origins" else 7     # told second, or fine
        with pytest.raises(FieldError) as error:
            rtcore.intersect(BALL, **given, threads=threads)
        assert str(error.value) == f"{name}[{row}]: expected {expected}"
    t_min = np.zeros(n)
    t_min[-1] = -2
    with pytest.raises(FieldError, match="^t_min: expected a number of at least 0, got -2.0$"):
        rtcore.intersect(BALL, np.zeros((n, 3)), np.ones((n, 3)), t_min, threads=threads)


@pytest.mark.parametrize("message", BAD)
def test_bad_rays(message):
    for ask in (rtcore.intersect, rtcore.occluded):
        with pytest.raises(FieldError) as error:
            ask(BALL, *BAD[message])
        assert str(error.value).startswith(message) and "\n" not in str(error.value)


def test_numbers_too_large_for_the_precision():
    with pytest.raises(FieldError, match=r"origins\[0\]: expected three finite numbers"):
        rtcore.intersect(BALL, [(1e39, 0, 0)], [Z], precision="f32")
    with pytest.raises(FieldError, match="float32"):
        rtcore.intersect(Scene(objects=[Sphere((1e39, 0, 0), 1)]), [(0, 0, 0)], [Z], precision="f32")
    big = rtcore.Polygon(((-1e39, -1e39, 0), (1e39, -1e39, 0), (0, 1e39, 0)))
    with pytest.raises(FieldError, match="float32"):
        rtcore.intersect(Scene(objects=[big]), [(0, 0, -1)], [Z], precision="f32")


@pytest.mark.parametrize("words", [{"precision": "f16"}, {"t_min": math.nan}, {"t_max": math.nan}, {"t_max": "far"}, {"t_min": [1, 2, 3]}])
def test_bad_options_of_intersect(words):
    with pytest.raises(FieldError):
        rtcore.intersect(BALL, [(0, 0, -5)] * 2, [Z] * 2, **words)


def test_transforms_that_cancel_out_are_refused_with_their_place():
    inner = Node(shape=Sphere((0, 0, 0), 1), transform=[Scale((1e-200, 1e-200, 1e-200))])
    scene = Scene(objects=[Plane((0, 0, 0), Z), Node(children=[inner], transform=[Scale((1e-200, 1e-200, 1e-200))])])
    with pytest.raises(FieldError, match=r"scene\[1\]\[0\]"):
        rtcore.intersect(scene, [(0, 0, -5)], [Z])


# --- render, load ---

def test_image():
    image = rtcore.render(BALL, size=(12, 7), spp=3)
    assert image.pixels.shape == (7, 12, 3) and image.pixels.dtype == np.float32 and (image.pixels >= 0).all()
    stats = image.stats
    assert stats["size"] == [12, 7] and stats["samples_per_pixel"] == 3 and stats["precision"] == "f64" and stats["threads"] >= 1
    assert set(stats["rays"]) == {"primary", "primary_hits", "shadow", "shadow_hits", "reflection", "refraction"}
    assert stats["rays"]["primary"] == 12 * 7 * 3 and stats["nonfinite_pixels"] == 0
    assert {"prepare", "trace"} <= set(stats["seconds"]) and all(s >= 0 for s in stats["seconds"].values())
    assert all(set(entry) == {"stage", "why"} for entry in stats["left_out"]) and stats["error"]["rmse_estimate"] >= 0


def test_image_shows_itself():
    image = rtcore.render(BALL, (20, 10))
    shown = Image.open(io.BytesIO(image._repr_png_()))
    assert shown.size == (20, 10) and shown.mode == "RGB"
    middle, linear = np.array(shown)[5, 10].astype(int), image.pixels[5, 10]
    expected = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.minimum(linear, 1) ** (1 / 2.4) - 0.055) * 255
    assert np.abs(middle - expected).max() <= 1


@pytest.mark.parametrize("words", [{"size": (0, 5)}, {"size": (5,)}, {"size": "big"}, {"spp": 0}, {"spp": 1.5}, {"precision": "f16"},
                                   {"max_depth": 0}, {"threads": -1}, {"view": "xray"}, {"seconds": 0}, {"error": -1}, {"shadows": 1}])
def test_bad_settings(words):
    with pytest.raises(FieldError):
        rtcore.render(BALL, **{"size": (4, 4), **words})


def test_load_gives_a_scene_to_render(tmp_path):
    file = tmp_path / "ball.yaml"
    file.write_text("rayscope: 1\nscene:\n  - sphere: {center: [0, 0, 0], radius: 1}\nfog: {density: 0.2}\n")
    scene = rtcore.load(file)
    assert scene.objects[0].shape == Sphere((0, 0, 0), 1) and scene.fog == Fog(density=0.2)
    assert rtcore.intersect(scene, [(0, 0, -5)], [Z]).t.tolist() == [4]
    assert rtcore.render(rtcore.load(str(file)), (8, 8)).stats["rays"]["primary_hits"] > 10     # framed: it names no camera


def test_records_are_exported():
    assert all(hasattr(rtcore, name) for name in rtcore.__all__)


def test_a_mesh_without_any_area_is_nothing():
    line = Mesh([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)])
    scene = Scene(objects=[line, Sphere((0, 0, 5), 1)])
    assert rtcore.intersect(scene, [(0, 0, -5), (2, 0, -5)], [(0, 0, 1), (0, 0, 1)]).node.tolist() == [1, -1]
    assert {"stage": "degenerate triangles", "why": "1 without area"} in rtcore.render(scene, (8, 6)).stats["left_out"]
