#!/usr/bin/env python3
"""Runs a part of the tests with the label `slow`, another part for each commit.

usage: slow.py BUILD_FOLDER [SECONDS [COMMIT]]

The tests have a fixed order, and the hash of the commit (HEAD) says where to begin in it, so that one
commit has one answer and many commits run all tests. After SECONDS (180) no further test is begun;
what did not run is listed. Exit 0 if no test failed, 1 if one did, 2 on wrong use.
"""
import concurrent.futures
import json
import os
import re
import subprocess
import sys
import threading
import time


def rotated(names, commit):
    """The names in the order in which this commit runs them."""
    names = sorted(names)
    begin = int(commit[:12], 16) % len(names)
    return names[begin:] + names[:begin]


def main():
    if not 2 <= len(sys.argv) <= 4:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    build = sys.argv[1]
    limit = float(sys.argv[2]) if len(sys.argv) > 2 else 180.0
    found = subprocess.run(['git', 'rev-parse', sys.argv[3] if len(sys.argv) > 3 else 'HEAD'],
                           capture_output=True, text=True)
    # Without git, every part of the tests begins with the first.
    commit = found.stdout.strip() if found.returncode == 0 else '0'
    listed = subprocess.run(['ctest', '--test-dir', build, '-L', '^slow$', '--show-only=json-v1'],
                            capture_output=True, text=True, check=True).stdout
    names = [test['name'] for test in json.loads(listed[listed.index('{'):])['tests']]
    if not names:
        print('slow: there is no test with the label slow', file=sys.stderr)
        return 1
    order = rotated(names, commit)
    begin, printing = time.monotonic(), threading.Lock()

    def run(name):
        started = time.monotonic()
        if started - begin >= limit:
            return name, None
        # ctest knows a test's environment, folder and limit of time.
        test = subprocess.run(['ctest', '--test-dir', build, '-L', '^slow$', '-R',
                               f'^{re.escape(name)}$', '--output-on-failure', '--no-tests=error'],
                              capture_output=True, text=True, errors='replace')
        # A slow machine is no fault of the program.
        in_time = '***Timeout' not in test.stdout
        outcome = 'passed' if test.returncode == 0 else 'FAILED' if in_time else 'not done in its time,'
        with printing:
            print(f'slow: {name}: {outcome} after {time.monotonic() - started:.0f} s', flush=True)
            if test.returncode and in_time:
                print(test.stdout + test.stderr, flush=True)
        return name, test.returncode if in_time else 0

    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        results = list(pool.map(run, order))
    left_out = [name for name, code in results if code is None]
    failed = [name for name, code in results if code]
    print(f'slow: {len(names) - len(left_out)} of {len(names)} slow tests ran in '
          f'{time.monotonic() - begin:.0f} s, beginning with {order[0]}; {len(failed)} failed')
    if left_out:
        print('slow: not run for this commit: ' + ' '.join(left_out))
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())
