#!/usr/bin/env python3
"""Runs over several hosts, networks that are slow or break, and Slurm, on one machine.

usage: distributed.py [CASE...] | --list       [--keep FOLDER]

ESTUARY_PROGRAMS is the folder of the programs (build/bin). What this machine cannot do (namespaces without root, Slurm
where it is not installed) is said loudly and left out; --strict makes that a failure.
"""
import argparse
import pathlib
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "faults"))
from driver import Failure, Place  # noqa: E402  the folder has to be on the path first
import host_cases  # noqa: E402
import hosts  # noqa: E402
import relay_cases  # noqa: E402
import slurm  # noqa: E402
import slurm_cases  # noqa: E402

MODULES = ((relay_cases, lambda: None), (host_cases, hosts.why_not), (slurm_cases, slurm.why_not))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("cases", nargs="*")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--keep", help="a folder for what the runs leave")
    parser.add_argument("--strict", action="store_true", help="what this machine cannot do is a failure")
    options = parser.parse_args()
    cases = {name[5:]: (value, why_not) for module, why_not in MODULES for name, value in vars(module).items()
             if name.startswith("case_")}
    if options.list:
        print("\n".join(cases))
        return 0
    unknown = [name for name in options.cases if name not in cases]
    if unknown:
        parser.error(f"no such case: {' '.join(unknown)}")
    failed, left_out, passed = 0, 0, 0
    reasons = {}
    with tempfile.TemporaryDirectory(prefix="estuary-distributed-") as temporary:
        for name in options.cases or cases:
            case, why_not = cases[name]
            if why_not not in reasons:
                reasons[why_not] = why_not()
            if reasons[why_not]:
                print(f"######## NOT TESTED {name}: {reasons[why_not]} ########", flush=True)
                left_out += 1
                continue
            begin = time.monotonic()
            try:
                note = case(Place(pathlib.Path(options.keep or temporary) / name))
                print(f"passed {name} in {time.monotonic() - begin:.1f} s{'  ' + note if note else ''}", flush=True)
                passed += 1
            except Failure as failure:
                print(f"FAILED {name} after {time.monotonic() - begin:.1f} s: {failure}", flush=True)
                failed += 1
    print(f"{passed} passed, {failed} failed, {left_out} not tested")
    return 1 if failed or (options.strict and left_out) else 0


if __name__ == "__main__":
    sys.exit(main())
