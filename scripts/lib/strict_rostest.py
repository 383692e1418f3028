#!/usr/bin/env python3
"""rostest, as its own command, that also fails where a test file ran no case, and where a process it started (a node, a
script of tests) ended by a signal or with another code than 0, be it at shutdown, which rostest does not look at."""
import sys

import rostest.rostest_main
import rostest.runner
from roslaunch.nodeprocess import LocalProcess

started = []  # (name, process)
faults = []
plain_start, plain_results = LocalProcess.start, rostest.runner._accumulateResults


def start(self):
    try:
        return plain_start(self)
    finally:
        if self.popen:
            started.append((self.name, self.popen))


def accumulate(results):
    if results.num_tests == 0:
        faults.append('a test ran no case')
    plain_results(results)


def main():
    LocalProcess.start, rostest.runner._accumulateResults = start, accumulate
    code = 0
    try:
        rostest.rostest_main.rostestmain()
    except SystemExit as end:
        code = end.code
    for name, process in started:
        if process.poll() != 0:
            faults.append('%s ended with %s' % (name, process.returncode))
    for fault in faults:
        print('strict_rostest: ' + fault, file=sys.stderr)
    return code or (3 if faults else 0)


if __name__ == '__main__':
    sys.exit(main())
