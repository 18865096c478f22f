"""The stub of the Rust side is true: the same names, and the same parameters. Docstrings have what the manual promises."""

import ast
import inspect
from importlib.resources import files

import sastrugi
from sastrugi import _native

STUB = ast.parse(files("sastrugi").joinpath("_native.pyi").read_text(encoding="utf-8"))


def parameters(function):
    arguments = function.args
    return [argument.arg for argument in arguments.posonlyargs + arguments.args + arguments.kwonlyargs]


def test_names():
    functions = {node.name for node in STUB.body if isinstance(node, ast.FunctionDef)}
    classes = {node.name for node in STUB.body if isinstance(node, ast.ClassDef)}
    ours = {name for name in dir(_native) if not name.startswith("_")}
    assert functions | classes == ours
    assert all(inspect.isclass(getattr(_native, name)) for name in classes)
    for node in (node for node in STUB.body if isinstance(node, ast.ClassDef)):
        stated = {item.name for item in node.body if isinstance(item, ast.FunctionDef) and not item.name.startswith("_")}
        assert stated == {name for name in dir(getattr(_native, node.name)) if not name.startswith("_")}, node.name


def test_parameters():
    for node in STUB.body:
        if isinstance(node, ast.FunctionDef):
            found = list(inspect.signature(getattr(_native, node.name)).parameters)
            assert parameters(node) == found, node.name
        if isinstance(node, ast.ClassDef):
            members = getattr(_native, node.name)
            methods = [item for item in node.body if isinstance(item, ast.FunctionDef) and item.name != "__init__"]
            for method in methods:
                member = getattr(members, method.name)
                if not method.decorator_list:
                    assert parameters(method) == list(inspect.signature(member).parameters), f"{node.name}.{method.name}"


def test_docstrings():
    """Every function has an example, which doctest runs, and says what it raises; checkers are told that there are types."""
    functions = [name for name in sastrugi.__all__ if inspect.isfunction(getattr(sastrugi, name))]
    assert {"analyze", "fit", "run", "terrain", "traverse"} < set(functions)
    for name in functions:
        stated = getattr(sastrugi, name).__doc__
        assert "    >>> " in stated and "    Raises SastrugiError" in stated, name
    assert ">>> " in sastrugi.Fit.__doc__ and ">>> " in sastrugi.Release.__doc__
    assert files("sastrugi").joinpath("py.typed").is_file()


def test_syntax():
    """The wheel is for CPython 3.10 and later; these tests run with one of them."""
    sources = [file for file in files("sastrugi").iterdir() if file.name.endswith((".py", ".pyi"))]
    assert len(sources) > 10
    for file in sources:
        ast.parse(file.read_text(encoding="utf-8"), file.name, feature_version=(3, 10))
