#!/usr/bin/env python3
"""Whether what the READMEs name as proof is there.

    tests/named_tests.py BUILD

Every table between `<!-- proven -->` and `<!-- end of proven -->` names in its last column, in backquotes, what proves the
row: a test as `ctest -N` lists it, a test of a GoogleTest program (`PROGRAM.Suite.Test`), `bench NAME` (a program of
tests/bench), or a path of the repository.
"""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]


def tests_of_program(program):
    suite = ""
    for line in subprocess.run([program, "--gtest_list_tests"], capture_output=True, text=True, check=True).stdout.splitlines():
        if line.startswith("  "):
            yield f"{program.name}.{suite}{line.split('#')[0].strip()}"
        elif line.split("#")[0].strip().endswith("."):
            suite = line.split("#")[0].strip()


def names_of_tests(build):
    listing = subprocess.run(["ctest", "--test-dir", build, "-N"], capture_output=True, text=True, check=True).stdout
    names = {line.split(":", 1)[1].split("#")[0].strip() for line in listing.splitlines() if re.match(r"\s*Test\s+#\d+:", line)}
    for name in {name.rsplit(".", 1)[0] for name in names if re.fullmatch(r"[^.]+\.\d+", name)}:
        names.update(tests_of_program(pathlib.Path(build) / "bin" / name))
    return names


def names_of_benches():
    text = "".join(path.read_text() for path in (ROOT / "tests" / "bench").glob("*/CMakeLists.txt"))
    return set(re.findall(r"add_executable\(([\w-]+)", text))


def main():
    tests = names_of_tests(sys.argv[1])
    benches = names_of_benches()
    rows = 0
    wrong = []
    for page in ROOT.glob("*.md"):
        for block in re.findall(r"<!-- proven -->\n(.*?)<!-- end of proven -->", page.read_text(encoding="utf-8"), re.DOTALL):
            for line in [line for line in block.splitlines() if line.startswith("|")][2:]:
                rows += 1
                proofs = re.findall(r"`([^`]+)`", line.rstrip("| ").rsplit("|", 1)[1])
                if not proofs:
                    wrong.append(f"{page.name}: nothing proves '{line[:60]}...'")
                for proof in proofs:
                    if proof.startswith("bench "):
                        known = proof.removeprefix("bench ") in benches
                    elif "/" in proof:
                        known = (ROOT / proof).exists()
                    else:
                        known = proof in tests
                    if not known:
                        wrong.append(f"{page.name}: there is no {proof}")
    if rows == 0:
        wrong.append("no row that names its proof was found")
    print("\n".join(wrong) or f"{rows} rows, all proofs are there")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
