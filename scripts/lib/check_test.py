#!/usr/bin/env python3
"""scripts/check refuses what it does not know before anything is installed or built, and builds wait for each other."""
import fcntl
import fnmatch
import os
import subprocess
import tempfile
import unittest

CHECKOUT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
ROOMS = sorted(set(name for name in os.listdir(os.path.join(CHECKOUT, 'test'))
                   if any(file.endswith(('_test.cpp', '.test'))
                          for file in (os.listdir(os.path.join(CHECKOUT, 'test', name))
                                       if os.path.isdir(os.path.join(CHECKOUT, 'test', name)) else ()))))


class CheckTest(unittest.TestCase):

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.environment = dict(os.environ, MESHLESS_SURGERY_OUTPUT=folder.name)
        self.lock = os.path.join(folder.name, 'lock')

    def check(self, *arguments):
        return subprocess.run(['scripts/check'] + list(arguments), cwd=CHECKOUT, env=self.environment, timeout=60,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)

    def test_what_is_unknown_is_refused_with_what_is_known(self):
        for argument in ('kitchen', '--fast', 'world/', '.*', ''):
            done = self.check('world', argument)
            self.assertEqual(2, done.returncode, done.stdout)
            self.assertIn('"%s"' % argument, done.stdout)
            self.assertIn('--full, --long', done.stdout)
            for room in ROOMS + ['scripts']:
                self.assertIn(room, done.stdout)
            self.assertFalse(os.path.exists(self.lock))

    def test_help_names_rooms_and_tiers(self):
        done = self.check('--help')
        self.assertEqual(0, done.returncode)
        for word in ROOMS + ['scripts', '--full', '--long', '--core']:
            self.assertIn(word, done.stdout)

    def test_what_is_left_out_by_name_is_there(self):
        with open(os.path.join(CHECKOUT, 'scripts/check'), encoding='utf-8') as script:
            lines = [line for line in script if line.startswith('sanitizer_leaves_out')]
        names = [name.strip(" '\n") for line in lines for name in line.split('=', 1)[1].split(':')]
        names = [name for name in names if name]
        self.assertGreater(len(names), 5)
        found = subprocess.run(['grep', '-rhoE', r'TEST(_[FP])?\(\w+, \w+\)', 'test'], cwd=CHECKOUT, check=True,
                               stdout=subprocess.PIPE, universal_newlines=True).stdout
        known = set('.'.join(line.split('(')[1].rstrip(')').split(', ')) for line in found.splitlines())
        for name in names:
            self.assertTrue(any(fnmatch.fnmatch(test, name) for test in known), name)

    def test_a_build_that_another_run_holds_is_waited_for(self):
        script = ('source scripts/lib/common.bash; source scripts/lib/build.bash; configure() { :; }; '
                  'inCleanEnvironment() { :; }; build "a thing" "$output/build" all --; echo built')
        with open(self.lock, 'w', encoding='ascii') as held:
            fcntl.flock(held, fcntl.LOCK_EX)
            run = subprocess.Popen(['bash', '-c', script], cwd=CHECKOUT, env=self.environment,
                                   stdout=subprocess.PIPE, universal_newlines=True)
            self.assertIn('Waiting for another build', run.stdout.readline())
        self.assertIn('built', run.communicate(timeout=60)[0])


if __name__ == '__main__':
    unittest.main()
