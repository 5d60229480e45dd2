"""Free rigid bodies over long times: what they keep, and what it costs. `python benchmarks/rigid.py [PERIODS]`."""

import sys
import time

import numpy as np

from varcalc import mechanics

BODIES = {
    "about the greatest": [0.3, 0.0, 1.0],
    "about the least": [1.0, 0.0, 0.2],
    "next to the middle": [1.0, 0.0, 0.57],
}


def main(periods: int) -> None:
    """One line a motion."""
    body = mechanics.RigidBody([1.0, 2.0, 3.0])
    body.motion((1, 0, 0, 0), (0, 0, 1), (0, 1))  # compiled
    print(f"{periods} periods       steps   seconds   energy   momentum   claimed   closed form")
    for name, omega in BODIES.items():
        period = body.polhode(omega).period
        began = time.process_time()
        motion = body.motion((1, 0, 0, 0), omega, (0, periods * period))
        seconds = time.process_time() - began
        energy = motion.drift["energy"] / float(motion.energy(0.0))
        momentum = max(motion.drift[axis] for axis in ("L_x", "L_y", "L_z"))
        off = np.abs(motion.angular_velocity(periods * period) - omega).max()
        print(
            f"{name:18} {motion.steps:8} {seconds:9.2f} {energy:8.1e} {momentum:10.1e} {motion.error:9.1e} {off:9.1e}"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000)
