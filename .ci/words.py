#!/usr/bin/env python3
"""Holds the words of the repository against words.txt, and its spelling against codespell.

usage: words.py [--lower]

Each rule may have as many hits as words-baseline says, and none where it says nothing: that number
may only go down. --lower writes the numbers of today where they are smaller. A line that is right as
it is has an entry in words-allowed. Exit 0 if everything holds, 1 if a rule has more hits than it may
have, 2 if one of the files of this check is wrong.
"""
import collections
import fnmatch
import os
import re
import subprocess
import sys

FOLDER = os.path.dirname(os.path.abspath(__file__))
CODE = ('.cc', '.h', '.cl', '.cmake', '.py', '.sh')
DOCS = ('.md', '.rst', '.txt')
SCRIPTS = ('dev', '.ci/run')
# They name the words, and inputs of the fuzzer are anything.
SKIPPED = ('.ci/words*', '.ci/spelling-allowed', 'tests/fuzz/corpus/*')
SPELLING = 'spelling'  # what an exception from codespell names as its rule
MAX_SHOWN = 20  # hits of a rule that exceeds its baseline

Rule = collections.namedtuple('Rule', 'name files whole_line pattern write')
Hit = collections.namedtuple('Hit', 'path number text')


class WrongFile(Exception):
    pass


def parse_rules(text):
    """The rules of words.txt, in their order."""
    rules = []
    for block in re.split(r'\n\s*\n', text):
        lines = [line for line in block.splitlines() if line.strip() and not line.startswith('#')]
        if not lines:
            continue
        values = collections.defaultdict(list)
        for line in lines:
            key, colon, value = line.partition(':')
            if not colon or key not in ('rule', 'files', 'in', 'find', 'write') or not value.strip():
                raise WrongFile(f'words.txt: not a line of a rule: {line}')
            values[key].append(value.strip())
        if any(len(values[key]) != 1 for key in ('rule', 'files', 'write')) or not values['find']:
            raise WrongFile(f'words.txt: a rule has one rule:, files: and write:, and some find:, '
                            f'but this one has not: {lines[0]}')
        if values['files'][0] not in ('all', 'code', 'docs', 'md'):
            raise WrongFile(f"words.txt: files: is all, code, docs or md, not {values['files'][0]}")
        if values['in'] not in ([], ['line'], ['prose']):
            raise WrongFile(f"words.txt: in: is line or prose, not {values['in']}")
        rules.append(Rule(values['rule'][0], values['files'][0], values['in'] == ['line'],
                          re.compile('|'.join(f'(?:{find})' for find in values['find'])),
                          values['write'][0]))
    return rules


def parse_baseline(text):
    """rule -> hits that it may have, from lines `NUMBER RULE`."""
    baseline = {}
    for line in text.splitlines():
        if not line.strip() or line.startswith('#'):
            continue
        found = re.fullmatch(r'\s*(\d+) +(.+?)\s*', line)
        if not found:
            raise WrongFile(f'words-baseline: NUMBER RULE is expected, found {line}')
        baseline[found.group(2)] = int(found.group(1))
    return baseline


def parse_allowed(text):
    """(rule, pattern of paths, part of the line) of lines `RULE | PATH | PART OF THE LINE`."""
    allowed = []
    for line in text.splitlines():
        if not line.strip() or line.startswith('#'):
            continue
        parts = [part.strip() for part in line.split(' | ', 2)]
        if len(parts) != 3 or not all(parts):
            raise WrongFile(f'words-allowed: RULE | PATH | PART OF THE LINE is expected, found {line}')
        allowed.append(tuple(parts))
    return allowed


def kind_of(path):
    if path in SCRIPTS or path.endswith(CODE):
        return 'code'
    return 'docs' if path.endswith(DOCS) else ''


def prose_of(path, line):
    """In code, the comments and string literals; in documents, the line."""
    if kind_of(path) != 'code':
        return line
    return ' '.join(re.findall(r'//.*|"(?:[^"\\]|\\.)*"|^\s*\*.*|(?:^|\s)#\s.*', line))


def hits_of(files, rules, allowed):
    """rule -> hits, of pairs of path and lines, and which of the exceptions were used."""
    hits = {rule.name: [] for rule in rules}
    used = set()
    for path, lines in files:
        kind = kind_of(path)
        here = [rule for rule in rules if kind and (rule.files in ('all', kind) or
                                                    rule.files == 'md' and path.endswith('.md'))]
        fenced = False
        for number, line in enumerate(lines, 1):
            if path.endswith('.md') and line.lstrip().startswith('```'):
                fenced = not fenced
                continue
            if fenced:
                continue
            prose = None
            for rule in here:
                # Most lines hold no prose and no hit: the cheap question comes first.
                if not rule.pattern.search(line):
                    continue
                if not rule.whole_line:
                    prose = prose_of(path, line) if prose is None else prose
                    if not rule.pattern.search(prose):
                        continue
                reasons = [entry for entry in allowed if entry[0] == rule.name and
                           fnmatch.fnmatchcase(path, entry[1]) and entry[2] in line]
                used.update(reasons)
                if not reasons:
                    hits[rule.name].append(Hit(path, number, line.strip()))
    return hits, used


def tracked_files():
    names = subprocess.run(['git', 'ls-files', '-z'], capture_output=True, text=True,
                           check=True).stdout.split('\0')
    return [name for name in names if name and os.path.isfile(name) and not os.path.islink(name) and
            not any(fnmatch.fnmatchcase(name, pattern) for pattern in SKIPPED)]


