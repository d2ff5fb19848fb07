"""Builds the compiled loops; where no compiler is, thermofast installs without them and runs their numpy twins."""

from Cython.Build import cythonize
from setuptools import Extension, setup

FLAGS = ["-O3", "-fno-math-errno"]

setup(
    ext_modules=cythonize(
        [
            Extension("models._lump", ["models/_lump.pyx"], extra_compile_args=FLAGS, optional=True),
            Extension("models._forward", ["models/_forward.pyx"], extra_compile_args=FLAGS, optional=True),
            Extension("filters._loop", ["filters/_loop.pyx"], extra_compile_args=FLAGS, optional=True),
        ]
    )
)
