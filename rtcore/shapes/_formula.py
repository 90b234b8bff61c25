"""Formulas in x, y, z: from the text that a person typed to a tape, the list of operations that the kernels interpret.

A formula is data. The text is cut into tokens and read by operator precedence (Pratt, *Top Down Operator Precedence*, 1973); what is read
goes straight onto the tape, where equal operations on equal operands are one (so the tape is the formula's expression tree with its
common parts shared) and constants are folded. Nothing is ever handed to an interpreter of programs.
"""
import functools
import math
import re
from typing import NamedTuple

import numpy as np

from rtcore.fields import FieldError

MOST_CHARACTERS, MOST_STEPS, MOST_NESTED = 2000, 256, 60
MOST_POWER = 64         # greater integer exponents are taken as real ones, of bases above 0

#: Operations of the tape. Each writes one row; a, b are rows, c is a number. COSINE has its row filled by the SINE before it.
(CONSTANT, X, Y, Z, ADD, ADD_C, SUB, C_SUB, NEGATE, MULTIPLY, MULTIPLY_C, DIVIDE, DIVIDE_C, C_DIVIDE, SQUARE, POWER, REAL_POWER, ROOT, EXP,
 LOG, SINE, COSINE, TANGENT, ABS, MIN, MAX, SMOOTH_MIN, ATAN2, FLOOR, MOD) = range(30)
OP, A, B, C = range(4)      # columns of a tape

FUNCTIONS = {"sin": 1, "cos": 1, "tan": 1, "exp": 1, "log": 1, "sqrt": 1, "abs": 1, "floor": 1, "min": 2, "max": 2, "atan2": 2, "mod": 2,
             "smin": 3}
VARIABLES = {"x": X, "y": Y, "z": Z}
NAMES = ", ".join(["x", "y", "z", "pi", *FUNCTIONS])
TOKEN = re.compile(r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z_]\w*)|(?P<sign>[-+*/^(),])|(?P<end>$)"
                   r"|(?P<else>.))", re.ASCII | re.DOTALL)
BINDING = {"+": 1, "-": 1, "*": 2, "/": 2, "^": 4}      # a sign in front binds with 3: -x^2 is -(x^2)


class Token(NamedTuple):
    sort: str       # number, name, sign, end
    text: str
    at: int         # of its first character, from 1


@functools.lru_cache(maxsize=256)      # a scene asks for each formula several times
def compiled(text: str) -> np.ndarray:
    """The tape of a formula: float64 (n, 4), a row an operation (operation, a, b, c); the last row is the formula's value.

    FieldError, with the place as "character 7", for a text that is no formula, has neither x, y nor z, or is too long.
    """
    if len(text) > MOST_CHARACTERS:
        raise FieldError(f"a formula of at most {MOST_CHARACTERS} characters", len(text))
    reader = _Reader(_tokens(text))
    result = reader.expression(0)
    if reader.token.sort != "end":
        raise reader.refusal("an operator (+ - * / ^) or the end")
    if isinstance(result, float):
        raise FieldError("a formula whose value depends on x, y or z", text)
    tape = _live(reader.steps, result)
    tape.flags.writeable = False
    return tape


def _tokens(text: str) -> list[Token]:
    found, position = [], 0
    while not found or found[-1].sort != "end":
        match = TOKEN.match(text, position)
        sort, position = match.lastgroup, match.end()
        token = Token(sort, match.group(sort), match.start(sort) + 1)
        if sort == "else":
            raise FieldError(f"a number, a name, or one of + - * / ^ ( ) , at character {token.at}", token.text)
        found.append(token)
    return found


def _live(steps: list[tuple], result: int) -> np.ndarray:
    """The tape without operations that nothing needs, ending with the result's."""
    needed = {result}
    for i in range(result, -1, -1):
        if i in needed:
            op, a, b, _ = steps[i]
            needed.update(row for row in (a, b) if row >= 0)
            if op == COSINE:
                needed.add(i - 1)
    needed |= {i + 1 for i in needed if steps[i][0] == SINE}
    place = {old: new for new, old in enumerate(sorted(needed))}
    rows = [(op, place.get(a, -1), place.get(b, -1), c) for op, a, b, c in (steps[i] for i in sorted(needed))]
    if place[result] != len(rows) - 1:      # a sine, whose cosine follows it
        rows.append((ADD_C, place[result], -1, 0.0))
    return np.array(rows, np.float64)


