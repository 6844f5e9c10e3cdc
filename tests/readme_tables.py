#!/usr/bin/env python3
"""Puts the tables of the studies into the READMEs: nobody types a figure.

    tests/readme_tables.py [--check]

Between the lines `<!-- study: NAME -->` and `<!-- end of study -->` of any Markdown file of the repository comes
configs/studies/evidence/NAME.md as the study wrote it, with its picture when there is one. --check changes nothing and
fails when a file is not up to date.
"""
import os
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
EVIDENCE = ROOT / "configs" / "studies" / "evidence"
BLOCK = re.compile(r"(<!-- study: ([\w-]+) -->\n)(.*?)(<!-- end of study -->)", re.DOTALL)


def block(name, page):
    table = EVIDENCE / f"{name}.md"
    if not table.exists():
        sys.exit(f"{page}: there is no {table.relative_to(ROOT)}; run configs/studies/{name}.toml first")
    text = table.read_text(encoding="utf-8")
    picture = EVIDENCE / f"{name}.png"
    if picture.exists():
        text += f"\n![{name}]({os.path.relpath(picture, page.parent)})\n"
    return text


def main():
    check = "--check" in sys.argv[1:]
    files = subprocess.run(["git", "ls-files", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    stale = []
    for page in (ROOT / name for name in files.split()):
        text = page.read_text(encoding="utf-8")
        fresh = BLOCK.sub(lambda found: found[1] + block(found[2], page) + found[4], text)
        if fresh == text:
            continue
        stale.append(page.relative_to(ROOT))
        if not check:
            page.write_text(fresh, encoding="utf-8")
    for page in stale:
        print(f"{page}: {'is not up to date' if check else 'refreshed'}")
    return 1 if check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
