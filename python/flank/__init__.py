"""Flank: gear vibro-impact with exact events.

A scene is a gear train with its start and the settings of its run. :func:`load` reads one, and :meth:`Scene.run` runs it.

>>> import flank
>>> scene = flank.load({
...     "flank": 1,
...     "train": {
...         "kind": "gear-pair-dimensionless", "damping_ratio": 0.05, "mean_load": 0.1,
...         "transmission_error": [{"amplitude": 0.05, "frequency": 0.8}],
...     },
...     "run": {"cycles": 100, "transient_cycles": 50},
... })
>>> run = scene.run()
>>> run.contacts["mesh"].separations
50
"""

from ._errors import Alarm, Error, Fault, Interrupted, SceneError, SceneWarning
from ._events import Events
from ._flank import __version__
from ._records import Named, Record
from ._run import Run, Trajectory
from ._scene import Scene, load

__all__ = [
    "Alarm",
    "Error",
    "Events",
    "Fault",
    "Interrupted",
    "Named",
    "Record",
    "Run",
    "Scene",
    "SceneError",
    "SceneWarning",
    "Trajectory",
    "__version__",
    "load",
]
