"""The rows of the benchmarks in two checkouts, in turn: which are worse, and by how much.

    python benchmarks/compare.py OLD NEW                        # all scripts, three times each
    python benchmarks/compare.py OLD NEW --rounds 7 pose smd    # some of them

Of each row the median of the rounds is shown, and the least and the most in brackets. A row is worse where the median and the best round
both are, by more than `--allowed`: what else a machine does scatters rows by a tenth, on a virtual one by a fifth. Exit status 1 where
one is.
"""

from __future__ import annotations

import argparse
import os
import re
import statistics
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

ROW = re.compile(r"^(\S+)\s+(.+?)\s+(-?[\d.]+|inf|nan)\s+(at most|at least)\s+(\S+)\s+(pass|FAIL)")
#: The same of the allocator for both, whether or not a checkout's `_timing.py` sees to it: freed memory is kept.
ALLOCATOR = {"MALLOC_MMAP_THRESHOLD_": str(32 << 20), "MALLOC_TRIM_THRESHOLD_": str(512 << 20)}

Key = tuple[str, str, str, str]


def rows_of(checkout: Path, script: str) -> dict[Key, float]:
    """Values of the rows that a script prints, by script, row, what is measured and the sense of its target; none without such a script."""
    path = checkout.resolve() / "benchmarks" / f"bench_{script}.py"
    if not path.exists():
        return {}
    environment = os.environ | ALLOCATOR | {"PYTHONPATH": str(checkout.resolve())}
    run = subprocess.run([sys.executable, path.name], cwd=path.parent, env=environment, capture_output=True, text=True, check=False)
    found = [match.groups() for match in map(ROW.match, run.stdout.splitlines()) if match]
    if not found:
        print(f"{path}: no rows; {' '.join(run.stderr.strip().splitlines()[-1:])}", file=sys.stderr)
    return {(script, row, what, bound): float(value) for row, what, value, bound, _, _ in found}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument("scripts", nargs="*", help="as pose for bench_pose.py; all by default")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--allowed", type=float, default=0.05, help="share by which a row may be worse")
    arguments = parser.parse_args()
    scripts = arguments.scripts or sorted(path.stem.removeprefix("bench_") for path in (arguments.new / "benchmarks").glob("bench_*.py"))
    worse = 0
    for script in scripts:
        values: dict[Key, tuple[list[float], list[float]]] = defaultdict(lambda: ([], []))
        for _ in range(arguments.rounds):
            for side, checkout in enumerate((arguments.old, arguments.new)):
                for key, value in rows_of(checkout, script).items():
                    values[key][side].append(value)
        for (_, row, what, bound), (old, new) in values.items():
            if not old or not new:
                print(f"{script:12} {row:4} {what:58} {'only in ' + ('NEW' if new else 'OLD')}", flush=True)
                continue
            before, after = statistics.median(old), statistics.median(new)
            sign, best = (1, min) if bound == "at most" else (-1, max)
            change, of_best = (sign * (b - a) / max(abs(a), 1e-12) for a, b in ((before, after), (best(old), best(new))))
            mark = "WORSE" if min(change, of_best) > arguments.allowed else ""
            worse += bool(mark)
            spread = f"[{min(old):.3f} {max(old):.3f}] [{min(new):.3f} {max(new):.3f}]"
            print(f"{script:12} {row:4} {what:58} {before:8.3f} {after:8.3f} {100 * change:+6.1f} % {mark:5} {spread}", flush=True)
    return 1 if worse else 0


if __name__ == "__main__":
    raise SystemExit(main())
