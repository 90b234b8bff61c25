"""`rayscope plan`: the stages that a scene needs and those it does not, with reasons and measured shares of time."""
from collections import Counter

from app.commands._shared import Parser, Refused, compile_missing, loaded, refusing, same_file, writable_or_refused, write_json

NAME = "plan"
HELP = "say which stages a scene needs, which are left out, and why"

SIZE = (160, 120)       # of the picture on which the shares are measured


def arguments(parser: Parser) -> None:
    """The options of the command."""
    parser.add_argument("scene", metavar="SCENE", help="scene or mesh file")
    parser.add_argument("--json", metavar="FILE", help="write the plan there as well")


def run(args, parser: Parser) -> int:
    """Print the plan under default settings; its shares are measured on a small picture."""
    writable_or_refused(args.json)
    if same_file(args.json, args.scene):
        raise Refused(f"{args.json}: expected another file than the scene itself", 2)
    scene, _ = loaded(args.scene)

    from rtcore.flatten import flatten
    from rtcore.plan import plan
    from rtcore.settings import Settings
    from rtcore.warm import missing
    with refusing(args.scene):
        compile_missing(missing(scene, Settings()))
        composed = plan(scene, Settings())
        shares = measured(scene)
        size = flatten(scene).nbytes
    if args.json is not None:
        write_json(args.json, {"stages": [{"name": stage, "share": shares.get(stage, 0.0)} for stage in composed.stages],
                               "left_out": [{"stage": stage, "why": why} for stage, why in composed.left_out],
                               "kernels": list(composed.kernels), "bytes": size})
    width = max(map(len, (*composed.stages, *(stage for stage, _ in composed.left_out))))
    print("kept, with the share of the time of tracing")
    for stage in composed.stages:
        print(f"  {stage:{width}}  {100 * shares[stage]:5.1f} %" if stage in shares else f"  {stage:{width}}  (within the others)")
    print("left out")
    for stage, why in composed.left_out:
        print(f"  {stage:{width}}  {why}")
    print(f"kernels: {', '.join(composed.kernels)}")
    print(f"geometry: {size / 2**20:.1f} MiB")
    return 0


def measured(scene) -> dict[str, float]:
    """Stage to its share of the time of tracing, 0 to 1, of those stages that can be told apart by time; they add up to 1."""
    from rtcore.framing import framed
    from rtcore.progressive import Renderer, RenderRequest
    from rtcore.settings import Settings
    request = RenderRequest(scene, framed(scene, SIZE[0] / SIZE[1]), Settings(size=SIZE, samples=2, threads=1))
    renderer, shares = Renderer(), Counter()
    try:
        for _ in range(2):      # the first picture loads the kernels and builds the trees
            *_, last = renderer.frames(request, coarse=False)
    finally:
        renderer.close()
    total = sum(last.seconds.values())
    for (stage, _), seconds in last.seconds.items():
        shares[stage] += seconds / total
    return shares
