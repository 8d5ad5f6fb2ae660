#!/usr/bin/env python3
"""Tests of words.py: python3 .ci/words_test.py"""
import os
import sys
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import words  # noqa: E402

RULES = words.parse_rules('''# A comment.

rule: idiom
files: all
find: \\bis told\\b
find: \\breckon\\w*
write: is reported

rule: number
files: code
in: line
find: \\bkMost\\w+
write: kMax...

rule: long line
files: md
in: line
find: ^.{31,}$
write: short lines
''')


def hits(path, *lines, allowed=()):
    found, used = words.hits_of([(path, list(lines))], RULES, list(allowed))
    return [(name, hit.number) for name, of_rule in found.items() for hit in of_rule], used


class Words(unittest.TestCase):
    def test_comments_and_strings_are_prose_and_names_are_not(self):
        self.assertEqual(hits('a.cc', '// It is told.', 'f("we reckon");', 'Reckon(is told);')[0],
                         [('idiom', 1), ('idiom', 2)])
        self.assertEqual(hits('a.cmake', 'set(a)  # is told')[0], [('idiom', 1)])
        self.assertEqual(hits('docs/a.txt', 'it is told')[0], [('idiom', 1)])

    def test_rules_hold_for_their_kinds_of_files(self):
        self.assertEqual(hits('a.cc', 'int kMostRays;')[0], [('number', 1)])
        self.assertEqual(hits('a.md', 'kMostRays')[0], [])
        self.assertEqual(hits('a.png', 'is told')[0], [])
        self.assertEqual(hits('a.md', 31 * 'x')[0], [('long line', 1)])
        self.assertEqual(hits('a.txt', 31 * 'x')[0], [])

    def test_code_in_markdown_is_left_alone(self):
        self.assertEqual(hits('a.md', '```', 'is told', '```', 'is told')[0], [('idiom', 4)])

    def test_exceptions_name_a_rule_a_path_and_a_part_of_the_line(self):
        entry = ('idiom', 'a/*.cc', 'this is told')
        self.assertEqual(hits('a/b.cc', '// this is told', allowed=[entry]), ([], {entry}))
        self.assertEqual(hits('b/b.cc', '// this is told', allowed=[entry]), ([('idiom', 1)], set()))
        self.assertEqual(hits('a/b.cc', '// that is told', allowed=[entry]), ([('idiom', 1)], set()))

    def test_a_baseline_may_be_reached_and_not_exceeded(self):
        found = {'idiom': [words.Hit('a.cc', n, f'line {n}') for n in (1, 2)], 'number': [],
                 'long line': []}
        lines, holds = words.report(RULES, {'idiom': 2}, found, set())
        self.assertEqual((lines, holds), ([], True))
        lines, holds = words.report(RULES, {'idiom': 1}, found, {('a.cc', 2)})
        self.assertFalse(holds)
        self.assertEqual(lines[0], 'a.cc:2: idiom: write is reported: line 2')
        self.assertEqual(len(lines), 2)
        lines, holds = words.report(RULES, {'idiom': 3}, found, set())
        self.assertTrue(holds)
        self.assertIn('--lower', lines[0])

    def test_numbers_are_only_lowered(self):
        found = {'idiom': [1], 'number': [1, 2, 3], 'long line': []}
        self.assertEqual(words.lowered('# Text.\n2 idiom\n2 number\n1 long line\n', found),
                         '# Text.\n1 idiom\n2 number\n')

    def test_wrong_files_are_refused(self):
        for text in ('rule: a\nfiles: all\nfind: x\n', 'rule: a\nfiles: some\nfind: x\nwrite: y\n',
                     'rule: a\nfiles: all\nwrite: y\n', 'a\n'):
            with self.assertRaises(words.WrongFile):
                words.parse_rules(text)
        for text in ('idiom\n', 'x idiom\n'):
            with self.assertRaises(words.WrongFile):
                words.parse_baseline(text)
        with self.assertRaises(words.WrongFile):
            words.parse_allowed('idiom | a.cc\n')


if __name__ == '__main__':
    unittest.main()
