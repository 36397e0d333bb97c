"""Messages of the command line's parser, in one sentence instead of a box."""

import re

_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_SIDES = re.compile(r"^[\s│|]*(.*?)[\s│|]*$")
_RULE = re.compile(r"^[╭╰]?[─━=-]{3,}.*$")
_OPTIONAL = re.compile(r"no type matching \{None\}\|(\w+) could be instantiated from \[(.*)\]")


def one_sentence(box: str) -> str:
    """The message of a box: a title, then blocks between rules.

    The first block is the message; of the others, flags and commands that may have been meant.
    """
    plain = [_SIDES.sub(r"\1", line) for line in _COLOUR.sub("", box).splitlines()]
    lines = [line for line in plain if line]
    blocks: list[list[str]] = [[]]
    for line in lines:
        if _RULE.match(line) or line.startswith("╭"):
            blocks.append([])
        else:
            blocks[-1].append(line)
    # A title stands above the first rule, or within it.
    filled = [block for block in blocks[1:] if block]
    if not filled:
        return "these arguments are not allowed: see jaxbiped --help."
    message, *others = filled
    parts = [_join_lines(message)]
    for block in others:
        flags = [line.split()[0] for line in block[1:] if line.startswith("--")]
        flags = [flag for flag in flags if flag not in parts[0].split()]
        if block[0].startswith("Perhaps you meant") and flags:
            parts.append(f"perhaps you meant {' or '.join(dict.fromkeys(flags))}")
        elif block[0].startswith("Available subcommands"):
            parts.append(_join_lines(block))
    return "; ".join(part[0].lower() + part[1:] for part in parts) + "."


def _join_lines(lines: list[str]) -> str:
    """The lines of a block in one, up to where it begins to list its reasons."""
    shown = []
    for line in lines:
        if line.startswith(("Got errors", "- <class")):
            break
        shown.append(line)
    return _OPTIONAL.sub(r"\2 is no \1", " ".join(shown)).rstrip(". ")
