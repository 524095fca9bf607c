"""Modelica and C sources: what each class or function declares, sets and compares.

Nothing is resolved that a compiler would resolve. Statements end at semicolons and, in C, at braces; what is
not closed ends with the file.
"""

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from falsifier.context.crossings import Definitions

# Comments, texts and names in quotes may contain any sign. Patterns take what they have looked at, so that
# time grows with the length of a file.
_SILENT = re.compile(
    r"""//[^\n]*+|/\*.*?(?:\*/|\Z)|"(?:[^"\\]|\\.)*+(?:"|\\?\Z)|(?P<name>'(?:[^'\\\n]|\\.){1,200}')""",
    re.DOTALL,
)
_DIRECTIVE = re.compile(r"^[ \t]*+#(?:[^\n\\]|\\.)*+", re.MULTILINE | re.DOTALL)
_DEFINE = re.compile(r"\s*#\s*define\s+(\w+)[ \t]+(.*)", re.DOTALL)
_CLASS = (
    r"(?:(?:partial|encapsulated|expandable|pure|impure|final|replaceable|redeclare|operator)\s+)*"
    r"(?:model|block|class|package|record|connector|function|type)\s+(?P<name>\w++)(?!\s*=)"
)
# What may stand before a statement.
_MODELICA_HEAD = re.compile(
    rf"\s*(?:(?P<section>(?:initial\s+)?(?:equation|algorithm)\b|public\b|protected\b)|{_CLASS}|else\b"
    r"|(?P<condition>if|for|while|when|elseif|elsewhen)\b(?P<test>.*?)\b(?:then|loop)\b)",
    re.DOTALL,
)
_C_HEAD = re.compile(
    r"\s*(?:else\b|do\b|case\b[^:;]*:|[^\W\d]\w*+\s*:(?!=)|(?P<condition>if|for|while|switch)\b)"
)
_PREFIX = (
    r"(?:final|inner|outer|replaceable|redeclare|parameter|constant|discrete|flow|stream|input|output)\s+"
)
_MODELICA_DECLARATION = re.compile(
    rf"(?P<words>(?:{_PREFIX})*)(?P<kind>\.?[^\W\d][\w.]*+)(?:\s*\[[^\]]*\])?\s++(?P<rest>[^\W\d].*)",
    re.DOTALL,
)
_C_DECLARATION = re.compile(
    r"(?P<words>(?:[^\W\d]\w*+[\s*]++)*?)(?P<kind>[^\W\d]\w*+)[\s*]++"
    r"(?P<rest>[^\W\d]\w*+\s*(?:[=,\[].*)?)$",
    re.DOTALL,
)
_UNDECLARED = re.compile(r"(?:return|goto|case|break|continue|import|external|within|annotation|end)\b")
_UNCHANGING = frozenset(("parameter", "constant", "const"))
_ASSIGNING = r"(?<![<>=!])[-+*/%&|^:]?=(?!=)"
# Of a.b, the name is a in Modelica and b in C.
_MODELICA_NAME = re.compile(r"(?<![\w.])[^\W\d]\w*+(?!\s*\()")
_C_NAME = re.compile(r"\b[^\W\d]\w*+(?!\s*(?:\(|\.|->))")
_WORD = re.compile(r"[^\W\d]\w*+")
_PATH = re.compile(r"\s*([^\W\d]\w*+(?:\.[^\W\d]\w*+)*+)")
_FOR = re.compile(r"[\s}]*(?:else\s+)?for\b")
_BRACKET = re.compile(r'"(?:[^"\\]|\\.)*+"?|[][(){}]')
_MAX_CHARACTERS = 4_000_000  # far more than a model of 10,000 lines has
_MAX_VALUE = 400  # characters of a modifier
_MAX_DEPTH = 20  # of structures within structures, and of modifiers within modifiers


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
class Scope:
    """A class of Modelica, a function of C, or what stands outside of all functions.

    Attributes:
        texts: its statements and conditions, with their lines in the file.
        own: names that a function declares, except copies of others of the same name.
        constants: values of its constants and parameters.
        bases: the classes that it extends.
        components: what a class declares, by name.
        leading: what leads to inputs of its components, such as ``limiter.u``.
        values: what each name is set to; empty text if that depends on a condition, or is no plain value.
        uses: names in the statements that set a name.
    """

    texts: list[tuple[str, int]] = field(default_factory=list)
    own: set[str] = field(default_factory=set)
    constants: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    bases: list[str] = field(default_factory=list)
    components: dict[str, Component] = field(default_factory=dict)
    leading: dict[str, str] = field(default_factory=dict)
    values: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    uses: dict[str, set[str]] = field(default_factory=lambda: defaultdict(set))


