#!/usr/bin/env python3
"""Clips with the mouse: where a pick is locked on a vessel (rviz: right click while it pulls), a clip closes the vessel there and the
pick is let go of. Locks on other tissue stay. Ends with Ctrl-C."""
import argparse
import queue

import rospy
from meshless_surgery import Refused, Surgeon, SurgeryError
from meshless_surgery.msg import State

ACROSS = ((0, 0, 1), (0, 1, 0))  # one of them is across the vessel


def clip(surgeon, pick, width):
    """The clip's name, or why there is none."""
    why = ''
    for direction in ACROSS:
        try:
            return surgeon.clip((pick.position.x, pick.position.y, pick.position.z), direction, width=width, body=pick.body).name, ''
        except Refused as refused:
            why = why or refused.message
    return '', why


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--node', default='/deformer', help='name of the deformer node (default: %(default)s)')
    parser.add_argument('--width', type=float, default=0.004, help='[m] of the jaws along the vessel (default: %(default)s)')
    arguments = parser.parse_args(rospy.myargv()[1:])
    rospy.init_node('clip_by_lock', anonymous=True)
    surgeon, states, done = Surgeon(arguments.node), queue.Queue(), set()
    rospy.Subscriber(arguments.node + '/state', State, states.put)
    print('where a pick is locked on a vessel, a clip is put on', flush=True)
    while not rospy.is_shutdown():
        try:
            state = states.get(timeout=0.2)
        except queue.Empty:
            continue
        for pick in state.picks:
            if not pick.locked or pick.pick_id in done:
                continue
            done.add(pick.pick_id)  # an older message may still have it
            try:
                name, why = clip(surgeon, pick, arguments.width)
                print(('%s is on' % name) if name else 'no clip: ' + why, flush=True)
                if name:
                    surgeon.release(pick.pick_id)
            except (SurgeryError, rospy.ROSException) as error:
                print(error, flush=True)


if __name__ == '__main__':
    main()
