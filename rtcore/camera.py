"""The camera: lookfrom, lookat, up, fov, and the lecture's chain that takes a pixel to the world.

Conventions: world space is right-handed. The view basis is w = lookat - lookfrom, u = up x w, v = w x u, all of length 1,
so u points to the *left* of the picture; the chain's S2 turns the sign. A picture's row 0 is its top row.

All functions are pure: a moved camera is a new Camera.
"""
import math
from typing import Annotated, NamedTuple

import msgspec
import numpy as np

from rtcore.fields import Choice, FieldError, Number, Record, Vec, Vector


class Chain(NamedTuple):
    """The four matrices of the notes (4 x 4): P_world = T4 R3 S2 T1 P, with P = (x, y, 0, 1), x to the right and y up in pixels."""

    t1: np.ndarray      # the picture's centre to the axis, the picture to the plane z = d
    s2: np.ndarray      # pixels to scene units; the sign of x turned
    r3: np.ndarray      # columns u, v, w
    t4: np.ndarray      # to lookfrom

    @property
    def matrix(self) -> np.ndarray:
        """The whole chain, 4 x 4."""
        return self.t4 @ self.r3 @ self.s2 @ self.t1

    @property
    def view_to_world(self) -> np.ndarray:
        """T4 R3, 4 x 4: from the view's axes at lookfrom to the world."""
        return self.t4 @ self.r3


class Camera(Record, frozen=True, kw_only=True):
    """A pinhole camera, or with an `aperture` a thin lens, behind which a plane across the view is sharp and all else is not. `fov` is
    vertical, in degrees, and spans the picture from edge to edge (or, as NFF has it, from the first row's centre to the last row's, with
    ``span="centers"``). Pixels are square."""

    lookfrom: Annotated[Vec, Vector(help="where the eye is", unit="scene units")] = (0.0, 0.0, -5.0)
    lookat: Annotated[Vec, Vector(help="the point in the middle of the picture", unit="scene units")] = (0.0, 0.0, 0.0)
    up: Annotated[Vec, Vector(nonzero=True, help="which way is up; need not be at right angles to the view")] = (0.0, 1.0, 0.0)
    fov: Annotated[float, Number(above=0, below=180, help="vertical field of view", unit="degrees")] = 40.0
    span: Annotated[str, Choice(words=("edges", "centers"), help="fov from edge to edge, or between the outer rows' centres")] = "edges"
    aperture: Annotated[float, Number(least=0, help="diameter of the lens; 0: a pinhole, and all is sharp", unit="scene units")] = 0.0
    focus: Annotated[float, Number(least=0, help="distance, along the view, of what is sharp; 0: that of lookat", unit="scene units")] = 0.0

    def check(self):
        with np.errstate(over="ignore"):
            w = np.subtract(self.lookat, self.lookfrom)
        if not np.isfinite(w).all() or not w.any():
            raise FieldError("a point other than lookfrom", self.lookat, "lookat")
        w /= np.abs(w).max()
        up = np.array(self.up) / np.abs(self.up).max()
        if np.linalg.norm(np.cross(up, w)) < 1e-6 * np.linalg.norm(up) * np.linalg.norm(w):
            raise FieldError("a direction that is not parallel to the view", self.up, "up")

    def basis(self) -> np.ndarray:
        """(3, 3): rows u (left), v (up), w (forward), each of length 1."""
        w = unit(np.subtract(self.lookat, self.lookfrom))
        u = unit(np.cross(unit(np.array(self.up)), w))
        return np.stack([u, np.cross(w, u), w])

    def distance(self) -> float:
        """From lookfrom to lookat."""
        return math.dist(self.lookfrom, self.lookat)

    def chain(self, nx: int, ny: int, d: float = 1.0) -> Chain:
        """The lecture's chain for a picture of `nx` by `ny` pixels at distance `d` before the eye."""
        pitch = self.pitch(ny) * d
        t1, r3, t4 = np.eye(4), np.eye(4), np.eye(4)
        t1[:3, 3] = -nx / 2, -ny / 2, d
        r3[:3, :3] = self.basis().T
        t4[:3, 3] = self.lookfrom
        return Chain(t1, np.diag([-pitch, pitch, 1.0, 1.0]), r3, t4)

    def pitch(self, ny: int) -> float:
        """Width of a pixel on the picture plane at distance 1, for a picture of `ny` rows."""
        rows = max(ny - 1, 1) if self.span == "centers" else ny
        return 2 * math.tan(math.radians(self.fov) / 2) / rows

    def rays(self, nx: int, ny: int) -> np.ndarray:
        """(4, 3): eye, the direction to the top left corner of the picture, and the steps of that direction per pixel
        to the right and per pixel down. A ray through (x, y) pixels from the top left has direction row 1 + x row 2 + y row 3."""
        u, v, w = self.basis()
        pitch = self.pitch(ny)
        return np.stack([np.array(self.lookfrom), w + (nx / 2 * u + ny / 2 * v) * pitch, -u * pitch, -v * pitch])

    def lens(self) -> np.ndarray:
        """(3, 3): half the lens' width to the left, half its height upward, and w over the distance of the plane that is sharp: a point p
        from the eye lies in that plane if row 2 · p = 1."""
        u, v, w = self.basis()
        return np.stack([u * (self.aperture / 2), v * (self.aperture / 2), w / (self.focus or self.distance())])

    def project(self, point, nx: int, ny: int) -> tuple[float, float] | None:
        """Pixel coordinates (from the top left) of a world point, or None if it is not in front of the eye."""
        a, b, c = self.basis() @ np.subtract(point, self.lookfrom)
        if c <= 0:
            return None
        pitch = self.pitch(ny)
        return nx / 2 - a / c / pitch, ny / 2 - b / c / pitch

    def at(self, **fields) -> "Camera":
        """The camera with these fields in place of its own; FieldError if the result is degenerate."""
        return msgspec.structs.replace(self, **fields)


