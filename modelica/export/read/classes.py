"""Reads Modelica text: pymoca's grammar and parser create the parse tree, this module the syntax tree.

pymoca's own syntax tree is not used, because it has no line numbers and drops named arguments, so that errors
would result in wrong FMUs.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from .bodies import BodyReader
from .syntax import Class, Component, ExportError, Extends, Import, Modifier, Place


def parse_file(path: Path, shown: str) -> list[Class]:
    """Parse one Modelica file.

    Args:
        path: the file.
        shown: its name in error messages.

    Returns:
        The classes defined in the file.
    """
    from pymoca.parser import ModelicaLexer, ModelicaParser, antlr4

    def stop(_: Any, __: Any, ___: Any, line: int, column: int, message: str, *____: Any) -> None:
        raise ExportError(Place(shown, line), f"syntax error at column {column + 1}: {message}")

    listener = antlr4.error.ErrorListener.ErrorListener()
    listener.syntaxError = lambda *args: stop(None, args[0], args[1], *args[2:])
    lexer = ModelicaLexer(antlr4.InputStream(path.read_text(encoding="utf-8") + "\n"))
    tokens = antlr4.CommonTokenStream(lexer)
    parser = ModelicaParser(tokens)
    for part in (lexer, parser):
        part.removeErrorListeners()
        part.addErrorListener(listener)
    tree = parser.stored_definition()
    rest = tokens.LT(1)
    if rest.type != antlr4.Token.EOF:
        raise ExportError(Place(shown, rest.line), f"syntax error: unexpected '{rest.text}'")
    reader = ClassReader(shown)
    return [reader.class_definition(node.class_definition()) for node in tree.stored_definition_class()]


class ClassReader(BodyReader):
    """Parse tree of classes -> syntax tree."""

    def class_definition(self, ctx: Any) -> Class:
        """Read one class with its contents."""
        place = self.place(ctx)
        kind = ctx.class_prefixes().class_type().getText()
        partial = bool(ctx.class_prefixes().PARTIAL())
        spec = ctx.class_specifier()
        form = type(spec).__name__
        name = spec.IDENT()[0].getText() if isinstance(spec.IDENT(), list) else spec.IDENT().getText()
        if form == "Class_spec_enumContext":
            return Class(name, kind, self.comment(spec.comment()), place, literals=self.literals(spec, name))
        if form == "Class_spec_baseContext":
            if prefix := spec.base_prefix().getText():
                raise ExportError(place, f"'{prefix}' in the short definition of '{name}' is not supported")
            target = self.ref(spec.component_reference())
            modifier = self.class_modification(spec.class_modification())
            result = Class(name, kind, self.comment(spec.comment()), place)
            result.alias_of = Extends(str(target), modifier, place)
            result.alias_dimensions = target.parts[-1].subscripts
            return result
        if form != "Class_spec_compContext":
            raise ExportError(place, f"this form of class definition is not supported ('{name}')")
        result = Class(name, kind, self.strings(spec.string_comment()), place, partial=partial)
        self.composition(spec.composition(), result)
        return result

    def literals(self, ctx: Any, name: str) -> tuple[tuple[str, str], ...]:
        """Return names and descriptions of the items of an enumeration."""
        items = ctx.enum_list().enumeration_literal() if ctx.enum_list() else ()
        if not items:
            raise ExportError(self.place(ctx), f"the enumeration '{name}' must list its items")
        found = tuple((item.IDENT().getText(), self.comment(item.comment())) for item in items)
        for k, (item, _) in enumerate(found):
            if item in (other for other, _ in found[:k]):
                raise ExportError(self.place(items[k]), f"'{item}' is declared twice in '{name}'")
        return found

    def composition(self, ctx: Any, owner: Class) -> None:
        """The body of a class."""
        for node in ctx.children or ():
            form = type(node).__name__
            if form == "Element_listContext":
                protected = any(node is section for section in ctx.epro)
                for element in node.element():
                    self.element(element, owner, public=not protected)
            elif form == "Equation_sectionContext":
                target = owner.initial_equations if node.INITIAL() else owner.equations
                target.extend(self.equations(node.equation_block()))
            elif form == "Algorithm_sectionContext":
                if node.INITIAL():
                    raise ExportError(
                        self.place(node), "'initial algorithm' is not supported; use 'initial equation'"
                    )
                owner.algorithms.append((self.statements(node.statement_block()), self.place(node)))
            elif form == "AnnotationContext":
                owner.annotation = self.class_modification(node.class_modification())
            elif node.getText() == "external":
                raise ExportError(self.place(node), "external functions are not supported")

    def element(self, ctx: Any, owner: Class, *, public: bool) -> None:
        """One declaration, import or extends clause."""
        place = self.place(ctx)
        if ctx.import_clause():
            owner.imports.extend(self.imports(ctx.import_clause()))
        elif ctx.extends_clause():
            clause = ctx.extends_clause()
            modifier = self.class_modification(clause.class_modification())
            owner.extends.append(Extends(str(self.ref(clause.component_reference())), modifier, place))
        elif ctx.replaceable_element():
            raise ExportError(place, "'replaceable' is not supported")
        else:
            node = ctx.regular_element()
            for word in (node.REDECLARE(), node.INNER(), node.OUTER()):
                if word:
                    raise ExportError(place, f"'{word.getText()}' is not supported")
            if node.class_elem:
                inner = self.class_definition(node.class_elem)
                inner.parent = owner
                owner.classes[inner.name] = inner
            else:
                owner.components.extend(
                    self.component_clause(node.comp_elem, public=public, final=bool(node.FINAL()))
                )

    def imports(self, ctx: Any) -> list[Import]:
        """Read an import clause in any of its four forms."""
        place, text = self.place(ctx), ctx.getText()
        name = str(self.ref(ctx.component_reference()))
        if ctx.IDENT():
            return [Import(ctx.IDENT().getText(), name, place)]
        if ctx.import_list():
            names = ctx.import_list().getText().split(",")
            return [Import(item, f"{name}.{item}", place) for item in names]
        if text.split('"')[0].endswith(".*"):
            return [Import("*", name, place)]
        return [Import(name.rsplit(".", 1)[-1], name, place)]

    def component_clause(self, ctx: Any, *, public: bool, final: bool) -> list[Component]:
        """Read all components of one clause such as `parameter Real a = 1, b = 2`."""
        prefix = [child.getText() for child in ctx.type_prefix().children or ()]
        for word in ("flow", "stream"):
            if word in prefix:
                raise ExportError(self.place(ctx), f"'{word}' and connections are not supported")
        variability = next((w for w in prefix if w in ("constant", "parameter", "discrete")), "")
        causality = next((w for w in prefix if w in ("input", "output")), "")
        shared = self.subscripts(ctx.array_subscripts())
        result = []
        for node in ctx.component_list().component_declaration():
            place = self.place(node)
            if node.condition_attribute():
                raise ExportError(place, "conditional components are not supported")
            declaration = node.declaration()
            result.append(
                Component(
                    name=declaration.IDENT().getText(),
                    type_name=ctx.type_specifier().getText().lstrip("."),
                    dimensions=self.subscripts(declaration.array_subscripts()) + shared,
                    variability=variability,
                    causality=causality,
                    modifier=self.modification(declaration.modification(), place),
                    description=self.comment(node.comment()),
                    public=public,
                    final=final,
                    place=place,
                )
            )
        return result

    def modification(self, ctx: Any, place: Place) -> Modifier:
        """`(min = 0) = 1`, `= 1` or nothing."""
        if ctx is None:
            return Modifier(place=place)
        if type(ctx).__name__ == "Modification_classContext":
            inner = self.class_modification(ctx.class_modification()).inner
            value = self.expression(ctx.expression()) if ctx.expression() else None
            return Modifier(value, inner, self.place(ctx))
        return Modifier(self.expression(ctx.expression()), (), self.place(ctx))

    def class_modification(self, ctx: Any) -> Modifier:
        """`(a = 1, b(start = 2))`."""
        if ctx is None:
            return Modifier()
        entries: list[tuple[str, Modifier]] = []
        for argument in ctx.argument_list().argument() if ctx.argument_list() else ():
            place = self.place(argument)
            node = argument.element_modification_or_replaceable()
            if node is None or node.element_modification() is None:
                raise ExportError(place, "'redeclare' and 'replaceable' are not supported")
            change = node.element_modification()
            name = self.ref(change.component_reference())
            if any(part.subscripts for part in name.parts):
                raise ExportError(place, f"a subscript in the modifier of '{name}' is not supported")
            inner = self.modification(change.modification(), place)
            inner = replace(inner, each=bool(node.EACH()), final=bool(node.FINAL()))
            for part in reversed(name.parts[1:]):
                inner = Modifier(None, ((part.name, inner),), place)
            entries.append((name.parts[0].name, inner))
        return Modifier(None, tuple(entries), self.place(ctx))

    def comment(self, ctx: Any) -> str:
        """The description string of a declaration."""
        return self.strings(ctx.string_comment()) if ctx else ""
