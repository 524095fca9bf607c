"""Modelica and C sources in one pass: statements with the names that they set and use, and constants.

Nothing is resolved that a compiler would resolve. What is read serves three ends: which values are compared,
what named constants are worth, and which lines to tell first if a file is too long to be told.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, pairwise

from falsifier.context.statements import Statement
from falsifier.context.tokens import CLOSING, OPENING, Token, parts, tokens_of, written

_LISTED_C = """
    if else for while do switch case default break continue return goto sizeof struct union enum
    typedef static const volatile extern inline register void char short int long float double
    signed unsigned bool true false NULL auto restrict _Bool real_T boolean_T int32_T uint32_T
    uint8_T int8_T int16_T uint16_T int_T time_T fmi2Real fmi2Boolean fmi2Integer fmi3Float64
    fmi3Boolean fmi3Int32
"""
_LISTED_MODELICA = """
    if then else elseif elsewhen when for while loop in end and or not true false initial each time
    return break parameter constant input output discrete flow stream final inner outer replaceable
    redeclare equation algorithm Real Integer Boolean String
"""
# Names that say nothing, in C and in Modelica.
_KEYWORDS = (frozenset(_LISTED_C.split()), frozenset(_LISTED_MODELICA.split()))
_LISTED_FUNCTIONS = """
    der pre edge change terminal sample noEvent smooth min max abs sqrt sin cos tan asin acos atan
    atan2 exp log log10 sign floor ceil integer mod div rem sum product size fill zeros ones connect
    reinit assert terminate homotopy delay Integer Real Boolean String enumeration semiLinear
    cardinality initial
