#!/usr/bin/env python3
"""test/falls_short.txt: at most ten laws, each with its figure, reason and issue, and each asked for by one test."""
import pathlib
import unittest

TESTS = pathlib.Path(__file__).resolve().parent
MOST = 10


def entries():
    lines = (TESTS / 'falls_short.txt').read_text(encoding='utf-8').splitlines()
    return [[field.strip() for field in line.split(' | ')] for line in lines if line and not line.startswith('#')]


class FallsShortTest(unittest.TestCase):

    def test_each_entry_says_law_figure_reason_and_issue(self):
        for entry in entries():
            self.assertEqual(4, len(entry), entry)
            self.assertTrue(all(entry), entry)

    def test_there_are_at_most_ten_laws_each_once(self):
        laws = [entry[0] for entry in entries()]
        self.assertLessEqual(len(laws), MOST)
        self.assertEqual(len(laws), len(set(laws)))

    def test_each_law_is_asked_for_by_one_test(self):
        sources = [path for path in TESTS.rglob('*_test.*') if path != pathlib.Path(__file__).resolve()]
        for law in (entry[0] for entry in entries()):
            asking = [path.name for path in sources
                      if any(quote + law + quote in path.read_text(encoding='utf-8') for quote in '"\'')]
            self.assertEqual(1, len(asking), '%s is asked for by %s' % (law, asking))


if __name__ == '__main__':
    unittest.main()
