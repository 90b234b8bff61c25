"""The tracing of tiles: which stages a picture's waves go through, and what only Python can do on their way."""
from collections import defaultdict
from collections.abc import Callable

import numpy as np

from rtcore import film as films, filters, fog as fogs, gloss, shading, stages
from rtcore.adaptive import FIRST as EVENLY
from rtcore.addresses import address, no_primitives
from rtcore.edits import shadow_key
from rtcore.eye import cast, cast_list
from rtcore.flatten import Geometry
from rtcore.indirect import SIZE, rows_for, words_of
from rtcore.jit import typed
from rtcore.keep import Memory, Recall
from rtcore.lens import bend
from rtcore.lights import SAMPLED, SHINE
from rtcore.lookup import UNREACHED, reach_in_words, write_down
from rtcore.plan import GLOW, VIEW, Plan
from rtcore.scene import Background, Fog
from rtcore.scratch import Scratch
from rtcore.settings import Settings
from rtcore.sorting import sort_rays, tell_hits
from rtcore.stages import (CAREFUL, CASTING, DEPTH, EYES, KEEPING, KEEPING_ROWS, KNOWN, KNOWN_SHADOWS, LAMP, LAST_LAMP, NOTING, PRIMARY,
                           PRIMARY_HITS, RAYS, REACHED, REFLECTION, REFRACTION, SHADOW_HITS, TILE, WHOLE, Lamp, Program, State, advance)
from rtcore.todo import Todo
from rtcore.wave import Wave, find_kinds

#: What time is counted to: stages of the plan and groups of kernels.
CAST, SPREAD, BEND = ("primary rays", "core"), ("pixel filter", "filter"), ("depth of field", "lens")
FILM, DEPOSIT, DIM, GLOWING = ("film", "core"), ("film", "glow"), ("fog", "fog"), (GLOW, "glow")
ONWARD, SORT, ROUGHEN = ("reflected and refracted rays", "bounce"), ("ray sorting", "sorting"), ("glossy reflection", "gloss")
SHADOWS = ("shadow rays", "lit")


CODE: dict[type, dict[Callable, Callable]] = defaultdict(dict)      # of kernels that have run, by the precision of the rays


