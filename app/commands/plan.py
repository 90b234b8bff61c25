"""`rayscope plan`: the stages and kernels that a scene needs and those it does not, with reasons and measured shares of time."""
from app.commands._shared import (Parser, Refused, compile_missing, loaded, refusing, same_file, settings_from, writable_or_refused,
                                  write_json)

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
    settings = settings_from(parser, size=SIZE, samples=2, threads=1)
    scene, _ = loaded(args.scene)

    from rtcore.account import account, loaded_kernels, sentences
    from rtcore.warm import missing
    with refusing(args.scene):
        compile_missing(missing(scene, settings))
        frame = traced(scene, settings)
    made, kernels = account(frame.plan, frame.seconds, frame.held), loaded_kernels()
    if args.json is not None:
        write_json(args.json, {"stages": [{"name": kept.stage, "share": kept.share} for kept in made.kept],
                               "left_out": [{"stage": stage, "why": why} for stage, why in made.left_out],
                               "kernels": [name for name, _ in made.kernels], "bytes": made.bytes})
    print(*sentences(made), sep="\n")
    width = max(map(len, (*frame.plan.stages, *(stage for stage, _ in made.left_out))))
    print("\nkept, with the share of the time of tracing")
    for kept in made.kept:
        print(f"  {kept.stage:{width}}  " + (f"(within {kept.within})" if kept.within else f"{100 * kept.share:5.1f} %"))
    print("left out")
    for stage, why in made.left_out:
        print(f"  {stage:{width}}  {why}")
    print("kernels")
    for name, share in made.kernels:
        print(f"  {name:{width}}  {100 * share:5.1f} %")
    compiled = sum(how == "compiled" for how in kernels.values())
    print(f"  in this process: {len(kernels) - compiled} functions loaded from the cache, {compiled} compiled")
    print(f"held for a picture of {SIZE[0]} x {SIZE[1]} by one thread: {made.bytes / 2**20:.1f} MiB")
    for what, size in made.held:
        print(f"  {what:{width}}  {size / 2**10:,.0f} KiB")
    return 0


def traced(scene, settings):
    """The last frame of a small picture, once its kernels are loaded and its trees are built."""
    from rtcore.framing import framed
    from rtcore.progressive import Renderer, RenderRequest
    request, renderer = RenderRequest(scene, framed(scene, SIZE[0] / SIZE[1]), settings), Renderer()
    try:
        for _ in range(2):
            *_, last = renderer.frames(request, coarse=False)
        return last
    finally:
        renderer.close()
