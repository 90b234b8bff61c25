"""Properties that need no oracle, for every shape and random rays: what scaling, mirroring and turning the whole scene must not change."""
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rtcore
from rtcore import Matrix, Node, Scene

from test_shapes import EXAMPLES, rays_at, transform

DTYPE = {"f64": np.float64, "f32": np.float32}
#: Where t is the true one to half an ulp, so that it can't depend on the axes' order by more than one.
CERTAIN = {"sphere", "plane", "polygon", "box", "cylinder", "tube", "cone", "frustum", "funnel", "saddle", "hyperboloid", "torus",
           "spindle", "gem", "wedge", "blob", "bitten blob", "blob of eight"}

number = st.floats(-3, 3, width=32)
ray = st.tuples(number, number, number, number, number, number).filter(lambda r: max(map(abs, r[3:])) > 1e-3)
rays = st.lists(ray, min_size=4, max_size=9)


def hits(shape, matrix, o, d, precision):
    placed = np.eye(4)
    placed[:3, :3] = matrix
    return rtcore.intersect(Scene(objects=[Node(shape=shape, transform=[Matrix(placed.tolist())])]), o, d, precision=precision).t


def split(drawn, precision):
    numbers = np.array(drawn, DTYPE[precision])
    return numbers[:, :3], numbers[:, 3:]


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", [name for name in EXAMPLES if name not in ("gyroid", "drop")])
class TestCompanions:
    @settings(max_examples=6)
    @given(drawn=rays, power=st.integers(-30, 30))
    def test_scaling_by_a_power_of_two_scales_t_bitwise(self, name, precision, drawn, power):
        o, d = split(drawn, precision)
        scale = DTYPE[precision](2.0 ** power)
        one = hits(EXAMPLES[name], np.eye(3), o, d, precision)
        two = hits(EXAMPLES[name], np.eye(3) * scale, o * scale, d, precision)
        assert (one * scale == two).all()

    @settings(max_examples=6)
    @given(drawn=rays, signs=st.tuples(*[st.sampled_from((1.0, -1.0))] * 3))
    def test_mirrored_axes_give_the_same_bits(self, name, precision, drawn, signs):
        if name == "polygon":
            return      # its half-open edges belong to one side
        o, d = split(drawn, precision)
        turn = np.array(signs, DTYPE[precision])
        one = hits(EXAMPLES[name], np.eye(3), o, d, precision)
        assert (one == hits(EXAMPLES[name], np.diag(turn), o * turn, d * turn, precision)).all()

    @settings(max_examples=6)
    @given(drawn=rays, order=st.permutations(range(3)))
    def test_the_order_of_the_axes_changes_an_ulp_at_most(self, name, precision, drawn, order):
        if name == "polygon":
            return
        o, d = split(drawn, precision)
        one = hits(EXAMPLES[name], np.eye(3), o, d, precision)
        two = hits(EXAMPLES[name], np.eye(3)[list(order)], o[:, order], d[:, order], precision)
        if name in CERTAIN:
            assert (np.isfinite(one) == np.isfinite(two)).all()
        both = np.isfinite(one) & np.isfinite(two)
        allowed = np.spacing(one[both]) if name in CERTAIN else 1e-4 * np.abs(one[both]) + 1e-4
        assert (np.abs(one[both] - two[both]) <= allowed).all()

    @settings(max_examples=6)
    @given(drawn=rays)
    def test_any_hit_is_closest_hit(self, name, precision, drawn):
        o, d = split(drawn, precision)
        scene = Scene(objects=[EXAMPLES[name]])
        t = rtcore.intersect(scene, o, d, precision=precision).t
        assert (rtcore.occluded(scene, o, d, precision=precision) == np.isfinite(t)).all()
        met = np.isfinite(t) & (t < 1e30)
        if met.any():
            assert not rtcore.occluded(scene, o[met], d[met], t_max=t[met].astype(float), precision=precision).any()
            beyond = np.nextafter(t[met], np.inf, dtype=t.dtype).astype(float)
            assert rtcore.occluded(scene, o[met], d[met], t_max=beyond, precision=precision).all()


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", sorted(CERTAIN))
def test_past_a_crossing_comes_the_next_one(name, precision):
    """Hits count from t_min on, which is open: also where a crossing and t_min are the same number only once t is rounded."""
    rng, seen = np.random.default_rng([len(name), len(precision)]), 0
    for kind in ("rigid", "stretched", "mirrored"):
        matrix = transform(rng, kind)
        scene = Scene(objects=[Node(shape=EXAMPLES[name], transform=[Matrix(matrix.tolist())])])
        for o, d in zip(*rays_at(rng, matrix, 40, precision)):
            true = rtcore.crossings(scene, o, d, precision)
            true = true[true > 0]
            for start in true:
                first = rtcore.intersect(scene, [o], [d], t_min=float(start), precision=precision).t[0]
                after = true[true > start]
                assert first == pytest.approx(after[0] if len(after) else np.inf, rel=1e-6), (matrix.tolist(), o.tolist(), d.tolist())
                seen += len(after)
    assert seen > 10 or name in ("plane", "polygon")
