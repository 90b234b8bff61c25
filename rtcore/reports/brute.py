"""Families that need no oracle, only many rays: at shared edges, leaving surfaces, across narrow gaps, any hit against the closest."""
import functools
import math
from collections.abc import Callable

import numpy as np

from rtcore.api import intersect, occluded
from rtcore.flatten import DTYPES, flatten
from rtcore.reports.catalogue import CUBE
from rtcore.reports.families import batches, families
from rtcore.reports.meshes import MESHES
from rtcore.reports.rows import Row, Worst, example
from rtcore.scene import Matrix, Node, Scene, Shape
from rtcore.shapes import Blob, Box, Cone, Cylinder, Implicit, Mesh, Plane, Polygon, Quadric, Sphere, Torus, Triangle
from rtcore.solvers import RENDERER, names, roots
from rtcore.wave import CLOSEST, DEAD, DX, ERR, GX, OX, PX, START, SURFACE_ROWS, T, new_rays

CHUNK = 100_000

#: Shapes that a ray leaving them outward can't meet again; of the others one that leaves steeply meets nothing nearer than NEAR.
CONVEX = (Sphere((0.3, -0.2, 0.1), 0.9), Plane((0.1, 0.2, 0.3), (1, -2, 0.5)), Triangle((-1, -1, 0.2), (1.2, -0.7, -0.4), (0.1, 1.3, 0.3)),
          Mesh([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]),
          Polygon(((-1, -1, 0), (1, -1, 0), (1, 0, 0), (0, 0, 0), (0, 1, 0))), Box((-1, -0.5, -0.7), (0.4, 1, 0.3)),
          Cylinder((-0.3, -0.8, 0.1), (0.4, 0.7, -0.2), 0.6), Cone((0, 0, -0.75), 0.4, (0, 0, 0.75), 0.9), CUBE)
CURVED = (Torus(0.7, 0.25), Quadric((4, 4, -2, 0, 0, 0, 0, 0, 0, -1), (-1, -1, -1), (1, 1, 1)),
          Blob((((-0.3, 0, 0), 0.7, 1), ((0.4, 0.1, 0), 0.7, 1)), 0.4),
          Implicit("(x^2+y^2+z^2+0.24)^2-1.2*(x^2+y^2)", (-1, -1, -1), (1, 1, 1)))
MODELS = {type(shape): shape for shape in CONVEX + CURVED}
FLAT = (Plane, Triangle, Polygon)
NEAR, STEEP = 0.02, 0.2
PLACES = (np.eye(4), [[1e-3, 0, 0, 7], [0, 0, -1e-3, -3], [0, 1e-3, 0, 11], [0, 0, 0, 1]],
          [[-1, 0, 0, 3], [0, 2, 0.1, 0], [0, 0.3, 0.5, -2], [0, 0, 0, 1]])


def _row(shape: type[Shape], precision: str, family: str, rays: int, wrong: int, worst: Worst | None = None, nonfinite: int = 0,
         solver: str = RENDERER) -> Row:
    target = "0 wrong" if solver == RENDERER else ""
    return Row(shape.__name__.lower(), solver, precision, family, rays, wrong, math.nan, math.nan, math.nan, nonfinite, math.nan, target,
               wrong == 0 and nonfinite == 0 if target else None, (worst,) if worst else ())


# --- any hit against the closest ---

