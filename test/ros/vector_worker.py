"""An environment in a process of its own, as Gymnasium's AsyncVectorEnv has them. Spawned processes import this by its name."""
import os
import signal
import sys
import traceback

import numpy


def make():
    from meshless_surgery import Environment
    return Environment('retract', hands=[('pick', (-0.05, -0.06, 0.07)), ('push', (0.06, -0.05, 0.12))], spread=0.003, reach=0.03)


def work(pipe):
    """Does (method, arguments) as they come and sends what each returns, or the error as a text; None ends it."""
    try:
        environment = make()
        pipe.send((environment.action_space.shape, environment.observation_space.shape))
        while True:
            asked = pipe.recv()
            if asked is None:
                break
            pipe.send(getattr(environment, asked[0])(**asked[1]))
        environment.close()
        pipe.send('closed')
    except Exception:
        pipe.send(traceback.format_exc())


def die():
    """Begins an environment, says the node's name and is gone as a process that was killed."""
    environment = make()
    environment.reset(seed=1)
    environment.step(numpy.zeros(7))
    print(environment.surgeon.node, flush=True)
    os.kill(os.getpid(), signal.SIGKILL)


if __name__ == '__main__':
    sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
    die()
