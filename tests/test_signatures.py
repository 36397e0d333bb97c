"""Options and defaults of all that is public, against those that were looked at.

    python -m tests.test_signatures

writes them anew after a change that is wanted.
"""

import dataclasses
import inspect
import re
from pathlib import Path

import jaxbiped as jb
from tests.public_names import namespaces

RECORD = Path(__file__).with_name("signatures.txt")


def _shown(parameter):
    """A parameter as it is called: its kind, name and default."""
    stars = {parameter.VAR_POSITIONAL: "*", parameter.VAR_KEYWORD: "**"}.get(parameter.kind, "")
    if parameter.default is parameter.empty:
        return stars + parameter.name
    default = re.sub(r" at 0x[0-9a-f]+", "", repr(parameter.default))
    return f"{parameter.name}={default}"


def _signature(thing):
    shown, keyword = [], False
    for parameter in inspect.signature(thing).parameters.values():
        if parameter.kind is parameter.KEYWORD_ONLY and not keyword:
            shown, keyword = [*shown, "*"], True
        shown.append(_shown(parameter))
    return f"({', '.join(shown)})"


def _lines():
    for home, module in {"jb": jb, **namespaces()}.items():
        for name in sorted(getattr(module, "__all__", None) or dir(module)):
            thing = getattr(module, name)
            public = name[0] != "_" and str(getattr(thing, "__module__", "")).startswith("jaxbiped")
            data = dataclasses.is_dataclass(thing) or hasattr(thing, "_fields")
            if public and callable(thing) and (data or not inspect.isclass(thing)):
                yield f"{home}.{name}{_signature(thing)}"


def test_options_and_defaults_are_those_that_were_looked_at():
    assert list(_lines()) == RECORD.read_text(encoding="utf-8").splitlines()


if __name__ == "__main__":
    RECORD.write_text("\n".join(_lines()) + "\n", encoding="utf-8")
