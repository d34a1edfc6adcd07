"""Between belie and a running robot: middleware in and out, answers in the robot's own conventions; no algorithm.

Messages arrive as ROS CDR from any transport, are read by the code that reads bags, and end as a `Verdict` that
sinks hand on. ``belie live`` is `belie.bridges.live`, ``belie play`` is `belie.bridges.player`, and ``belie attack
--live`` is `belie.bridges.hijack`.
"""
