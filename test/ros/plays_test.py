#!/usr/bin/env python3
"""A scene of the paper, launched as users launch it and played by its client; the client must find everything well."""
import subprocess
import sys
import unittest

import rospy
import rostest


class PlayTest(unittest.TestCase):
    def test_everything_holds(self):
        client = rospy.get_param('~client')
        run = subprocess.run(['rosrun', 'meshless_surgery', client], stdout=subprocess.PIPE,
                             stderr=subprocess.STDOUT, universal_newlines=True, timeout=480)
        print(run.stdout)
        self.assertEqual(0, run.returncode, run.stdout)
        self.assertIn('  ok    ', run.stdout)
        self.assertNotIn('WRONG', run.stdout)


if __name__ == '__main__':
    rospy.init_node('plays_test')
    rostest.rosrun('meshless_surgery', 'plays', PlayTest, sys.argv)
