"""The house in figures: code lines, files, wide functions and the largest room, of any checkout.

    python docs/house_figures.py            # this checkout
    python docs/house_figures.py OLD NEW    # two, side by side

Code lines are those with code on them: no blank lines, comments or docstrings. A function is wide with eight arguments or more.
"""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from collections import Counter
from pathlib import Path

WIDE = 8
SKIPPED = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENCODING, tokenize.ENDMARKER}


def docstring_lines(tree: ast.Module) -> set[int]:
    """Lines of the docstrings of a file."""
    lines: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and ast.get_docstring(node) is not None:
            lines |= set(range(node.body[0].lineno, node.body[0].end_lineno + 1))
    return lines


def code_lines(text: str) -> int:
    """How many lines of a file have code on them."""
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in SKIPPED:
            lines |= set(range(token.start[0], token.end[0] + 1))
    return len(lines - docstring_lines(ast.parse(text)))


def wide_functions(text: str) -> list[str]:
    """Names of the functions with so many arguments that nobody remembers their order."""
    found = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            arguments = [one.arg for one in node.args.posonlyargs + node.args.args + node.args.kwonlyargs]
            if len([one for one in arguments if one not in ("self", "cls")]) >= WIDE:
                found.append(node.name)
    return found


def figures(root: Path) -> dict[str, str]:
    """The figures of a checkout."""
    package, rooms, wide = root / "hmc", Counter[str](), []
    files = sorted(package.rglob("*.py"))
    for path in files:
        text, names = path.read_text(encoding="utf-8"), path.relative_to(package).with_suffix("").parts
        rooms[names[0]] += code_lines(text)
        wide += [f"{'.'.join(names)}.{name}" for name in wide_functions(text)]
    total = sum(rooms.values())
    everything = sum(
        code_lines(path.read_text(encoding="utf-8")) for folder in ("tests", "benchmarks") for path in (root / folder).rglob("*.py")
    )
    name, size = rooms.most_common(1)[0]
    shown = {f"code lines, {room}": f"{lines:,}" for room, lines in rooms.most_common(10)}
    return shown | {
        "code lines, hmc/": f"{total:,}",
        "code lines, tests/ and benchmarks/": f"{everything:,}",
        "files, hmc/": f"{len(files):,}",
        "largest room": f"{name}, {size / total:.0%}",
        f"functions with {WIDE} arguments or more": str(len(wide)),
        "which": ", ".join(wide) if len(wide) <= 12 else "",
    }


def main() -> None:
    """Print the figures, a line each."""
    roots = [Path(one) for one in sys.argv[1:]] or [Path(__file__).resolve().parent.parent]
    columns = [figures(root) for root in roots]
    for name in dict.fromkeys(name for column in columns for name in column):
        print(f"{name:42}" + "  ".join(f"{column.get(name, '-'):>12}" for column in columns))


if __name__ == "__main__":
    main()
