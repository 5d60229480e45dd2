"""One name for one thing: what a reader meets twice under one name is the same thing."""

import ast
from collections import defaultdict
from functools import cache
from pathlib import Path

import varcalc as vc

PACKAGE = Path(vc.__file__).parent


@cache
def modules():
    """Those of the package; the reference problems, which a wheel holds within it, have names of their own."""
    problems = PACKAGE / "problems"
    paths = sorted(path for path in PACKAGE.rglob("*.py") if not path.is_relative_to(problems))
    return [(str(path.relative_to(PACKAGE)), ast.parse(path.read_text(encoding="utf-8"))) for path in paths]


def classes(body):
    """Those that are written among statements, within others as well."""
    for node in body:
        if isinstance(node, ast.ClassDef):
            yield node
        for within in ("body", "orelse", "finalbody", "handlers", "cases"):
            yield from classes(getattr(node, within, []))


def assigned(node):
    """The names that a statement of a module gives values to."""
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return [
        name.id
        for t in targets
        for name in ast.walk(t)
        if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)
    ]


def test_no_class_name_is_given_twice():
    places = defaultdict(list)
    for module, tree in modules():
        for node in classes(tree.body):
            places[node.name].append(module)
    assert {name: where for name, where in places.items() if len(where) > 1} == {}


def test_no_module_gives_a_constant_twice():
    twice = {}
    for module, tree in modules():
        names = [name for node in tree.body for name in assigned(node) if name.isupper()]
        twice |= {(module, name): names.count(name) for name in names if names.count(name) > 1}
    assert twice == {}


ANYWHERE = {"RULES", "MEETS"}
"""What says the same in every module: how many, how far, how much."""


def test_constants_are_named_for_what_they_are():
    values = defaultdict(set)
    for _, tree in modules():
        for node in tree.body:
            for name in filter(str.isupper, assigned(node)):
                values[name].add(ast.unparse(node))
    assert {name: found for name, found in values.items() if len(found) > 3 and name not in ANYWHERE} == {}
