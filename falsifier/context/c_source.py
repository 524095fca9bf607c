"""C sources: the functions that set some variables, and what these depend on."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

from falsifier.context.statements import Branch, Slice, Statement, heads, rendered, simple, sliced
from falsifier.context.tokens import Token, tokens_of, written
from falsifier.core.words import counted
from falsifier.errors import SpecError

_MAX_DEPTH = 200
# A type and a name, with or without a value.
_DECLARED = re.compile(
    r"(?!return\b|goto\b)(?:(?:const|static|volatile|unsigned)\s+)*\w+\s+\**[A-Za-z_]\w*\s*[=;]"
)
_COMMENT = re.compile(r"//.*|/\*.*?\*/")
_LISTED_KEYWORDS = """
    if else for while do switch case default break continue return goto sizeof struct union enum
    typedef static const volatile extern inline register void char short int long float double
    signed unsigned bool true false NULL auto restrict _Bool real_T boolean_T int32_T uint32_T
    uint8_T int8_T int16_T uint16_T int_T time_T fmi2Real fmi2Boolean fmi2Integer fmi3Float64
    fmi3Boolean fmi3Int32
"""
_KEYWORDS = frozenset(_LISTED_KEYWORDS.split())
_ASSIGNING = frozenset(["=", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^="])


@dataclass(frozen=True, slots=True)
class CFunction:
    """One function.

    Attributes:
        name: its name.
        head: its return type, name and parameters as written.
        statements: its body.
        line: its line in the source, from 1.
    """

    name: str
    head: str
    statements: tuple[Statement, ...]
    line: int


@dataclass(frozen=True, slots=True)
class CSource:
    """One file.

    Attributes:
        functions: its functions.
        declared: what stands outside functions: variables, constants, types.
        macros: values of ``#define NAME VALUE``; several if it stands under several conditions.
    """

    functions: tuple[CFunction, ...]
    declared: tuple[Statement, ...]
    macros: Mapping[str, tuple[str, ...]]

    @property
    def statements(self) -> tuple[Statement, ...]:
        """Declarations, and the bodies of all functions."""
        return (*self.declared, *(s for f in self.functions for s in f.statements))

    @property
    def names(self) -> frozenset[str]:
        """All names that something sets."""
        return frozenset(name for s in simple(self.statements) for name in s.sets)

    @property
    def own(self) -> frozenset[str]:
        """Variables that functions declare for themselves, except copies of others of the same name."""
        inside = (s for f in self.functions for s in simple(f.statements))
        inner = (s for s in inside if not s.text.startswith("extern "))
        declared = (s for s in inner if s.is_declaration or _DECLARED.match(s.text))
        return frozenset(name for s in declared for name in s.sets if "=" not in s.text or name not in s.uses)

    @property
    def constants(self) -> Mapping[str, str]:
        """Values of macros and constants, as written; ``5 or 9`` of a macro that is defined twice."""
        found = {
            name: " or ".join(dict.fromkeys(_COMMENT.sub("", text).strip() for text in texts))
            for name, texts in self.macros.items()
        }
        for statement in self.declared:
            left, equals, right = statement.text.rstrip("; ").partition("=")
            if equals and "const" in left.split() and len(statement.sets) == 1:
                found[next(iter(statement.sets))] = right.strip()
        return found


def read_c(source: str, shown: str) -> CSource:
    """Return functions, declarations and constants of a file; macros are not expanded.

    Raises:
        SpecError: naming the line where a bracket is not closed or statements are nested too deep.
    """
    tokens = tokens_of(source, shown)
    macros: dict[str, tuple[str, ...]] = {}
    for name, text in _macros(t.text for t in tokens if t.kind == "directive"):
        macros[name] = (*macros.get(name, ()), text)
    reader = _Reader(source, [t for t in tokens if t.kind != "directive"], shown)
    functions, declared = reader.file()
    return CSource(tuple(functions), tuple(declared), macros)


def c_slice(found: CSource, names: Iterable[str]) -> Slice:
    """Return what variables depend on; of ``model.speed`` the member ``speed`` counts.

    A call counts as use of what the called function returns, and a function that sets a variable of this name
    anywhere sets it: variables of the same name in two functions are not told apart.
    """
    values = {name: _words(" ".join(texts)) for name, texts in found.macros.items()}
    seeds = {name.rpartition(".")[2] for name in names}
    part = sliced(found.statements, values, seeds)
    # A statement that only calls a function is kept if something in that function is.
    for _ in found.functions:
        called = {f.name for f in found.functions if any(s in part.kept for s in simple(f.statements))}
        calls = {s for s in simple(found.statements) if not s.sets and s.uses & called and s not in part.kept}
        if not calls:
            break
        part = Slice(part.names, part.kept | calls)
    return part


def c_text(found: CSource, kept: Slice | None) -> str:
    """Return what is kept as C: macros, declarations, functions; None: everything."""
    statements = frozenset(simple(found.statements)) if kept is None else kept.kept
    lines = [
        f"#define {name} {text}"
        for name, texts in found.macros.items()
        if kept is None or name in kept.names
        for text in dict.fromkeys(texts)
    ]
    lines += rendered(found.declared, statements)
    left_out = 0
    for function in found.functions:
        inside = list(rendered(function.statements, statements, 1))
        if inside:
            lines += [f"{function.head} {{", *inside, "}"]
        else:
            left_out += 1
    if left_out:
        lines.append(f"/* {counted(left_out, 'function')} left out: no influence on the requirement */")
    return "\n".join(lines)


def c_conditions(found: CSource, kept: Slice | None) -> Iterator[tuple[str, int]]:
    """Return the texts in which values are compared, with their lines."""
    statements = frozenset(simple(found.statements)) if kept is None else kept.kept
    yield from heads(found.statements, statements)
    for statement in simple(found.statements):
        if statement in statements:
            yield statement.text, statement.line


def _macros(directives: Iterable[str]) -> Iterator[tuple[str, str]]:
    for directive in directives:
        words = directive.replace("\\\n", " ").strip().lstrip("#").split(None, 2)
        if len(words) == 3 and words[0] == "define" and "(" not in words[1]:
            yield words[1], " ".join(words[2].split())


def _words(text: str) -> frozenset[str]:
    return _names(tokens_of(text, "macro"))


class _Reader:
    """Goes through the tokens of a file once."""

    def __init__(self, source: str, tokens: list[Token], shown: str) -> None:
        self.source, self.tokens, self.shown = source, tokens, shown
        self.at = 0
        self.function = ""

    def file(self) -> tuple[list[CFunction], list[Statement]]:
        functions, declared = [], []
        while self.at < len(self.tokens):
            if self._word() == "extern" and self._word(1) == '"C"' and self._word(2) == "{":
                self.at += 3  # its end is passed over like that of any block that is not understood
            begin = self.at
            name = self._head()
            head = self.tokens[begin : self.at]
            if name and self._word() == "{":
                self.function = name.text
                body = self._block(0)
                functions.append(CFunction(name.text, written(self.source, head), body, name.line))
                self.function = ""
            else:
                self.at = begin
                tokens = self._until_semicolon()
                if tokens and not _is_prototype(tokens):
                    declared.append(_simple_statement(self.source, tokens, ""))
        return functions, declared

    def _word(self, ahead: int = 0) -> str:
        i = self.at + ahead
        return self.tokens[i].text if i < len(self.tokens) else ""

    def _head(self) -> Token | None:
        """Go behind the head of a function, if there is one; return its name."""
        while self.at < len(self.tokens):
            token = self.tokens[self.at]
            if token.text in (";", "=", "{", "}"):
                return None
            if token.text == "(":
                name = self.tokens[self.at - 1] if self.at else None
                self._brackets()
                return name if name is not None and name.kind == "name" else None
            self.at += 1
        return None

    def _brackets(self) -> None:
        """Go behind the bracket that closes the one here."""
        begin, depth = self.tokens[self.at], 0
        while self.at < len(self.tokens):
            text = self._word()
            depth += (text in "([{") - (text in ")]}")
            self.at += 1
            if depth == 0:
                return
        raise SpecError(f"{self.shown}: the bracket {begin.text} of line {begin.line} is not closed")

    def _until_semicolon(self) -> list[Token]:
        begin = self.at
        while self.at < len(self.tokens):
            text = self._word()
            if text == ";":
                self.at += 1
                return self.tokens[begin : self.at - 1]
            if text in ("(", "[", "{"):
                self._brackets()
            elif text == "}":  # of a block that is not understood
                self.at += 1
                return self.tokens[begin : self.at - 1]
            else:
                self.at += 1
        return self.tokens[begin:]

    def _block(self, depth: int) -> tuple[Statement, ...]:
        """Return the statements within the braces here."""
        opened = self.tokens[self.at]
        if depth > _MAX_DEPTH:
            raise SpecError(f"{self.shown}: line {opened.line}: nested more than {_MAX_DEPTH} deep")
        self.at += 1
        found = []
        while self._word() != "}":
            if not self._word():
                raise SpecError(f"{self.shown}: the brace of line {opened.line} is not closed")
            found.append(self._statement(depth + 1))
        self.at += 1
        return tuple(found)

    def _statement(self, depth: int) -> Statement:
        token = self.tokens[self.at]
        if token.text in ("if", "for", "while", "switch"):
            return self._branches(depth)
        if token.text == "do":
            self.at += 1
            body = self._body(depth)
            condition = self._until_semicolon()
            head = f"do {{ ... }} {written(self.source, condition)} {{"
            return Statement("}", token.line, branches=(Branch(head, _names(condition), body),))
        if token.text == "{":
            return Statement("}", token.line, branches=(Branch("{", frozenset(), self._block(depth)),))
        if token.text in ("case", "default"):
            begin = self.at
            while self._word() not in (":", ""):
                self.at += 1
            self.at += 1
            return Statement(written(self.source, self.tokens[begin : self.at]), token.line, is_mark=True)
        return _simple_statement(self.source, self._until_semicolon(), self.function)

    def _branches(self, depth: int) -> Statement:
        line = self.tokens[self.at].line
        branches: list[Branch] = []
        while True:
            begin = self.at
            while self._word() in ("else", "if", "for", "while", "switch"):
                self.at += 1
            if self._word() == "(":
                self._brackets()
            head = self.tokens[begin : self.at]
            close = "} " if branches else ""
            body = self._body(depth)
            branches.append(Branch(f"{close}{written(self.source, head)} {{", _names(head), body))
            if self._word() != "else" or head[0].text not in ("if", "else"):
                return Statement("}", line, branches=tuple(branches))

    def _body(self, depth: int) -> tuple[Statement, ...]:
        if depth > _MAX_DEPTH:
            line = self.tokens[min(self.at, len(self.tokens) - 1)].line
            raise SpecError(f"{self.shown}: line {line}: nested more than {_MAX_DEPTH} deep")
        if self._word() == "{":
            return self._block(depth)
        return (self._statement(depth + 1),) if self._word() else ()


def _simple_statement(source: str, tokens: list[Token], function: str) -> Statement:
    text = f"{written(source, tokens)};"
    line = tokens[0].line if tokens else 0
    if tokens and (tokens[0].text in ("break", "continue", "goto") or text == "return;"):
        return Statement(text, line, is_mark=True)
    if tokens and tokens[0].text == "return":
        return Statement(text, line, frozenset((function,)), _names(tokens))
    for i, token in enumerate(tokens):
        if token.text in _ASSIGNING:
            target, right = tokens[:i], tokens[i + 1 :]
            own = _names(target) if token.text != "=" else frozenset()
            return Statement(text, line, _target(target), _names(right) | own | _indices(target))
        if token.text in ("++", "--"):
            return Statement(text, line, _names(tokens), _names(tokens))
    if len(tokens) > 1 and tokens[0].kind == "name" and (tokens[-1].kind == "name" or tokens[-1].text == "]"):
        return Statement(text, line, frozenset(_declared(tokens)), _names(tokens), is_declaration=True)
    addressed = {b.text for a, b in pairwise(tokens) if a.text == "&" and b.kind == "name"}
    return Statement(text, line, frozenset(addressed), _names(tokens))


def _is_prototype(tokens: list[Token]) -> bool:
    return tokens[-1].text == ")" or tokens[0].text in ("extern", "typedef")


def _declared(tokens: list[Token]) -> Iterator[str]:
    """Return the variables and arrays of a declaration without a value."""
    depth = 0
    for token, after in zip(tokens, [*(t.text for t in tokens[1:]), ","], strict=True):
        depth += (token.text in "([{") - (token.text in ")]}")
        if depth == 0 and token.kind == "name" and after in (",", "["):
            yield token.text


def _target(tokens: list[Token]) -> frozenset[str]:
    """What stands on the left: a variable, the last member of a structure, or what a macro names."""
    plain, depth = [], 0
    for token in tokens:
        depth += token.text == "["
        if depth == 0:
            plain.append(token)
        depth -= token.text == "]"
    names = sorted(_names(plain))
    last = next((t.text for t in reversed(plain) if t.kind == "name"), "")
    is_macro = bool(plain) and plain[-1].text == ")"
    return frozenset(names if is_macro else [last] if last else [])


def _indices(tokens: list[Token]) -> frozenset[str]:
    depth, inside = 0, []
    for token in tokens:
        depth += (token.text == "[") - (token.text == "]")
        if depth:
            inside.append(token)
    return _names(inside)


def _names(tokens: Iterable[Token]) -> frozenset[str]:
    """Names of variables and functions; of ``a->b.c`` the last member."""
    listed = list(tokens)
    found = set()
    for token, after in zip(listed, [*listed[1:], None], strict=False):
        is_path = after is not None and after.text in ("->", ".")
        if token.kind == "name" and not is_path and token.text not in _KEYWORDS:
            found.add(token.text)
    return frozenset(found)
