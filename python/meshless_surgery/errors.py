"""What can go wrong, as exceptions."""
import contextlib
import enum
import os
import threading

import rospy

from meshless_surgery.srv import ReleaseResponse

# The constants that every answer of the package has.
ErrorCode = enum.IntEnum('ErrorCode', [(name, getattr(ReleaseResponse, name)) for name in (
    'OK', 'INVALID_ARGUMENT', 'UNKNOWN_NAME', 'DUPLICATE_NAME', 'UNREADABLE', 'FORBIDDEN', 'UNSUITABLE_SHAPE', 'MISSED',
    'UNSUPPORTED', 'FAILED')])


class SurgeryError(RuntimeError):
    """Any of these."""


class Refused(SurgeryError):
    """A service answered success=false, and nothing has changed. `service` is its name, `message` what it said, and `code` an
    ErrorCode, or None where the service is of std_srvs, whose answers have none."""

    def __init__(self, service, message, code=None):
        super().__init__('%s: %s' % (service, message))
        self.service = service
        self.message = message
        self.code = None if code is None else ErrorCode(code)


class Cancelled(SurgeryError):
    """A goal was cancelled. `action` is its name, `result` what the node answered: steps_done of a step; nothing else was done."""

    def __init__(self, action, result):
        super().__init__('%s: %s' % (action, result.message))
        self.action = action
        self.result = result


class Unreachable(SurgeryError, rospy.ROSException):
    """No node offers what was asked for, or it says nothing: nothing was sent."""


def need_master():
    """Raises Unreachable where no master answers: rospy.init_node would wait for one for ever."""
    uri = os.environ.get('ROS_MASTER_URI', '')
    try:
        rospy.get_master().getPid()
    except Exception as error:  # of the name, the connection, or what answers there
        raise Unreachable('no master answers at ROS_MASTER_URI, which is %s (%s): start a launch file or roscore, or set it'
                          % (uri or 'not set', error))


@contextlib.contextmanager
def reaching(what):
    """A wait of rospy's, which says nothing of who was waited for."""
    try:
        yield
    except rospy.ROSInterruptException:
        raise
    except rospy.ROSException as error:
        need_master()
        raise Unreachable('%s does not answer: does the node run? (%s)' % (what, error))


_forked_from_node = False


def _after_fork():
    """In the child: an answer of the master would come to either, by the connection of both, and topics to the parent's node."""
    global _forked_from_node
    _forked_from_node = rospy.core.is_initialized()
    for proxy in rospy.core._xmlrpc_cache.values():
        proxy._lock = threading.Lock()
        proxy('close')()


os.register_at_fork(after_in_child=_after_fork)


def need_topics(what):
    """Services need no rospy node of this process, topics do: one begins where there is none."""
    if _forked_from_node:
        raise Unreachable('%s cannot be heard or said: this process was forked from one that had a rospy node; accepted: services, '
                          "or a process that was started by 'spawn' or 'forkserver'" % what)
    if not rospy.core.is_initialized():
        need_master()
        rospy.init_node('surgeon', anonymous=True, disable_signals=True)


class Unanswered(SurgeryError):
    """A request was sent and not answered: it may have been done, or not. The text says how the world is now."""
