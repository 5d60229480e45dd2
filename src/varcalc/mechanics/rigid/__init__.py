"""Rigid bodies: inertia tensors, motions in quaternions with Euler angles in and out, and tops.

| module | holds |
|---|---|
| ``rotations`` | quaternions, rotation matrices, Euler angles and their rates |
| ``inertia`` | mass, centre and tensor of points and of simple solids, composed and moved |
| ``body`` | a body with one fixed point, or about its centre of mass, and what its torques keep |
| ``motion`` | where it is at any time, and how well that is known |
| ``free`` | free rotation: cones of a symmetric body, polhodes of any, steady rotations |
| ``top`` | the heavy symmetric top and its nutation, by the cubic in cos θ |
"""
