"""Long work that goes on while its caller does something else: the goals of the node's actions."""
import threading
import time

import rospy
from actionlib import ActionClient, CommState
from actionlib_msgs.msg import GoalID, GoalStatus

from meshless_surgery import msg
from meshless_surgery.errors import Cancelled, ErrorCode, Refused, Unanswered, need_topics

LOOK = 0.2  # [s] between looks whether the node is still there


class Goals:
    """Sends goals to the actions of one node."""

    def __init__(self, node, timeout):
        self._node = node
        self._timeout = timeout
        self._clients = {}

    def send(self, name, fields, feedback=None):
        need_topics(self._node + '/actions')
        if name not in self._clients:
            self._clients[name] = ActionClient(self._node + '/actions/' + name, getattr(msg, name.capitalize() + 'Action'))
        return Goal(self._clients[name], name, getattr(msg, name.capitalize() + 'Goal')(**fields), feedback, self._timeout)


class Goal:
    """One of them. `feedback(message)` is called in another thread, while it goes on."""

    def __init__(self, client, name, goal, feedback, timeout):
        self.name = name
        self._client = client
        self._done = threading.Event()
        self._result = self._status = None
        end = time.monotonic() + timeout
        # Not before it was heard of: this wait goes by ROS time, which may stand still.
        while client.last_status_msg is None or not client.wait_for_server(rospy.Duration(0, 1)):
            if time.monotonic() > end:
                raise Unanswered('%s was not sent: no node offers the action %s' % (name, client.ns))
            time.sleep(0.005)
        self._handle = client.send_goal(goal, self._changed, feedback and (lambda handle, message: feedback(message)))

    @property
    def id(self):
        """As in the messages of the action's topics."""
        return self._handle.comm_state_machine.action_goal.goal_id.id

    def _changed(self, handle):
        if handle.get_comm_state() == CommState.DONE and not self.done():
            self._result, self._status = handle.get_result(), handle.get_terminal_state()
            self._done.set()

    def cancel(self):
        """Does not wait; result() says what became of it."""
        # Not by the handle: it would call a goal lost that the node has not heard of yet.
        if not self.done():
            self._handle.comm_state_machine.send_cancel_fn(GoalID(id=self.id))

    def done(self):
        return self._done.is_set()

    def result(self, timeout=None):
        """Waits for it. Refused where it was refused or failed, Cancelled where it was cancelled, TimeoutError where it goes
        on after `timeout` [s] of wall time."""
        end = None if timeout is None else time.monotonic() + timeout
        while not self._done.wait(LOOK if end is None else max(0.0, min(LOOK, end - time.monotonic()))):
            if end is not None and time.monotonic() >= end:
                raise TimeoutError('%s goes on after %g s' % (self.name, timeout))
            if self._client.result_sub.get_num_connections() == 0 and not self._done.wait(LOOK):
                raise Unanswered('%s was sent once and not answered: the node has ended' % self.name)
        result, status = self._result, self._status
        if status in (GoalStatus.PREEMPTED, GoalStatus.RECALLED):
            # One that comes before its goal actionlib answers with an empty result.
            result.message = result.message or 'cancelled before it began'
            result.error_code = result.error_code or ErrorCode.FAILED
            raise Cancelled(self.name, result)
        if result is None or status == GoalStatus.LOST:
            raise Unanswered('%s was sent once and not answered: the node knows it no more' % self.name)
        if not result.success:
            raise Refused(self.name, result.message, result.error_code)
        return result
