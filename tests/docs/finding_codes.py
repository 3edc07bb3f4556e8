"""All codes of findings that the packages can give, read from their syntax trees."""

import ast
from collections.abc import Iterator
from pathlib import Path

PACKAGES = ("validation", "survey", "laser_gt", "vision_gt", "rtk_gt")
CODE_POSITION = 3
Functions = dict[str, list[ast.FunctionDef]]


class UnreadableCodeError(Exception):
    """A finding whose code the syntax tree does not tell."""


def finding_codes(repository: Path) -> dict[str, set[str]]:
    """Code of each finding, and the files that give it."""
    codes: dict[str, set[str]] = {}
    for package in PACKAGES:
        for path in sorted((repository / package).rglob("*.py")):
            tree = ast.parse(path.read_text())
            place = path.relative_to(repository).as_posix()
            for code in _codes_of(tree, place):
                codes.setdefault(code, set()).add(place)
    return codes


def _codes_of(tree: ast.Module, place: str) -> Iterator[str]:
    for scope, call in _calls(tree, "Finding"):
        expression = _argument(call, CODE_POSITION, "code")
        if expression is not None:
            yield from _values(expression, scope, tree, f"{place}:{call.lineno}")


def _calls(tree: ast.Module, name: str) -> Iterator[tuple[ast.FunctionDef | None, ast.Call]]:
    """Calls of a function, each with the innermost function that it stands in."""

    def visit(node: ast.AST, scope: ast.FunctionDef | None):
        if isinstance(node, ast.FunctionDef):
            scope = node
        if isinstance(node, ast.Call):
            called = node.func
            written = called.id if isinstance(called, ast.Name) else getattr(called, "attr", "")
            if written == name:
                yield scope, node
        for child in ast.iter_child_nodes(node):
            yield from visit(child, scope)

    yield from visit(tree, None)


def _argument(call: ast.Call, position: int, name: str) -> ast.expr | None:
    for keyword in call.keywords:
        if keyword.arg == name:
            return keyword.value
    return call.args[position] if position < len(call.args) else None


def _values(
    expression: ast.expr, scope: ast.FunctionDef | None, tree: ast.Module, place: str
) -> Iterator[str]:
    """All strings that an expression can stand for."""
    if isinstance(expression, ast.Constant) and isinstance(expression.value, str):
        yield expression.value
    elif isinstance(expression, ast.IfExp):
        yield from _values(expression.body, scope, tree, place)
        yield from _values(expression.orelse, scope, tree, place)
    elif isinstance(expression, ast.Name):
        yield from _values_of_name(expression.id, scope, tree, place)
    elif isinstance(expression, ast.Call) and isinstance(expression.func, ast.Attribute):
        yield from _values_of_get(expression, scope, tree, place)
    else:
        raise UnreadableCodeError(f"{place}: {ast.unparse(expression)}")


def _values_of_get(
    call: ast.Call, scope: ast.FunctionDef | None, tree: ast.Module, place: str
) -> Iterator[str]:
    """What ``{...}.get(key, default)`` can be."""
    lookup = call.func
    assert isinstance(lookup, ast.Attribute)
    if lookup.attr != "get" or not isinstance(lookup.value, ast.Dict):
        raise UnreadableCodeError(f"{place}: {ast.unparse(call)}")
    for value in (*lookup.value.values, *call.args[1:]):
        yield from _values(value, scope, tree, place)


def _values_of_name(
    name: str, scope: ast.FunctionDef | None, tree: ast.Module, place: str
) -> Iterator[str]:
    parameters = [] if scope is None else [argument.arg for argument in scope.args.args]
    if scope is not None and name in parameters:
        for outer, call in _calls(tree, scope.name):
            expression = _argument(call, parameters.index(name), name)
            if expression is not None:
                yield from _values(expression, outer, tree, place)
        return
    assigned = list(_assigned(name, tree if scope is None else scope)) or list(
        _assigned(name, tree)
    )
    if not assigned:
        raise UnreadableCodeError(f"{place}: {name}")
    for expression in assigned:
        yield from _values(expression, scope, tree, place)


def _assigned(name: str, within: ast.AST) -> Iterator[ast.expr]:
    """What is assigned to a name, also as one of several, and in a loop over pairs."""
    for node in ast.walk(within):
        if not isinstance(node, ast.Assign):
            continue
        for target in node.targets:
            if isinstance(target, ast.Name) and target.id == name:
                yield node.value
            elif isinstance(target, ast.Tuple):
                names = [getattr(one, "id", "") for one in target.elts]
                if name in names:
                    yield from _part(node.value, names.index(name))


def _part(value: ast.expr, position: int) -> Iterator[ast.expr]:
    if isinstance(value, ast.Tuple):
        yield value.elts[position]
    elif isinstance(value, ast.IfExp):
        yield from _part(value.body, position)
        yield from _part(value.orelse, position)
