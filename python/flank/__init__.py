"""Flank: gear vibro-impact with exact events.

A scene is a gear train with its start and the settings of its run. :func:`load` reads one, and :meth:`Scene.run` runs it.

>>> import flank
>>> scene = flank.load({
...     "flank": 1,
...     "train": {
...         "kind": "gear-pair-dimensionless", "damping_ratio": 0.05, "damping_in_gap": True, "mean_load": 0.1,
...         "transmission_error": [{"amplitude": 0.2, "frequency": 0.6}],
...     },
...     "initial": {"q": [1.1]},
...     "run": {"cycles": 200, "transient_cycles": 100},
... })
>>> run = scene.run()
>>> run.contacts["mesh"].separations
100
>>> round(run.contacts["mesh"].apart_fraction, 12)
0.679010997521
"""

from ._dynamics import (
    Branch,
    Ensemble,
    Exponents,
    Image,
    Orbit,
    SectionMap,
    continuation,
    exponents,
    orbit,
    orbits,
    threshold,
)
from ._errors import Alarm, Error, Fault, Interrupted, SceneError, SceneWarning
from ._events import Events
from ._flank import Section, __version__
from ._grids import basins, map, sweep
from ._matrices import Matrices
from ._records import Named, Record
from ._run import Run, Trajectory
from ._scene import Scene, load, schema

__all__ = [
    "Alarm",
    "Branch",
    "Ensemble",
    "Error",
    "Events",
    "Exponents",
    "Fault",
    "Image",
    "Interrupted",
    "Matrices",
    "Named",
    "Orbit",
    "Record",
    "Run",
    "Scene",
    "SceneError",
    "SceneWarning",
    "Section",
    "SectionMap",
    "Trajectory",
    "__version__",
    "basins",
    "continuation",
    "exponents",
    "load",
    "map",
    "orbit",
    "orbits",
    "schema",
    "sweep",
    "threshold",
]
