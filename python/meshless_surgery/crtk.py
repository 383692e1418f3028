"""The two messages of crtk_msgs that tools take and give, for clients without that package: names, fields and MD5 sums are its own."""
from genpy.dynamic import generate_dynamic

_HEADER = 'std_msgs/Header header\n'
_HEADER_TEXT = '=' * 80 + '\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n'


def _message(name, fields):
    return generate_dynamic('crtk_msgs/' + name, _HEADER + fields + _HEADER_TEXT)['crtk_msgs/' + name]


StringStamped = _message('StringStamped', 'string string\n')
operating_state = _message('operating_state', 'string state\nbool is_homed\nbool is_busy\n')
