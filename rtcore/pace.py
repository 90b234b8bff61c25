"""How fast first samples are traced on the scene at hand; from that, how fine the first lattice may be for the time there is."""
import math

from rtcore.schedule import COARSEST, LATTICES, TILE

EDGES = (2 * TILE, TILE, TILE // 2, TILE // 4)
ENOUGH, FEWER = 6, 3    # tiles for each thread, so that they end at about the same time; of a coarse lattice, which is soon done
LONG = 0.1          # seconds that a tile may take, so that threads end at about the same time: kernels see it sooner if it is not wanted
SAFE = 0.8          # share of the deadline that is planned with: one view takes longer than the one before
SPREAD = 1.5        # rays further apart have less in common: each doubling of the spacing is taken to make them so much slower


class Pace:
    """What passes took so far."""

    def __init__(self):
        self._seconds: dict[int, float] = {}    # of all threads together, for a pixel of a pass over lattices, by the finest one's spacing
        self._known: float | None = None        # for a pixel where all hits are known from before
        self.frame = 0.01                       # for a frame, made and shown

    def note(self, spacing: int, pixels: float, seconds: float) -> None:
        """A pass over lattices took so long on all threads together."""
        if pixels > 0:
            self._seconds[spacing] = seconds / pixels

    def note_known(self, pixels: float, seconds: float) -> None:
        """The same for one that traced nothing, for all hits were known."""
        if pixels > 0:
            self._known = seconds / pixels

    def forget(self) -> None:
        """The scene is another one."""
        self._seconds.clear()
        self._known = None

    def seconds(self, spacing: int) -> float | None:
        """For a pixel of a lattice; None as long as nothing is known."""
        if not self._seconds:
            return None
        nearest = min(self._seconds, key=lambda known: abs(math.log2(known / spacing)))
        return self._seconds[nearest] * SPREAD ** max(math.log2(spacing / nearest), 0)

    def finest(self, pixels: int, threads: int, deadline: float, known: bool) -> int:
        """Spacing of the finest lattice that is likely to be on the screen `deadline` seconds from now."""
        budget = max(SAFE * deadline - self.frame, deadline / 4) * threads
        for spacing in reversed(LATTICES):
            each = self._known if known else self.seconds(spacing)
            if each is not None and each * pixels / spacing ** 2 <= budget:
                return spacing
        return 1 if known and self._known is None else COARSEST

    def edge(self, spacing: int, size: tuple[int, int], threads: int) -> int:
        """Lattice points along the edge of a tile of a picture of this size, where what is met is kept. A large one has fewer calls a ray,
        for which Python is needed there."""
        each = self.seconds(spacing)

        def suits(edge: int) -> bool:
            soon = edge <= TILE if each is None else edge ** 2 * each <= LONG
            return soon and math.prod(-(-side // (spacing * edge)) for side in size) >= (ENOUGH if spacing == 1 else FEWER) * threads
        return next(filter(suits, EDGES), EDGES[-1])
