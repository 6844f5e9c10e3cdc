#!/usr/bin/env python3
"""What happens when processes, machines' disks and messages fail, on real processes.

usage: faults.py [CASE...]       these cases, all quick ones by default
       faults.py --list
       faults.py --random N [--seed S]   N signals at random moments over several scenes
       faults.py --scenes        every kind of scene, interrupted and gone on with: the same bits

ESTUARY_PROGRAMS is the folder of the programs (build/bin).
"""
import argparse
import os
import random
import signal
import sys
import tempfile
import time

from driver import Failure, Place, expect
import clock_cases
import disk_cases
import message_cases
import phase_cases
import rank_cases
import recovery_cases
import reply_cases
import security_cases
import scene_cases
import scenes

CASES = {}
for module in (recovery_cases, phase_cases, message_cases, reply_cases, security_cases, disk_cases, clock_cases, rank_cases, scene_cases):
    CASES.update({name[5:]: value for name, value in vars(module).items() if name.startswith("case_")})


def run_case(name, case, folder):
    begin = time.monotonic()
    try:
        note = case(Place(os.path.join(folder, name)))
    except Failure as failure:
        print(f"FAILED {name} after {time.monotonic() - begin:.1f} s: {failure}", flush=True)
        return False
    print(f"passed {name} in {time.monotonic() - begin:.1f} s{'  ' + note if note else ''}", flush=True)
    return True


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("cases", nargs="*")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--random", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scenes", nargs="*", default=None)
    parser.add_argument("--keep", help="a folder for what the runs leave")
    options = parser.parse_args()
    if options.list:
        print("\n".join(CASES))
        return 0
    with tempfile.TemporaryDirectory(prefix="estuary-faults-") as temporary:
        folder = options.keep or temporary
        if options.scenes is not None:
            good = [run_case(name, case, folder) for name, case in scenes.cases(options.scenes)]
        elif options.random:
            good = [run_case(name, case, folder)
                    for name, case in scenes.random_cases(options.random, random.Random(options.seed))]
        else:
            unknown = [name for name in options.cases if name not in CASES]
            if unknown:
                parser.error(f"no such case: {' '.join(unknown)}")
            good = [run_case(name, CASES[name], folder) for name in options.cases or CASES]
    print(f"{sum(good)} of {len(good)} passed")
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main())
