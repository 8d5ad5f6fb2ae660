#!/usr/bin/env python3
"""Runs clang-tidy on the lines that a change adds.

usage: tidy.py BUILD_FOLDER [SECONDS]

The change is what came since the commit CI_BASE, or else since the last common commit with
origin/main, or else the last commit. BUILD_FOLDER is configured with the preset `tidy`. After SECONDS
(300) no further file is begun, and those that were left out are listed. Exit 0 if nothing was found,
1 if something was, 2 on wrong use.
"""
import concurrent.futures
import json
import os
import re
import subprocess
import sys
import time

MAX_FILES = 40
FILE_LIMIT_S = 240  # one file, on a busy machine


def git(*arguments):
    run = subprocess.run(['git', *arguments], capture_output=True, text=True, errors='replace')
    return run.stdout if run.returncode == 0 else None


def base_of_change():
    head = git('rev-parse', 'HEAD')
    for name, find in (('CI_BASE', ['merge-base', os.environ.get('CI_BASE', ''), 'HEAD']),
                       ('origin/main', ['merge-base', 'origin/main', 'HEAD']),
                       ('the last commit', ['rev-parse', '--verify', '--quiet', 'HEAD~1'])):
        found = git(*find)
        if found and found.strip() != (head or '').strip():
            return name, found.strip()
    return '', ''


def added_lines(diff):
    """path -> ranges of lines, of the output of git diff -U0."""
    added, path = {}, ''
    for line in diff.splitlines():
        if line.startswith('+++ '):
            path = line[6:]
        found = re.match(r'@@ -\S+ \+(\d+)(?:,(\d+))? @@', line)
        if found:
            begin, count = int(found.group(1)), int(found.group(2) or 1)
            if count:
                added.setdefault(path, []).append([begin, begin + count - 1])
    return added


def sources_of(changed, known):
    """The source files to run on: those that changed and, for a header, one that includes it."""
    sources = [path for path in changed if path in known]
    for header in changed:
        if not header.endswith('.h'):
            continue
        name = header.split('/include/')[-1] if '/include/' in header else os.path.basename(header)
        including = [path for path in (git('grep', '-l', '-F', f'{name}"', '--', '*.cc') or '').split()
                     if path in known]
        own = [path for path in including if os.path.basename(path)[:-3] == os.path.basename(header)[:-2]]
        if including and not set(including) & set(sources):
            sources.append((own or including)[0])
    return sources


def main():
    if len(sys.argv) not in (2, 3):
        print(__doc__.strip(), file=sys.stderr)
        return 2
    build, limit = sys.argv[1], float(sys.argv[2]) if len(sys.argv) == 3 else 300.0
    begin = time.monotonic()
    name, base = base_of_change()
    if not base:
        print('tidy: skipped, because the history that would show the change is missing')
        return 0
    added = added_lines(git('diff', '-U0', '--no-color', '--no-ext-diff', '--diff-filter=d', base, 'HEAD',
                            '--', '*.cc', '*.h') or '')
    top = os.getcwd()
    with open(os.path.join(build, 'compile_commands.json')) as commands:
        known = {os.path.relpath(entry['file'], top) for entry in json.load(commands)}
    sources = sources_of(added, known)
    print(f'tidy: {len(sources)} files for the change since {base[:10]} ({name})')
    if not sources:
        return 0
    lines = json.dumps([{'name': path, 'lines': ranges} for path, ranges in added.items()])

    def check(path):
        left = limit - (time.monotonic() - begin)
        if left <= 0:
            return path, None, ''
        try:
            run = subprocess.run(['clang-tidy', '-p', build, '--quiet', '--warnings-as-errors=*',
                                  f'--line-filter={lines}', path], capture_output=True, text=True,
                                 errors='replace', timeout=min(FILE_LIMIT_S, left + 60))
        except subprocess.TimeoutExpired:
            return path, None, ''
        return path, run.returncode, run.stdout + (run.stderr if run.returncode else '')

    left_out, found = sources[MAX_FILES:], 0
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for path, code, output in pool.map(check, sources[:MAX_FILES]):
            if code is None:
                left_out.append(path)
            elif code:
                found += 1
                print(f'tidy: {path}:\n{output.strip()}')
    if left_out:
        print(f'tidy: {len(left_out)} files were left out for lack of time: ' + ' '.join(left_out))
    print(f'tidy: {len(sources) - len(left_out)} files in {time.monotonic() - begin:.0f} s, '
          f'{found} with findings')
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
