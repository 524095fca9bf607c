"""From the text of a Modelica file to its classes, in one pass over its tokens."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from falsifier.context.modelica.classes import Declaration, ModelicaClass
from falsifier.context.statements import Branch, Statement
from falsifier.context.tokens import Token, tokens_of, written
from falsifier.errors import SpecError

_CLASS_WORDS = ("model", "block", "class", "package", "record", "connector", "function", "operator", "type")
_CLASS_PREFIXES = (
    "partial",
    "encapsulated",
    "expandable",
    "pure",
    "impure",
    "final",
    "replaceable",
    "redeclare",
)
_SECTIONS = ("equation", "algorithm", "public", "protected", "initial")
_LISTED_PREFIXES = """
    parameter constant input output discrete flow stream final inner outer replaceable redeclare
"""
_PREFIXES = frozenset(_LISTED_PREFIXES.split())
_ENDING = {"if": "then", "when": "then", "for": "loop", "while": "loop"}
_OPENING = tuple(_ENDING)
_LISTED_KEYWORDS = """
    if then else elseif elsewhen when for while loop in end and or not true false initial each time
    return break
"""
_KEYWORDS = frozenset(_LISTED_KEYWORDS.split())
_LISTED_FUNCTIONS = """
    der pre edge change terminal sample noEvent smooth min max abs sqrt sin cos tan asin acos atan
    atan2 exp log log10 sign floor ceil integer mod div rem sum product size fill zeros ones connect
    reinit assert terminate homotopy delay Integer Real Boolean String enumeration semiLinear
    cardinality
