"""Run generated models: load, simulate, differentiate.  Needs neither SymPy nor pint.

Names are imported when first used, so that ``ballpass.runtime.contract`` stays light for those who only write one.
"""

from __future__ import annotations

from ballpass.runtime.contract.lazy_names import names_of_stub

__getattr__, __dir__, __all__ = names_of_stub(__name__, __file__)