@dataclass(slots=True)
class Source:
    """One file.

    Attributes:
        text: its text.
        shown: what messages call it.
        is_modelica: whether it is Modelica.
        scopes: its classes or functions by name; the empty name has what stands outside of functions.
        modified: values that modifiers such as ``Base(limit = 8)`` give to names, anywhere in it.
        structures: types and names of the fields of each structure of C, as it is declared.
        filled: types and values of the variables that are declared with values in braces.
    """

    text: str
    shown: str
    is_modelica: bool
    scopes: dict[str, Scope] = field(default_factory=lambda: defaultdict(Scope))
    modified: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    structures: dict[str, list[tuple[str, str]]] = field(default_factory=dict)
    filled: list[tuple[str, str]] = field(default_factory=list)

    @property
    def names_set(self) -> set[str]:
        """The names to which anything in it gives a value."""
        return {name for scope in self.scopes.values() for name in scope.values}


@dataclass(slots=True)
class _Block:
    """A class, function, structure or condition whose statements are being read."""

    word: str  # class, function, struct or condition; empty outside of all
    scope: str
    names: Sequence[str] = ()  # of a structure
    fields: list[tuple[str, str]] = field(default_factory=list)


def read_source(text: str, shown: str, *, is_modelica: bool) -> Source | None:
    """Return what a file says; None if it is too long to be read."""
    if len(text) > _MAX_CHARACTERS:
        return None
    found = Source(text, shown, is_modelica)
    plain = _SILENT.sub(lambda each: _blank(each, keeps_names=is_modelica), text)
    if is_modelica:
        _read_modelica(found, plain)
    else:
        for directive in _DIRECTIVE.finditer(plain):
            defined = _DEFINE.match(directive[0])
            if defined:
                found.scopes[""].constants[defined[1]].append(_one_line(defined[2].replace("\\\n", " ")))
        _read_c(found, _DIRECTIVE.sub(lambda each: "\n" * each[0].count("\n"), plain))
    return found


def without_annotations(text: str) -> str:
    """Return Modelica as written, without its annotations."""
    told, end = "", 0
    for found in re.finditer(r"(?<!\s)\s*\bannotation\s*\(", text):
        if found.start() >= end:
            told += text[end : found.start()]
            end = _closing(text, found.end() - 1)
    return told + text[end:]


def definitions_of(scopes: Iterable[Scope]) -> Definitions:
    """Return what variables are equal to at all times, and what each depends on in one step.

    A variable with several statements, or one under a condition, equals no single expression.
    """
    values: dict[str, list[str]] = defaultdict(list)
    fed: dict[str, set[str]] = defaultdict(set)
    for scope in scopes:
        for name, texts in scope.values.items():
            values[name] += texts
            fed[name] |= scope.uses[name]
    equal = {name: texts[0] for name, texts in values.items() if len(texts) == 1 and texts[0]}
    return Definitions(equal, {name: frozenset(used) for name, used in fed.items()})


def _blank(found: re.Match[str], *, keeps_names: bool) -> str:
    """Return what stands for a comment or text, with as many lines."""
    return found[0] if keeps_names and found["name"] else " " + "\n" * found[0].count("\n")


def _read_modelica(found: Source, text: str) -> None:
    blocks = [_Block("", "")]
    is_initial = False  # whether equations hold at the beginning only
    for statement, line, _ in _pieces(text, is_modelica=True):
        at = 0
        while head := _MODELICA_HEAD.match(statement, at):
            at = head.end()
            if head["name"]:
                blocks.append(_Block("class", head["name"]))
            elif head["condition"]:
                found.scopes[blocks[-1].scope].texts.append((_one_line(head["test"]), line))
                if not head["condition"].startswith("else"):
                    blocks.append(_Block("condition", blocks[-1].scope))
            if head["section"] or head["name"]:
                is_initial = (head["section"] or "").startswith("initial")
        rest = re.split(r"\bannotation\b", statement[at:], maxsplit=1)[0]
        line += statement.count("\n", 0, at + len(rest) - len(rest.lstrip()))
        rest = rest.strip()
        block = blocks[-1]
        ending = re.match(r"end\b\s*(if|for|while|when)?", rest)
        if ending:
            while not ending[1] and len(blocks) > 1 and blocks[-1].word == "condition":
                blocks.pop()
            if len(blocks) > 1 and (blocks[-1].word == "condition") == bool(ending[1]):
                blocks.pop()
        elif rest.startswith("extends") and (base := _PATH.match(rest[len("extends") :])):
            found.scopes[block.scope].bases.append(base[1].rpartition(".")[2])
            _modified(found, rest)
        elif block.scope:
            _read_statement(found, block, rest, line, is_always=block.word == "class" and not is_initial)