"""
_FUNCTIONS = (_KEYWORDS[False], frozenset(_LISTED_FUNCTIONS.split()))
_CONDITIONS = frozenset(("if", "for", "while", "switch", "when", "elseif", "elsewhen"))
_BRANCHES = frozenset(("else", "elseif", "elsewhen"))
_JUMPS = frozenset(("case", "default", "break", "continue", "goto", "return"))
_ASSIGNING = frozenset(("=", ":=", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^="))
_SECTIONS = frozenset(("equation", "algorithm", "public", "protected"))
_CLASS_WORDS = frozenset(
    ("model", "block", "class", "package", "record", "connector", "function", "operator", "type")
)
_CLASS_PREFIXES = frozenset(
    ("partial", "encapsulated", "expandable", "pure", "impure", "final", "replaceable", "redeclare")
)
_UNTOLD = frozenset(("annotation", "import", "external", "within"))
_GIVEN = frozenset(("input", "parameter", "constant", "const"))
_END = Token("sign", "", 0, 0, 0)
_MAX_VALUE = 40  # tokens of a modifier
_MAX_DEPTH = 20  # of structures within structures


@dataclass(frozen=True, slots=True)
class Component:
    """What Modelica declares.

    Attributes:
        kind: name of its type.
        modifiers: values that are given to names within it, as written.
        line: its line.
    """

    kind: str
    modifiers: Mapping[str, str]
    line: int


@dataclass(slots=True)
class Source:
    """One file.

    Attributes:
        text: its text.
        shown: what messages call it.
        is_modelica: whether it is Modelica.
        statements: what it says, in order.
        own: names that each function declares, except copies of others of the same name.
        constants: values of the constants and parameters of each class, outside classes of all.
        bases: what each class extends.
        modified: values that modifiers such as ``Base(limit = 8)`` give to names, anywhere in it.
        components: what each class declares, by name.
        leading: what leads to inputs of the components of each class, such as ``limiter.u``.
        structures: types and names of the fields of each structure of C, as it is declared.
        filled: types and values of the variables that are declared with values in braces.
    """

    text: str
    shown: str
    is_modelica: bool
    statements: list[Statement] = field(default_factory=list)
    own: dict[str, set[str]] = field(default_factory=lambda: defaultdict(set))
    constants: dict[str, dict[str, list[str]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(list))
    )
    bases: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    modified: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    components: dict[str, dict[str, Component]] = field(default_factory=lambda: defaultdict(dict))
    leading: dict[str, dict[str, str]] = field(default_factory=lambda: defaultdict(dict))
    structures: dict[str, list[tuple[str, str]]] = field(default_factory=dict)
    filled: list[tuple[str, Sequence[Token]]] = field(default_factory=list)


def read_source(text: str, shown: str, *, is_modelica: bool) -> Source:
    """Return what a file says; what is not closed ends with it.

    Raises:
        SpecError: if it is too long.
    """
    reader = _Reader(Source(text, shown, is_modelica))
    for token, after in pairwise(chain(tokens_of(text, shown), (_END,))):
        reader.take(token, after)
    reader.end_statement()
    return reader.found


def names_in(tokens: Iterable[Token], *, is_modelica: bool) -> frozenset[str]:
    """Return the names in a text: of ``a.b`` the first one in Modelica, the last member in C."""
    found = set()
    before = _END
    for token, after in pairwise(chain(tokens, (_END,))):
        is_function = after.text == "("
        is_left = before.text != "." if is_modelica else after.text not in ("->", ".")
        unsaid = (_FUNCTIONS if is_function else _KEYWORDS)[is_modelica]
        if token.kind == "name" and (is_function or is_left) and token.text not in unsaid:
            found.add(token.text)
        before = token
    return frozenset(found)


@dataclass(slots=True)
class _Open:
    """A class, function, structure, condition or loop whose statements are being read."""

    head: Statement
    first: Statement  # of a branch, the head of the first one
    word: str
    scope: str
    is_conditional: bool = False
    fields: list[tuple[str, str]] = field(default_factory=list)


class _Reader:
    """Goes through the tokens of a file once."""

    def __init__(self, found: Source) -> None:
        self.found = found
        self.open: list[_Open] = []
        self.current: list[Token] = []
        self.brackets: list[str] = []
        self.previous: _Open | None = None  # the condition to which an else belongs
        self.leading = ""  # what a statement of Modelica has been so far: the beginning of a class, or not
        self.is_initial = False  # whether equations hold at the beginning only

    def take(self, token: Token, after: Token) -> None:
        """Read one token, before which everything was read."""
        text, current = token.text, self.current
        first = current[0].text if current else text
        if token.kind == "directive":
            self._directive(token)
        elif text == ";" and not self._is_inside(first):
            self.end_statement()
        elif self.brackets:
            current.append(token)
            if text in OPENING:
                self.brackets.append(text)
            elif text in CLOSING:
                self.brackets.pop()
        elif self.found.is_modelica:
            self._modelica(token, after, first)
        else:
            self._c(token, after, first)

    def _is_inside(self, first: str) -> bool:
        """Whether a semicolon here ends nothing: in a matrix, the head of a loop, a value."""
        if self.found.is_modelica:
            return "[" in self.brackets[-1:]
        return bool(self.brackets) and (first in ("for", "else") or "{" in self.brackets[-1:])

    def _modelica(self, token: Token, after: Token, first: str) -> None:
        text = token.text
        self.current.append(token)
        is_first = len(self.current) == 1
        if text in OPENING:
            self.brackets.append(text)
        elif text in _SECTIONS and self.open and (is_first or first == "initial"):
            self.is_initial = first == "initial"
            self._add(follows=True)
        elif (is_first and text == "else") or (first in _CONDITIONS and text in ("then", "loop")):
            if first in _BRANCHES and self.open and self.open[-1].is_conditional:
                self.previous = self.open.pop()
            self._head(first)
        elif is_first or self.leading:
            self._class_begins(token, after, is_first=is_first)

    def _class_begins(self, token: Token, after: Token, *, is_first: bool) -> None:
        """Follow the words before a declaration, up to the name of a class."""
        leading = "prefixes" if is_first else self.leading
        self.leading = ""
        if leading == "named":
            self._head("class", self.current[-2].text)
        elif leading in ("prefixes", "class") and token.text in _CLASS_WORDS:
            self.leading = "class"
        elif leading == "class" and after.text != "=":
            self.leading = "named" if after.kind == "text" else ""
            if not self.leading:
                self._head("class", token.text)
        elif leading == "prefixes" and token.text in _CLASS_PREFIXES:
            self.leading = leading

    def _c(self, token: Token, after: Token, first: str) -> None:
        text = token.text
        if text == "}":
            self.end_statement()
            self.current.append(token)
            self._close(after)
            return
        self.current.append(token)
        if text == "{" and len(self.current) > 1 and self.current[-2].text == "=":
            self.brackets.append(text)
        elif text == "{":
            words = [t.text for t in self.current]
            name = next((a.text for a, b in pairwise(self.current) if b.text == "(" and a.kind == "name"), "")
            if first in (*_CONDITIONS, "else", "do"):
                self._head(first)
            elif name and not (self.open and self.open[-1].scope):
                self._head("function", name)
            else:
                self._head("struct" if {"struct", "union", "typedef"} & set(words) else "{")
        elif text in OPENING:
            self.brackets.append(text)
        elif text == ":" and (first in ("case", "default") or len(self.current) == 2):
            self._add(follows=True)

    def _directive(self, token: Token) -> None:
        words = token.text.replace("\\\n", " ").strip().lstrip("#").split(None, 2)
        inner = list(tokens_of(words[2], "")) if len(words) == 3 and "(" not in words[1] else []
        if inner and words[0] == "define":
            value = written(words[2], inner[0].start, inner[-1].end)
            self.found.constants[""][words[1]].append(value)
            uses = names_in(inner, is_modelica=False)
            self.found.statements.append(
                Statement(self.found.text, token.start, token.end, token.line, sets=frozenset([words[1]]),
                          uses=uses, is_declaration=True, is_given=True)
            )  # fmt: skip

    def _head(self, word: str, scope: str = "") -> None:
        around = self.open[-1] if self.open else None
        previous = self.previous if word in _BRANCHES else None
        tokens = self.current
        is_condition = word not in ("class", "function", "struct")
        uses = names_in(tokens, is_modelica=self.found.is_modelica) if is_condition else frozenset[str]()
        head = self._add(
            uses=uses, scope=scope, outer=previous.head if previous else around.head if around else None
        )
        is_conditional = word in ("else", "do", *_CONDITIONS) or (
            around is not None and around.is_conditional
        )
        word = "if" if word in _BRANCHES else word
        scope = scope or (around.scope if around else "")
        self.open.append(_Open(head, previous.first if previous else head, word, scope, is_conditional))
        self.previous = None

    def _close(self, after: Token) -> None:
        """End what is open, with the statement that is being read."""
        if not self.open or not self.current:
            self.current = []
            return
        popped = self.open.pop()
        self._add(follows=True, outer=popped.first, scope=popped.scope)
        if popped.word == "struct":
            listed = tokens_of(popped.head.text, "")
            names = [t.text for t in listed if t.kind == "name" and t.text not in _KEYWORDS[False]]
            for name in (*names[:1], after.text):  # struct P_ { ... }; and typedef struct { ... } P;
                if name.isidentifier():
                    self.found.structures[name] = popped.fields
            if self.open and after.kind == "name":
                self.open[-1].fields.append((after.text, after.text))
        self.previous = popped if after.text == "else" else None

    def _add(
        self,
        *,
        sets: Iterable[str] = (),
        uses: frozenset[str] = frozenset(),
        outer: Statement | None = None,
        scope: str = "",
        value: tuple[int, int] | None = None,
        follows: bool = False,
        is_declaration: bool = False,
        is_given: bool = False,
        is_told: bool = True,
    ) -> Statement:
        """End the statement that is being read."""
        tokens, around = self.current, self.open[-1] if self.open else None
        cut = next((i for i, t in enumerate(tokens) if i and t.text == "annotation"), 0)
        statement = Statement(
            self.found.text, tokens[0].start, tokens[cut - 1].end, tokens[0].line,
            scope or (around.scope if around else ""),
            outer or (around.head if around else None), frozenset(sets), uses, value, follows,
            is_declaration, is_given, is_told, tokens[-1].end if cut else 0,
        )  # fmt: skip
        if not self.found.is_modelica or statement.scope:  # outside of classes is nothing to tell
            self.found.statements.append(statement)
        self.current = []
        self.brackets = []
        return statement

    def end_statement(self) -> None:
        """End a statement without others in it."""
        tokens = self.current
        self.leading = ""
        self.brackets = []
        first = tokens[0].text if tokens else ""
        if not tokens:
            return
        if self.found.is_modelica and first == "end":
            is_inner = len(tokens) > 1 and tokens[1].text in _CONDITIONS
            while not is_inner and len(self.open) > 1 and self.open[-1].word != "class":
                self.open.pop()
            if is_inner and not (self.open and self.open[-1].is_conditional):
                self.current = []
            self._close(_END)
        elif first in _UNTOLD:
            self._add(is_told=False)
        elif self.found.is_modelica and first == "extends":
            self.found.bases[self.open[-1].scope if self.open else ""].append(_path(tokens[1:]))
            self._modified(tokens)
            self._add(follows=True)
        elif first in _JUMPS and first != "return":
            self._add(follows=True)
        else:
            self._plain(tokens)

    def _plain(self, tokens: Sequence[Token]) -> None:
        """Read what sets, declares or calls something."""
        told = _before(tokens, "annotation")
        body = _without_heads(told)
        around = self.open[-1] if self.open else None
        scope = around.scope if around else ""
        kind = _kind(body)
        words = {t.text for t in body[:4]} if kind else set[str]()
        sets: set[str] = set()
        value = None
        for part in parts(body, ",") if kind else [list(body)]:
            left, right = _sides(part)
            right = [t for t in right if t.kind != "text"]
            names = _set(left, is_modelica=self.found.is_modelica, is_declaration=bool(kind))
            sets |= names
            value = (right[0].start, right[-1].end) if right else value
            for name in names if kind else ():
                self._declared(scope, name, kind, right, words, part)
        if body and body[0].text == "return":
            sets = {scope}
        elif self.found.is_modelica:
            self._leading(body, scope)
        uses = names_in(told, is_modelica=self.found.is_modelica)
        is_always = not (around and around.is_conditional) and len(body) == len(told) and not self.is_initial
        is_plain = len(sets) == 1 and is_always and _is_equal(body)
        previous = self.previous if tokens[0].text == "else" else None
        statement = self._add(
            sets=sets,
            uses=uses - sets if kind else uses,  # what is declared together has nothing else in common
            outer=previous.head if previous else None,
            value=value if is_plain and not words & {"parameter", "constant"} else None,
            is_declaration=bool(kind),
            is_given=bool(kind) and bool(value or words & _GIVEN or kind.endswith("Input")),
        )
        is_if = tokens[0].text in ("if", "else")
        self.previous = _Open(statement, statement, "if", scope) if is_if else None

    def _declared(
        self, scope: str, name: str, kind: str, value: Sequence[Token], words: set[str], part: Sequence[Token]
    ) -> None:
        """Note what a declaration says of a name."""
        text = written(self.found.text, value[0].start, value[-1].end) if value else ""
        if "typedef" in words:
            self.found.structures.setdefault(name, [(kind, "")])
        elif self.open and self.open[-1].word == "struct":
            self.open[-1].fields.append((kind, name))
        elif self.found.is_modelica:
            modifiers = dict(self._modified(part))
            self.found.components[scope][name] = Component(kind, modifiers, part[0].line)
            if text and words & {"parameter", "constant"}:
                self.found.constants[scope][name].append(text)
        elif scope and "extern" not in words and name not in names_in(value, is_modelica=False):
            self.found.own[scope].add(name)
        elif value and value[0].text == "{":
            self.found.filled.append((kind, value))
        elif value and "const" in words:
            self.found.constants[""][name].append(text)

    def _modified(self, tokens: Sequence[Token]) -> Iterator[tuple[str, str]]:
        """Note the values that modifiers give to names; return those directly within the first bracket."""
        opened: list[int] = []
        last = 0  # where the bracket began that was closed last
        outer: list[tuple[str, str]] = []
        for i, token in enumerate(tokens):
            if token.text in OPENING:
                opened.append(i)
            elif token.text in CLOSING and opened:
                last = opened.pop()
            elif token.text == "=" and opened:
                name = tokens[last - 1] if tokens[i - 1].text == ")" else tokens[i - 1]  # p(min = 0) = 4
                value = _inside(tokens[i + 1 : i + 1 + _MAX_VALUE])
                if value:
                    text = written(self.found.text, value[0].start, value[-1].end)
                    self.found.modified[name.text].append(text)
                    outer += [(name.text, text)] if len(opened) == 1 else []
        return iter(outer)

    def _leading(self, tokens: Sequence[Token], scope: str) -> None:
        """Note what leads to an input of a component, which the library calls u, u1, ... or reference."""
        left, right = _sides(tokens)
        if tokens and tokens[0].text == "connect":
            sides = [_path(part) for part in parts(tokens[2:-1], ",")]
            pairs = [sides[:2], sides[1::-1]] if len(sides) == 2 else []
        else:
            pairs = [[_path(left), written(self.found.text, right[0].start, right[-1].end)]] if right else []
        for port, source in pairs:
            _, dot, last = port.rpartition(".")
            declared = self.found.components[scope].get(port)
            kind = declared.kind if declared else ""
            is_input = dot and (last.rstrip("0123456789") == "u" or last == "reference")
            if is_input or (kind.endswith("Output") and tokens[0].text == "connect"):
                self.found.leading[scope][port] = source


def _without_heads(tokens: Sequence[Token]) -> Sequence[Token]:
    """Return the tokens behind ``else if (...)`` and the like."""
    i = 0
    while i < len(tokens) and tokens[i].text in ("else", "if", "for", "while", "switch", "do"):
        i += 1
        depth = 0
        while i < len(tokens) and (depth or tokens[i].text == "("):
            depth += (tokens[i].text in OPENING) - (tokens[i].text in CLOSING)
            i += 1
            if not depth:
                break
    return tokens[i:]


def _kind(tokens: Sequence[Token]) -> str:
    """Return the type in a declaration, which begins with two names; empty if a statement is none."""
    words: list[str] = []
    is_member, depth = False, 0
    for token in tokens:
        depth += (token.text == "[") - (token.text == "]")
        if token.kind == "name" and not depth:
            if is_member:
                words[-1] += f".{token.text}"
            else:
                words.append(token.text)
        elif (not depth and token.text not in ("]", "*", ".")) or not words:
            break
        is_member = token.text == "."
    return words[-2] if len(words) > 1 and words[0] not in _JUMPS else ""


def _set(tokens: Sequence[Token], *, is_modelica: bool, is_declaration: bool) -> frozenset[str]:
    """Return what is declared or stands on the left of a sign; of a call, all names."""
    if not is_declaration and tokens and tokens[-1].text == ")":
        return names_in(tokens, is_modelica=is_modelica)
    paths: list[list[str]] = []
    is_member, depth = False, 0
    for token in tokens:
        depth += (token.text in OPENING) - (token.text in CLOSING)
        if not depth and token.kind == "name" and token.text not in _KEYWORDS[is_modelica]:
            if not is_member:
                paths.append([])
            paths[-1].append(token.text)
        is_member = bool(paths) and token.text in (".", "->")
    if is_declaration:
        return frozenset(paths[-1][-1:] if paths else [])
    return frozenset(path[0 if is_modelica else -1] for path in paths)


def _sides(tokens: Sequence[Token]) -> tuple[Sequence[Token], Sequence[Token]]:
    depth = 0
    for i, token in enumerate(tokens):
        depth += (token.text in OPENING) - (token.text in CLOSING)
        if token.text in _ASSIGNING and depth == 0:
            return tokens[:i], tokens[i + 1 :]
    return tokens, []


def _is_equal(tokens: Sequence[Token]) -> bool:
    """Whether a name, and not its derivative or an element of it, is equal to something."""
    left, right = _sides(tokens)
    sign = tokens[len(left)].text if right else ""
    return sign in ("=", ":=") and left[-1].kind == "name"


def _path(tokens: Sequence[Token]) -> str:
    """Return the name ``a.b.c`` at the beginning."""
    names = [tokens[0].text] if tokens else []
    names += [b.text for a, b in pairwise(tokens) if a.text == "." and b.kind == "name"]
    return ".".join(names)


def _inside(tokens: Sequence[Token]) -> Sequence[Token]:
    """Return the tokens before a comma, or before the bracket that closes what is around them."""
    depth = 0
    for i, token in enumerate(tokens):
        depth += (token.text in OPENING) - (token.text in CLOSING)
        if depth < 0 or (token.text == "," and depth == 0):
            return tokens[:i]
    return tokens


def _before(tokens: Sequence[Token], word: str) -> Sequence[Token]:
    return next((tokens[:i] for i, token in enumerate(tokens) if token.text == word), tokens)


def constants_of(sources: Sequence[Source], signals: Iterable[str]) -> Mapping[str, str]:
    """Return values of macros, constants and fields of filled structures of C; ``5 or 9`` if there are two.

    Args:
        sources: files, each of which may define the structures of another one.
        signals: names of signals, which are no constants although a structure may give their first value.
    """
    found: dict[str, dict[str, None]] = defaultdict(dict)
    structures = {name: fields for s in sources for name, fields in s.structures.items()}
    changing = {name.rpartition(".")[2] for name in signals}
    changing |= {
        name for s in sources for each in s.statements if not each.is_declaration for name in each.sets
    }
    for source in sources:
        for name, texts in source.constants[""].items():
            found[name] |= dict.fromkeys(texts)
        for kind, values in source.filled:
            for name, value in _fields(source.text, kind, values, structures):
                if name not in changing:
                    found[name][value] = None
    return {name: " or ".join(texts) for name, texts in found.items()}


def _fields(
    text: str,
    kind: str,
    values: Sequence[Token],
    structures: Mapping[str, Sequence[tuple[str, str]]],
    depth: int = 0,
) -> Iterator[tuple[str, str]]:
    """Return names and values of the fields of a structure, from ``{ 1, { 2, 3 }, .x = 4 }``."""
    fields = structures.get(kind, ())
    if len(fields) == 1 and not fields[0][1]:  # another name of this structure
        fields = structures.get(fields[0][0], ())
    at = 0
    for part in parts(values[1:-1], ","):
        if len(part) > 3 and part[0].text == "." and part[2].text == "=":
            at = next((i for i, (_, name) in enumerate(fields) if name == part[1].text), at)
            part = part[3:]
        if at < len(fields) and part:
            inner, name = fields[at]
            if part[0].text != "{":
                yield name, written(text, part[0].start, part[-1].end)
            elif depth < _MAX_DEPTH:
                yield from _fields(text, inner, part, structures, depth + 1)
        at += 1