"""
_FUNCTIONS = frozenset(_LISTED_FUNCTIONS.split())
_MAX_DEPTH = 100
_MAX_VALUE = 40


def read_modelica(source: str, shown: str) -> tuple[ModelicaClass, ...]:
    """Return the classes of a file in the order of their ends, inner ones first.

    What is not understood, such as external functions, is passed over up to the next semicolon.

    Raises:
        SpecError: naming the line at which a class is not closed.
    """
    reader = _Reader(source, tokens_of(source, shown), shown)
    reader.file()
    return tuple(reader.classes)


def modified_values(source: str, shown: str) -> dict[str, list[str]]:
    """Return the values that modifiers such as ``Base(limit = 8)`` give to names, anywhere in a file."""
    tokens = tokens_of(source, shown)
    found: dict[str, list[str]] = {}
    opened: list[int] = []
    last = 0  # where the bracket began that was closed last
    for i, token in enumerate(tokens):
        if token.text in ("(", "[", "{"):
            opened.append(i)
        elif token.text in (")", "]", "}") and opened:
            last = opened.pop()
        elif token.text == "=" and opened:
            name = tokens[last - 1] if tokens[i - 1].text == ")" else tokens[i - 1]  # p(min = 0) = 4
            value = next(_split(_inside(tokens[i + 1 : i + 1 + _MAX_VALUE]), ","))
            found.setdefault(name.text, []).append(written(source, value))
    return found


@dataclass(slots=True)
class _Open:
    """A class that is being read."""

    name: str
    kind: str
    line: int
    description: str = ""
    declarations: list[Declaration] = field(default_factory=list)
    equations: list[Statement] = field(default_factory=list)
    algorithms: list[Statement] = field(default_factory=list)
    bases: list[str] = field(default_factory=list)
    definitions: list[tuple[str, str]] = field(default_factory=list)

    def closed(self) -> ModelicaClass:
        return ModelicaClass(
            self.name,
            self.kind,
            self.description,
            tuple(self.declarations),
            tuple(self.equations),
            tuple(self.algorithms),
            tuple(self.bases),
            tuple(self.definitions),
        )


class _Reader:
    """Goes through the tokens of a file once."""

    def __init__(self, source: str, tokens: list[Token], shown: str) -> None:
        self.source, self.tokens, self.shown = source, tokens, shown
        self.at = 0
        self.classes: list[ModelicaClass] = []

    def file(self) -> None:
        while self.at < len(self.tokens):
            begin = self.at
            if self._class_begins():
                self._class(())
            else:
                self._until_semicolon()
            assert self.at > begin

    def _word(self, ahead: int = 0) -> str:
        i = self.at + ahead
        return self.tokens[i].text if i < len(self.tokens) else ""

    def _class_begins(self) -> bool:
        ahead = 0
        while self._word(ahead) in _CLASS_PREFIXES:
            ahead += 1
        return self._word(ahead) in _CLASS_WORDS

    def _class(self, around: tuple[str, ...]) -> tuple[str, str] | None:
        """Read one class; return name and text of a short definition."""
        begin = self.at
        if len(around) > _MAX_DEPTH:
            raise SpecError(f"{self.shown}: classes are nested more than {_MAX_DEPTH} deep")
        while self._word() in _CLASS_PREFIXES:
            self.at += 1
        kind = self._word()
        self.at += 1
        while self._word() in _CLASS_WORDS:  # operator record
            self.at += 1
        line, name = self.tokens[begin].line, self._word()
        self.at += 1
        if self._word() == "=":
            return name, written(self.source, self._until_semicolon(begin))
        path = (*around, name)
        opened = _Open(".".join(path), kind, line)
        if self.at < len(self.tokens) and self.tokens[self.at].kind == "text":
            opened.description = " ".join(self._word().split())
            self.at += 1
        self._body(opened, path)
        self.classes.append(opened.closed())
        return None

    def _body(self, opened: _Open, path: tuple[str, ...]) -> None:
        section = "public"
        while True:
            word = self._word()
            if not word:
                raise SpecError(
                    f"{self.shown}: the {opened.kind} {opened.name} of line {opened.line} is not closed"
                )
            if word == "end" and self._word(1) not in _OPENING:
                self._until_semicolon()
                return
            if word in _SECTIONS:
                section = word if word != "initial" else section
                self.at += 1
            elif word in ("annotation", "import", "external", ";"):
                self._until_semicolon()
            elif section == "equation":
                opened.equations.append(self._statement(is_equation=True))
            elif section == "algorithm":
                opened.algorithms.append(self._statement(is_equation=False))
            elif word == "extends":
                opened.bases.append(_dotted(self._until_semicolon()[1:])[0])
            elif self._class_begins():
                short = self._class(path)
                opened.definitions += [short] if short else []
            else:
                opened.declarations += self._declared(self._until_semicolon())

    def _until_semicolon(self, begin: int | None = None) -> list[Token]:
        """Go behind the next semicolon outside brackets; return the tokens before it."""
        begin = self.at if begin is None else begin
        depth = 0
        while self.at < len(self.tokens):
            text = self.tokens[self.at].text
            depth += (text in "([{") - (text in ")]}")
            self.at += 1
            if text == ";" and depth <= 0:
                return self.tokens[begin : self.at - 1]
        return self.tokens[begin:]

    def _declared(self, tokens: list[Token]) -> Iterator[Declaration]:
        i = 0
        while i < len(tokens) and tokens[i].text in _PREFIXES:
            i += 1
        prefixes = tuple(token.text for token in tokens[:i])
        kind, length = _dotted(tokens[i:])
        i += length
        if i < len(tokens) and tokens[i].text == "[":
            i += _closing(tokens[i:]) + 1
        head = written(self.source, tokens[:i])
        for part in _split(tokens[i:], ","):
            if part and part[0].kind == "name":
                yield Declaration(
                    name=part[0].text,
                    type=kind,
                    prefixes=prefixes,
                    text=f"{head} {written(self.source, _without_annotation(part))}",
                    value=written(self.source, _value(part)),
                    uses=_names(_modifiers(part)),
                    line=part[0].line,
                )

    def _statement(self, *, is_equation: bool, depth: int = 0) -> Statement:
        if depth > _MAX_DEPTH:
            line = self.tokens[self.at].line
            raise SpecError(f"{self.shown}: line {line}: statements are nested more than {_MAX_DEPTH} deep")
        word = self._word()
        if word in _OPENING:
            return self._branches(word, is_equation=is_equation, depth=depth)
        tokens = self._until_semicolon()
        return _simple_statement(f"{written(self.source, tokens)};", tokens, is_equation=is_equation)

    def _branches(self, word: str, *, is_equation: bool, depth: int) -> Statement:
        branches = []
        line = self.tokens[self.at].line
        while self._word() and self._word() != "end":
            begin = self.at
            if self._word() == "else":
                self.at += 1
            else:
                self._behind(_ENDING[word])
            head = self.tokens[begin : self.at]
            inside = []
            while self._word() and self._word() not in ("end", "else", "elseif", "elsewhen"):
                inside.append(self._statement(is_equation=is_equation, depth=depth + 1))
            branches.append(Branch(written(self.source, head), _names(head), tuple(inside)))
        self._until_semicolon()
        return Statement(f"end {word};", line, branches=tuple(branches))

    def _behind(self, word: str) -> None:
        """Go behind a word outside brackets."""
        depth = 0
        while self.at < len(self.tokens):
            text = self._word()
            depth += (text in "([{") - (text in ")]}")
            self.at += 1
            if text == word and depth <= 0:
                return


def _simple_statement(text: str, tokens: list[Token], *, is_equation: bool) -> Statement:
    """What stands alone on the left of the sign, as it is or differentiated, is what is set."""
    line = tokens[0].line if tokens else 0
    left, right = _sides(tokens)
    if not right:
        return Statement(text, line, frozenset(), _names(tokens), is_equation)
    target = left[2:-1] if [token.text for token in left[:2]] == ["der", "("] else left
    name, length = _dotted(target)
    index = target[length:]
    if name and (not index or (index[0].text == "[" and _closing(index) == len(index) - 1)):
        return Statement(text, line, _names(target[:1]), _names([*right, *index]), is_equation)
    if not is_equation:  # (a, b) := f(x)
        return Statement(text, line, _names(left), _names(right))
    return Statement(text, line, frozenset(), _names(tokens), is_equation)


def _sides(tokens: list[Token]) -> tuple[list[Token], list[Token]]:
    depth = 0
    for i, token in enumerate(tokens):
        depth += (token.text in "([{") - (token.text in ")]}")
        if token.text in ("=", ":=") and depth == 0:
            return tokens[:i], tokens[i + 1 :]
    return tokens, []


def _names(tokens: Iterable[Token]) -> frozenset[str]:
    """Names of variables and of functions that are not built in; of ``a.b.c`` the first one."""
    listed = list(tokens)
    found = set()
    for before, token, after in zip([None, *listed], listed, [*listed[1:], None], strict=False):
        is_first = token.kind == "name" and (before is None or before.text != ".")
        is_built_in = token.text in _FUNCTIONS and after is not None and after.text == "("
        if is_first and token.text not in _KEYWORDS and not is_built_in:
            found.add(token.text)
    return frozenset(found)


def _dotted(tokens: list[Token]) -> tuple[str, int]:
    """Return the name ``a.b.c`` at the beginning, and how many tokens it has."""
    i = 0
    while i < len(tokens) and (tokens[i].kind == "name" or tokens[i].text == "."):
        if tokens[i].kind == "name" and i and tokens[i - 1].text != ".":
            break
        i += 1
    return "".join(token.text for token in tokens[:i]), i


def _closing(tokens: list[Token]) -> int:
    """Index of the bracket that closes the first one."""
    depth = 0
    for i, token in enumerate(tokens):
        depth += (token.text in "([{") - (token.text in ")]}")
        if depth == 0:
            return i
    return len(tokens) - 1


def _inside(tokens: list[Token]) -> list[Token]:
    """Return the tokens before the bracket that closes what is around them."""
    depth = 0
    for i, token in enumerate(tokens):
        depth += (token.text in "([{") - (token.text in ")]}")
        if depth < 0:
            return tokens[:i]
    return tokens


def _split(tokens: list[Token], sign: str) -> Iterator[list[Token]]:
    depth, begin = 0, 0
    for i, token in enumerate(tokens):
        depth += (token.text in "([{") - (token.text in ")]}")
        if token.text == sign and depth == 0:
            yield tokens[begin:i]
            begin = i + 1
    yield tokens[begin:]


def _value(part: list[Token]) -> list[Token]:
    _, right = _sides(_without_annotation(part))
    return [token for token in right if token.kind != "text"]


def _modifiers(part: list[Token]) -> list[Token]:
    """What stands on the right of equals signs, at any depth."""
    found, is_right = [], False
    for token in _without_annotation(part)[1:]:
        is_right = (is_right or token.text == "=") and token.text != ","
        if is_right:
            found.append(token)
    return found


def _without_annotation(part: list[Token]) -> list[Token]:
    return next((part[:i] for i, token in enumerate(part) if token.text == "annotation"), part)
