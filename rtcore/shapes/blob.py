"""Blob: soft spheres that flow together (Wyvill, McPheeters and Wyvill, *Data Structure for Soft Objects*, 1986)."""
from fractions import Fraction
from typing import Annotated

import numpy as np

from rtcore.walk import ACTIVE, PACKET, begin, leaf_end, leaf_first, new_walk, next_leaf, shrink
from rtcore.exact import inverse, moved, parts
from rtcore.fields import Field, FieldError, Number, Vec, Vector
from rtcore.jit import inline, kernel
from rtcore.lanes import along, dot, greatest, load, root, size, store, vec3
from rtcore.scene import Shape, invertible
from rtcore.shapes._ball import advance, lowest
from rtcore.shapes._blob import (ALONG, ELEMENT_COLUMNS, FROM, HIT, MISS, MORE, MOST_ELEMENTS, NOISE, PARTS, POINT, RADIUS, REST, ROUGH,
                                 SHIFT, SPEED, STRENGTH, UNSURE, WAY, X, Y, Z, meet, new_scratch, search)
from rtcore.shapes._softly import settle
from rtcore.shapes._unit import line_in_pairs
from rtcore.shapes.kind import OWN, REACH, Kind, Packed, around, forward, normalized, placed, put_placed, unit_hit
from rtcore.wave import ERR, START, T, U, record

LEAST, MOST = 1e-30, 1e30       # radii of a unit blob's elements; smaller ones can't be seen, larger ones can't be told from these
LONGEST = 0.05                  # step toward the surface, in a unit blob
THRESHOLD, COUNT = OWN, OWN + 3     # columns: threshold in two parts (see `halves`), first element, number of elements


class Elements(Field):
    """A list of (center, radius, strength)."""

    def take(self, value):
        if isinstance(value, (str, bytes, dict)) or not hasattr(value, "__iter__"):
            raise FieldError("a list of elements: [center, radius, strength] each", value)
        result = []
        for i, element in enumerate(value):
            try:
                center, radius, strength = element
            except (TypeError, ValueError):
                raise FieldError("an element: [center, radius, strength]", element, f"[{i}]") from None
            parts = []
            for name, field, part in (("center", Vector(), center), ("radius", Number(above=0), radius), ("strength", Number(), strength)):
                try:
                    parts.append(field.take(part))
                except FieldError as error:
                    raise error.inside(name).inside(f"[{i}]") from None
            result.append(tuple(parts))
        if not 1 <= len(result) <= MOST_ELEMENTS:
            raise FieldError(f"1 to {MOST_ELEMENTS} elements", len(result))
        return tuple(result)


class Blob(Shape, frozen=True):
    """Where the field f(p) = Σ strength·(1 - |p - center|²/radius²)², each term within its radius only, equals `threshold`; the inside is
    where it is greater. A negative strength takes away."""

    elements: Annotated[tuple[tuple[Vec, float, float], ...], Elements(help="center, radius of influence and strength of each element")]
    threshold: Annotated[float, Number(above=0, help="value of the field on the surface")]

    def check(self):
        most = sum(strength for _, _, strength in self.elements if strength > 0)
        if most < self.threshold:
            raise FieldError(f"positive strengths that together reach the threshold, {self.threshold:g}", most, "elements")

    def kind(self, matrix: np.ndarray) -> Kind:
        return BLOB

    def pack(self, matrix: np.ndarray) -> Packed:
        centers, radii = np.array([c for c, _, _ in self.elements]), np.array([r for _, r, _ in self.elements])
        strengths = np.array([s for _, _, s in self.elements])
        with np.errstate(all="ignore"):     # numbers that overflow make a matrix that is refused
            low = (centers - radii[:, None])[strengths > 0].min(0)
            high = (centers + radii[:, None])[strengths > 0].max(0)
            scale = np.ldexp(1.0, np.frexp((high / 2 - low / 2).max() * (1 + 2.0 ** -18))[1])
            # scale a power of two and the middle of few digits: the elements keep theirs
            middle = np.round((low / 2 + high / 2) / scale * 2.0 ** 20) * 2.0 ** -20 * scale
            local = matrix @ np.array([[scale, 0, 0, middle[0]], [0, scale, 0, middle[1]], [0, 0, scale, middle[2]], [0, 0, 0, 1]])
            back = invertible(local)
            places = centers / scale - middle / scale
            back_again = places + middle / scale
            rest = (centers / scale - back_again) + ((back_again - places) - middle / scale)    # of that difference, exactly
            unit = np.column_stack([places, radii / scale, rest])
            unit *= np.minimum(1, MOST / unit[:, 3:4])
            strong = np.ldexp(1.0, -np.frexp(np.abs(strengths).max())[1])
            kept = (unit[:, 3] >= LEAST) & (strengths != 0)
            extra = np.column_stack([*halves(np.column_stack([unit[:, :4], strengths * strong])), unit[:, 4:]])[kept]
        exact = [*parts(moved(matrix, middle), 3), *parts([x / Fraction(scale) for row in inverse(matrix) for x in row], 3)]
        return Packed(BLOB, placed(local, back, *halves(self.threshold * strong), 0.0, len(extra))[None], extra, exact=np.array([exact]))


