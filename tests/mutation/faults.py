"""The small faults that a mutant may have: what may stand in the place of a node of a syntax tree."""

import ast
import copy
from collections.abc import Callable, Iterator
from typing import Any, Final

COMPARISONS: Final[dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
OPERATIONS: Final[dict[type[ast.operator], type[ast.operator]]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Div,
    ast.Mod: ast.Add,
}
FUNCTIONS: Final = {"min": "max", "max": "min", "sin": "cos", "cos": "sin", "any": "all", "all": "any"}


def faults(node: ast.AST) -> Iterator[ast.AST]:
    """Yield what may stand in a node's place, each a fault that someone could have made."""
    for kind, instead in KINDS.items():
        if isinstance(node, kind):
            yield from instead(node)


def left_alone(tree: ast.AST) -> set[ast.AST]:
    """Return the nodes that decide nothing when the program runs: annotations, decorators, texts of messages."""
    tops = list[ast.AST]()
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(returns=ast.AST() as annotation):
                tops += [*node.decorator_list, annotation]
            case ast.ClassDef():
                tops += [*node.decorator_list, *node.keywords]
            case ast.arg(annotation=ast.AST() as annotation) | ast.AnnAssign(annotation=annotation):
                tops.append(annotation)
            case ast.JoinedStr() | ast.Raise():
                tops.append(node)
            case ast.If() if is_type_checking(node.test):
                tops.append(node)
    return {each for top in tops for each in ast.walk(top)}


def is_type_checking(node: ast.AST) -> bool:
    """Return whether a condition is true for a type checker alone."""
    return isinstance(node, ast.Name) and node.id == "TYPE_CHECKING"


def _of_comparison(node: ast.Compare) -> Iterator[ast.AST]:
    if len(node.ops) == 1:
        for other in COMPARISONS[type(node.ops[0])]:
            yield _changed(node, ops=[other()])


def _of_operation(node: ast.BinOp | ast.AugAssign) -> Iterator[ast.AST]:
    left = node.left if isinstance(node, ast.BinOp) else node.value
    is_text = isinstance(left, ast.Constant) and isinstance(left.value, str)
    if type(node.op) in OPERATIONS and not is_text:
        yield _changed(node, op=OPERATIONS[type(node.op)]())


def _of_conditions(node: ast.BoolOp) -> Iterator[ast.AST]:
    yield _changed(node, op=ast.And() if isinstance(node.op, ast.Or) else ast.Or())
    for i in range(len(node.values)):
        rest = node.values[:i] + node.values[i + 1 :]
        yield rest[0] if len(rest) == 1 else _changed(node, values=rest)


def _of_sign(node: ast.UnaryOp) -> Iterator[ast.AST]:
    if isinstance(node.op, ast.Not | ast.USub):
        yield node.operand


def _of_branch(node: ast.IfExp | ast.If | ast.While) -> Iterator[ast.AST]:
    yield _changed(node, test=ast.UnaryOp(ast.Not(), node.test))


def _of_constant(node: ast.Constant) -> Iterator[ast.AST]:
    if isinstance(node.value, bool):
        yield _changed(node, value=not node.value)
    elif isinstance(node.value, int | float):
        yield _changed(node, value=node.value + 1)
        if node.value not in {0, 1}:
            yield _changed(node, value=node.value * 2)


def _of_call(node: ast.Call) -> Iterator[ast.AST]:
    match node.func:
        case ast.Name(id=name) if name in FUNCTIONS:
            yield _changed(node, func=_changed(node.func, id=FUNCTIONS[name]))
        case ast.Attribute(attr=name) if name in FUNCTIONS:
            yield _changed(node, func=_changed(node.func, attr=FUNCTIONS[name]))


def _of_statement(node: ast.Expr | ast.AugAssign | ast.Continue | ast.Break) -> Iterator[ast.AST]:
    if not isinstance(node, ast.Expr) or isinstance(node.value, ast.Call | ast.Yield):
        yield ast.Pass()


def _of_return(node: ast.Return) -> Iterator[ast.AST]:
    if node.value is not None and not (isinstance(node.value, ast.Constant) and node.value.value is None):
        yield _changed(node, value=ast.Constant(None))


KINDS: Final[dict[Any, Callable[[Any], Iterator[ast.AST]]]] = {
    ast.Compare: _of_comparison,
    (ast.BinOp, ast.AugAssign): _of_operation,
    ast.BoolOp: _of_conditions,
    ast.UnaryOp: _of_sign,
    (ast.IfExp, ast.If, ast.While): _of_branch,
    ast.Constant: _of_constant,
    ast.Call: _of_call,
    (ast.Expr, ast.AugAssign, ast.Continue, ast.Break): _of_statement,
    ast.Return: _of_return,
}
"""The kinds of nodes, and what yields the faults of each."""


def _changed(node: ast.AST, **fields: object) -> ast.AST:
    new = copy.copy(node)
    for name, value in fields.items():
        setattr(new, name, value)
    return new
