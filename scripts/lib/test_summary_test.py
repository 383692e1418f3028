#!/usr/bin/env python3
"""test_summary.py neither loses a failure nor counts a test twice."""
import os
import tempfile
import unittest

from test_summary import Counts, Entry, listEntries, parseResults, summarize

CTEST_LOG = '''Test project /tmp/build
      Start  1: good
 1/6 Test  #1: good .............................   Passed    0.02 sec
 2/6 Test  #2: wrong ............................***Failed    0.01 sec
 3/6 Test  #3: crashed ..........................***Exception: SegFault  0.11 sec
 4/6 Test  #4: slow .............................***Timeout 300.01 sec
 5/6 Test  #5: absent ...........................***Not Run   0.00 sec
 6/6 Test  #6: left_out .........................***Skipped   0.00 sec
'''


def junit(*cases):
    return '<?xml version="1.0"?><testsuites><testsuite>%s</testsuite></testsuites>' % ''.join(cases)


PASSED = '<testcase name="right" classname="Laws" status="run" result="completed"/>'
FAILED = '<testcase name="wrong" classname="Laws"><failure message="1 is not 2">1 is not 2\nby 1</failure></testcase>'
ERROR = '<testcase name="broken" classname="Laws"><error type="Exception">no file</error></testcase>'
SKIPPED = '<testcase name="later" classname="Laws" status="run" result="skipped"><skipped/></testcase>'
DISABLED = '<testcase name="never" classname="Laws" status="notrun" result="suppressed"/>'


class TestSummaryTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def write(self, name, text):
        path = os.path.join(self.folder.name, name)
        with open(path, 'w', encoding='utf-8') as out:
            out.write(text)
        return path

    def countsOf(self, *entries):
        return summarize(list(entries))[0]

    def testCtestLines(self):
        self.assertEqual({'good': 'Passed', 'wrong': 'Failed', 'crashed': 'Exception', 'slow': 'Timeout',
                          'absent': 'Not Run', 'left_out': 'Skipped'}, parseResults(CTEST_LOG))

    def testEntriesWithoutFiles(self):
        tests = [{'name': name} for name in ('good', 'wrong', 'crashed', 'slow', 'absent', 'left_out', 'never_started')]
        counts, failures, _ = summarize(listEntries(tests, parseResults(CTEST_LOG)))
        self.assertEqual(Counts(1, 5, 1), counts)
        self.assertEqual(5, len(failures))
        self.assertIn('never_started: did not run', failures)

    def testJunitFileOfCatkin(self):
        command = ['env.sh', '/usr/bin/python3', '/usr/share/run_tests.py', '/r/gtest-a.xml', '--return-code', 'a --x=b.xml']
        self.assertEqual([Entry('a', 'Passed', '/r/gtest-a.xml')],
                         listEntries([{'name': 'a', 'command': command}], {'a': 'Passed'}))

    def testJunitFileOfGtest(self):
        command = ['env', 'GTEST_SHARD_INDEX=0', 'a_tests', '--gtest_output=xml:/r/gtest-a_0.xml']
        self.assertEqual([Entry('a_0', 'Passed', '/r/gtest-a_0.xml')],
                         listEntries([{'name': 'a_0', 'command': command}], {'a_0': 'Passed'}))

    def testAShareWithoutACaseIsFineAndAProgramWithoutOneIsNot(self):
        full = Entry('a_0', 'Passed', self.write('gtest-a_0.xml', junit(PASSED)))
        empty = [Entry(name, 'Passed', self.write('gtest-%s.xml' % name, junit())) for name in ('a_1', 'b_0', 'b_1')]
        self.assertEqual(Counts(1, 0, 0), self.countsOf(full, empty[0]))
        self.assertEqual(Counts(1, 1, 0), self.countsOf(full, *empty))
        self.assertEqual(Counts(0, 1, 0), self.countsOf(Entry('a', 'Passed', '/nowhere/gtest-a.xml')))

    def testSeconds(self):
        slow = PASSED.replace('status', 'time="2.5" status')
        cases = summarize([Entry('a', 'Passed', self.write('gtest-a.xml', junit(slow)))])[2]
        self.assertEqual([2.5], [case.seconds for case in cases])

    def testCases(self):
        path = self.write('gtest-a.xml', junit(PASSED, PASSED, FAILED, ERROR, SKIPPED, DISABLED))
        counts, failures, _ = summarize([Entry('a', 'Failed', path)])
        self.assertEqual(Counts(2, 2, 2), counts)
        self.assertIn('by 1', failures[0])
        self.assertIn('no file', failures[1])

    def testFailureThatNoCaseTells(self):
        path = self.write('gtest-a.xml', junit(PASSED))
        self.assertEqual(Counts(1, 1, 0), self.countsOf(Entry('a', 'Timeout', path)))
        self.assertEqual(Counts(0, 1, 0), self.countsOf(Entry('a', 'Failed', self.write('gtest-b.xml', '<cut off'))))
        self.assertEqual(Counts(0, 1, 0), self.countsOf(Entry('a', 'Not Run', path)))
        self.assertEqual(Counts(0, 1, 0), self.countsOf(Entry('a', None, path)))

    def testNoTestIsAFailure(self):
        self.assertEqual(Counts(0, 1, 0), self.countsOf())

    def testRostestIsNotCountedTwice(self):
        rostest = junit('<testcase classname="rostest.runner.RosTest" name="testpick"/>',
                        '<testcase classname="rostest.runner.RosTest" name="testhz"/>')
        path = self.write('rostest-test_ros_pick.xml', rostest)
        self.write('rosunit-pick.xml', junit(PASSED, PASSED, SKIPPED))
        self.assertEqual(Counts(3, 0, 1), self.countsOf(Entry('pick', 'Passed', path)))

    def testRostestThatDiedAfterItsCases(self):
        rostest = junit('<testcase classname="RosTest" name="testpick"><failure>the node died</failure></testcase>')
        path = self.write('rostest-test_ros_pick.xml', rostest)
        self.write('rosunit-pick.xml', junit(PASSED))
        self.assertEqual(Counts(1, 1, 0), self.countsOf(Entry('pick', 'Failed', path)))

    def testRostestThatRanNoTest(self):
        path = self.write('rostest-test_ros_pick.xml', junit('<testcase classname="RosTest" name="testpick"/>'))
        self.write('rosunit-pick.xml', junit())
        self.assertEqual(Counts(0, 1, 0), self.countsOf(Entry('pick', 'Passed', path)))


if __name__ == '__main__':
    unittest.main()