def unit(v: np.ndarray) -> np.ndarray:
    """`v` at length 1, without overflow."""
    v = v / np.abs(v).max()
    return v / np.linalg.norm(v)


def turn(v: np.ndarray, axis: np.ndarray, angle: float) -> np.ndarray:
    """`v` turned about the unit `axis` by `angle` radians (Rodrigues)."""
    c, s = math.cos(angle), math.sin(angle)
    return c * v + s * np.cross(axis, v) + (1 - c) * (axis @ v) * axis


def orbit(camera: Camera, right: float, up: float, pivot: Vec | None = None) -> Camera:
    """The eye carried around `pivot` (lookat unless given): `right` and `up` in radians, as the picture's content follows
    the mouse. Stops short of the poles of `camera.up`."""
    pole = unit(np.array(camera.up))
    center = np.array(camera.lookat if pivot is None else pivot)
    w = unit(np.subtract(camera.lookat, camera.lookfrom))
    polar = math.acos(min(max(float(-w @ pole), -1.0), 1.0))      # angle between the pole and the eye, seen from lookat
    limit = math.radians(1.0)
    if up:
        up = min(max(polar + up, limit), math.pi - limit) - polar
    left = unit(np.cross(pole, w))

    def carried(p):
        return turn(turn(p - center, left, -up), pole, -right) + center

    return camera.at(lookfrom=carried(np.array(camera.lookfrom)), lookat=carried(np.array(camera.lookat)))


def pan(camera: Camera, right: float, up: float) -> Camera:
    """Eye and lookat moved across the view so that the content at lookat's distance follows by `right` and `up`, in
    picture heights."""
    u, v, _ = camera.basis()
    height = 2 * math.tan(math.radians(camera.fov) / 2) * camera.distance()
    shift = (u * right - v * up) * height
    return camera.at(lookfrom=camera.lookfrom + shift, lookat=camera.lookat + shift)


def dolly(camera: Camera, factor: float, toward: Vec | None = None) -> Camera:
    """The distance to `toward` (lookat unless given) multiplied by `factor`; lookat moves along, so what is under the
    cursor stays there."""
    center = np.array(camera.lookat if toward is None else toward)

    def nearer(p):
        return center + (np.array(p) - center) * factor

    return camera.at(lookfrom=nearer(camera.lookfrom), lookat=nearer(camera.lookat))


def focus_on(camera: Camera, point: Vec) -> Camera:
    """The camera with the plane through `point`, across the view, in focus; FieldError for a point that is not before the eye."""
    return camera.at(focus=float(camera.basis()[2] @ np.subtract(point, camera.lookfrom)))


def fly(camera: Camera, right: float, up: float, forward: float) -> Camera:
    """Eye and lookat moved along the view's axes, in scene units."""
    u, v, w = camera.basis()
    shift = -u * right + v * up + w * forward
    return camera.at(lookfrom=camera.lookfrom + shift, lookat=camera.lookat + shift)


def frame(camera: Camera, low, high, aspect: float = 1.0) -> Camera:
    """The camera drawn back along its view until the box from `low` to `high` fills the picture, with a little air."""
    low, high = np.array(low, float), np.array(high, float)
    center = (low + high) / 2
    radius = max(float(np.linalg.norm(high - low)) / 2, 1e-6 * float(np.abs(center).max()), 1e-9)
    half = math.radians(camera.fov) / 2
    half = min(half, math.atan(math.tan(half) * aspect))
    w = camera.basis()[2]
    return camera.at(lookfrom=center - w * (radius * 1.05 / math.sin(half)), lookat=center)
