"""What the clients of the scenes share: a scene that a script plays and checks. The services are in the module
meshless_surgery; this file passes on what was here before it.

    from surgery_client import Surgeon
"""

import argparse
import math
import sys

import rospy

from meshless_surgery import Refused, Surgeon, Unanswered
from meshless_surgery.errors import SurgeryError, Unreachable, need_master
from meshless_surgery.poses import blades_pose, quaternion_of_axes

__all__ = ["Play", "Refused", "Surgeon", "Unanswered", "begin", "blades_pose", "distance", "lowest", "quaternion_of_axes"]


def begin(name):
    """A rospy node; ends the script with a line where there is no master to begin it at."""
    try:
        need_master()
    except Unreachable as error:
        sys.exit(str(error))
    rospy.init_node(name, anonymous=True)


class Play:
    """A scene played by a script: counts what was checked, prints it with its numbers, and ends with an exit code."""

    def __init__(self, description):
        parser = argparse.ArgumentParser(description=description)
        parser.add_argument("--node", default="/deformer", help="name of the deformer node (default: %(default)s)")
        parser.add_argument("--slow", action="store_true",
                            help="let the world run in real time, to watch; else it is stepped as fast as it goes")
        self.arguments = parser.parse_args(rospy.myargv()[1:])
        begin("play")
        self.surgeon = Surgeon(self.arguments.node)
        self.failures = 0

    def start(self):
        self.surgeon.reset()
        if not self.arguments.slow:
            self.surgeon.stepped()
        else:
            self.surgeon.pause(False)
        return self.surgeon

    def say(self, text):
        print(text)
        sys.stdout.flush()

    def check(self, holds, text):
        self.say(("  ok    " if holds else "  WRONG ") + text)
        self.failures += 0 if holds else 1

    def run(self, scenario):
        """Runs scenario(surgeon, play); returns 0 where everything held."""
        try:
            scenario(self.start(), self)
        except (SurgeryError, rospy.ROSException, rospy.ServiceException) as error:
            self.say("  WRONG " + str(error))
            self.failures += 1
        finally:
            if self.surgeon.is_stepped:
                self.surgeon.runs()
        self.say("done: %s" % ("everything held" if self.failures == 0 else "%d went wrong" % self.failures))
        return 1 if self.failures else 0


def lowest(points):
    return min(p.z for p in points)


def distance(a, b):
    return math.sqrt((a.x - b.x) ** 2 + (a.y - b.y) ** 2 + (a.z - b.z) ** 2)
