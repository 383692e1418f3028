#!/usr/bin/env python3
"""Plays the pile scene (Mueller et al. 2005, Fig. 8): blocks of 32 triangles fall on each other and come to rest."""
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from surgery_client import Play  # noqa: E402


def scenario(surgeon, play):
    state = surgeon.state()
    count = len(state.bodies)
    play.check(count >= 24, "%d blocks of %d tetrahedra" % (count, surgeon.body(state.bodies[0].name).tetrahedra))
    surgeon.live(6.0)
    state = surgeon.state()
    play.check(len(state.bodies) == count, "none is lost")
    heights = sorted(b.centre_of_mass.z for b in state.bodies)
    play.check(heights[0] > 0, "the lowest lies at %.0f mm, the highest at %.0f mm" % (1e3 * heights[0], 1e3 * heights[-1]))
    upper = sum(h > 0.03 for h in heights)
    play.check(upper >= 4, "%d lie on others: a single block lies at about 20 mm" % upper)
    speeds = sorted((b.velocity.x ** 2 + b.velocity.y ** 2 + b.velocity.z ** 2) ** 0.5 for b in state.bodies)
    play.check(speeds[len(speeds) // 2] < 0.1, "half of them move slower than %.3f m/s" % speeds[len(speeds) // 2])
    worst = min(b.volume / b.rest_volume for b in state.bodies)
    play.check(worst > 0.3, "the most squeezed keeps %.0f %% of its volume" % (100 * worst))
    play.say("real-time factor %.2f" % state.real_time_factor)


if __name__ == "__main__":
    play = Play(__doc__)
    sys.exit(play.run(scenario))