def _read_c(found: Source, text: str) -> None:
    blocks = [_Block("", "")]
    closed: list[tuple[str, str]] | None = None  # fields of the structure that ended last
    for statement, line, sign in _pieces(text, is_modelica=False):
        if closed is not None and statement.isidentifier():  # typedef struct { ... } P;
            found.structures[statement] = closed
            blocks[-1].fields.append((statement, statement))
            statement = ""
        closed = None
        block, at = blocks[-1], 0
        while head := _C_HEAD.match(statement, at):
            at = _closing(statement, head.end()) if head["condition"] else head.end()
        rest = statement[at:].strip()
        if sign != "{":
            is_always = block.word != "condition" and not at
            _read_statement(found, block, rest, line, is_always=is_always, head=statement[:at])
        else:
            blocks.append(_opened(block, rest, is_condition=at > 0))
            found.scopes[block.scope].texts.append((_one_line(statement[:at]), line))
        if sign == "}" and len(blocks) > 1:
            ended = blocks.pop()
            if ended.word == "struct":
                closed = ended.fields
                found.structures.update(dict.fromkeys(ended.names, closed))


def _opened(around: _Block, head: str, *, is_condition: bool) -> _Block:
    """Return what a brace of C opens, by what stands before it."""
    called = re.search(r"([^\W\d]\w*+)\s*\(", head)
    if is_condition:
        return _Block("condition", around.scope)
    if called and not around.scope:
        return _Block("function", called[1])
    if re.match(r"(static\s+|const\s+)*(struct|union|typedef)\b", head):
        names = [name for name in re.findall(r"\w+", head) if name not in ("struct", "union", "typedef")]
        return _Block("struct", around.scope, names[-1:])
    return _Block(around.word, around.scope)


def _read_statement(
    found: Source, block: _Block, text: str, line: int, *, is_always: bool, head: str = ""
) -> None:
    """Read what declares or sets something."""
    scope, names = found.scopes[block.scope], _MODELICA_NAME if found.is_modelica else _C_NAME
    if text or head:
        scope.texts.append((_one_line(f"{head} {text}"), line))
    form = _MODELICA_DECLARATION if found.is_modelica else _C_DECLARATION
    declaration = None if _UNDECLARED.match(text) else form.match(text)
    words = {*declaration["words"].split(), declaration["kind"]} if declaration else set[str]()
    for part in split_at_commas(declaration["rest"]) if declaration else [text]:
        left, sign, value = sides_of(part)
        met = (_WORD if declaration else names).findall(re.sub(r"\[[^\]]*\]", "", left))
        if declaration and met:
            _declare(found, block, declaration["kind"], met[0], left, value, words, line)
        if value and not words & _UNCHANGING:
            is_plain = is_always and sign in ("=", ":=") and (declaration or left[-1:] not in (")", "]"))
            for name in met[:1] if declaration or found.is_modelica else met[-1:]:
                scope.values[name].append(value if is_plain else "")
                scope.uses[name].update(names.findall(f"{head} {text}"))
    if found.is_modelica and not declaration:
        scope.leading.update(_leads(text, scope))


def _declare(
    found: Source, block: _Block, kind: str, name: str, left: str, value: str, words: set[str], line: int
) -> None:
    """Note what a declaration says of a name."""
    scope = found.scopes[block.scope]
    if found.is_modelica:
        scope.components[name] = Component(kind, _modified(found, left), line)
        if value and words & _UNCHANGING:
            scope.constants[name].append(value)
    elif "typedef" in words:
        found.structures.setdefault(name, [(kind, "")])
    elif block.word == "struct":
        block.fields.append((kind, name))
    elif block.scope and "extern" not in words and name not in _C_NAME.findall(value):
        scope.own.add(name)
    elif value.startswith("{"):
        found.filled.append((kind, value))
    elif value and "const" in words:
        found.scopes[""].constants[name].append(value)