def lines_of(paths):
    for path in paths:
        if kind_of(path):
            with open(path, encoding='utf-8', errors='replace') as text:
                yield path, text.read().split('\n')


def added_lines():
    """(path, number) of the lines that are new since origin/main, or else since the last commit."""
    def git(*arguments):
        run = subprocess.run(['git', *arguments], capture_output=True, text=True, errors='replace')
        return run.stdout if run.returncode == 0 else ''

    base = git('merge-base', 'origin/main', 'HEAD').strip()
    if base in ('', git('rev-parse', 'HEAD').strip()):
        base = git('rev-parse', '--verify', '--quiet', 'HEAD~1').strip() or 'HEAD'
    added, path, number = set(), '', 0
    for line in git('diff', '-U0', '--no-color', '--no-ext-diff', base, '--').splitlines():
        if line.startswith('+++ '):
            path = line[6:]
        elif line.startswith('@@'):
            number = int(re.search(r'\+(\d+)', line).group(1))
        elif line.startswith('+'):
            added.add((path, number))
            number += 1
    return added


def spelling(paths, allowed):
    """What codespell prints about these files, and which of the exceptions were used."""
    with open(os.path.join(FOLDER, 'spelling-allowed')) as text:
        words = [line.strip() for line in text if line.strip() and not line.startswith('#')]
    run = subprocess.run(['codespell', '--ignore-words-list', ','.join(words), *paths],
                         capture_output=True, text=True, errors='replace')
    if run.returncode not in (0, 64, 65):
        raise WrongFile(f'codespell failed (exit {run.returncode}): {run.stderr.strip()}')
    lines, used = [], set()
    for line in run.stdout.splitlines():
        found = re.match(r'(?:\./)?(.*?):\d+: (\S+) ==>', line)
        reasons = [entry for entry in allowed if found and entry[0] == SPELLING and
                   fnmatch.fnmatchcase(found.group(1), entry[1]) and entry[2] == found.group(2)]
        used.update(reasons)
        if not reasons:
            lines.append(line)
    return lines, used


def report(rules, baseline, hits, added):
    """The lines to print, and whether everything holds."""
    lines, holds = [], True
    for rule in rules:
        found, allowed = hits[rule.name], baseline.get(rule.name, 0)
        if len(found) > allowed:
            holds = False
            # Those of the change, where it can be known, are most likely the new ones.
            shown = [hit for hit in found if (hit.path, hit.number) in added] or found
            for hit in shown[:MAX_SHOWN]:
                lines.append(f'{hit.path}:{hit.number}: {rule.name}: write {rule.write}: '
                             f'{hit.text[:120]}')
            if len(shown) > MAX_SHOWN:
                lines.append(f'... and {len(shown) - MAX_SHOWN} more of {rule.name}')
            lines.append(f'words: {rule.name}: {len(found)} places, and at most {allowed} are allowed')
        elif len(found) < allowed:
            lines.append(f'words: {rule.name}: {len(found)} places where words-baseline allows '
                         f'{allowed}; .ci/words.py --lower stores the smaller number')
    return lines, holds


def lowered(text, hits):
    """words-baseline with the smaller ones of its numbers and of today's."""
    lines = []
    for line in text.splitlines():
        found = re.fullmatch(r'\s*(\d+) +(.+?)\s*', line)
        if found and not line.startswith('#') and found.group(2) in hits:
            number = min(int(found.group(1)), len(hits[found.group(2)]))
            if number:
                lines.append(f'{number} {found.group(2)}')
        else:
            lines.append(line)
    return '\n'.join(lines) + '\n'


def read(name):
    with open(os.path.join(FOLDER, name), encoding='utf-8') as text:
        return text.read()


def check(lower):
    os.chdir(os.path.dirname(FOLDER))
    rules = parse_rules(read('words.txt'))
    baseline = parse_baseline(read('words-baseline'))
    allowed = parse_allowed(read('words-allowed'))
    names = {SPELLING, *(rule.name for rule in rules)}
    for name in [*baseline, *(entry[0] for entry in allowed)]:
        if name not in names:
            raise WrongFile(f'there is no rule "{name}" in words.txt')
    paths = tracked_files()
    hits, used = hits_of(lines_of(paths), rules, allowed)
    if lower:
        text = lowered(read('words-baseline'), hits)
        with open(os.path.join(FOLDER, 'words-baseline'), 'w', encoding='utf-8') as out:
            out.write(text)
        baseline = parse_baseline(text)
    lines, holds = report(rules, baseline, hits, added_lines())
    misspelt, used_for_spelling = spelling(paths, allowed)
    used |= used_for_spelling
    for entry in allowed:
        if entry not in used:
            lines.append(f"words: words-allowed has an entry that nothing needs: {' | '.join(entry)}")
            holds = False
    for line in misspelt:
        lines.append(f'{line} (spelling; names that are right are listed in .ci/spelling-allowed)')
    print('\n'.join(lines) + '\n' if lines else '', end='')
    return 0 if holds and not misspelt else 1


def main():
    arguments = sys.argv[1:]
    if arguments not in ([], ['--lower']):
        print(__doc__.strip(), file=sys.stderr)
        return 2
    try:
        return check(bool(arguments))
    except (WrongFile, OSError, re.error, subprocess.CalledProcessError) as error:
        print(f'words: error: {error}', file=sys.stderr)
        return 2


if __name__ == '__main__':
    sys.exit(main())
