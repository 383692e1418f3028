"""What rospy does not say of a topic."""


def connected(subscriber):
    """Whether a publisher's messages reach this rospy.Subscriber. Its get_num_connections() counts a publisher before the
    connection to it is made: what that one says until then is lost."""
    topic = subscriber.impl
    return topic is not None and any(connection.md5sum is not None for connection in topic.connections)
