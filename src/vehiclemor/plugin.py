"""All that a plug-in imports; until version 2 the names in `plugin.pyi` keep their meaning.

Each is imported when it is first used: a plug-in's method does not wait for SymPy.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub("vehiclemor", __file__)
