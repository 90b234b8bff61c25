"""`rayscope warm`: kernels compiled ahead of time."""
import time

from app.commands._progress import time_in_words
from app.commands._shared import Parser, compile_missing, loaded, refusing


def arguments(parser: Parser) -> None:
    """The options of the command."""
    parser.add_argument("scenes", metavar="SCENE", nargs="*", help="scene files; without any, every kernel is compiled")


def run(args, parser: Parser) -> int:
    """Compile what is not in the cache yet."""
    from rtcore.settings import Settings
    from rtcore.warm import ALL, missing
    start = time.perf_counter()
    if args.scenes:
        names: dict[str, None] = {}
        for path in args.scenes:
            scene, _ = loaded(path)
            with refusing(path):
                names.update(dict.fromkeys(missing(scene, Settings())))
    else:
        names = dict.fromkeys(ALL)
    compile_missing(list(names), "making {} kernels ready")
    if names:
        print(f"{len(names)} kernel group{'s' * (len(names) != 1)} made ready in {time_in_words(time.perf_counter() - start)}")
    else:
        print("every kernel needed is in the cache already")
    return 0