def _modified(found: Source, text: str, depth: int = 0) -> dict[str, str]:
    """Note the values that modifiers give to names; return those directly within the first bracket."""
    opening = text.find("(")
    direct: dict[str, str] = {}
    if opening < 0 or depth > _MAX_DEPTH:
        return direct
    for part in split_at_commas(text[opening + 1 : _closing(text, opening) - 1]):
        left, _, value = sides_of(part)
        names = _WORD.findall(left.partition("(")[0])  # each final start(...) = 3
        if names and 0 < len(value) <= _MAX_VALUE:
            direct[names[-1]] = value
            found.modified[names[-1]].append(value)
        _modified(found, left, depth + 1)
    return direct


def _leads(text: str, scope: Scope) -> Iterator[tuple[str, str]]:
    """Return what leads to an input of a component, which the library calls u, u1, ... or reference."""
    left, _, right = sides_of(text)
    is_connection = text.startswith("connect")
    if is_connection:
        sides = [path[1] for part in split_at_commas(left.partition("(")[2]) if (path := _PATH.match(part))]
        pairs = [(sides[0], sides[1]), (sides[1], sides[0])] if len(sides) == 2 else []
    else:
        path = _PATH.match(left)
        pairs = [(path[1], right)] if path and right else []
    for port, source in pairs:
        _, dot, last = port.rpartition(".")
        declared = scope.components.get(port)
        is_input = dot and (last.rstrip("0123456789") == "u" or last == "reference")
        if is_input or (is_connection and declared is not None and declared.kind.endswith("Output")):
            yield port, source


def _pieces(text: str, *, is_modelica: bool) -> Iterator[tuple[str, int, str]]:
    """Return statements with their lines, and the sign that ends each: a semicolon, or a brace of C.

    A bracket that is not closed ends with its statement, except matrices of Modelica, loops and values of C.
    """
    begin, line, opened = 0, 1, list[str]()
    for found in re.finditer(r"=\s*\{|[][(){};]", text):
        sign, at = found[0][-1], found.start()
        if sign == ";":
            kept = "[" if is_modelica else "{(" if _FOR.match(text, begin) else "{"
            is_end = not opened or opened[-1] not in kept
        else:
            is_end = not is_modelica and not opened and found[0] in ("{", "}")
        if is_end:
            piece = text[begin:at]
            blank = len(piece) - len(piece.lstrip())
            yield piece.strip(), line + piece.count("\n", 0, blank), sign
            line += text.count("\n", begin, found.end())
            begin, opened = found.end(), []
        elif sign in "([{":
            opened.append(sign)
        elif sign != ";" and opened:
            opened.pop()
    blank = len(text) - begin - len(text[begin:].lstrip())
    yield text[begin:].strip(), line + text.count("\n", begin, begin + blank), ""


def _closing(text: str, at: int) -> int:
    """Return the place behind the bracket that closes the first one from a place on."""
    depth = 0
    for found in _BRACKET.finditer(text, at):
        depth += (found[0] in "([{") - (found[0] in ")]}")
        if depth <= 0 and found[0] in ")]}":
            return found.end()
    return len(text)


def _outside(text: str, sign: str) -> Iterator[re.Match[str]]:
    """Return where a sign stands outside of brackets."""
    depth = 0
    for found in re.finditer(rf"[(\[{{]|[)\]}}]|(?P<sign>{sign})", text):
        if found["sign"] is None:
            depth += 1 if found[0] in "([{" else -1
        elif depth == 0:
            yield found


def split_at_commas(text: str) -> Iterator[str]:
    """Return what stands between the commas that are outside of brackets."""
    begin = 0
    for comma in _outside(text, ","):
        yield text[begin : comma.start()].strip()
        begin = comma.end()
    yield text[begin:].strip()


def sides_of(text: str) -> tuple[str, str, str]:
    """Return what stands before an assignment or equation, its sign, and its value in one line."""
    sign = next(_outside(text, _ASSIGNING), None)
    if sign is None:
        return text, "", ""
    return text[: sign.start()].strip(), sign[0], _one_line(text[sign.end() :])


def _one_line(text: str) -> str:
    return " ".join(text.split())