class Tracer:
    """Traces tiles of one scene from one camera. Holds nothing that changes but the kernels it has met, so threads may share it."""

    def __init__(self, geometry: Geometry, plan: Plan, settings: Settings, view: np.ndarray, lens: np.ndarray | None, up,
                 background: Background, fog: Fog | None, hits: bool, lit: bool):
        self.geometry, self.plan, self.settings, self.view, self.lens = geometry, plan, settings, view, lens
        self.code = CODE[geometry.dtype]
        self.look = shading.make_look(geometry.leaves, geometry.leaf, plan.ambient, background, up)
        self.filter = filters.made(settings.filter) if plan.filter else None
        self.shadow_keys = [shadow_key(light) for light in plan.lights]     # what their shadows depend on
        # numbers of primitives whose surface rows are kept
        self.lasting = [(group.first, group.first + len(group.owner)) for group in geometry.groups if group.kind.lasting]
        self.lasting_kinds = [group.kind.lasting for group in geometry.groups]
        self._held: list = []       # arrays of which the program has only addresses
        self.program = self._programmed(fog, hits, lit)
        self.laps = self._named()

    def _programmed(self, fog: Fog | None, hits: bool, lit: bool) -> Program:
        """The stages that the plan keeps; hits: whether the film notes the first hits; lit: which lights reach them."""
        plan, groups, dtype = self.plan, self.geometry.groups, self.geometry.dtype
        like = no_primitives(dtype)
        kinds, primitives = np.zeros((len(groups), 3), np.int64), rows_for(len(groups), like)
        for k, group in enumerate(groups):
            meet = group.kind.textbook if plan.textbook and group.kind.textbook else group.kind.intersect
            kinds[k] = (address(meet, "meets", dtype, group.table), address(group.kind.surface, "surface", dtype, group.table), group.first)
            primitives[k] = words_of((group.tree, group.table))
        no_lamp = Lamp(np.zeros(0), np.zeros(0))
        lamps, numbers = np.zeros((len(plan.lights), 2), np.int64), rows_for(len(plan.lights), no_lamp)
        for j, light in enumerate(plan.lights):
            sampled = isinstance(light, SAMPLED)
            lamp = Lamp(light.numbers(), np.multiply(light.color, light.intensity, dtype=float))
            lamps[j] = address(SHINE[type(light)], "shines sampled" if sampled else "shines", dtype), sampled
            numbers[j] = words_of(lamp)
            self._held.append(lamp)
        settings, view = self.settings, np.array(self.view, float)
        bright, signed = VIEW[settings.view].needs_light, self.filter is not None and self.filter.gain < 1
        listed = settings.adaptive and plan.samples > EVENLY
        wanted = [(stages.SENDS, cast, "sends", True), (stages.SENDS_LIST, cast_list, "sends list", listed),
                  (stages.FINDS, find_kinds, "finds", len(groups) > 1), (stages.NOTES, films.note_first_hits, "notes", hits),
                  (stages.GLOWS, shading.glow, "glows", bright), (stages.GATHERS, shading.gather, "gathers", plan.lights),
                  (stages.NOTES_LIT, films.note_lit, "notes lit", lit and plan.lights),
                  (stages.DIMS, fogs.dim, "dims", plan.fog), (stages.DEPOSITS, films.deposit, "deposits", bright),
                  (stages.BOUNCES, shading.bounce, "bounces", plan.bounces), (stages.SORTS, sort_rays, "sorts", plan.sorting),
                  (stages.TELLS, tell_hits, "tells", plan.sorting), (stages.COMMITS, films.commit, "commits", not signed)]
        chosen = np.zeros(stages.STAGES, np.int64)
        for place, kernel, sort, needed in wanted:
            chosen[place] = address(kernel, sort, dtype) if needed else 0
        chosen[stages.SHADOWED], chosen[stages.ROUGH], chosen[stages.LASTS] = plan.shadows, plan.gloss, any(self.lasting_kinds)
        chosen[stages.SPREADS] = self.filter is not None or self.lens is not None
        chosen[stages.NUMBERED] = chosen[stages.SPREADS] or plan.gloss or any(isinstance(light, SAMPLED) for light in plan.lights)
        chosen[stages.DOUBTS] = hits and any(group.kind.doubtful or group.kind.textbook and plan.textbook for group in groups)
        ends = np.array([group.first + len(group.owner) for group in groups], np.int64)
        fogged = fogs.numbers(fog) if plan.fog else np.zeros(0)
        return Program(chosen, view, kinds, primitives, ends, lamps, numbers, fogged, self.look, like, no_lamp)

    def _named(self) -> tuple[tuple[str, str], ...]:
        """What the ticks of `stages.advance` are for."""
        names = [CAST, FILM, GLOWING, DIM, DEPOSIT, ONWARD, SORT]
        for light in self.plan.lights:
            name = type(light).__name__.lower()
            names += [(f"light: {name}", f"light-{name}"), (f"light: {name}", "lit")]
        for group in self.geometry.groups:
            name = group.kind.name
            names += [(f"hits: {name}", name), ("surface at the hits", name), ("shadow rays", name)]
        return tuple(names)

    def run(self, kernel: Callable, *arguments):
        """Call a kernel. Within one precision its arguments have the same types every time, so they are looked at once: that saves 2 of
        a call's 3 us, and of the first one in a picture some hundred."""
        code = self.code.get(kernel)
        if code is None:
            code = self.code[kernel] = kernel.compile(tuple(map(typed, arguments)))
        return code(*arguments)

    def trace(self, scratch: Scratch, film: films.Film, todo: Todo, samples: range, stale: Callable[[], bool],
              memory: Memory | None = None) -> bool:
        """Trace these samples of tiles, or parts of a list, onto the film as long as there are any, but for those that are there already.
        False if it was given up; the film is then as it was before the tile at hand. With a memory, what first samples have met is taken
        from there and kept there."""
        keeping, settings, shadows = memory is not None and samples.start == 0 and len(todo.pixels) == 0, self.settings, self.plan.shadows
        arrays = self.program, self.laps, shadows, settings.max_depth, keeping
        state, recall = scratch.state(*arrays), None
        state.numbers[:] = 0
        state.numbers[stages.STEP:stages.WIDTH + 1] = (stages.TAKE, samples.start, samples.stop, keeping, settings.seed, settings.max_depth,
                                                       settings.size[0])
        if not keeping and shadows:
            state.reaches[:] = UNREACHED
        while (wanted := self.run(advance, self.program, state, film, todo)) != stages.DONE:
            if wanted == stages.STALE or wanted != stages.KEEP_TILE and stale():
                self._forget_lit(scratch, state, film)
                return False
            scratch.clock.start()
            if wanted == stages.RECALL_TILE:
                recall = memory.recall(todo.tiles[state.numbers[TILE]])
                self._recall_tile(state, scratch.waves[0], recall)
                scratch.clock.lap(CAST)
            elif wanted == stages.KEEP_TILE:
                recall.passed(1)
                recall.note_film()
                if recall.grown:
                    memory.keep(todo.tiles[state.numbers[TILE]], recall)
                scratch.clock.lap(FILM)
            else:
                self._serve(wanted, scratch, state, film, todo, recall)
            state = scratch.state(*arrays)
        return True

    def _forget_lit(self, scratch: Scratch, state: State, film: films.Film) -> None:
        """What the film has noted of lights on the tile at hand does not count."""
        if state.numbers[stages.FIRST] and len(film.lit):
            film.lit[scratch.target[:state.numbers[EYES]]] = 0

    def _recall_tile(self, state: State, wave: Wave, recall: Recall) -> None:
        """Let it be known what is known of the tile at hand; nothing of it beforehand if it is to be gone through carefully."""
        numbers, shadows = state.numbers, self.plan.shadows
        if not numbers[CAREFUL]:
            numbers[WHOLE] = write_down(state.kept, recall.whole(), self.shadow_keys if shadows else [], self.lasting_kinds,
                                        len(wave.surface))
        numbers[CAREFUL] = False
        numbers[NOTING] = numbers[KEEPING] = not recall.noted

    def _serve(self, wanted: int, scratch: Scratch, state: State, film: films.Film, todo: Todo, recall: Recall | None) -> None:
        """Do what `stages.advance` can't for the wave at hand."""
        numbers, counts, clock = state.numbers, state.counts, scratch.clock
        depth, n = int(numbers[DEPTH]), int(numbers[RAYS])
        wave = state.odd if depth % 2 else state.even
        if wanted == stages.ROOM:
            if numbers[stages.STEP] == stages.SEND:
                scratch.primary(int(todo.tiles[numbers[TILE], 2:4].prod()))
            elif numbers[stages.STEP] == stages.MEET:
                scratch.wave(depth, n)
            elif numbers[stages.STEP] == stages.BOUNCE:
                scratch.wave(depth, 2 * n)
            else:
                scratch.beams(n, int(numbers[LAST_LAMP]))
        elif wanted == stages.SPREAD:
            self._spread(scratch, wave, n)
        elif wanted == stages.BEGIN_AGAIN:      # something new has come behind a wave that is a part of a known one
            self._forget_lit(scratch, state, film)
            numbers[stages.STEP], numbers[CAREFUL] = stages.SEND, True
        elif wanted == stages.RECALL_HITS:
            numbers[KEEPING] = True
            recall.passed(depth - 1)
            known, hits, reflected, refracted = recall.hits(wave, n)
            if depth == 1:
                counts[PRIMARY] -= known
                counts[PRIMARY_HITS] -= hits
            else:
                counts[REFLECTION] -= reflected
                counts[REFRACTION] -= refracted
            numbers[KNOWN] = known
            if known == n:
                self._keep_hits(state, wave, n, recall)
            clock.lap(CAST if depth == 1 else ONWARD)       # looking up counts to what it spares
        elif wanted == stages.KEEP_HITS:
            self._keep_hits(state, wave, n, recall)
            clock.lap(CAST if depth == 1 else ONWARD)
        elif wanted == stages.KEEP_ROWS:
            recall.note_rows(wave, n, self.lasting)
            clock.lap(CAST if depth == 1 else ONWARD)
        elif wanted == stages.NOTE_DOUBT:
            self._note_doubt(film, wave, n, scratch.target)
            clock.lap(FILM)
        elif wanted == stages.RECALL_SHADOWS:
            numbers[KEEPING] = True
            recall.passed(depth)
            known = sum(last - first - recall.shadows(state.beam, key, first, last) for key, first, last in self._casting(state))
            counts[SHADOW_HITS] -= int(np.count_nonzero(state.beam.rays.prim[:numbers[CASTING]] >= 0))
            numbers[KNOWN_SHADOWS] = known
            clock.lap(SHADOWS)
        elif wanted == stages.KEEP_SHADOWS:
            for key, first, last in self._casting(state):
                recall.note_shadows(state.beam, key, first, last)
            clock.lap(SHADOWS)
        elif wanted == stages.ROUGHEN:      # n are those sent on already
            child, before = state.even if depth % 2 else state.odd, scratch.path(depth - 1, int(numbers[EYES]) if depth == 1 else 0)
            gloss.roughen(wave, child, n, self.look, before, scratch.path(depth, n), scratch.target, scratch.number, self.settings.seed)
            clock.lap(ROUGHEN)
        elif wanted == stages.COMMIT_SIGNED:
            eyes = int(numbers[EYES])
            if numbers[stages.FIRST]:
                scratch.signs[:eyes] = 1
            counts[stages.NONFINITE] += filters.commit(film, scratch.sample, eyes, scratch.target, scratch.signs)
            clock.lap(FILM)

    def _spread(self, scratch: Scratch, wave: Wave, n: int) -> None:
        """Let samples leave the middles of their pixels, and the middle of the lens."""
        clock, target, number, seed = scratch.clock, scratch.target, scratch.number, self.settings.seed
        if self.filter is not None:
            filters.spread(wave, n, target, number, self.view, self.settings.size[0], self.filter.place, self.filter.sign, seed,
                           scratch.signs)
            clock.lap(SPREAD)
        if self.lens is not None:
            bend(wave, n, target, number, self.lens, seed)
            clock.lap(BEND)

    def _keep_hits(self, state: State, wave: Wave, n: int, recall: Recall) -> None:
        """The wave has met what it meets: keep that, and find out what else is known of it."""
        recall.note_hits(wave, n)
        level, groups = recall.levels[-1], self.geometry.groups
        given = bool(self.lasting) and recall.rows(wave)
        if level.found is None:
            state.there[:] = len(groups) == 1
            if len(groups) > 1:
                self.run(find_kinds, wave.rays.prim, n, self.program.ends, state.there)
            level.found = state.there.tolist()
        state.there[:] = [found and not (given and group.kind.lasting) for group, found in zip(groups, level.found)]
        state.numbers[KEEPING_ROWS] = bool(self.lasting) and level.rows is None
        if state.numbers[DEPTH] == 1:
            state.numbers[NOTING] = not level.noted
        if self.plan.shadows:
            state.reaches[:] = [reach_in_words(level, key) for key in self.shadow_keys]
            # what a light brings at once must come before what the next one's rays bring
            state.numbers[REACHED] = state.reaches[:, SIZE].any()

    def _casting(self, state: State) -> list[tuple]:
        """The lights at hand: what makes their shadows, and the first and one past the last of their columns of the beam."""
        first, last = state.numbers[[LAMP, LAST_LAMP]].tolist()
        return list(zip(self.shadow_keys[first:last], state.ends[:last - first].tolist(), state.ends[1:last - first + 1].tolist()))

    def _note_doubt(self, film: films.Film, wave: Wave, n: int, target: np.ndarray) -> None:
        """Note on the film which first hits lack a proof."""
        for group in self.geometry.groups:
            if group.kind.doubtful:
                films.note_doubt(film, wave, n, target, group.first, group.first + len(group.owner))
            if group.kind.textbook is not None and self.plan.textbook:
                prim, last = wave.rays.prim[:n], group.first + len(group.owner)
                film.doubt[target[:n][(group.first <= prim) & (prim < last)]] = 1
