# Public names and the modules that have them, for `__init__.py` and for checkers of types.
from ballpass.derive.emit.equations import equations as equations
from ballpass.derive.emit.generate import check as check
from ballpass.derive.emit.generate import generate as generate
from ballpass.derive.lowering.functions import lower as lower
from ballpass.derive.reading.read import read_scene as read_scene
from ballpass.derive.scene.errors import SceneError as SceneError
from ballpass.derive.scene.records import Scene as Scene
from ballpass.derive.scene.shipped import shipped_scenes as shipped_scenes
from ballpass.derive.system import System as System
from ballpass.derive.system import derive as derive
from ballpass.runtime.contract.version import __version__ as __version__
