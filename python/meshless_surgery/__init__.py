"""Soft tissue for surgical training: a running deformer's services, topics and errors in plain Python numbers.

    from meshless_surgery import Surgeon, Refused
    surgeon = Surgeon('/deformer')
    pick = surgeon.pick((0, 0, 0.1))

`meshless_surgery.testing` has what a test of a scene needs. Messages and services are in `meshless_surgery.msg` and `.srv`.
"""

# Where sys.path leads to the sources themselves, messages and services are further along it, in the build's package of this
# name: so it is in a process that was started by one that has read that package, whose first path is then that of the sources.
__path__ = __import__('pkgutil').extend_path(__path__, __name__)

_PLACES = {'Surgeon': 'surgeon', 'ToolStream': 'streams', 'SurgeryError': 'errors', 'Refused': 'errors',
           'Cancelled': 'errors', 'Goal': 'goals', 'Environment': 'environment',
           'Unanswered': 'errors', 'Unreachable': 'errors', 'ErrorCode': 'errors'}


def __getattr__(name):
    # Not before it is asked for: who only reads messages needs no rospy.
    if name not in _PLACES:
        raise AttributeError("module 'meshless_surgery' has no attribute '%s'" % name)
    import importlib
    return getattr(importlib.import_module('meshless_surgery.' + _PLACES[name]), name)
