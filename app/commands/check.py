"""`rayscope check`: whether a scene file is sound."""
from app.commands._shared import Parser, loaded, refusing


def arguments(parser: Parser) -> None:
    """The options of the command."""
    parser.add_argument("scene", metavar="SCENE", help="scene or mesh file")


def run(args, parser: Parser) -> int:
    """Load the scene and place every shape in it as a render would."""
    from rtcore.flatten import packed
    scene, _ = loaded(args.scene)
    with refusing(args.scene):
        leaves = list(scene.leaves())
        dropped = sum(packed(leaf).dropped for leaf in leaves)
    lights = "studio lights" if scene.lights is None else _counted(len(scene.lights), "light")
    note = f"; {_counted(dropped, 'degenerate triangle')} left out" if dropped else ""
    print(f"{args.scene}: sound: {_counted(len(leaves), 'shape')}, {lights}{note}")
    return 0


def _counted(count: int, what: str) -> str:
    return f"{count:,} {what}{'s' * (count != 1)}"
