"""What share of the time of tracing each stage takes: the tracer's steps, timed one by one on a small picture."""
import contextlib
import dataclasses
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from unittest import mock

SIZE = (160, 120)

#: The tracer's steps besides those of the shapes and lights: (module in `rtcore.trace`, function) -> stage.
STEPS = {("", "cast"): "primary rays", ("shading", "glow"): "surface at the hits", ("fogs", "dim"): "fog",
         ("shading", "bounce"): "reflected and refracted rays",
         ("films", "note_first_hits"): "film", ("films", "deposit"): "film", ("films", "commit"): "film"}


class _Clock:
    """Seconds by stage. A light's own stage takes in what comes after its aim, up to the shaded surface."""

    def __init__(self):
        self.seconds: dict[str, float] = defaultdict(float)
        self.light = ""

    def timed(self, work: Callable, stage: Callable[[tuple], str]) -> Callable:
        def run(*args):
            start = time.perf_counter()
            result = work(*args)
            self.seconds[stage(args)] += time.perf_counter() - start
            return result
        return run

    def aimed(self, aim: Callable, stage: str) -> Callable:
        def note(args):
            self.light = stage
            return stage
        return self.timed(aim, note)


def measured(scene) -> dict[str, float]:
    """Stage to its share, 0 to 1, of those stages of the plan that can be told apart by time; they add up to 1."""
    from rtcore.framing import framed
    from rtcore.progressive import Renderer, RenderRequest
    from rtcore.settings import Settings
    request = RenderRequest(scene, framed(scene, SIZE[0] / SIZE[1]), Settings(size=SIZE, samples=2, threads=1))
    renderer = Renderer()
    try:
        for _ in renderer.frames(request, coarse=False):    # loads the kernels and builds the trees
            pass
        with _clocked() as clock:
            for _ in renderer.frames(request, coarse=False):
                pass
    finally:
        renderer.close()
    total = sum(clock.seconds.values())
    return {stage: seconds / total for stage, seconds in clock.seconds.items()} if total else {}


@contextlib.contextmanager
def _clocked() -> Iterator[_Clock]:
    """A context in which every `Tracer` that is made runs its steps by the clock."""
    from rtcore import trace

    clock = _Clock()
    original = trace.Tracer.__init__

    def __init__(self, geometry, plan, *rest):
        def hits(kind):
            def stage(args):
                return f"hits: {kind.name}" if args[-1] is trace.CLOSEST else "shadow rays"
            return dataclasses.replace(kind, intersect=clock.timed(kind.intersect, stage),
                                       surface=clock.timed(kind.surface, lambda args: "surface at the hits"))
        groups = tuple(group._replace(kind=hits(group.kind)) for group in geometry.groups)
        original(self, geometry._replace(groups=groups), plan, *rest)
        self.lamps = [lamp._replace(aim=clock.aimed(lamp.aim, f"light: {type(light).__name__.lower()}"))
                      for lamp, light in zip(self.lamps, plan.lights)]

    with contextlib.ExitStack() as stack:
        stack.enter_context(mock.patch.object(trace.Tracer, "__init__", __init__))
        for (module, name), stage in STEPS.items():
            place = getattr(trace, module) if module else trace
            stack.enter_context(mock.patch.object(place, name, clock.timed(getattr(place, name), lambda args, stage=stage: stage)))
        for name in ("light_up", "gather"):
            stack.enter_context(mock.patch.object(trace.shading, name, clock.timed(getattr(trace.shading, name), lambda args: clock.light)))
        yield clock
