"""The stubs, signatures and documentation of the module."""

import ast
import inspect
import pathlib

import glint_splat as g
import pytest
from glint_splat import _glint

FOLDER = pathlib.Path(g.__file__).parent
SPECIAL = {"__new__", "__len__", "__repr__"}


def stubs():
    return ast.parse((FOLDER / "_glint.pyi").read_text(encoding="utf-8")).body


def arguments(stub):
    """Names of a stub's arguments, and whether each has a default."""
    given = stub.args
    missing = len(given.args) - len(given.defaults)
    both = [(argument.arg, at >= missing) for at, argument in enumerate(given.args)]
    both += [(argument.arg, default is not None) for argument, default in zip(given.kwonlyargs, given.kw_defaults)]
    return [pair for pair in both if pair[0] not in ("self", "cls")]


def parameters(function):
    found = inspect.signature(function).parameters.values()
    return [(p.name, p.default is not p.empty) for p in found if p.name != "self"]


def test_stubs_have_the_extension_s_names():
    assert (FOLDER / "py.typed").exists()
    kept = [s for s in stubs() if isinstance(s, (ast.AnnAssign, ast.ClassDef, ast.FunctionDef))]
    named = {s.target.id if isinstance(s, ast.AnnAssign) else s.name for s in kept}
    assert named == {name for name in dir(_glint) if name == "__version__" or not name.startswith("__")}


@pytest.mark.parametrize("stub", [s for s in stubs() if isinstance(s, ast.FunctionDef)], ids=lambda stub: stub.name)
def test_stubs_have_the_extension_s_functions(stub):
    assert arguments(stub) == parameters(getattr(_glint, stub.name))


@pytest.mark.parametrize("stub", [s for s in stubs() if isinstance(s, ast.ClassDef)], ids=lambda stub: stub.name)
def test_stubs_have_the_extension_s_classes(stub):
    own = getattr(_glint, stub.name)
    methods = {method.name: method for method in stub.body}
    assert set(methods) - SPECIAL == {name for name in vars(own) if not name.startswith("__")}
    for name, method in methods.items():
        found = vars(own)[name] if name != "__new__" else own
        if method.decorator_list:
            assert inspect.isgetsetdescriptor(found), name
        else:
            assert arguments(method) == parameters(found), name


def public():
    for name, value in vars(g).items():
        if not name.startswith("_") and getattr(value, "__module__", "").startswith("glint_splat"):
            yield name, value
            if inspect.isclass(value):
                members = [(member, own) for member, own in vars(value).items() if not member.startswith("_")]
                yield from ((f"{name}.{member}", own) for member, own in members if callable(own) or inspect.isgetsetdescriptor(own))


@pytest.mark.parametrize("name, value", public())
def test_everything_public_is_documented_and_typed(name, value):
    assert len(value.__doc__) > 15
    if inspect.isfunction(value):
        code = value.__code__
        named = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        assert set(named) - {"self"} <= set(value.__annotations__) and "return" in value.__annotations__


def test_signatures_have_the_command_s_options():
    train = inspect.signature(g.train).parameters
    assert {"dataset", "output", "iterations", "max_size", "gaussians", "points", "seed", "device"} <= set(train)
    assert "view" not in train and "json" not in train
    assert "iterations: " in g.train.__doc__
