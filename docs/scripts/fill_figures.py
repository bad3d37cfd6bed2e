"""Put figures and tables into the pages: what stands between `<!-- figures: NAME -->` and its end.

    python docs/scripts/fill_figures.py [--demos]

Figures come from benchmarks/results, keys, columns and messages from the code; ``--demos`` first
runs the demos that claims are about, and stores what they give (a minute).
"""

import argparse
import json
import re
import sys
from functools import cache
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(DOCS / "extensions"), str(DOCS.parent / "benchmarks")]

import choices  # noqa: E402
import claims  # noqa: E402
import gallery_runs  # noqa: E402
import messages  # noqa: E402
import reference_tables  # noqa: E402
import stamp  # noqa: E402
import stored  # noqa: E402
from placing import write_changed  # noqa: E402

END = "<!-- end of figures -->"
MAKERS = {
    "claims": claims.page,
    "hard_cases_sum": claims.hard_cases,
    **reference_tables.PARTS,
    **messages.PARTS,
    **choices.PARTS,
}
BLOCK = re.compile(rf"<!-- figures: (\w+) -->\n.*?{END}", re.DOTALL)


@cache
def part(name: str) -> str:
    """What stands in a block: from the code, or from the stored results."""
    return MAKERS[name]() if name in MAKERS else stored.parts()[name]


def filled(page: str) -> str:
    """A page with the stored figures in its blocks.

    Raises:
        KeyError: A block has the name of no stored figures.
    """
    return BLOCK.sub(
        lambda block: f"<!-- figures: {block[1]} -->\n\n{part(block[1]).strip()}\n\n{END}", page
    )


def pages() -> list[Path]:
    """The pages that have such blocks."""
    found = (path for path in DOCS.rglob("*.md") if not {"_build", "generated"} & {*path.parts})
    return sorted(path for path in found if BLOCK.search(path.read_text(encoding="utf-8")))


def main() -> None:
    """Fill all pages."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--demos", action="store_true", help="run the demos of claims first")
    if parser.parse_args().demos:
        runs, _ = gallery_runs.execute_all(only=claims.DEMOS)
        facts = stamp.stamp() | {"figures": claims.of_demos(runs)}
        path = stored.RESULTS / "demos.json"
        path.write_text(json.dumps(facts, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    for path in pages():
        write_changed(path, filled(path.read_text(encoding="utf-8")))


if __name__ == "__main__":
    main()
