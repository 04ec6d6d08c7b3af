"""The code of docs/python.md."""

import ast
import inspect
import re
from pathlib import Path

import glint_splat


def test_calls_of_the_documentation_have_the_arguments_of_their_functions():
    text = (Path(__file__).parents[2] / "docs/python.md").read_text()
    blocks = re.findall(r"(?:^    .*\n|^\n)+", text, re.M)
    code = "".join(re.sub("^    ", "", block, flags=re.M) for block in blocks if " g." in block or " as g" in block)
    calls = [node for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)]
    calls = [call for call in calls if isinstance(call.func.value, ast.Name) and call.func.value.id == "g"]
    assert len(calls) > 8
    for call in calls:
        function = getattr(glint_splat, call.func.attr)
        inspect.signature(function).bind(*call.args, **{keyword.arg: keyword.value for keyword in call.keywords})
