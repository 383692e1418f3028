#!/usr/bin/env python3
"""The launch of a review opens with the tissue, before anybody plays or seeks."""
import os
import shutil
import sys
import tempfile
import unittest

import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
sys.path.insert(1, os.path.join(os.path.dirname(os.path.dirname(os.path.realpath(__file__))), 'ros'))
from deformer_support import OwnNode  # noqa: E402
from rviz_view import view_rectangle  # noqa: E402
from virtual_display import VirtualDisplay, stop, wait_until  # noqa: E402


class ShownReviewTest(unittest.TestCase):
    def test_the_tissue_is_there_at_the_start(self):
        folder = tempfile.mkdtemp(prefix='meshless_review_')
        self.addCleanup(shutil.rmtree, folder, True)
        with OwnNode(scene='liver', session_directory=folder, command_log='monday', paused=True) as node:
            node.good('step', steps=60)
        display = VirtualDisplay()
        self.addCleanup(display.close)

        def tissue():
            """Pixels of the view that are red."""
            picture = display.screenshot()
            rectangle = view_rectangle(picture)
            if rectangle is None:
                return 0
            top, bottom, left, right = rectangle
            pixels = picture[top:bottom, left:right].astype(int)
            return (pixels[:, :, 0] > pixels[:, :, 2] + 35).sum()
        launch = display.start_rviz(['roslaunch', 'meshless_surgery', 'review.launch', 'log:=' + folder + '/monday'],
                                    lambda: view_rectangle(display.screenshot()) is not None)
        self.addCleanup(stop, launch)
        shown = wait_until(lambda: tissue() > 2000, 60)
        file = os.path.join(os.environ.get('ROS_HOME', '/tmp'), 'shown_review.png')
        display.save(file)
        print('picture: %s, %d pixels of tissue' % (file, tissue()))
        self.assertTrue(shown, 'the picture is empty')


if __name__ == '__main__':
    rospy.init_node('shown_review_test')
    rostest.rosrun('meshless_surgery', 'shown_review', ShownReviewTest, sys.argv)
