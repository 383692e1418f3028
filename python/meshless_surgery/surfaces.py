"""The surfaces that ~topology and ~vertices say together, live or out of a bag."""
import collections

import numpy

# vertices: (n, 3) [m] in the world frame; triangles: (m, 3); cut: (m,), True on the faces of cuts.
Surface = collections.namedtuple('Surface', 'name vertices triangles cut')


class SurfaceReader:
    """Hears both topics in any order and knows the surfaces that they make.

        reader = SurfaceReader()
        for topic, message, _ in bag.read_messages():
            if reader.hear(message):
                draw(reader.surfaces())
    """

    def __init__(self):
        self._topologies = {}
        self._early = {}  # vertices that came before their topology, from the last complete message on
        self._shown = None
        self._vertices = {}

    def hear(self, message):
        """A Topology or Vertices; others are passed over. True where surfaces() has changed."""
        if message._type == 'meshless_surgery/Topology':
            key = (message.run, message.topology)
            self._topologies[key] = message
            self._forget_oldest(self._topologies)
            return any([self._move(key, early) for early in self._early.pop(key, [])])
        if message._type == 'meshless_surgery/Vertices':
            key = (message.run, message.topology)
            if key in self._topologies:
                return self._move(key, message)
            self._early[key] = ([] if message.complete else self._early.get(key, [])) + [message]
            self._forget_oldest(self._early)
        return False

    @staticmethod
    def _forget_oldest(kept, most=8):  # the two topics are never far apart
        for key in sorted(kept)[:-most]:
            del kept[key]

    def _move(self, key, message):
        if key != self._shown and not message.complete:
            return False
        if message.complete:
            self._vertices = {}
        self._shown = key
        for body in message.bodies:
            steps = numpy.frombuffer(body.xyz, dtype='<u2') if isinstance(body.xyz, bytes) else numpy.array(body.xyz)
            self._vertices[body.id] = (numpy.array([body.origin.x, body.origin.y, body.origin.z]) +
                                       body.step * steps.reshape(-1, 3).astype(float))
        return True

    def surfaces(self):
        """{name: Surface} as they are now; empty until both topics have been heard."""
        if self._shown is None:
            return {}
        return {body.name: Surface(body.name, self._vertices[body.id],
                                   numpy.array(body.triangles, dtype=int).reshape(-1, 3),
                                   numpy.array(list(body.cut), dtype=bool))
                for body in self._topologies[self._shown].bodies if body.id in self._vertices}