def halves(x):
    """Float64 as a float32 and the rest, so that a table of float32 keeps 48 digits of it."""
    first = np.asarray(x, np.float32).astype(np.float64)
    return first, x - first


@inline
def take_elements(element, data, q, extra):
    """The elements of blob q in full precision; returns how many there are."""
    first, count = int(data[q, COUNT - 1]), int(data[q, COUNT])
    for k in range(count):
        for j in range(PARTS):
            element[k, j] = np.float64(extra[first + k, j]) + np.float64(extra[first + k, PARTS + j])
        for j in range(3):
            element[k, REST + j] = extra[first + k, 2 * PARTS + j]
        element[k, ROUGH] = abs(element[k, STRENGTH]) * (1 + 4 / element[k, RADIUS])
    return count


@inline
def take_lines(ray, i, exact, q, line):
    """Eight rays in the unit space of blob q, about their closest approach to its middle; see `_blob.POINT`."""
    f, f1, v, v1 = line_in_pairs(ray, i, exact, q)
    longest = greatest(size(v.x), greatest(size(v.y), size(v.z)))
    e = v * (1 / longest)
    square = dot(e, e)
    shift = -dot(f, e) / square / longest
    nx, ny, nz = (advance(f.x, f1.x, shift, v.x, v1.x)[0], advance(f.y, f1.y, shift, v.y, v1.y)[0],
                  advance(f.z, f1.z, shift, v.z, v1.z)[0])
    more = -dot(vec3(nx, ny, nz), e) / square       # what the rounding of the shift left
    n = along(vec3(nx, ny, nz), more, e)
    inverse = 1 / root(square)
    put(line, POINT, n)
    put(line, ALONG, e * inverse)
    store(line, SPEED, 0, longest / inverse)
    store(line, SHIFT, 0, shift)
    store(line, MORE, 0, more / longest)
    put(line, FROM, f)
    put(line, FROM + 3, f1)
    put(line, WAY, v)
    put(line, WAY + 3, v1)


@inline
def put(line, row, v):
    """Three rows of eight."""
    store(line, row, 0, v.x)
    store(line, row + 1, 0, v.y)
    store(line, row + 2, 0, v.z)