def any_hit(shape: type[Shape], precision: str, n: int, seed: int) -> list[Row]:
    """Rays of every random family: `occluded` says the same as `intersect`."""
    rays = wrong = nonfinite = 0
    worst = None
    kinds = [family for family in families(shape) if family != "catalogue"]
    for family in kinds:
        for batch in batches(family, shape, DTYPES[precision], n // len(kinds), seed, per_shape=max(n // len(kinds) // 8, 1)):
            hits = intersect(batch.scene, batch.origins, batch.directions, precision=precision, threads=1)
            differ = (hits.node >= 0) != occluded(batch.scene, batch.origins, batch.directions, precision=precision, threads=1)
            rays, wrong = rays + len(differ), wrong + int(differ.sum())
            nonfinite += int((np.isnan(hits.t) | ~np.isfinite(hits.normal).all(axis=1)).sum())
            if differ.any() and worst is None:
                i = int(differ.argmax())
                worst = Worst(True, math.inf, "any-hit and closest-hit differ",
                              example(batch.shape, batch.transform, batch.origins[i], batch.directions[i], precision))
    return [_row(shape, precision, "any-hit", rays, wrong, worst, nonfinite)]


# --- shared edges ---

def closed_mesh(name: str, shape: type[Shape], precision: str, n: int, seed: int) -> list[Row]:
    """From inside a closed mesh at its vertices and edges: every ray hits."""
    rng, dtype = np.random.default_rng([seed, 1]), DTYPES[precision]
    (vertices, faces), room, share = MESHES[name]
    mesh, n = Mesh(vertices.astype(dtype).astype(float), faces), round(n * share)
    wrong, worst = 0, None
    for start in range(0, n, CHUNK):
        size = min(CHUNK, n - start)
        corners = mesh.vertices[mesh.faces[rng.integers(0, len(faces), size)]]
        first = rng.integers(0, 3, size)
        a, b = corners[np.arange(size), first], corners[np.arange(size), (first + 1) % 3]
        along = rng.choice([0, 0.5, 0.25, 2], (size, 1), p=[0.4, 0.1, 0.1, 0.4])
        target = a + np.where(along > 1, rng.random((size, 1)), along) * (b - a)
        eye = rng.uniform(-room, room, (size, 3))
        eye[::2] = rng.uniform(-room, room, 3)      # half of the rays from one point, as a camera's are
        eye = eye.astype(dtype).astype(float)
        lost = ~np.isfinite(intersect(Scene(objects=[mesh]), eye, target - eye, precision=precision, threads=1).t)
        wrong += int(lost.sum())
        if lost.any() and worst is None:
            i = int(lost.argmax())
            code = example(f"Mesh(*MESHES[{name!r}][0])", (), eye[i], (target - eye)[i], precision)
            worst = Worst(True, math.inf, "a ray gets out of a closed mesh", code)
    return [_row(shape, precision, f"shared edges: {name}", n, wrong, worst)]


def shared_edge(shape: type[Shape], precision: str, n: int, seed: int) -> list[Row]:
    """Two triangles with a common edge, rays at it: every ray hits one of them, by each solver."""
    rng, dtype, per_pair = np.random.default_rng([seed, 2]), DTYPES[precision], 2000
    rows = []
    lost = dict.fromkeys(names(shape), 0)
    pairs = max(n // per_pair, 1)
    for _ in range(pairs):
        a, b = rng.uniform(-1, 1, (2, 3))
        along = (b - a) / np.linalg.norm(b - a)
        side = np.cross(along, rng.normal(size=3))
        side /= np.linalg.norm(side)
        up, middle = np.cross(along, side), (a + b) / 2
        c, d = (middle + sign * side + rng.uniform(-0.3, 0.3) * up + rng.uniform(-0.3, 0.3) * along for sign in (1, -1))
        a, b, c, d = (p.astype(dtype).astype(float) for p in (a, b, c, d))
        # the same way around, as in a mesh, each from any of its corners
        one, two = (Triangle(*(tuple(p.tolist()) for p in np.roll(corners, rng.integers(3), axis=0))) for corners in ((a, b, c), (b, a, d)))
        eye = (middle + 2 * up + rng.uniform(-0.3, 0.3, (per_pair, 3))).astype(dtype)
        way = (a + rng.uniform(0.01, 0.99, (per_pair, 1)) * (b - a) - eye).astype(dtype)
        rays = np.ascontiguousarray(np.concatenate([eye.T, way.T]))
        for name in lost:
            if name == RENDERER:
                hit = intersect(Scene(objects=[one, two]), eye, way, precision=precision, threads=1).node >= 0
            else:
                hit = (roots(one, name, rays)[1] > 0) | (roots(two, name, rays)[1] > 0)
            lost[name] += int((~hit).sum())
    rows += [_row(shape, precision, "shared edges", pairs * per_pair, count, solver=name) for name, count in lost.items()]
    return rows


# --- leaving a surface ---

def _trace(geometry, o: np.ndarray, d: np.ndarray):
    """Rays (3, n) against a scene: their Rays, and the surfaces they hit."""
    n = o.shape[1]
    rays = new_rays(n, geometry.dtype)
    rays.ray[:], rays.ray[DX], rays.ray[T], rays.prim[:], rays.depth[:] = 0, 1, DEAD, -1, 0
    rays.ray[OX:OX + 3, :n], rays.ray[DX:DX + 3, :n], rays.ray[START, :n], rays.ray[T, :n] = o, d, 0, np.inf
    surface = np.zeros((SURFACE_ROWS, rays.ray.shape[1]), geometry.dtype)
    for group in geometry.groups:
        group.kind.intersect(rays, n, group.tree, group.table, group.first, CLOSEST)
    for group in geometry.groups:
        group.kind.surface(rays, n, surface, group.table, group.first)
    return rays, surface


def _leave(geometry, m: np.ndarray, rng, n: int):
    """Rays that hit, then what leaves the hit points on the eye's side as the shading sends it: moved by the error bound along the normal,
    half of the ways cosine distributed and half all but level. Origins and ways (3, k), whether each left on the front, the cosine with the
    normal, the surface's rows, the normal on that side."""
    target = m[:3, :3] @ rng.uniform(-1, 1, (3, n)) + m[:3, 3:]
    way = _ways(rng, n)
    o = target + way * np.abs(m[:3, :3]).sum() * rng.choice([1.0, 300.0], n)
    rays, surface = _trace(geometry, o.astype(geometry.dtype), (-way).astype(geometry.dtype))
    hit = np.flatnonzero(rays.prim[:n] >= 0)
    surface = surface[:, hit].astype(float)
    front = (rays.ray[DX:DX + 3, hit] * surface[GX:GX + 3]).sum(axis=0) < 0
    normal = surface[GX:GX + 3] * np.where(front, 1.0, -1.0)
    way = _ways(rng, len(hit))
    way = np.where(np.arange(len(hit)) % 2, way + normal, way - normal * (way * normal).sum(axis=0) + 1e-4 * normal)
    way /= np.linalg.norm(way, axis=0)
    cosine = (way * normal).sum(axis=0)
    keep = cosine > 1e-5
    origin = (surface[PX:PX + 3] + surface[ERR] * normal).astype(geometry.dtype)
    return origin[:, keep], way[:, keep].astype(geometry.dtype), front[keep], cosine[keep], surface[:, keep], normal[:, keep]


def _ways(rng, n: int) -> np.ndarray:
    way = rng.normal(size=(3, n))
    return way / np.linalg.norm(way, axis=0)


def leaving(shape: type[Shape], precision: str, n: int, seed: int) -> list[Row]:
    """Rays that leave a surface meet nothing of it where nothing is; see CONVEX."""
    rng = np.random.default_rng([seed, 3])
    model = MODELS[shape]
    rays = wrong = 0
    worst = None
    while rays < n:
        for place in PLACES:
            m = np.array(place, float)
            transform = (Matrix(m.tolist()),)
            geometry = flatten(Scene(objects=[Node(shape=model, transform=transform)]), precision)
            o, way, front, cosine, _, _ = _leave(geometry, m, rng, min(n, CHUNK))
            again, _ = _trace(geometry, o, way)
            k = len(front)
            met = again.prim[:k] >= 0
            if shape in FLAT:
                bad = met
            elif model in CONVEX:
                bad = met & front
            else:
                smallest = np.linalg.svd(m[:3, :3])[1][-1]
                bad = met & (cosine > STEEP) & (again.ray[T, :k] < NEAR * smallest)
            rays, wrong = rays + k, wrong + int(bad.sum())
            if bad.any() and worst is None:
                i = int(bad.argmax())
                worst = Worst(True, math.inf, "a ray that leaves meets the surface it left",
                              example(model, transform, o[:, i], way[:, i], precision))
    return [_row(shape, precision, "leaving", rays, wrong, worst)]


def gap(shape: type[Shape], precision: str, n: int, seed: int) -> list[Row]:
    """A plane over the surface, 64 ulp of its coordinates away, is met by every ray that leaves toward it not all but level."""
    rng, per_lid = np.random.default_rng([seed, 4]), 100
    model = MODELS[shape]
    rays = wrong = 0
    worst = None
    _, _, _, _, surface, normal = _leave(flatten(Scene(objects=[model]), precision), np.eye(4), rng, max(n // per_lid, 20) * 20)
    for k in range(min(n // per_lid, surface.shape[1])):
        point, up, bound = surface[PX:PX + 3, k], normal[:, k], surface[ERR, k]
        high = point + up * 64 * float(np.spacing(DTYPES[precision](max(np.abs(point).max(), 0.5))))
        lid = Plane(tuple(high.tolist()), tuple(up.tolist()))
        both = flatten(Scene(objects=[model, lid]), precision)
        way = _ways(rng, per_lid) + up[:, None]
        way /= np.linalg.norm(way, axis=0)
        way = way[:, (way * up[:, None]).sum(axis=0) > 0.02]
        o = np.repeat((point + bound * up).astype(both.dtype)[:, None], way.shape[1], axis=1)
        again, _ = _trace(both, o, way.astype(both.dtype))
        prim = again.prim[:way.shape[1]]
        bad = (prim < 0) | (both.leaf[prim] != 1)
        rays, wrong = rays + len(bad), wrong + int(bad.sum())
        if bad.any() and worst is None:
            i = int(bad.argmax())
            ray = f"[{o[:, i].tolist()}], [{way[:, i].tolist()}], precision={precision!r}"
            worst = Worst(True, math.inf, "a plane 64 ulp above it is not met", f"intersect(Scene(objects=[{model!r}, {lid!r}]), {ray})")
    return [_row(shape, precision, "gap", rays, wrong, worst)]


def brute(shape: type[Shape]) -> dict[str, Callable]:
    """The families of this page that a shape has: (shape, precision, rays, seed) -> rows."""
    work = {"any-hit": any_hit}
    if shape is Triangle:
        work["shared edges"] = shared_edge
    if shape is Mesh:
        work |= {f"shared edges: {name}": functools.partial(closed_mesh, name) for name in MESHES}
    if shape in MODELS:
        work |= {"leaving": leaving, "gap": gap}
    return work