class _Reader:
    """Reads tokens from left to right and writes the tape. What has been read is a float, if constant, or the row of an operation."""

    def __init__(self, tokens: list[Token]):
        self.tokens, self.next, self.depth = tokens, 0, 0
        self.steps: list[tuple] = []
        self.known: dict[tuple, int] = {}

    @property
    def token(self) -> Token:
        return self.tokens[self.next]

    def take(self) -> Token:
        self.next += 1
        return self.tokens[self.next - 1]

    def refusal(self, expected: str) -> FieldError:
        return FieldError(f"{expected} at character {self.token.at}", self.token.text or None)

    def expect(self, sign: str) -> None:
        if self.token.text != sign:
            raise self.refusal(sign)
        self.take()

    def expression(self, least: int) -> float | int:
        """What binds more strongly than `least`."""
        self.depth += 1
        if self.depth > MOST_NESTED:
            raise FieldError(f"a formula nested at most {MOST_NESTED} deep at character {self.token.at}", self.token.text or None)
        left = self.operand()
        while self.token.sort == "sign" and BINDING.get(self.token.text, 0) > least:
            sign = self.take()
            # a power binds to the right: its exponent may be another power, or begin with a sign
            right = self.expression(BINDING[sign.text] - (sign.text == "^"))
            left = self.combine(sign, left, right)
        self.depth -= 1
        return left

    def operand(self) -> float | int:
        token = self.token
        if token.sort == "number":
            value = float(self.take().text)
            if not math.isfinite(value):
                raise FieldError(f"a number that float64 can hold at character {token.at}", token.text)
            return value
        if token.text in ("-", "+"):
            self.take()
            value = self.expression(3)
            return value if token.text == "+" else self.negated(value)
        if token.text == "(":
            self.take()
            value = self.expression(0)
            self.expect(")")
            return value
        if token.sort == "name":
            if token.text in FUNCTIONS:
                return self.call(self.take())
            if token.text in VARIABLES:
                self.take()
                return self.step(VARIABLES[token.text], at=token)
            if token.text == "pi":
                self.take()
                return math.pi
            raise self.refusal(f"one of {NAMES}")
        raise self.refusal("a number, a name, ( or -")

    def call(self, name: Token) -> float | int:
        self.expect("(")
        given, places = [], []
        while True:
            places.append(self.token)
            given.append(self.expression(0))
            if len(given) == FUNCTIONS[name.text]:
                break
            self.expect(",")
        self.expect(")")
        if name.text == "smin" and not (isinstance(given[2], float) and given[2] > 0):
            raise FieldError(f"a constant greater than 0 as the width of smin at character {places[2].at}", places[2].text)
        return self.function(name, given)

    # --- writing ---

    def step(self, op: int, a: float | int = -1, b: float | int = -1, c: float = 0.0, *, at: Token) -> int:
        """The row of an operation, which is written only if it is not there yet."""
        a, b = (self.step(CONSTANT, c=row, at=at) if isinstance(row, float) else row for row in (a, b))
        key = (op, a, b, c, math.copysign(1, c))
        if key not in self.known:
            if len(self.steps) >= MOST_STEPS - 2:
                raise FieldError(f"a formula of at most {MOST_STEPS - 2} operations at character {at.at}", at.text)
            self.known[key] = len(self.steps)
            self.steps.append((op, a, b, c))
        return self.known[key]

    def negated(self, value: float | int) -> float | int:
        if isinstance(value, float):
            return -value
        op, inner, _, _ = self.steps[value]
        return inner if op == NEGATE else self.step(NEGATE, value, at=self.token)

    def folded(self, at: Token, function, *numbers: float) -> float:
        """A function of constants; FieldError where it has no finite value."""
        try:
            value = function(*numbers)
        except (ArithmeticError, ValueError):
            value = math.nan
        if isinstance(value, complex) or not math.isfinite(value):
            raise FieldError(f"a finite value of {at.text} at character {at.at}", ", ".join(f"{x:g}" for x in numbers))
        return float(value)

    def combine(self, sign: Token, left: float | int, right: float | int) -> float | int:
        lone, rone = isinstance(left, float), isinstance(right, float)
        step = functools.partial(self.step, at=sign)
        if lone and rone:
            return self.folded(sign, {"+": float.__add__, "-": float.__sub__, "*": float.__mul__, "/": float.__truediv__,
                                      "^": float.__pow__}[sign.text], left, right)
        match sign.text:
            case "+":
                if lone or rone:
                    row, number = (right, left) if lone else (left, right)
                    return row if number == 0 else step(ADD_C, row, c=number)
                return step(ADD, min(left, right), max(left, right))
            case "-":
                if lone:
                    return self.negated(right) if left == 0 else step(C_SUB, right, c=left)
                return (left if right == 0 else step(ADD_C, left, c=-right)) if rone else step(SUB, left, right)
            case "*":
                if lone or rone:
                    row, number = (right, left) if lone else (left, right)
                    return 0.0 if number == 0 else row if number == 1 else self.negated(row) if number == -1 else step(
                        MULTIPLY_C, row, c=number)
                return step(SQUARE, left) if left == right else step(MULTIPLY, min(left, right), max(left, right))
            case "/":
                if rone and right == 0:
                    raise FieldError(f"a divisor other than 0 at character {sign.at}", right)
                if rone:
                    return left if right == 1 else step(DIVIDE_C, left, c=right)
                return (0.0 if left == 0 else step(C_DIVIDE, right, c=left)) if lone else step(DIVIDE, left, right)
            case _:
                return self.power(sign, left, right)

    def power(self, sign: Token, base: float | int, exponent: float | int) -> float | int:
        """By multiplication for integer exponents; any other power is that of a base above 0."""
        step = functools.partial(self.step, at=sign)
        if isinstance(exponent, float):
            if exponent in (0, 1, 0.5):
                return 1.0 if exponent == 0 else base if exponent == 1 else step(ROOT, base)
            if exponent.is_integer() and abs(exponent) <= MOST_POWER:
                size = abs(exponent)
                row = base if size == 1 else step(SQUARE, base) if size == 2 else step(POWER, base, c=size)
                return row if exponent > 0 else step(C_DIVIDE, row, c=1.0)
            return step(REAL_POWER, base, c=exponent)
        logarithm = self.folded(sign, math.log, base) if isinstance(base, float) else step(LOG, base)
        return step(EXP, self.combine(sign._replace(text="*"), logarithm, exponent))

    def function(self, name: Token, given: list[float | int]) -> float | int:
        step, word = functools.partial(self.step, at=name), name.text
        if all(isinstance(value, float) for value in given):
            return self.folded(name, CONSTANT_FUNCTIONS[word], *given)
        match word:
            case "sin" | "cos":
                sine = step(SINE, given[0])
                cosine = step(COSINE, given[0])     # always the row after its sine: known together or written together
                return sine if word == "sin" else cosine
            case "smin":
                return step(SMOOTH_MIN, *given[:2], c=given[2])
            case "mod":
                if isinstance(given[1], float):
                    if given[1] == 0:
                        raise FieldError(f"a divisor other than 0 at character {name.at}", 0)
                    return step(MOD, given[0], c=given[1])
                whole = step(FLOOR, self.combine(name._replace(text="/"), *given))
                return self.combine(name._replace(text="-"), given[0], self.combine(name._replace(text="*"), given[1], whole))
            case _:
                return step({"tan": TANGENT, "exp": EXP, "log": LOG, "sqrt": ROOT, "abs": ABS, "floor": FLOOR, "min": MIN, "max": MAX,
                             "atan2": ATAN2}[word], *given)


def smooth_min(a: float, b: float, k: float) -> float:
    """The smaller one, rounded off where the two differ by less than k, by k/4 at most: the polynomial smooth minimum (Quilez, 2013)."""
    return min(a, b) - max(k - abs(a - b), 0.0) ** 2 / (4 * k)


CONSTANT_FUNCTIONS = {
    "sin": math.sin, "cos": math.cos, "tan": math.tan, "exp": math.exp, "log": math.log, "sqrt": math.sqrt, "abs": abs, "floor": math.floor,
    "min": min, "max": max, "atan2": math.atan2, "mod": lambda a, b: a - b * math.floor(a / b), "smin": smooth_min}