@inline
def hit_blob(rays, i, lane, scratch, count, threshold, side):
    """One ray against the elements in `scratch`: HIT, MISS or UNSURE."""
    ray, line = rays.ray, scratch.line
    start, far = np.float64(ray[START, i]), ray[T, i]
    scratch.found[0, lane] = np.inf
    if not far > start:
        return MISS
    speed, shift, more = line[SPEED, lane], line[SHIFT, lane], line[MORE, lane]
    low = ((start - shift) - more) * speed
    m = meet(scratch, count, line[0, lane], line[1, lane], line[2, lane], line[3, lane], line[4, lane], line[5, lane], low)
    if m == 0:
        return MISS
    return search(scratch, count, m, threshold, low, shift, more, speed, start, far, side, lane)


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk, scratch = new_walk(rays), new_scratch(rays)
    data = table.data
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree, False)
        leaf = next_leaf(walk, tree, table)
        while leaf >= 0:
            for q in range(leaf_first(leaf), leaf_end(leaf)):
                count = take_elements(scratch.element, data, q, table.extra)
                threshold = np.float64(data[q, THRESHOLD]) + np.float64(data[q, THRESHOLD + 1])
                for g in range(PACKET // 8):
                    if (walk.state[ACTIVE] >> g) & 1:
                        i, hit, late = start + g * 8, 0, 0
                        take_lines(rays.ray, i, table.exact, q, scratch.line)
                        for lane in range(8):
                            result = hit_blob(rays, i + lane, lane, scratch, count, threshold, table.side[q])
                            if result != HIT:
                                scratch.found[0, lane] = np.inf
                            hit |= int(result == HIT) << lane
                            late |= int(result == UNSURE) << lane
                        if hit:
                            t = load(scratch.found, 0, 0)
                            record(rays, i, first + q, t, t < np.inf, opacity)
                        while late:
                            settle(rays, i + lowest(late), first + q, table.exact, q, scratch.element, count, threshold, table.side[q],
                                   opacity)
                            late &= late - 1
            shrink(walk, rays, start, walk.state[ACTIVE])
            leaf = next_leaf(walk, tree, table)


@inline
def gradient(element, count, threshold, x, y, z):
    """Field minus threshold, its gradient (three parts) and its rounding at a point."""
    f, gx, gy, gz, noise = -threshold, 0.0, 0.0, 0.0, threshold
    for k in range(count):
        ux, uy, uz, square = x - element[k, X], y - element[k, Y], z - element[k, Z], element[k, RADIUS] * element[k, RADIUS]
        w = (square - (ux * ux + uy * uy + uz * uz)) / square
        if w > 0:
            g = element[k, STRENGTH] * w
            f += g * w
            g *= -4 / square
            gx, gy, gz, noise = gx + g * ux, gy + g * uy, gz + g * uz, noise + abs(element[k, STRENGTH]) * w
    return f, gx, gy, gz, noise * NOISE


@kernel
def surface(rays, n, out, table, first):
    last, taken, count, threshold = first + table.data.shape[0], -1, 0, 0.0
    data, element = table.data, np.empty((MOST_ELEMENTS, ELEMENT_COLUMNS))
    for i in range(n):
        if first <= rays.prim[i] < last:
            q = rays.prim[i] - first
            if q != taken:
                taken, count = q, take_elements(element, data, q, table.extra)
                threshold = np.float64(data[q, THRESHOLD]) + np.float64(data[q, THRESHOLD + 1])
            x, y, z = unit_hit(rays, i, data, q)
            f, gx, gy, gz, noise = gradient(element, count, threshold, x, y, z)
            for _ in range(8):
                square = gx * gx + gy * gy + gz * gz
                if abs(f) <= 0.25 * noise or abs(f) <= 8 * noise and not abs(f) <= 0.1 * square or not square > 0:
                    break       # on it, or at a touch, which a step would leave
                step = f / square
                step *= min(1.0, LONGEST / (abs(step) * np.sqrt(square)))
                x, y, z = x - step * gx, y - step * gy, z - step * gz
                f, gx, gy, gz, noise = gradient(element, count, threshold, x, y, z)
            steep = np.sqrt(gx * gx + gy * gy + gz * gz)
            nx, ny, nz = (-gx, -gy, -gz) if steep > noise else (x, y, z)      # where nothing slopes: away from the middle
            ux, uy, uz = normalized(x, y, z)
            u, v = around(out, uy, ux), np.arccos(min(max(-uz, -1.0), 1.0)) / np.pi if out.shape[0] > U else 0.0
            put_placed(out, i, data, q, x, y, z, nx, ny, nz, u, v)
            # what is left of the field, by the slope; where that vanishes the surface is as far as a parabola takes to rise by it
            width = max(abs(data[q, 12]) + abs(data[q, 13]) + abs(data[q, 14]), max(
                abs(data[q, 15]) + abs(data[q, 16]) + abs(data[q, 17]), abs(data[q, 18]) + abs(data[q, 19]) + abs(data[q, 20])))
            left = abs(f) + noise
            out[ERR, i] += 2 * width * left / max(steep, np.sqrt(left))


def _bounds(data, extra):
    owner = np.repeat(np.arange(len(data)), data[:, COUNT].astype(int))
    element, m = extra[:, :PARTS] + extra[:, PARTS:2 * PARTS], forward(data)
    middle = data[owner, :3] + np.einsum("nij,nj->ni", m[owner], element[:, :3])
    half = element[:, RADIUS, None] * np.sqrt((m[owner] ** 2).sum(2)) + 1e-12 * data[owner, REACH, None]
    low, high, adds = np.full((len(data), 3), np.inf), np.full((len(data), 3), -np.inf), element[:, STRENGTH] > 0
    np.minimum.at(low, owner[adds], (middle - half)[adds])
    np.maximum.at(high, owner[adds], (middle + half)[adds])
    return low, high


_PAIR = Blob([((0, 0, 0), 1, 1), ((1, 0, 0), 1, -0.5)], 0.25)
BLOB = Kind("blob", intersect, surface, _bounds, (_PAIR, ()), leaf_most=1, lasting=True, shared_extra=True)
