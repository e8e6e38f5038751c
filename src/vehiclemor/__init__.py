"""vehiclemor: benchmark suite for model order reduction of multibody vehicle models.

The names in `__init__.pyi` are all that a user needs.  Each is imported when it is first used, so
that `import vehiclemor` is quick.
"""

import lazy_loader

__version__ = "1.1.0"
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
